"""What the three nodes of the robot have in common: they speak the messages of the document's Table 5."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from eurobot_od.device.bound import BoundObject
from eurobot_od.device.flow import Ask
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

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that cannot be believed: a position of another robot is none of ours."""
        code, source = super().doubt(message), messages.SOURCES.get(type(message))
        if code is None and source is not None and getattr(message, "source", None) is not source:
            return RobotError.WRONG_SOURCE
        return code

    def asking(self, request: Message, answer: type[Message], wait: str, attempts: str) -> Ask:
        """Ask by two settings, read when they are needed: what a master wrote holds from the next question on."""
        return Ask(request, answer, self.seconds(wait), self.setting(attempts))
