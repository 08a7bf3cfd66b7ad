"""The robot's three nodes; rule of this package: no clock, no bus, no thread (see `node`)."""

from __future__ import annotations

from eurobot_od.nodes.core import Core
from eurobot_od.nodes.drive import Drive
from eurobot_od.nodes.navigation import Navigation
from eurobot_od.nodes.node import Node

ROLES: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation}
"""The node class for each EDS file by its name."""

__all__ = ["ROLES", "Core", "Drive", "Navigation", "Node"]
