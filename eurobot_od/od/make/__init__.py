"""Makes the EDS files and the network file from a protocol table: table, layout, objects, text, files.

Each module knows only those before it in this list; `files` alone touches the disk.
"""
