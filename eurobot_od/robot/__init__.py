"""The Eurobot 2014 robot: its messages, nodes, world, matches and checks. Nothing below imports this package.

Its public names are loaded when they are asked for, as those of `eurobot_od`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eurobot_od.robot.protocol import EurobotProtocol as Protocol

__all__ = ["Protocol"]


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    from importlib import import_module

    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.protocol").EurobotProtocol
