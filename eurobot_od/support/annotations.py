"""Annotations: findings in lines of files, as GitHub Actions reads them from what a step of a workflow prints.

Source: GitHub's documentation, "Workflow commands for GitHub Actions". Every line that begins with `::error` becomes a
note at that line of the change.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

from eurobot_od.support.escaping import one_line

DATA = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
PROPERTY = DATA | str.maketrans({":": "%3A", ",": "%2C"})
"""What would end a message, or one of its properties."""


class Level(Enum):
    """How bad it is; the value is GitHub's word."""

    ERROR = "error"
    WARNING = "warning"
    NOTICE = "notice"


def annotation(level: Level, file: str, line: int, column: int, title: str, lines: Iterable[str]) -> str:
    """Return the line to print; `line` and `column` count from 1, `lines` are the message."""
    properties = {"file": file, "line": str(line), "col": str(column), "title": title}
    said = ",".join(f"{name}={one_line(text).translate(PROPERTY)}" for name, text in properties.items())
    message = "\n".join(map(one_line, lines)).translate(DATA)
    return f"::{level.value} {said}::{message}"
