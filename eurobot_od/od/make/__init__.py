"""Makes the EDS files from the protocol table: YAML, table, layout, object dictionary, text, one module each.

Rule of this package: each module knows the one before it; only the command `make_eds` touches files.
"""
