"""A picture of a match on the playing field.

Rule of this package: what is drawn (`recording`) is worked out first, apart from how it is drawn (all the others).
"""
