"""What a fault is: a sentence, the class that makes it, and the step of a check that finds it; and faults of messages.

What may be wrong with any message is a value of its own, made for the messages of any network.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from eurobot_od.device.faults.hooks import Mixin, arriving, data, late, leaving, lost, moved, twice
from eurobot_od.device.node import Node
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import Message
from eurobot_od.support import durations

NodeT = TypeVar("NodeT", bound=Node)


class Caught(NamedTuple):
    """The step of a suite that turns red: the one whose name says what is wrong."""

    suite: str
    step: str

    def fault(self, text: str, mixin: Mixin) -> Fault:
        """Return a fault that this step finds."""
        return Fault(text, mixin, self)


class Fault(NamedTuple):
    """Something that is wrong with a node.

    `mixin` is the class that goes in front of the node's class; `text` says what the node does wrong.
    """

    text: str
    mixin: Mixin
    caught_by: Caught

    def given_to(self, role: type[NodeT]) -> type[NodeT]:
        """Return the class of a node that has this fault."""
        return type(role.__name__, (self.mixin, role), {})


# Of messages


class Wrong(NamedTuple):
    """What may be wrong with any message: how the fault's sentence goes, `{}` for the message, and what makes it."""

    text: str
    mixin: Callable[[type[Message]], Mixin]


def _reversed(content: bytes) -> bytes:
    return content[::-1]


NOT_SENT = Wrong("sends no {}", lambda message: leaving(message, lost))
NOT_ANSWERED = Wrong("answers no {}", lambda message: arriving(message, lost))
NOT_HEARD = Wrong("does not hear {}", lambda message: arriving(message, lost))
TWICE = Wrong("sends {} twice", lambda message: leaving(message, twice))
MOVED = Wrong("sends {} one identifier too high", lambda message: leaving(message, moved(1)))
REVERSED = Wrong("sends the bytes of {} the wrong way round", lambda message: leaving(message, data(_reversed)))
READ_REVERSED = Wrong("reads the bytes of {} the wrong way round", lambda message: arriving(message, data(_reversed)))

OF_SENDER = {"not-sent": NOT_SENT, "sent-twice": TWICE, "moved": MOVED}
OF_RECEIVER = {"not-heard": NOT_HEARD}
"""What can be wrong with every message in its sender and in its receivers, by the end of the fault's name."""

NO_STEP = Caught("", "")
"""A fault that no step of a shipped suite is promised to find."""


def sent_late(seconds: float) -> Wrong:
    """Return what is wrong with a message that is held back for some seconds."""
    return Wrong(f"sends {{}} {durations.text(seconds)} late", lambda message: late(message, seconds))


def words(message: type[Message]) -> str:
    """Write a message's name as the document does: `Goto XY`, `Enemy 1 Position Request`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z0-9])|(?<=[0-9])(?=[A-Z])", " ", message.__name__)


def generated(binding: Binding, node: str) -> dict[str, Fault]:
    """Make the faults of a message in one of its nodes, by their names: those of several nodes have the node in it."""
    order = {"reversed": REVERSED} if binding.layout.length > 1 else {}  # one byte reversed is itself
    name, made = words(binding.type).lower().replace(" ", "-"), {}
    for nodes, kinds in ((binding.senders, {**OF_SENDER, **order}), (binding.receivers, OF_RECEIVER)):
        for end, wrong in kinds.items() if node in nodes else ():
            fault = NO_STEP.fault(wrong.text.format(words(binding.type)), wrong.mixin(binding.type))
            # A message of several senders has a fault in each of them, and the command line names faults, not nodes.
            made[f"{name}-{end}" + f"-by-{node}" * (len(nodes) > 1)] = fault
    return made
