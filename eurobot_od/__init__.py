"""A CANopen workbench for any device, and the Eurobot 2014 robot's CAN protocol as CANopen object dictionaries.

    from eurobot_od import Network

    with Network.open("socketcan", "can0") as network:
        drive = network.add(5, "drive.eds")
        drive["Profile velocity"].value = 1500

`help(Network)` shows what else there is; docs/api.md says what stays as it is. The public names are loaded when they
are asked for, so that a command that needs no bus starts at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eurobot_od.bus.live import Live as Live
    from eurobot_od.bus.live import open_bus as open_bus
    from eurobot_od.bus.simulated.network import Simulation as Simulation
    from eurobot_od.client.emergencies import Emergency as Emergency
    from eurobot_od.client.network import AsyncNetwork as AsyncNetwork
    from eurobot_od.client.network import Network as Network
    from eurobot_od.client.network import simulated as simulated
    from eurobot_od.client.remote_device import AsyncRemoteDevice as AsyncRemoteDevice
    from eurobot_od.client.remote_device import RemoteDevice as RemoteDevice
    from eurobot_od.client.remote_pdos import PdoReading as PdoReading
    from eurobot_od.client.remote_pdos import PdoValue as PdoValue
    from eurobot_od.client.watch import NodeEvent as NodeEvent
    from eurobot_od.device.profiles.devices import SimulatedDrive as SimulatedDrive
    from eurobot_od.device.profiles.devices import SimulatedModule as SimulatedModule
    from eurobot_od.device.simulated import SimulatedDevice as SimulatedDevice
    from eurobot_od.frame import Frame as Frame
    from eurobot_od.gatekeeper import Gatekeeper as Gatekeeper
    from eurobot_od.od.dictionary import Dictionary as Dictionary
    from eurobot_od.pdo.protocol import Protocol as Protocol
    from eurobot_od.robot.facade import Robot as Robot
    from eurobot_od.robot.match import rehearse as rehearse
    from eurobot_od.robot.match import rehearse_async as rehearse_async
    from eurobot_od.robot.model import messages as messages
    from eurobot_od.robot.nodes import Core as Core
    from eurobot_od.robot.nodes import Drive as Drive
    from eurobot_od.robot.nodes import Navigation as Navigation
    from eurobot_od.robot.plugin import own_robot as own_robot
    from eurobot_od.season.season import Season as Season

_HOMES = {
    "AsyncNetwork": "client.network",
    "AsyncRemoteDevice": "client.remote_device",
    "Core": "robot.nodes",
    "Dictionary": "od.dictionary",
    "Drive": "robot.nodes",
    "Emergency": "client.emergencies",
    "Frame": "frame",
    "Gatekeeper": "gatekeeper",
    "Live": "bus.live",
    "Navigation": "robot.nodes",
    "Network": "client.network",
    "NodeEvent": "client.watch",
    "PdoReading": "client.remote_pdos",
    "PdoValue": "client.remote_pdos",
    "Protocol": "pdo.protocol",
    "RemoteDevice": "client.remote_device",
    "Robot": "robot.facade",
    "Season": "season.season",
    "SimulatedDevice": "device.simulated",
    "SimulatedDrive": "device.profiles.devices",
    "SimulatedModule": "device.profiles.devices",
    "Simulation": "bus.simulated.network",
    "messages": "robot.model.messages",
    "open_bus": "bus.live",
    "own_robot": "robot.plugin",
    "rehearse": "robot.match",
    "rehearse_async": "robot.match",
    "simulated": "client.network",
}
"""Where each public name is; `messages` is a module itself."""

__all__ = [  # noqa: RUF022 (as documented; each is loaded by __getattr__)
    "Network",
    "AsyncNetwork",
    "RemoteDevice",
    "AsyncRemoteDevice",
    "PdoReading",
    "PdoValue",
    "Emergency",
    "NodeEvent",
    "simulated",
    "Simulation",
    "SimulatedDevice",
    "SimulatedDrive",
    "SimulatedModule",
    "Dictionary",
    "Protocol",
    "Frame",
    "Gatekeeper",
    "Live",
    "open_bus",
    "Season",
    "messages",
    "Core",
    "Drive",
    "Navigation",
    "Robot",
    "rehearse",
    "rehearse_async",
    "own_robot",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module on first use."""
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = import_module(f"{__name__}.{_HOMES[name]}")
    if name == "Protocol":
        home.Protocol.load = staticmethod(_load)
    return home if name == "messages" else getattr(home, name)


def _load(dialect: Any = None) -> Any:
    """Load the robot's messages. Deprecated, gone in version 2.0: use `eurobot_od.robot.Protocol.load`."""
    from warnings import warn

    from eurobot_od.robot.protocol import EurobotProtocol

    warn("the robot's messages are eurobot_od.robot.Protocol.load()", DeprecationWarning, stacklevel=2)
    return EurobotProtocol.load(dialect)
