"""What may be written to a stream: colours, and lines that are drawn again in place."""

from __future__ import annotations

import os
from typing import TextIO

ENDLESS = 10_000
"""Characters of a line where nothing says how long it may be."""

WITH_COLOURS = {"WT_SESSION", "TERM", "ANSICON", "ConEmuANSI"}
"""What terminals on Windows set that know escape sequences; the old console prints them as they are."""


def redraws(stream: TextIO) -> bool:
    """Whether a line can be written over: on a terminal, unless it says that it is dumb."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def in_colour(stream: TextIO) -> bool:
    """Whether colours are wanted and shown: NO_COLOR is not set (no-color.org), and the terminal has them."""
    is_known = os.name != "nt" or bool(WITH_COLOURS & os.environ.keys())
    return is_known and redraws(stream) and not os.environ.get("NO_COLOR")  # set, but empty, it does not count


def columns(stream: TextIO) -> int:
    """Return how many characters a line of a terminal has; practically endless for anything else."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or ENDLESS
    except (OSError, ValueError):  # a text in memory has no file
        return ENDLESS


def folded(text: str, stream: TextIO, indent: int) -> str:
    """Return a line as lines of whole words that fit a terminal, all but the first one indented."""
    width = columns(stream)
    if len(text) <= width or width < 2 * indent:
        return text
    from textwrap import fill  # not with every command: it needs `re`

    return fill(text, width, subsequent_indent=" " * indent, break_on_hyphens=False)
