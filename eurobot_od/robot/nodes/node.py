"""What the three nodes of the robot have in common: they speak the messages of the document's Table 5."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from eurobot_od.device.node import Node
from eurobot_od.pdo.message import Message
from eurobot_od.robot.messages import CATALOGUE

Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]
"""What a node does with each message: a function of the node and the message; it returns the answer, or None."""


class RobotNode(Node):
    """A node of the robot."""

    CATALOGUE = CATALOGUE
