"""Reads objects of nodes in trouble, one at a time, for `diagnose --ask`.

Meanings and times go in, requests come out; who drives it has the bus. Nothing is asked while the transfer of another
client is open on the bus. If one begins in the middle of a question, that is left to the other, and asked again later.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from typing import TypeAlias

from eurobot_od.device.broadcasts import REGISTER_BITS
from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.lint.findings import Severity
from eurobot_od.od import cia402, standard
from eurobot_od.od.profiles import dictionary_of
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, ERROR_FIELD, IDENTITY, LSS_IDENTITY
from eurobot_od.od.values import Address, label
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo import wire
from eurobot_od.support.texts import amount
from eurobot_od.traffic.diagnosis.incidents import Incident, ObservedBus, ObservedNode
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.services import SDO, SdoEnd, value_words

ANSWER_WAIT = 0.5
"""Timeout of an answer, in s."""

GIVEN_UP = 1.0
"""Silence after which another client's transfer counts as abandoned, in s."""

AGAIN = 10.0
"""Minimum time before a node with new trouble is asked again, in s."""

MOST_ENTRIES = 8
"""Maximum number of entries of 0x1003 and of 0x1016 to read."""

TROUBLE = (Severity.ERROR, Severity.WARNING)
"""Severities of incidents whose nodes are asked."""

Objects: TypeAlias = Generator[Address, "bytes | None", None]
"""Yields the objects to read, and is sent their contents; None if the node refuses."""


def _objects(axes: Callable[[], Sequence[int]]) -> Objects:
    """Yield the objects to read of a node in trouble; `axes` are the numbers of a drive's axes."""
    yield standard.ERROR_REGISTER
    yield from _entries(ERROR_FIELD)
    yield from ((IDENTITY, sub) for sub in range(1, len(LSS_IDENTITY) + 1))
    yield standard.DEVICE_TYPE
    yield from _entries(CONSUMED_HEARTBEATS)
    yield standard.HEARTBEAT_TIME
    for axis in axes():
        for index in (cia402.STATUSWORD, cia402.ERROR_CODE):
            yield index + cia402.AXIS_STEP * (axis - 1), 0


def _entries(index: int) -> Objects:
    count = yield index, 0
    for sub in range(1, min(_number(count or b""), MOST_ENTRIES) + 1):
        yield index, sub


def _number(content: bytes) -> int:
    return int.from_bytes(content, "little")


ErrorText: TypeAlias = Callable[[int], str]
"""Returns the meaning of a node's error code."""


def _register_words(register: int, _: ErrorText) -> str:
    bits = ", ".join(name for bit, name in enumerate(REGISTER_BITS) if register >> bit & 1)
    return f"error register 0x{register:02X} ({bits or 'no error'})"


def _consumer_words(entry: int, _: ErrorText) -> str:
    return f"waits {entry & 0xFFFF} ms for node-ID {entry >> 16 & 0x7F}"


OF_NUMBERS: Mapping[Address, tuple[str, str]] = {
    (ERROR_FIELD, 0): ("remembered error", "remembered errors"),
    (CONSUMED_HEARTBEATS, 0): ("entry of consumers", "entries of consumers"),
}
"""Nouns for the count in sub-index 0 of a list."""

OF_OBJECTS: Mapping[int, Callable[[int, ErrorText], str]] = {
    standard.ERROR_REGISTER[0]: _register_words,
    ERROR_FIELD: lambda entry, errors: f"0x{entry & 0xFFFF:04X} {errors(entry & 0xFFFF)}",
    standard.DEVICE_TYPE[0]: lambda number, _: f"device type 0x{number:08X}, profile {number & 0xFFFF}",
    CONSUMED_HEARTBEATS: _consumer_words,
    standard.HEARTBEAT_TIME[0]: lambda period, _: f"heartbeat time {period} ms",
}
"""Formatters of an object's number, by index."""


def answer_words(address: Address, content: bytes, errors: ErrorText) -> str:
    """Format the content of an object; `errors` returns the meanings of its error codes."""
    index, sub = address
    if address in OF_NUMBERS:
        return amount(_number(content), *OF_NUMBERS[address])
    if index in OF_OBJECTS:
        return OF_OBJECTS[index](_number(content), errors)
    if index == IDENTITY:
        return f"{LSS_IDENTITY[sub - 1]} 0x{_number(content):08X}"
    drive = dictionary_of(cia402.PROFILE)
    variable = drive.variable(address) if drive else None
    return f"{variable.name if variable else ''} {value_words(drive, address, content)}".lstrip()


class OpenQuestion:
    """A question to a node on its SDO channel: its transfer, and its requests not yet seen on the bus."""

    def __init__(self, node: ObservedNode, objects: Objects, address: Address, request: int, time: float) -> None:
        self.node = node
        self.objects = objects
        self.address = address
        self.request = request
        self.transfer = sdo.upload(address, ANSWER_WAIT)
        self.unseen: list[bytes] = []
        self.add(self.transfer.start(time))

    @property
    def is_of_list(self) -> bool:
        """Whether it reads an entry of a list, which may be empty."""
        index, sub = self.address
        return (index, 0) in OF_NUMBERS and sub > 0

    def add(self, requests: Iterable[bytes]) -> None:
        """Add requests that are being sent."""
        self.unseen += requests


