"""The live table of a bus: what is on it, message by message."""
