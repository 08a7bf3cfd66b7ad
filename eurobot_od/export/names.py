"""Names and texts of files, made fit for other languages: valid, distinct identifiers of bounded length.

Rule of this file: whatever a file contains, the result is printable ASCII in one line, and never an empty name.
"""

from __future__ import annotations

import re
from itertools import count

LONGEST_IDENTIFIER = 31
"""Significant characters of an identifier in every C compiler (C99, 5.2.4.1)."""

LONGEST_TEXT = 400
"""Characters of a text that goes into a comment or a label."""

UNNAMED = "unnamed"

NOT_PRINTABLE = re.compile(r"[^\x20-\x7E]+")
NOT_AN_IDENTIFIER = re.compile(r"[^A-Za-z0-9]+")


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return a text as printable ASCII in one line, cut at `longest` characters; what is neither becomes a dot."""
    # Cut before its words are split: a text of a file has any length.
    shown = NOT_PRINTABLE.sub(".", " ".join(text[: 2 * longest].split()))
    return shown if len(shown) <= longest else f"{shown[: longest - 3]}..."


def label(name: str) -> str:
    """Return a name as printable ASCII that is not empty."""
    return printable(name) or UNNAMED


class Identifiers:
    """Hands out identifiers, each only once whatever its case; the `reserved` words, in lower case, never."""

    def __init__(self, reserved: str = "", longest: int = LONGEST_IDENTIFIER) -> None:
        self._taken, self._longest = set(reserved.split()), longest

    def new(self, name: str) -> str:
        """Return the identifier of a name: `Status (raw)` is `Status_raw`, a second one `Status_raw_2`."""
        base = NOT_AN_IDENTIFIER.sub("_", name).strip("_")[: self._longest] or UNNAMED
        base = f"n{base}"[: self._longest] if base[0].isdigit() else base
        ends = (f"_{number}" if number > 1 else "" for number in count(1))
        candidates = (base[: self._longest - len(end)] + end for end in ends)
        found = next(each for each in candidates if each.lower() not in self._taken)
        self._taken.add(found.lower())
        return found
