"""Small changes put into the package one at a time, and the tests that should notice them; `tools/mutants.py` runs it.

`changes` makes them from the source's syntax tree, `reach` measures which tests come by a line, `trial` runs those
tests on a changed copy, `equivalent` knows the changes that nobody can notice.
"""
