"""The robot's three nodes, and who is one of them.

Rule of this package: no clock, no bus, no thread (see `device.node`).
"""

from __future__ import annotations

from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.outline import Outline
from eurobot_od.robot.messages import CATALOGUE
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.drive import Drive
from eurobot_od.robot.nodes.navigation import Navigation

ROLES: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation}
"""The node class for each EDS file by its name."""

ANY_DEVICE = ""
"""What stands for a role where a device is none of the robot's nodes."""

KINDS: dict[str, type[Node]] = {**ROLES, ANY_DEVICE: SimulatedDevice}
"""The node class for any device, by its role."""


def role_of(outline: Outline) -> str:
    """Return which of the robot's nodes a file describes: it has its name, and messages of the robot."""
    pdos = outline.read_pdos(outline.default, lambda _: None)
    is_ours = outline.name in ROLES and any(CATALOGUE.find(pdo.name) for pdo in pdos)
    return outline.name if is_ours else ANY_DEVICE


__all__ = ["ANY_DEVICE", "KINDS", "ROLES", "Core", "Drive", "Navigation", "Node", "role_of"]
