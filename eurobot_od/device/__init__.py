"""CANopen devices: `device` combines the services of the other modules.

There is no clock and no bus in this package. Names are imported from the modules, so that users of one service do not
load a whole device.
"""
