"""The questions to other people's programs about our files and nodes, and how their answers are judged.

A question is one function; `tools/interop.py` and `tests/interop` ask the same ones.
"""
