"""The EDS checker: a tolerant reader, rules for files and for networks, and the comparison of two dictionaries.

Nothing in this package raises for any input bytes. Nothing imports canopen, because that takes longer than a check.
"""
