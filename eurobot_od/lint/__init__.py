"""The EDS checker: a tolerant reader, rules for files and for networks, and the comparison of two dictionaries.

Rule of this package: nothing raises, whatever the bytes; and nothing imports canopen, which takes longer than a check.
"""