class Questions:
    """Questions to the nodes of a bus in trouble; `axes` returns the known axes of a drive."""

    def __init__(self, bus: ObservedBus, axes: Callable[[int], Sequence[int]]) -> None:
        self._bus, self._axes = bus, axes
        self._known: set[tuple[str, str]] = set()
        self._asked: dict[int, float] = {}
        self._waiting: dict[int, tuple[ObservedNode, Objects, Address]] = {}
        self._open: OpenQuestion | None = None
        self._others: dict[int, float] = {}
        self._to_send: list[Frame] = []
        self._answers: dict[str, dict[Address, str]] = {}

    @property
    def is_busy(self) -> bool:
        """Whether a question waits for its turn or its answer."""
        return bool(self._waiting or self._open or self._to_send)

    def look(self, time: float, found: Iterable[Incident]) -> None:
        """Process the incidents found until a time in s; nodes with new trouble are asked."""
        for each in found:
            node = self._bus.named(each.who) if each.who and each.rule.severity in TROUBLE else None
            if node and (each.who, each.rule.id) not in self._known:
                self._known.add((each.who, each.rule.id))
                if time - self._asked.get(node.node_id, -inf) > AGAIN:
                    self._asked[node.node_id] = time
                    objects = _objects(partial(self._axes, node.node_id))
                    self._waiting[node.node_id] = node, objects, next(objects)
            self.look(time, each.follows)

    def take(self, time: float, meaning: Meaning) -> None:
        """Process a frame of the bus, including our own."""
        if meaning.name != SDO or not isinstance(meaning.raw, Frame) or meaning.raw.is_remote:
            return
        service = self._bus.decoder.services.get(meaning.raw.cob_id)
        if service is None or service.end is None:
            return
        end = service.end
        data = meaning.raw.data
        question = self._open
        if question and end.channel == question.request and (end.is_answer or data in question.unseen):
            self._own(time, question, end, data)
            return
        if question and end.channel == question.request:
            # Another client's transfer has interrupted the question, which is postponed.
            self._open = None
            self._waiting[question.node.node_id] = question.node, question.objects, question.address
        is_over = meaning.transfer is not None and meaning.transfer.is_whole
        if is_over or data[0] == wire.ABORT:
            self._others.pop(end.channel, None)
        else:
            self._others[end.channel] = time

    def _own(self, time: float, question: OpenQuestion, end: SdoEnd, data: bytes) -> None:
        if not end.is_answer:
            question.unseen.remove(data)
            return
        self._send(question, question.transfer.receive(data, time))
        self._finish(question)

    def _send(self, question: OpenQuestion, requests: list[bytes]) -> None:
        question.add(requests)
        self._to_send += (Frame(question.request, each) for each in requests)

    def _finish(self, question: OpenQuestion) -> None:
        """Process the end of a question, if it is done."""
        if not question.transfer.done:
            return
        self._open = None
        content = None
        is_silent = False
        try:
            content = question.transfer.result()
            text = answer_words(question.address, content, self._bus.decoder.errors.of(question.node.node_id))
        except RemoteError as error:
            text = str(error)
            is_silent = isinstance(error, sdo.Silence)
        if not (question.is_of_list and content is not None and not any(content)):  # an entry that is not used
            self._answers.setdefault(question.node.name, {})[question.address] = f"{label(question.address)} {text}"
        try:
            if not is_silent:  # a silent node is not asked again
                following = question.objects.send(content)
                self._waiting[question.node.node_id] = question.node, question.objects, following
        except StopIteration:
            pass

    def due(self, time: float) -> list[Frame]:
        """Return the requests to send at a time in s."""
        if self._open:
            self._send(self._open, self._open.transfer.tick(time))
            self._finish(self._open)
        elif self._waiting and not any(time - last < GIVEN_UP for last in self._others.values()):
            self._ask(time, *self._waiting.pop(next(iter(self._waiting))))
        frames = self._to_send
        self._to_send = []
        return frames

    def _ask(self, time: float, node: ObservedNode, objects: Objects, address: Address) -> None:
        services = self._bus.decoder.services.values()
        ends = (each.end for each in services if each.end and not each.end.is_answer)
        channel = next(each.channel for each in ends if each.server == node.node_id)
        self._open = OpenQuestion(node, objects, address, channel, time)
        self._bus.own_question = node.node_id, address
        self._to_send += (Frame(channel, each) for each in self._open.unseen)

    def answered(self, found: Iterable[Incident]) -> Iterator[Incident]:
        """Yield incidents; the first one of each node gets the node's answers."""
        left = dict(self._answers)
        for each in found:
            said = tuple(left.pop(each.who, {}).values())
            yield replace(each, asked=said) if said else each
