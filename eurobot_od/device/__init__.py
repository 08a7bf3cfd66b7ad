"""CANopen devices: `device` puts together what the other modules do, one service each.

Rule of this package: no clock and no bus. Names are imported from the modules, so that whoever needs the numbers of a
service does not load a whole device.
"""
