"""What other people's programs are asked about our files and nodes, and how their answers are judged.

A question is one function; `tools/interop.py` and `tests/interop` ask the same ones.
"""
