"""The Eurobot 2014 robot's CAN protocol as CANopen object dictionaries.

Rule of this file: names only, loaded when they are asked for, so that a command that needs no bus starts at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eurobot_od import messages as messages
    from eurobot_od.frame import Frame as Frame
    from eurobot_od.protocol import Protocol as Protocol

__all__ = ["Frame", "Protocol", "messages"]
_HOMES = {"Frame": "eurobot_od.frame", "Protocol": "eurobot_od.protocol"}


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use."""
    from importlib import import_module

    if name == "messages":
        return import_module("eurobot_od.messages")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
