"""The messages of the packaging line: one of each kind of field that a catalogue can give a meaning."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Annotated, Any, ClassVar, NamedTuple

from eurobot_od.errors import UnknownName
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import REAL32, Limits, typed_number
from eurobot_od.pdo.kinds import (
    Catalogue,
    Choice,
    ColumnForm,
    KeyedForm,
    Kind,
    OutOfRange,
    Quantity,
    Real,
    whole_number,
    words_of,
)

CATALOGUE = Catalogue({ErrorCode.VALUE_OUT_OF_RANGE.value: "value out of range", 0xFF02: "lift blocked"})

MOVES, PLACES, SET_UP = "MOVES", "PLACES", "SET-UP"


class Cause(IntEnum):
    """Why the lift is to halt."""

    OPERATOR = 0
    CURTAIN = 1


class Source(IntEnum):
    """What has measured a place."""

    ENCODER = 0
    CAMERA = 1
    LASER = 2


class Fault(IntEnum):
    """Why a move has no remaining time."""

    BLOCKED = 0xFFFFFE
    NOT_POSSIBLE = 0xFFFFFF


class Colour(IntEnum):
    """The colour of an order's boxes."""

    GREEN = 0
    BLUE = 1


class Direction(IntEnum):
    """How the lift moves; forward where it is not mapped."""

    FORWARD = 0
    BACKWARD = 1


class Route(IntEnum):
    """Whether the lift goes round what stands there; planned where it is not mapped."""

    DIRECT = 0
    PLANNED = 1


class Reading(IntEnum):
    """What the scale says in place of a weight."""

    OVERLOAD = 0xFFFF


class Angle(Kind):
    """Degrees, 0..359 on the wire, any whole angle from a caller."""

    modulus = 360

    def read(self, raw: int, limits: Limits) -> Any:
        return super().read(raw, Limits(0, 359))

    def write(self, value: Any, limits: Limits) -> int:
        return whole_number(value) % 360

    def allowed(self, limits: Limits) -> str:
        return "any whole angle in degrees"

    def numbers(self, limits: Limits) -> range:
        return range(360)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, 359)


class Heading(Angle):
    """An angle that may be unknown, alone or with its coordinates."""

    UNKNOWN = 0x3FF
    unknown_as_a_whole = UNKNOWN

    def read(self, raw: int, limits: Limits) -> Any:
        return None if raw == self.UNKNOWN else super().read(raw, limits)

    def write(self, value: Any, limits: Limits) -> int:
        return self.UNKNOWN if value is None else super().write(value, limits)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, self.UNKNOWN)

    def named_values(self) -> Mapping[int, str]:
        return {self.UNKNOWN: "unknown"}

    def allowed(self, limits: Limits) -> str:
        return super().allowed(limits) + ", None for unknown"


class Coordinate(Kind):
    """A coordinate that is unknown only together with the others; 255 alone is a place."""

    unknown_as_a_whole = 0xFF

    def allowed(self, limits: Limits) -> str:
        return super().allowed(limits) + ", or x, y and angle None for unknown"


class Remaining(Kind):
    """A move's remaining time: 0 arrived, None unknown, or a Fault."""

    UNKNOWN = 0xFFFFFD
    MEANING: ClassVar = {UNKNOWN: None} | {fault.value: fault for fault in Fault}
    CODE: ClassVar = {meaning: raw for raw, meaning in MEANING.items()}
    PLAIN: ClassVar = Limits(0, 0xFFFFF)

    def read(self, raw: int, limits: Limits) -> Any:
        return self.MEANING[raw] if raw in self.MEANING else super().read(raw, self.PLAIN)

    def write(self, value: Any, limits: Limits) -> int:
        return self.CODE[value] if value in self.CODE else super().write(value, self.PLAIN)

    def numbers(self, limits: Limits) -> range:
        return range(self.PLAIN.high + 1)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(0, max(self.MEANING))

    def parse(self, text: str) -> Any:
        names = {"unknown": None} | {words_of(fault): fault for fault in Fault}
        return names[text] if text in names else super().parse(text)

    def named_values(self) -> Mapping[int, str]:
        return {0: "arrived"} | {raw: self.text(meaning) for raw, meaning in self.MEANING.items()}

    def allowed(self, limits: Limits) -> str:
        return f"{super().allowed(self.PLAIN)}, None for unknown, {', '.join(map(words_of, Fault))}"


