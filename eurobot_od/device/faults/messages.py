"""Faults of messages: what may be wrong with any one of them, and all of that for the messages of a network."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from eurobot_od.device.faults.fault import Caught, Fault
from eurobot_od.device.faults.hooks import Mixin, arriving, data, late, leaving, lost, moved, twice
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import Message
from eurobot_od.support import durations


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
