"""Makes the EDS files and the network file from a protocol table: table, objects, text.

Each module knows only those before it in this list; `text` alone touches the disk.
"""
