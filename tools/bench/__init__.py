"""The bench: our speed beside that of other people's programs.

Rule of this package: `measure` runs rounds and knows no subject; `rows` has one module a subject; `programs` are
started as processes of their own.
"""
