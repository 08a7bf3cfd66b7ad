"""Texts in which a ^ marks the place that a complaint must name."""

from __future__ import annotations


def marked(text: str) -> tuple[str, str]:
    """Take the ^ out of a text; give the text without it and its place as `line:column`."""
    before, after = text.split("^")
    lines = before.split("\n")
    return before + after, f"{len(lines)}:{len(lines[-1]) + 1}"
