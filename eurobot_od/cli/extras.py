"""Packages that only some commands need: an extra that is missing is one line, with what installs it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from eurobot_od.errors import LocalError


@contextmanager
def needed(extra: str) -> Iterator[None]:
    """Import something inside that the extra brings; raises LocalError if it is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("eurobot_od"):
            raise
        install = f"pip install 'eurobot-od[{extra}]'"
        raise LocalError(f"{error.name} is not installed; the extra `{extra}` brings it: {install}") from None
