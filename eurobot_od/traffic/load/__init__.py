"""How much a CAN bus carries, and how late each message can be: worst-case response times that are proved.

Rule of this package: times are whole numbers, microseconds where people give them and bit times in the analysis, and
everything is rounded to the worse side: periods and deadlines down, jitter up.
"""
