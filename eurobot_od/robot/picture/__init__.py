"""What a person looks at: the playing field with a match on it, and the live table of a bus.

Rule of this package: values in, text out; what is drawn is worked out first and apart from how it is drawn.
"""
