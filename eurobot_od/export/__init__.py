"""The protocol in the formats of other tools.

Rule of this package: plain functions from loaded dictionaries to text; what a format cannot say is an error.
"""
