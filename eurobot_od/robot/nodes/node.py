"""What the three nodes of the robot have in common: they speak the messages of the document's Table 5."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from eurobot_od.device.bound import BoundObject
from eurobot_od.device.node import Node
from eurobot_od.errors import Cause, Refused
from eurobot_od.pdo.message import Message
from eurobot_od.robot import messages
from eurobot_od.robot.values import RobotError

Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]
"""What a node does with each message: a function of the node and the message; it returns the answer, or None."""

Objects: TypeAlias = Mapping[str, BoundObject]
"""What a node's objects, by their ParameterNames, are read from and mean when they are written."""


class RobotNode(Node):
    """A node of the robot."""

    CATALOGUE = messages.CATALOGUE

    def check_configuration(self, configuration: messages.StartConfigurationSet) -> None:
        """Raise Refused, and report it by EMCY until a good one comes, if a start configuration contradicts itself."""
        wrong = configuration.contradiction()
        if wrong is not None:
            self.raise_error(RobotError.CONFIGURATION_REFUSED, messages.StartConfigurationSet)
            raise Refused(Cause.VALUES, str(wrong))
        self.clear_error(messages.StartConfigurationSet)
