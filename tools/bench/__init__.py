"""The bench: our speed beside that of other people's programs.

`measure` runs rounds, whatever the subject; `rows` has one module for each subject; `programs` are started as processes
of their own.
"""
