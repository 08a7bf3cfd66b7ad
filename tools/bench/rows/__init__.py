"""The rows of the bench: one module a subject, each with its series in `SERIES`.

The modules do not import each other; what several need is in `shared`.
"""