class Gates(Kind):
    """The gates on the way, two bits each: free, shut or locked."""

    column_form = ColumnForm.BITS
    NAMES = ("gate 1", "gate 2", "gate 3", "gate 4")
    STATES = ("free", "shut", "locked")
    keyed_form = KeyedForm("gate", NAMES, "state", STATES)

    def read(self, raw: int, limits: Limits) -> Any:
        return raw

    def numbers(self, limits: Limits) -> range:
        return range(0)

    def sendable(self, limits: Limits) -> range:
        return range(limits.low, limits.high + 1)

    def parse(self, text: str) -> Any:
        if text == "none" or text[:1].isdigit():
            return 0 if text == "none" else typed_number(text)
        parts = (part.partition(":") for part in text.split(","))
        named = {name.strip().replace("-", " "): state.strip() or "shut" for name, _, state in parts}
        for name in named:
            if name not in self.NAMES:
                raise UnknownName("gate", name, self.NAMES)
        return sum(self.STATES.index(state) << 2 * self.NAMES.index(name) for name, state in named.items())

    def text(self, value: Any) -> str:
        states = ((name, value >> 2 * number & 3) for number, name in enumerate(self.NAMES))
        return (
            ",".join(f"{name.replace(' ', '-')}:{self.STATES[min(each, 2)]}" for name, each in states if each) or "none"
        )

    def plain(self, value: Any) -> Any:
        return self.text(value)

    def allowed(self, limits: Limits) -> str:
        return f"{super().allowed(limits)}, or {', '.join(self.NAMES)} with :free, :shut or :locked"


@CATALOGUE.message(MOVES, always=True)
class HaltAll(NamedTuple):
    """Everything has to stand."""


@CATALOGUE.message(MOVES, always=True)
class HaltCause(NamedTuple):
    """The lift has to stand, and why."""

    cause: Annotated[Cause | OutOfRange, Choice(Cause)]


@CATALOGUE.message(MOVES, always=True)
class HaltLift(NamedTuple):
    """The lift has to stand and forget its move."""


@CATALOGUE.message(MOVES)
class MoveTo(NamedTuple):
    """Move to a place; `gates` are optional on the wire, `direction` and `route` exist only where the EDS maps them."""

    x: Annotated[int, Kind("mm")]
    y: Annotated[int, Kind("mm")]
    angle: Annotated[int, Angle("deg")]
    speed: Annotated[int, Kind("%")]
    gates: Annotated[int, Gates()] = 0
    direction: Annotated[Direction, Choice(Direction)] = Direction.FORWARD
    route: Annotated[Route, Choice(Route)] = Route.PLANNED


@CATALOGUE.message(MOVES)
class MoveConfirm(NamedTuple):
    """The move was received."""


@CATALOGUE.message(MOVES)
class MoveStateRequest(NamedTuple):
    """How long until the move is done?"""


@CATALOGUE.message(MOVES)
class MoveStateResponse(NamedTuple):
    """The remaining time."""

    time: Annotated[int | Fault | None, Remaining("ms")]


@CATALOGUE.message(PLACES)
class PlaceRequest(NamedTuple):
    """Where is the lift?"""


@CATALOGUE.message(PLACES)
class PlaceResponse(NamedTuple):
    """Where the lift is."""

    x: Annotated[int | None, Coordinate("mm")]
    y: Annotated[int | None, Coordinate("mm")]
    angle: Annotated[int | None, Heading("deg")]
    source: Annotated[Source | OutOfRange, Choice(Source)]


@CATALOGUE.message(PLACES)
class WeightRequest(NamedTuple):
    """What is on the scale?"""


@CATALOGUE.message(PLACES)
class WeightResponse(NamedTuple):
    """What is on the scale."""

    weight: Annotated[float | Reading, Quantity("kg", step=0.01, within=(0, 500), codes=Reading)]
    temperature: Annotated[float, Real(REAL32, "degC")]


@CATALOGUE.message(SET_UP)
class OrderSet(NamedTuple):
    """What is to be packed."""

    colour: Annotated[Colour, Choice(Colour)]
    boxes: Annotated[int, Kind()]
    rows: Annotated[int, Kind()]


@CATALOGUE.message(SET_UP)
class OrderConfirm(NamedTuple):
    """The order was received; sent by lift and scale alike."""


@CATALOGUE.message(SET_UP)
class CheckScaleRequest(NamedTuple):
    """Is the scale there?"""


@CATALOGUE.message(SET_UP)
class CheckScaleResponse(NamedTuple):
    """The scale is there."""


@CATALOGUE.message(SET_UP)
class CheckLiftRequest(NamedTuple):
    """Is the lift there?"""


@CATALOGUE.message(SET_UP)
class CheckLiftResponse(NamedTuple):
    """The lift is there."""
