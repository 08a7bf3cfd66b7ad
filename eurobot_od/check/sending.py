"""Lists of frames that are sent with periods, in bursts, and when something is seen: `send FILE`, and the page's Send.

Frames and the time go in, frames come out; whoever runs a list sends them. A list is a YAML file:

    - {send: 185#0102, period: 100 ms}
    - {send: motor.RPDO1, fields: {target_speed: 100}, burst: 3, gap: 5 ms}
    - {send: 705#R1, trigger: motor.TPDO1.speed becomes > 100}
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from graphlib import CycleError, TopologicalSorter
from math import ceil, inf
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from eurobot_od.check.values import Expected, FieldValues, Scale, expectation
from eurobot_od.errors import LocalError, RemoteError
from eurobot_od.frame import HIGHEST_IDENTIFIER, Frame
from eurobot_od.pdo.protocol import FrameToSend, Protocol, frame_to_send
from eurobot_od.support.declared import Within
from eurobot_od.support.yaml_shapes import DURATION, SCALAR, converted, listing, read_yaml, shape_of

MOST_ROWS = 100

IDENTIFIER = re.compile(r"[0-9A-Fa-f]{3}")
CONDITION = re.compile(r"(?P<message>.+?)\.(?P<field>\w+)\s+(?P<edge>becomes\s+)?(?P<wanted>.+)")

Pause = Annotated[float, DURATION, Within(0.005, 60, "s")]


class WrittenRow(NamedTuple):
    """A row as it is written: a frame, or a message with its `fields`, and when it is sent.

    Without a trigger it is sent at the start. With a `period` it is sent again and again from then on. A `burst` is so
    many frames each time, with a `gap` between them.
    """

    send: Annotated[str, SCALAR]
    fields: Mapping[str, Annotated[str, SCALAR]] = {}
    period: Pause | None = None
    burst: Annotated[int, Within(1, 1000)] = 1
    gap: Pause | None = None
    trigger: Annotated[str, SCALAR] = ""

    def as_texts(self) -> dict[str, Any]:
        """Return it as it could be written; what is left out is left out."""
        times = {name: f"{1000 * span:g} ms" for name in ("period", "gap") if (span := getattr(self, name))}
        said: dict[str, Any] = {
            "send": str(self.send),
            "fields": {name: str(value) for name, value in self.fields.items()},
            **times,
        }
        if self.burst > 1:
            said["burst"] = int(self.burst)
        return {name: each for name, each in (said | {"trigger": str(self.trigger)}).items() if each}


class Trigger(NamedTuple):
    """What is waited for: a frame with a COB-ID, or one whose `field` is as `wanted`.

    With `edge` the value must not have been so in the frame before.
    """

    cob_id: int
    field: str = ""
    wanted: Expected | None = None
    edge: bool = False

    @classmethod
    def parse(cls, protocol: Protocol, text: str) -> Trigger:
        """Read `181`, `motor.TPDO1`, `motor.TPDO1.speed > 100`, `motor.TPDO1.speed becomes > 100`; raises LocalError.

        Values are written as in suites: `88..92`, `1200 +- 15`, `not red`.
        """
        if IDENTIFIER.fullmatch(text) and int(text, 16) <= HIGHEST_IDENTIFIER:
            return cls(int(text, 16))
        match = CONDITION.fullmatch(text)
        if match is None:
            return cls(protocol.cob_id(text))
        binding = protocol.binding(match["message"])
        field = binding.field(match["field"])
        scale = Scale(FieldValues(binding.kinds[field], binding.limits[field]), {}, frozenset())
        return cls(binding.cob_id, field, expectation(match["wanted"], scale), match["edge"] is not None)

    def is_met(self, protocol: Protocol, frame: Frame) -> bool:
        """Return whether a frame is what is waited for, whatever came before it."""
        if frame.cob_id != self.cob_id or frame.is_remote:
            return False
        if self.wanted is None:
            return True
        try:
            return self.wanted.fits(getattr(protocol.decode(*frame), self.field), {})
        except RemoteError:  # too short for the message
            return False


class SendRow(NamedTuple):
    """A row that can be sent."""

    written: WrittenRow
    thing: FrameToSend
    trigger: Trigger | None


def read_list(text: str, file: str | Path, protocol: Protocol) -> tuple[SendRow, ...]:
    """Read a list; raises YamlError with everything that is wrong, LocalError for rows that would trigger each other.

    `file` is its name in errors.
    """
    rows = read_yaml(text, listing(converted(shape_of(WrittenRow), partial(_row, protocol))), file)
    if not 1 <= len(rows) <= MOST_ROWS:
        raise LocalError(f"{file}: a list has 1 to {MOST_ROWS} rows, not {len(rows)}")
    _refuse_circle(rows, file)
    return rows


def _row(protocol: Protocol, written: WrittenRow) -> SendRow:
    length = (written.gap or 0) * (written.burst - 1)
    if written.period is not None and length >= written.period:
        raise LocalError(f"the burst takes {length:g} s, which is not shorter than the period of {written.period:g} s")
    thing = frame_to_send(protocol, written.send, [f"{name}={value}" for name, value in written.fields.items()])
    return SendRow(written, thing, Trigger.parse(protocol, written.trigger) if written.trigger else None)


def _refuse_circle(rows: Sequence[SendRow], file: str | Path) -> None:
    """Check that rows do not trigger each other for ever; raises LocalError."""
    sets_off = {
        number: {
            other
            for other, each in enumerate(rows, 1)
            if row.trigger is not None and each.thing.frame.cob_id == row.trigger.cob_id
        }
        for number, row in enumerate(rows, 1)
    }
    try:
        TopologicalSorter(sets_off).prepare()
    except CycleError as error:
        circle = ", ".join(map(str, sorted(set(error.args[1]))))
        raise LocalError(f"{file}: row {circle}: it would set itself off for ever") from None


class _RowRun:
    """One row as it runs: its next frame is `due`, with `left` frames of the burst that began at `begun`."""

    def __init__(self, row: SendRow, now: float) -> None:
        self.row, self.left, self.begun, self.due = row, 0, now, inf
        self._was_met = False
        if row.trigger is None:
            self.begin(now)

    def begin(self, now: float) -> None:
        """Begin a burst."""
        self.left, self.begun, self.due = self.row.written.burst, now, now

    def take(self, now: float, frame: Frame, protocol: Protocol) -> None:
        """Take in a frame; one that comes while the row is being sent sets nothing off."""
        trigger = self.row.trigger
        if trigger is None or frame.cob_id != trigger.cob_id:
            return
        is_met, was_met = trigger.is_met(protocol, frame), self._was_met
        self._was_met = is_met
        if is_met and self.due == inf and not (trigger.edge and was_met):
            self.begin(now)

    def sent(self, now: float) -> None:
        """Note that the frame that was due is sent."""
        written = self.row.written
        self.left = self.left - 1
        if self.left:
            self.due += written.gap or 0
        elif written.period is None:
            self.due = inf
        else:
            # Not from `now`: a period that is late once would be late for ever. Those that are missed are left out.
            self.begin(self.begun + written.period * max(1, ceil((now - self.begun) / written.period)))


class RunningList:
    """A list that is being sent; `sent` counts the frames.

    `take` is given each data frame of the bus, also those of the list; `due` returns what is to be sent.
    """

    def __init__(self, rows: Iterable[SendRow], protocol: Protocol, now: float) -> None:
        self._rows, self._protocol, self.sent = [_RowRun(each, now) for each in rows], protocol, 0

    @property
    def next(self) -> float:
        """When the next frame is due, infinite if none is."""
        return min(each.due for each in self._rows)

    @property
    def is_over(self) -> bool:
        """Whether the list has sent its last frame."""
        return self.next == inf and all(each.row.trigger is None for each in self._rows)

    def take(self, now: float, frame: Frame) -> None:
        """Take in a frame, which may be what a row waits for."""
        for each in self._rows:
            each.take(now, frame, self._protocol)

    def due(self, now: float) -> list[Frame]:
        """Return the frames that are due, each once."""
        frames = list[Frame]()
        for each in self._rows:
            while each.due <= now:
                frames.append(each.row.thing.frame)
                each.sent(now)
        self.sent += len(frames)
        return frames
