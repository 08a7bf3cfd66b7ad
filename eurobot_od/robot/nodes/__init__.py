"""The robot's three nodes, without clock, bus or thread (see `device.node`)."""

from __future__ import annotations

from eurobot_od.device.node import Node
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.drive import Drive
from eurobot_od.robot.nodes.navigation import Navigation

ROLES: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation}
"""The node class for each EDS file, by its name."""

__all__ = ["ROLES", "Core", "Drive", "Navigation", "Node"]
