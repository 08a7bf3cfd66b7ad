"""The bench: compares the speed of this package with that of other people's programs.

`measure` runs the rounds, whatever is measured; `rows` has one module for each subject; `programs` are started as
processes of their own.
"""
