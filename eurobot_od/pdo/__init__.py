"""PDOs: layouts of bits, kinds of fields, messages, and the table of a network's messages."""
