"""CANopen devices: `device` puts together what the other modules do, one service each.

There is no clock and no bus in this package. Names are imported from the modules, not from here, so that whoever needs
the numbers of a service does not load a whole device.
"""
