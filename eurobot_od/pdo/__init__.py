"""PDOs: layouts of bits, kinds of fields, messages, and the table of a network's messages."""

from eurobot_od.canopen_names import module_attribute

__getattr__ = module_attribute(__name__)
