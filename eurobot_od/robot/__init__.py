"""The Eurobot 2014 robot: its messages, nodes, world, matches and checks. No module outside it imports this package.

Its public names, for a team's own robot, are loaded on first use, as those of `eurobot_od`: `__init__.pyi` lists them.
"""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any

with open(f"{__path__[0]}/__init__.pyi", encoding="utf-8") as _lines:  # noqa: PTH123 (pathlib takes longer than this)
    _HOMES = {
        name: (home, there)
        for home, there, name in re.findall(r"^from (\S+) import (\w+) as (\w+)", _lines.read(), re.MULTILINE)
    }

__all__ = [*_HOMES]


def __dir__() -> list[str]:
    """Return the public names, including those that are not loaded yet."""
    return sorted({*globals(), *_HOMES})


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home, there = _HOMES[name]
    try:  # a module of that name first, as looking it up here would recurse
        found = import_module(f"{home}.{there}")
    except ModuleNotFoundError:
        found = getattr(import_module(home), there)
    return globals().setdefault(name, found)
