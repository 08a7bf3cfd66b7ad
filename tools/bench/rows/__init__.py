"""The rows of the bench: one module a subject, each with its series in `SERIES`.

Rule of this package: no module knows another one; what several need is in `shared`.
"""
