"""Faults on demand: what can be wrong with a device, each as a class of node that does just that; and their hooks.

A hook returns a class to be put between a node's class and `Node`, where it overrides what `Node` offers to everybody:
`handle`, `outgoing`, `reset`, `setting`, `receive`. The node's own class is as it is and knows nothing of faults.
Several hooks can stand in front of one node: what arrives passes the first of them first, what leaves the last.

Every fault names the step of a suite that finds it. Those of any device are in `device`; what can be wrong with the
nodes of one network only, such as the robot's, stands with those nodes, made of the same hooks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any, NamedTuple, TypeAlias, TypeVar

from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.od.standard import EMCY, SYNC
from eurobot_od.od.values import BASE_IDENTIFIER, ERROR_CONTROL_BASE, NMT_COB_ID, Address
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message
from eurobot_od.support import texts

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
    return Wrong(f"sends {{}} {texts.text(seconds)} late", lambda message: late(message, seconds))


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


Mixin: TypeAlias = type[Node]
"""A class that goes in front of a node's class."""

FrameChange: TypeAlias = Callable[[Any, Frame], Iterable[Frame]]
"""What becomes of a frame: nothing, itself, another one, several."""

ServiceCobId: TypeAlias = "Callable[[Node], int | None]"
"""The COB-ID of a CANopen service of a node, None if it does not have that."""

Which: TypeAlias = "type[Message] | ServiceCobId"
"""Which frames: those of a message, or those of a service."""

React: TypeAlias = Callable[[Any, Any, Callable[[Any], None]], object]
"""What a node does with a message: the node, the message, and the healthy reaction to call or not."""


def heartbeat(node: Node) -> int:
    """Boot-up and heartbeat."""
    return ERROR_CONTROL_BASE + node.device.node_id


def emcy(node: Node) -> int | None:
    """Emergency messages."""
    return node.device.objects.cob_id(EMCY)


def sdo_answer(node: Node) -> int:
    """Answers of the SDO server."""
    return node.device.sdo_answers


def sdo_request(node: Node) -> int:
    """Requests to the SDO server."""
    return node.device.sdo_requests


def sync(node: Node) -> int:
    """SYNC, sent or heard."""
    return node.device.objects.raw(SYNC) & BASE_IDENTIFIER


def nmt(_node: Node) -> int:
    """NMT commands."""
    return NMT_COB_ID


def _cob_id(node: Node, which: Which) -> int | None:
    return node.device.protocol.cob_id(which) if isinstance(which, type) else which(node)


# Hooks


def leaving(which: Which, change: FrameChange) -> Mixin:
    """Have `change` applied to frames that leave the node."""

    class Leaving(Node):
        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            return _changed(super().outgoing(frames), _cob_id(self, which), lambda frame: change(self, frame))

    return Leaving


def numbered(which: Which, change: Callable[[int], FrameChange]) -> Mixin:
    """Have frames that leave the node changed by their number, from 1 on with each start or reset of the node."""

    class Numbered(Node):
        def reset(self) -> None:
            super().reset()
            self._numbers = count(1)

        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            numbered = super().outgoing(frames)
            return _changed(numbered, _cob_id(self, which), lambda frame: change(next(self._numbers))(self, frame))

    return Numbered


def late(which: Which, seconds: float) -> Mixin:
    """Hold frames back for some seconds before they leave the node."""

    class Late(Node):
        def reset(self) -> None:
            super().reset()
            self._due: list[Frame] = []

        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            in_time = _changed(super().outgoing(frames), _cob_id(self, which), self._hold)
            # Whatever the node sends next takes along what is due: the timer below makes it send at that time.
            due, self._due = self._due, []
            return in_time + due

        def _hold(self, frame: Frame) -> Iterable[Frame]:
            self.at(self.now + seconds, lambda _: self._due.append(frame))
            return ()

    return Late


def arriving(which: Which, change: FrameChange) -> Mixin:
    """Have `change` applied to frames before the node gets them."""

    class Arriving(Node):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            # Asked for each frame: COB-IDs are objects, which a master may write.
            arrived = change(self, frame) if frame.cob_id == _cob_id(self, which) else [frame]
            return [answer for each in arrived for answer in super(Arriving, self).receive(each, now)]

    return Arriving


def handling(message_type: type[Message], react: React) -> Mixin:
    """Have `react` do what the node should do with a message."""

    class Handling(Node):
        def handle(self, message: Message) -> None:
            if isinstance(message, message_type):
                react(self, message, super().handle)
            else:
                super().handle(message)

    return Handling


def preset(setting: str, value: int) -> Mixin:
    """Have a setting another value than the object dictionary says."""

    class Preset(Node):
        def setting(self, name: str) -> int:
            return value if name == setting else super().setting(name)

    return Preset


def asked(answer: Callable[[Node, int, float], list[Frame] | None]) -> Mixin:
    """Have the node answer remote frames differently; None leaves one to the node."""

    class Asked(Node):
        def requested(self, cob_id: int, now: float) -> list[Frame]:
            answers = answer(self, cob_id, now)
            return super().requested(cob_id, now) if answers is None else answers

    return Asked


def other_value(choose: Callable[[Node], Address | None]) -> Mixin:
    """Give an object another value after power-on than the file says."""

    class OtherValue(Node):
        def reset(self) -> None:
            super().reset()
            address = choose(self)
            if address is not None:
                # the lowest bit: another value, and one that any whole number's type has
                self.device.objects.values[address] = self.device.objects.raw(address) ^ 1

    return OtherValue


def every(seconds: float, action: Callable[[Any], object]) -> Mixin:
    """Have `action` called with the node again and again, from its start on."""

    class Every(Node):
        def reset(self) -> None:
            super().reset()
            self.at(self.now + seconds, self._again)

        def _again(self, now: float) -> None:
            action(self)
            self.at(now + seconds, self._again)

    return Every


def _changed(frames: Iterable[Frame], cob_id: int | None, change: Callable[[Frame], Iterable[Frame]]) -> list[Frame]:
    """Return the frames with what becomes of those that have a COB-ID."""
    return [left for frame in frames for left in (change(frame) if frame.cob_id == cob_id else [frame])]


# Changes


def kept(_node: Node, frame: Frame) -> Iterable[Frame]:
    """It comes as it is."""
    return (frame,)


def lost(_node: Node, _frame: Frame) -> Iterable[Frame]:
    """Nothing arrives."""
    return ()


def twice(_node: Node, frame: Frame) -> Iterable[Frame]:
    """It comes twice."""
    return frame, frame


def only(wanted: Callable[[bytes], bool]) -> FrameChange:
    """Lose the frames whose data bytes are not as wanted."""
    return lambda _, frame: [frame] if wanted(frame.data) else []


def data(change: Callable[[bytes], bytes]) -> FrameChange:
    """Change a frame's data bytes."""
    return lambda _, frame: [Frame(frame.cob_id, change(frame.data))]


def moved(offset: int) -> FrameChange:
    """Send a frame under a COB-ID that is `offset` higher."""
    return lambda _, frame: [Frame(frame.cob_id + offset, frame.data)]


def unawaited(answer: Message) -> FrameChange:
    """Have the node believe at once that a request is answered, whether or not an answer comes."""

    def changed(node: Node, frame: Frame) -> Iterable[Frame]:
        node.soon(lambda _: node.handle(answer))  # not now: the node is in the middle of sending the request
        return [frame]

    return changed
