"""Kinds of fields that only the robot has: angles, coordinates, a goto's remaining time, barrier flags."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from eurobot_od.od.values import Limits, typed_number
from eurobot_od.pdo.kinds import ColumnForm, KeyedForm, Kind, whole_number, words_of
from eurobot_od.robot.model.values import Barriers, GotoFault, Passage

if TYPE_CHECKING:
    from eurobot_od.robot.model.robot_file import Facts


class Angle(Kind):
    """Degrees on the unit circle: 0..359 on the wire, any whole angle from a caller (document section 1)."""

    modulus: int = 360

    def read(self, raw: int, limits: Limits) -> Any:
        # Ten bits can hold 1023: a received value that is not an angle is kept raw and flagged, not reduced modulo 360.
        return super().read(raw, Limits(0, self.modulus - 1))

    def write(self, value: Any, limits: Limits) -> int:
        return whole_number(value) % self.modulus

    def allowed(self, limits: Limits) -> str:
        return "any whole angle in degrees"

    def numbers(self, limits: Limits) -> range:
        return range(self.modulus)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, self.modulus - 1)


class Heading(Angle):
    """An angle that may be unknown, alone or together with its coordinates (document Table 2)."""

    UNKNOWN = 0x3FF
    unknown_as_a_whole = UNKNOWN

    def read(self, raw: int, limits: Limits) -> Any:
        return None if raw == self.UNKNOWN else super().read(raw, limits)

    def write(self, value: Any, limits: Limits) -> int:
        return self.UNKNOWN if value is None else super().write(value, limits)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, self.UNKNOWN)

    def named_values(self) -> Mapping[int, str]:
        return {self.UNKNOWN: self.text(None)}

    def allowed(self, limits: Limits) -> str:
        return super().allowed(limits) + ", None for unknown"


class Coordinate(Kind):
    """A coordinate in mm, unknown only together with its partner and the heading (document Table 2).

    0xFF alone is a real place; x, y and angle together with their codes mean "position unknown".
    """

    unknown_as_a_whole = 0xFF

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
        # The codes above are left out: they are not times, and have words of their own.
        return range(self.UNKNOWN)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, max(self.MEANING))

    def write(self, value: Any, limits: Limits) -> int:
        # A caller cannot send a code as a number: 1048575 ms would arrive as "unknown".
        return self.CODE[value] if value in self.CODE else super().write(value, Limits(0, self.UNKNOWN - 1))

    def parse(self, text: str) -> Any:
        names = {"unknown": None} | {words_of(fault): fault for fault in GotoFault}
        return names[text] if text in names else super().parse(text)

    def named_values(self) -> Mapping[int, str]:
        return {0: "arrived"} | {raw: self.text(meaning) for raw, meaning in self.MEANING.items()}

    def allowed(self, limits: Limits) -> str:
        faults = ", ".join(words_of(fault) for fault in GotoFault)
        return f"{super().allowed(Limits(0, self.UNKNOWN - 1))}, None for unknown, {faults}"


def _shipped() -> Facts:
    from eurobot_od.robot.model import robot_file  # YAML, which most commands start without

    return robot_file.read()


class BarrierFlags(Kind):
    """Barrier flags: any 16 bits; a person writes `fire-1:forced,pool-2:normal`, `none` or a number.

    The barriers are those of the robot's file, read when their names are first needed; `facts` gives another robot's.
    """

    column_form = ColumnForm.BITS

    def __init__(self, facts: Callable[[], Facts] = _shipped) -> None:
        super().__init__()
        self._asked = facts

    @cached_property
    def _facts(self) -> Facts:
        return self._asked()

    @property
    def keyed_form(self) -> KeyedForm:  # type: ignore[override]
        names = tuple(each.name for each in self._facts.barriers)
        return KeyedForm("barrier", names, "passage", tuple(map(words_of, Passage)))

    def read(self, raw: int, limits: Limits) -> Any:
        return Barriers(raw)

    def numbers(self, limits: Limits) -> range:
        return range(0)

    def sendable(self, limits: Limits) -> range:
        return range(limits.low, limits.high + 1)

    def parse(self, text: str) -> Any:
        if text == "none" or text[:1].isdigit():
            return Barriers(0 if text == "none" else typed_number(text))
        passages = {}
        for part in text.split(","):
            name, _, passage = part.partition(":")
            wanted = passage.strip().upper() or Passage.NORMAL.name
            if wanted not in Passage.__members__:
                raise ValueError(part)
            passages[self._facts.barrier(name).number] = Passage[wanted]
        return Barriers.of(passages)

    def text(self, value: Any) -> str:
        return self._facts.words(Barriers(value)) if value else str(Barriers(0))

    def plain(self, value: Any) -> Any:
        return self.text(value)

    def allowed(self, limits: Limits) -> str:
        passages = " or ".join(words_of(passage) for passage in Passage)
        names = ", ".join(each.name.replace(" ", "-") for each in self._facts.barriers)
        return f"{super().allowed(limits)}, or {names} with :{passages}"
