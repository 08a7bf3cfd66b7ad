"""Text of files and peers on its way out of the program: whatever it contains, it stays in its place and is visible.

Rule of this file: whatever writes output calls it once for each text that is not its own: a name in an EDS, a channel
of a log, a step of a suite, a node's string. XML, HTML and JSON add their own escapes.
"""

from __future__ import annotations

from typing import Any

FORMULA = ("=", "+", "-", "@")
"""What a spreadsheet takes for the beginning of a formula."""


def one_line(text: str) -> str:
    r"""Return a text as one line that a terminal shows as it is: control characters and line ends as `\x1b`, `\n`."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def cell(value: Any) -> Any:
    """Return a value for CSV: a text in one line, and with `'` in front if a spreadsheet would calculate it."""
    if not isinstance(value, str):  # a number may begin with a minus
        return value
    return f"'{one_line(value)}" if value.startswith(FORMULA) else one_line(value)
