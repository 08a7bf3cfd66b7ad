"""The Eurobot 2014 robot's CAN protocol as CANopen object dictionaries, and a CANopen workbench for any device.

The public names are loaded when they are asked for, so that a command that needs no bus starts at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eurobot_od.device.simulated import SimulatedDevice as SimulatedDevice
    from eurobot_od.frame import Frame as Frame
    from eurobot_od.gatekeeper import Gatekeeper as Gatekeeper
    from eurobot_od.live import Live as Live
    from eurobot_od.live import open_bus as open_bus
    from eurobot_od.robot.facade import Robot as Robot
    from eurobot_od.robot.match import rehearse as rehearse
    from eurobot_od.robot.match import rehearse_async as rehearse_async
    from eurobot_od.robot.model import messages as messages
    from eurobot_od.robot.nodes import Core as Core
    from eurobot_od.robot.nodes import Drive as Drive
    from eurobot_od.robot.nodes import Navigation as Navigation
    from eurobot_od.robot.plugin import own_robot as own_robot
    from eurobot_od.robot.protocol import EurobotProtocol as Protocol
    from eurobot_od.season.season import Season as Season

_HOMES = {
    "Core": "robot.nodes",
    "Drive": "robot.nodes",
    "Frame": "frame",
    "Gatekeeper": "gatekeeper",
    "Live": "live",
    "Navigation": "robot.nodes",
    "Protocol": "robot.protocol",
    "Robot": "robot.facade",
    "Season": "season.season",
    "SimulatedDevice": "device.simulated",
    "messages": "robot.model.messages",
    "open_bus": "live",
    "own_robot": "robot.plugin",
    "rehearse": "robot.match",
    "rehearse_async": "robot.match",
}
"""Where each public name is; `messages` is a module itself."""

__all__ = [  # noqa: RUF022 (as documented; each is loaded by __getattr__)
    "Protocol",
    "messages",
    "Frame",
    "Core",
    "Drive",
    "Navigation",
    "Robot",
    "rehearse",
    "own_robot",
    "rehearse_async",
    "Gatekeeper",
    "Live",
    "open_bus",
    "SimulatedDevice",
    "Season",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use."""
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = import_module(f"{__name__}.{_HOMES[name]}")
    return home if name == "messages" else getattr(home, {"Protocol": "EurobotProtocol"}.get(name, name))
