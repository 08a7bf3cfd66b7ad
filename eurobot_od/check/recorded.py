"""Makes a suite from a part of a log: a node's SDO requests, its answers, its RPDOs, and what it sent by itself.

Between two commands (a write, an NMT command, an RPDO with other data), the reads of each object become one step with
the range of the values. At the end of the suite come the node's periodic PDOs and its heartbeat, with their periods,
and the ranges of the fields.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import inf
from statistics import median
from typing import Any, NamedTuple

import yaml

from eurobot_od.device.nmt import COMMAND_NAMES, STATE_NAMES, NmtCommand, NmtState
from eurobot_od.errors import LocalError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import at
from eurobot_od.od.values import ALL_NODES, ERROR_CONTROL_BASE, NMT_COB_ID, Address, Value, label
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Kind
from eurobot_od.support.texts import amount, one_line, text
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import Raw
from eurobot_od.traffic.meaning import Decoder, Meaning, SdoTransfer

MOST_STEPS = 1000
"""Maximum number of steps of a suite; a part of a log with more is refused."""

PAUSE = 0.2
"""Minimum time between two commands, in s, for which the suite has a `wait`."""

FEW = 5
"""Minimum number of distances between frames from which a period is computed."""

MOST_PERIODS = 10
"""Maximum number of periods that a suite measures."""

STEADY = 0.5
"""Maximum deviation of a single distance, as a share of the period; with more the frames are not periodic."""


class _Reads:
    """The reads between two commands: the transfers of each object, in the order of their first one."""

    def __init__(self) -> None:
        self.answers: dict[Address, list[SdoTransfer]] = {}

    def take(self, transfer: SdoTransfer) -> None:
        assert transfer.address is not None
        self.answers.setdefault(transfer.address, []).append(transfer)


class _Order(NamedTuple):
    """A write, NMT command, RPDO or boot-up: the step for it, and the time since the one before, in s."""

    step: dict[str, Any]
    name: str
    after: float


class RecordedNode:
    """Collects what a node does in a part of a log."""

    def __init__(self, device: Dictionary, decoder: Decoder) -> None:
        self._device = device
        self._bindings = {each.cob_id: each for each in decoder.protocol.bindings if device.name in each.senders}
        told = (each.cob_id for each in decoder.protocol.bindings if device.name in each.receivers)
        self._told: dict[int, Frame | None] = dict.fromkeys(told)
        """Identifiers of the PDOs that it receives, each with the last frame."""
        self._heartbeat = ERROR_CONTROL_BASE + device.node_id
        self._parts: list[_Reads | _Order] = [_Reads()]
        self._times: dict[int, list[float]] = {}
        self._values: dict[int, list[Any]] = {}
        self._state: int | None = None
        self._last: float | None = None

    def take(self, time: float, meaning: Meaning) -> None:
        """Add a frame, with its meaning."""
        raw, transfer = meaning.raw, meaning.transfer
        self._last = time if self._last is None else self._last
        if transfer and transfer.end and transfer.end.server == self._device.node_id and transfer.is_whole:
            self._transferred(time, transfer)
        elif raw[0] == NMT_COB_ID and len(raw[1]) > 1 and raw[1][1] in (ALL_NODES, self._device.node_id):
            self._commanded(time, int(raw[1][0]))
        elif raw[0] == self._heartbeat and raw[1]:
            self._heard(time, int(raw[1][0]))
        elif raw[0] in self._told and isinstance(raw, Frame) and not raw.is_remote:
            if raw != self._told[raw[0]]:  # the same once more tells it nothing
                self._told[raw[0]] = raw
                self._order(time, {"send": {"raw": str(raw)}}, f"{meaning.name}: {meaning.text}")
        elif meaning.message is not None and raw[0] in self._bindings:
            self._times.setdefault(raw[0], []).append(time)
            self._values.setdefault(raw[0], []).append(meaning.message)

    def _transferred(self, time: float, transfer: SdoTransfer) -> None:
        if transfer.address is None or (transfer.content is None and transfer.aborted is None):
            return
        if not transfer.is_upload and transfer.content is not None:
            thing = self._thing(transfer.address)
            said = _given(thing, transfer.content, "value") | _refusal(transfer)
            self._order(time, {"sdo": {"write": self._label(transfer.address), **said}}, thing.qualname)
        elif transfer.is_upload and isinstance(self._parts[-1], _Reads):
            self._parts[-1].take(transfer)
            self._last = time

    def _commanded(self, time: float, command: int) -> None:
        if command in set(NmtCommand):
            self._order(time, {"nmt": COMMAND_NAMES[NmtCommand(command)]}, "")

    def _heard(self, time: float, state: int) -> None:
        if state == NmtState.INITIALISING:
            self._order(time, {"boot-up": "awaited", "within": "10 s"}, "")
            return
        self._state = state
        self._times.setdefault(self._heartbeat, []).append(time)

    def _order(self, time: float, step: dict[str, Any], name: str) -> None:
        self._parts += [_Order(step, name, time - (self._last or time)), _Reads()]
        self._last = time

    def _thing(self, address: Address) -> Any:
        return at(address, self._device.objects)

    def _label(self, address: Address) -> str:
        """Return the address as text; without the sub-index for an object that has only sub-index 0."""
        return f"0x{address[0]:04X}" if self._device.members.get(address[0], {}).keys() == {0} else label(address)

    # The suite

    def suite(self, title: str) -> str:
        """Return the suite as YAML.

        Raises LocalError if this part of the log has nothing of the node, or too many steps.
        """
        steps = [*self._asked(), *self._sent()]
        if not steps:
            raise LocalError(f"the log has nothing of {self._device.name} in this stretch")
        if len(steps) > MOST_STEPS:
            raise LocalError(f"{amount(len(steps), 'step')} are too many: at most {MOST_STEPS}; take a shorter stretch")
        head = {"spec": 1, "name": one_line(title), "node": self._device.name}
        return "".join([yaml.safe_dump(head, sort_keys=False, allow_unicode=True), "steps:\n", *steps])

    def _asked(self) -> Iterator[str]:
        for part in self._parts:
            if isinstance(part, _Order):
                if part.after >= PAUSE:
                    yield _line({"wait": text(round(part.after, 1))})
                yield _line(part.step, part.name)
                continue
            for address, transfers in part.answers.items():
                thing = self._thing(address)
                said = _refusal(transfers[-1]) or _seen(thing, [each.content or b"" for each in transfers])
                yield _line({"sdo": {"read": self._label(address), **said}}, thing.qualname)

    def _sent(self) -> Iterator[str]:
        periodic = {cob_id: _period(times) for cob_id, times in sorted(self._times.items())}
        if any(periodic[each] for each in self._bindings if each in periodic) and self._state == NmtState.OPERATIONAL:
            yield _line({"nmt": COMMAND_NAMES[NmtCommand.START]}, "its PDOs come in OPERATIONAL only")
        for cob_id, period in periodic.items():
            binding = self._bindings.get(cob_id)
            name: Any = {"heartbeat": STATE_NAMES[NmtState(self._state)]} if binding is None and self._state else None
            name = name or (binding and {binding.name: dict(_ranges(binding, self._values[cob_id]))})
            if period is None:
                yield f"  # {binding.name if binding else 'its heartbeat'}: no period, so it is not checked\n"
            else:
                yield _line({"period": {"message": name, **period}})


def suite_of(
    decoder: Decoder,
    node: str,
    entries: Iterable[tuple[float, str, Raw]],
    title: str,
    begin: float = 0.0,
    end: float = inf,
) -> str:
    """Return a suite in YAML for a node, from the frames between `begin` and `end`, in s from the first frame.

    Raises UnknownName for the node, LocalError as `RecordedNode.suite`.
    """
    known = {each.name: each for each in decoder.dictionaries}
    found = RecordedNode(look_up("node", node, known), decoder)
    following = TrackingDecoder(decoder)
    first: float | None = None
    for time, channel, raw in entries:
        first = time if first is None else first
        if time - first > end:
            break
        meaning = following(time, channel, raw)  # also frames before `begin`: they may configure how later ones decode
        if time - first >= begin:
            found.take(time, meaning)
    return found.suite(title)


def _line(step: dict[str, Any], name: str = "") -> str:
    (key, value), *more = step.items()
    rest = "".join(f"    {each}: {further}\n" for each, further in more)
    comment = f"  # {one_line(name)}" if name else ""
    return f"  - {key}: {_flow(value)}{comment}\n{rest}"


PLAIN = re.compile(r"-?[0-9A-Za-z][0-9A-Za-z_. -]*")
"""Words and numbers that YAML needs no quotes for."""


def _flow(value: Any) -> str:
    """Return a value as YAML on one line; numbers are not changed, so hexadecimal ones stay hexadecimal."""
    if isinstance(value, dict):
        # Bytes without a letter would be a number.
        said = {_flow(key): json.dumps(each) if key == "data" else _flow(each) for key, each in value.items()}
        return f"{{{', '.join(f'{key}: {each}' for key, each in said.items())}}}"
    written = str(value)
    return written if PLAIN.fullmatch(written) else json.dumps(written, ensure_ascii=False)


def _refusal(transfer: SdoTransfer) -> dict[str, Any]:
    """Return the expected abort of an aborted transfer, nothing for any other."""
    return {} if transfer.aborted is None else {"abort": f"0x{transfer.aborted:08X}"}


def _given(thing: Any, content: bytes, key: str) -> dict[str, Any]:
    """Return a value, in words if these are read back as the same bytes, otherwise as bytes."""
    number = _number(thing, content)
    return {"data": content.hex(" ").upper()} if number is None else {key: number}


def _seen(thing: Any, contents: list[bytes]) -> dict[str, Any]:
    """Return what to expect of an object: its value, or the range of its values if they are numbers."""
    different = list(dict.fromkeys(contents))
    numbers = [objects.decode(thing, each) for each in different if _number(thing, each) is not None]
    if len(different) == 1:
        return _given(thing, different[0], "expect")
    if len(numbers) != len(different):
        return {}
    low, high = min(numbers, key=_sortable), max(numbers, key=_sortable)
    return {"expect": f"{_plain(thing, low)}..{_plain(thing, high)}"}


def _sortable(value: Value) -> float:
    assert isinstance(value, (int, float))
    return value


def _number(thing: Any, content: bytes) -> str | None:
    """Return a number in the notation of a suite; None for other values, and where the notation loses bits."""
    value = objects.decode(thing, content) if objects.is_described(thing) else None
    if not isinstance(value, (int, float)):
        return None
    written = _plain(thing, value)
    try:
        return written if objects.encode(thing, objects.parse(thing, written)) == content else None
    except LocalError:
        return None


def _plain(thing: Any, value: Value) -> str:
    return objects.measured(thing, value).partition(" ")[0]


def _ranges(binding: Binding, messages: Iterable[Any]) -> Iterator[tuple[str, str]]:
    """Yield each field with the range of its numbers, or with its word if that was always the same."""
    columns = list(zip(*messages))
    for (name, kind), values in zip(binding.kinds.items(), columns):
        if name in binding.limits and (said := _range(kind, values)):
            yield name, said


def _range(kind: Kind, values: Iterable[Any]) -> str:
    plain = [kind.plain(each) for each in values]
    if all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in plain):
        return str(plain[0]) if min(plain) == max(plain) else f"{min(plain)}..{max(plain)}"
    return str(plain[0]) if len(set(map(str, plain))) == 1 and plain[0] is not None else ""


def _period(times: list[float]) -> dict[str, Any] | None:
    """Return the median period of frames, with a tolerance that all of them meet; None if they are not periodic."""
    distances = [later - earlier for earlier, later in pairwise(times)]
    if len(distances) < FEW:
        return None
    every = median(distances)
    off = max(abs(each - every) for each in distances)
    if off > STEADY * every:
        return None
    tolerance = max(0.2 * every, 1.5 * off, 0.005)
    count = min(len(distances), MOST_PERIODS)
    return {"every": text(round(every, 4)), "tolerance": text(round(tolerance, 4)), "count": count}
