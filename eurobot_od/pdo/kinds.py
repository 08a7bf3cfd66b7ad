"""Kinds of fields: how a raw integer and its meaning go over into each other.

Rule of this file: each rule stands here once: what a raw value means, what raw value a meaning has, how a person
writes it, and what is allowed. Widths and limits are the EDS's and come in as arguments.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, ClassVar

from eurobot_od.od.values import Limits
from eurobot_od.robot.values import Barriers, GotoFault, OutOfRange, Passage, barrier_number


class Kind:
    """A plain number in `unit`; raw value and meaning are the same, the EDS limits are the range."""

    def __init__(self, unit: str = "") -> None:
        self.unit = unit

    def read(self, raw: int, limits: Limits) -> Any:
        """Return the meaning of a raw value, or OutOfRange."""
        return raw if limits.low <= raw <= limits.high else OutOfRange(raw)

    def write(self, value: Any, limits: Limits) -> int:
        """Return the raw value; raises ValueError or TypeError if the value has none."""
        raw = _integer(value)
        if not limits.low <= raw <= limits.high:
            raise ValueError(value)
        return raw

    def numbers(self, limits: Limits) -> range:
        """Return the raw values that mean their own number, so that `text` writes that and the unit."""
        return range(limits.low, limits.high + 1)

    def parse(self, text: str) -> Any:
        """Read what a person wrote; raises ValueError."""
        return int(text, 0)

    def text(self, value: Any) -> str:
        """Write the value for a person, with its unit."""
        if value is None:
            return "unknown"
        return f"{int(value)}{' ' * bool(self.unit)}{self.unit}" + " (out of range)" * isinstance(value, OutOfRange)

    def allowed(self, limits: Limits) -> str:
        """Say what may be sent."""
        return f"{limits.low}..{limits.high}" + (f" {self.unit}" if self.unit else "")


class Angle(Kind):
    """Degrees on the unit circle: 0..359 on the wire, any whole angle from a caller (document section 1)."""

    FULL = 360

    def read(self, raw: int, limits: Limits) -> Any:
        return super().read(raw, Limits(0, self.FULL - 1))

    def write(self, value: Any, limits: Limits) -> int:
        return _integer(value) % self.FULL

    def allowed(self, limits: Limits) -> str:
        return "any whole angle in degrees"

    def numbers(self, limits: Limits) -> range:
        return range(self.FULL)


class Heading(Angle):
    """An angle that may be unknown (document Table 2)."""

    UNKNOWN = 0x3FF

    def read(self, raw: int, limits: Limits) -> Any:
        return None if raw == self.UNKNOWN else super().read(raw, limits)

    def write(self, value: Any, limits: Limits) -> int:
        return self.UNKNOWN if value is None else super().write(value, limits)

    def parse(self, text: str) -> Any:
        return None if text == "unknown" else super().parse(text)

    def allowed(self, limits: Limits) -> str:
        return super().allowed(limits) + ", None for unknown"


class Coordinate(Kind):
    """A coordinate in mm, unknown only together with its partner and the heading (document Table 2).

    0xFF alone is a real place; x, y and angle together with their codes mean "position unknown".
    """

    UNKNOWN = 0xFF

    def parse(self, text: str) -> Any:
        return None if text == "unknown" else super().parse(text)

    def allowed(self, limits: Limits) -> str:
        return super().allowed(limits) + ", or x, y and angle None for unknown"


class Remaining(Kind):
    """A goto's remaining time in ms: 0 arrived, None unknown, or a GotoFault (document Table 1, 2014 robot)."""

    UNKNOWN = 0x0FFFFF
    MEANING: ClassVar = {UNKNOWN: None} | {fault.value: fault for fault in GotoFault}
    CODE: ClassVar = {meaning: raw for raw, meaning in MEANING.items()}

    def read(self, raw: int, limits: Limits) -> Any:
        if raw in self.MEANING:
            return self.MEANING[raw]
        return super().read(raw, Limits(0, self.UNKNOWN))

    def numbers(self, limits: Limits) -> range:
        return range(self.UNKNOWN)

    def write(self, value: Any, limits: Limits) -> int:
        return self.CODE[value] if value in self.CODE else super().write(value, Limits(0, self.UNKNOWN - 1))

    def parse(self, text: str) -> Any:
        names = {"unknown": None} | {_plain(fault): fault for fault in GotoFault}
        return names[text] if text in names else super().parse(text)

    def text(self, value: Any) -> str:
        return _plain(value) if isinstance(value, GotoFault) else super().text(value)

    def allowed(self, limits: Limits) -> str:
        faults = ", ".join(_plain(fault) for fault in GotoFault)
        return f"{super().allowed(Limits(0, self.UNKNOWN - 1))}, None for unknown, {faults}"


class Choice(Kind):
    """One of the members of an enum; a reserved number is read as OutOfRange."""

    def __init__(self, enum: type[IntEnum]) -> None:
        super().__init__()
        self.enum = enum

    def read(self, raw: int, limits: Limits) -> Any:
        return self.enum(raw) if raw in self.enum.__members__.values() else OutOfRange(raw)

    def numbers(self, limits: Limits) -> range:
        return range(0)

    def write(self, value: Any, limits: Limits) -> int:
        return int(self.enum(_integer(value)))

    def parse(self, text: str) -> Any:
        names = {_plain(member): member for member in self.enum}
        return names[text] if text in names else self.enum(int(text, 0))

    def text(self, value: Any) -> str:
        return _plain(value) if isinstance(value, self.enum) else super().text(value)

    def allowed(self, limits: Limits) -> str:
        return ", ".join(f"{_plain(member)} ({member.value})" for member in self.enum)


class BarrierFlags(Kind):
    """Barrier flags: any 16 bits; a person writes `fire-1:forced,pool-2:normal`, `none` or a number."""

    def read(self, raw: int, limits: Limits) -> Any:
        return Barriers(raw)

    def numbers(self, limits: Limits) -> range:
        return range(0)

    def parse(self, text: str) -> Any:
        if text == "none" or text[:1].isdigit():
            return Barriers(0 if text == "none" else int(text, 0))
        return Barriers.of(dict(map(_barrier, text.split(","))))

    def text(self, value: Any) -> str:
        return str(Barriers(value))

    def allowed(self, limits: Limits) -> str:
        passages = " or ".join(_plain(passage) for passage in Passage)
        return f"{super().allowed(limits)}, or fire-1..fire-6 and pool-1, pool-2 with :{passages}"


def _integer(value: Any) -> int:
    """Return a whole number as int; raises ValueError for 1.5, infinity, what is no number and what is flagged."""
    if isinstance(value, OutOfRange) or not isinstance(value, (int, float)) or value % 1 != 0:
        raise ValueError(value)
    return int(value)


def _plain(member: IntEnum) -> str:
    return member.name.lower().replace("_", " ")


def _barrier(text: str) -> tuple[int, Passage]:
    name, _, passage = text.partition(":")
    wanted = passage.strip().upper() or Passage.NORMAL.name
    if wanted not in Passage.__members__:
        raise ValueError(text)
    return barrier_number(name), Passage[wanted]
