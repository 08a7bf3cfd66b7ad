"""What an EDS or DCF says: the object dictionary of a device, of any vendor."""

DEFAULT = "eurobot-od.yaml"
"""The network file of a working folder; here, as it is asked for before anything is read."""
