"""What an EDS or DCF says: the object dictionary of a device, of any vendor."""
