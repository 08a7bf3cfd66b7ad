"""The master's side: finding CANopen nodes on a bus, reading, writing and configuring them.

Rule of this package: every exception of canopen and python-can becomes one of ours. Nothing here prints; only `master`
waits.
"""
