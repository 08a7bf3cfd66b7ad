"""Numbers of things in words: `1 frame`, `2 frames`."""

from __future__ import annotations


def amount(number: int, thing: str) -> str:
    """Return how many there are of a thing, which is named in the singular and forms its plural by an s."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
