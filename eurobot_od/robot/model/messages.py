"""The 23 messages of the document's Table 5.

Their fields have meaning: millimetres, degrees, milliseconds, enums and None for "unknown". All numbers come from the
EDS files: COB-IDs, bit positions, widths, ranges and codes. A unit is named here if the nodes compute in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self, TypeAlias

from eurobot_od.errors import FieldError
from eurobot_od.od.meanings import ObjectMeaning
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import Limits, typed_number
from eurobot_od.pdo.kinds import (
    Catalogue,
    Choice,
    ColumnForm,
    KeyedForm,
    Kind,
    MeaningError,
    Message,
    OutOfRange,
    whole_number,
    words_of,
)
from eurobot_od.robot.model.values import (
    Barriers,
    Direction,
    GotoFault,
    Obstacle,
    Passage,
    RobotError,
    Route,
    Source,
    TeamColour,
)

if TYPE_CHECKING:
    from pathlib import Path

    from eurobot_od.robot.model.robot_file import Facts


# Kinds of fields that only the robot has: angles, coordinates, barrier flags


class Angle(Kind):
    """Degrees on the unit circle (document section 1): any whole angle from a caller, 0 to 359 in a frame."""

    modulus: int = 360

    @property
    def _circle(self) -> int:
        """The number of steps of a full circle."""
        return round(self.modulus / self.scale.factor)

    def of(self, said: ObjectMeaning) -> Self:
        made = super().of(said)
        if made._within not in (None, Limits(0, made._circle - 1)):
            circle = f"0..{made._circle - 1}"
            raise MeaningError(f"is a full circle, {circle} in steps of {made.raw_unit}; the table has {made._within}")
        return made

    def write(self, value: Any, limits: Limits) -> int:
        if value is None:
            return self._raw_of(value)
        return (whole_number(value) if self.scale.is_raw else self._steps(value)) % self._circle

    def measured(self, limits: Limits) -> Limits:
        # Ten bits can hold 1023. A received value above 359 is flagged, not reduced modulo 360.
        return Limits(0, self._circle - 1)

    def allowed(self, limits: Limits) -> str:
        return ", ".join(["any whole angle in degrees", *self._allowed_codes()])


UNKNOWN: Mapping[str, None] = {"unknown": None}
"""The code of an unknown position (document Table 2)."""


class Heading(Angle):
    """An angle that may be unknown, alone or together with its coordinates (document Table 2)."""

    def __init__(self, unit: str) -> None:
        super().__init__(unit, UNKNOWN)

    @property
    def unknown_as_a_whole(self) -> int | None:  # type: ignore[override]
        return self._raws.get((type(None), None))


class Coordinate(Kind):
    """A coordinate, unknown only together with the other one and the heading (document Table 2).

    The code alone is a real coordinate; x, y and angle with their codes mean "position unknown".
    """

    def __init__(self, unit: str) -> None:
        super().__init__(unit, UNKNOWN)

    def _number(self, codes: Mapping[str, int]) -> None:
        super()._number({})
        self.unknown_as_a_whole = codes.get("unknown")

    def allowed(self, limits: Limits) -> str:
        return f"{super().allowed(limits)}, or x, y and angle None for unknown ({self.unknown_as_a_whole})"


TIMES: Mapping[str, Any] = {"arrived": 0, **UNKNOWN, **{words_of(fault): fault for fault in GotoFault}}
"""Meaning of the codes of a goto's remaining time (document Table 1, 2014 robot)."""


def _facts_of(file: Path | None = None) -> Facts:
    """Return the facts of the robot's file beside an EDS file; the shipped one without an EDS file."""
    from eurobot_od.robot.model import robot_file  # here, as it imports YAML, which most commands do not need

    return robot_file.read(file and robot_file.file_for(file))


class BarrierFlags(Kind):
    """Barrier flags: any 16 bits, written as `fire-1:forced,pool-2:normal`, `none` or a number.

    The barriers are those of the robot's file, read when their names are first needed.
    """

    column_form = ColumnForm.BITS

    def __init__(self, facts: Callable[[], Facts] = _facts_of) -> None:
        super().__init__()
        self._read_facts = facts

    def beside(self, file: Path) -> BarrierFlags:
        return BarrierFlags(partial(_facts_of, file))

    @cached_property
    def _facts(self) -> Facts:
        return self._read_facts()

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
            name, _, passage = part.replace("=", ":").partition(":")
            wanted = passage.strip().upper() or Passage.NORMAL.name
            if wanted not in Passage.__members__:
                raise ValueError(part)
            passages[self._facts.barrier(name).number] = Passage[wanted]
        return Barriers.of(passages)

    def text(self, value: Any) -> str:
        return self._facts.words(Barriers(value)) if value else str(Barriers(0))

    def plain(self, value: Any) -> Any:
        return self.text(value)

    def wanted(self, value: Any, limits: Limits) -> str:
        return f"Barriers.of({{1: Passage.NORMAL}}), or {super().allowed(limits)}"

    def allowed(self, limits: Limits) -> str:
        passages = " or ".join(words_of(passage) for passage in Passage)
        names = ", ".join(each.name.replace(" ", "-") for each in self._facts.barriers)
        return f"{super().allowed(limits)}, or {names} with :{passages}"


# The messages

CATALOGUE = Catalogue({code.value: words_of(code) for code in (ErrorCode.VALUE_OUT_OF_RANGE, *RobotError)})
"""The message types of this module by the names of their PDOs, and the texts of the nodes' own error codes."""

GTP, ELP, GIP = "GTP", "ELP", "GIP"
"""The document's three protocols: Goto, Estimated Location, General Information (Table 5)."""

Millimetres: TypeAlias = Annotated[int, Kind("mm")]
Degrees: TypeAlias = Annotated[int, Angle("deg")]
MaybeDegrees: TypeAlias = Annotated["int | None", Heading("deg")]
MaybeMillimetres: TypeAlias = Annotated["int | None", Coordinate("mm")]
MaybeSource: TypeAlias = Annotated["Source | OutOfRange", Choice(Source)]


class PositionResponse(NamedTuple):
    """The fields of all position responses (document Table 2); `source` is the robot they are about."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@CATALOGUE.message(GTP, always=True)
class EmergencyShutdown(NamedTuple):
    """GTP Stop to all nodes: the mushroom was hit (document 4.2.2); nodes keep their safe state."""


@CATALOGUE.message(GTP, always=True)
class EmergencyStop(NamedTuple):
    """GTP Extended Stop: brake now because of an obstacle (document 2.1, 4.2.2)."""

    obstacle: Annotated[Obstacle | OutOfRange, Choice(Obstacle)]


@CATALOGUE.message(GTP, always=True)
class StopDrive(NamedTuple):
    """GTP Stop: brake and forget the goto (document 2.1)."""


@CATALOGUE.message(GTP)
class GotoXY(NamedTuple):
    """GTP Goto: drive to x, y and turn to angle (document 2.1, Table 1); the newest goto wins.

    `speed` is in percent of the drive's maximum. `barriers` are optional on the wire; `direction` and `route` exist
    only where the EDS maps them.
    """

    x: Millimetres
    y: Millimetres
    angle: Degrees
    speed: Annotated[int, Kind("%")]
    barriers: Annotated[Barriers, BarrierFlags()] = Barriers(0)
    direction: Annotated[Direction, Choice(Direction)] = Direction.FORWARD
    route: Annotated[Route, Choice(Route)] = Route.PLANNED


@CATALOGUE.message(GTP)
class GotoConfirm(NamedTuple):
    """GTP Goto ACK: the goto was received (document 2.1)."""


@CATALOGUE.message(GTP)
class GotoStateRequest(NamedTuple):
    """GTP State Request: how long until the goto is done? (document 2.1)."""


@CATALOGUE.message(GTP)
class GotoStateResponse(NamedTuple):
    """GTP State Response: remaining time in ms, 0 arrived, None unknown, or a GotoFault (document Table 1)."""

    time: Annotated[int | GotoFault | None, Kind("ms", TIMES)]


@CATALOGUE.message(ELP)
class NaviPositionRequest(NamedTuple):
    """ELP: navigation, send the raw position of our robot to the drive (document 4.2.2 Navigation)."""


@CATALOGUE.message(ELP)
class NaviPositionResponse(PositionResponse):
    """ELP: raw position of our robot, navigation to drive (document Table 2)."""

    __slots__ = ()


@CATALOGUE.message(ELP)
class KalmanPositionRequest(NamedTuple):
    """ELP: drive, send the filtered position of our robot to the core (document 4.2.2 Position)."""


@CATALOGUE.message(ELP)
class KalmanPositionResponse(PositionResponse):
    """ELP: filtered position of our robot, drive to core (document Table 2)."""

    __slots__ = ()


@CATALOGUE.message(ELP)
class Enemy1PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 1? (document Table 5)."""


@CATALOGUE.message(ELP)
class Enemy1PositionResponse(PositionResponse):
    """ELP: position of enemy 1, navigation to core (document Table 2)."""

    __slots__ = ()


@CATALOGUE.message(ELP)
class Enemy2PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 2? (document Table 5)."""


@CATALOGUE.message(ELP)
class Enemy2PositionResponse(PositionResponse):
    """ELP: position of enemy 2, navigation to core (document Table 2)."""

    __slots__ = ()


@CATALOGUE.message(ELP)
class ConfederatePositionRequest(NamedTuple):
    """ELP: navigation, where is the confederate? (document Table 5)."""


@CATALOGUE.message(ELP)
class ConfederatePositionResponse(PositionResponse):
    """ELP: position of the confederate, navigation to core (document Table 2)."""

    __slots__ = ()


DIAMETERS: Mapping[Source, str] = {Source.ENEMY_1: "enemy_1_diameter", Source.ENEMY_2: "enemy_2_diameter"}
"""The start configuration's field for each robot's diameter."""


@CATALOGUE.message(GIP)
class StartConfigurationSet(NamedTuple):
    """GIP: team colour, number of enemies and confederates, the enemies' diameters in cm (document Table 3)."""

    team_colour: Annotated[TeamColour, Choice(TeamColour)]
    enemies: Annotated[int, Kind()]
    confederates: Annotated[int, Kind()]
    enemy_1_diameter: Annotated[int, Kind("cm")]
    enemy_2_diameter: Annotated[int, Kind("cm")]

    def includes(self, whom: Source) -> bool:
        """Return whether a robot is in the match; ours always is."""
        if whom is Source.CONFEDERATE:
            return self.confederates >= 1
        # The document only has the number of enemies; a single one is enemy 1.
        return self.enemies >= {Source.ENEMY_1: 1, Source.ENEMY_2: 2}.get(whom, 0)

    def contradiction(self) -> FieldError | None:
        """Return an error for the diameter of a missing enemy, None if there is none."""
        for whom, field in DIAMETERS.items():
            diameter = getattr(self, field)
            if diameter and not self.includes(whom):
                return FieldError("Start Configuration Set", field, diameter, f"0, as enemies = {self.enemies}")
        return None


@CATALOGUE.message(GIP)
class StartConfigurationConfirm(NamedTuple):
    """GIP: the start configuration was received; sent by drive and navigation alike (document Table 5)."""


@CATALOGUE.message(GIP)
class CheckNaviRequest(NamedTuple):
    """GIP Node Check Request to the navigation (document 2.3)."""


@CATALOGUE.message(GIP)
class CheckNaviResponse(NamedTuple):
    """GIP Node Check Response of the navigation (document 2.3)."""


@CATALOGUE.message(GIP)
class CheckDriveRequest(NamedTuple):
    """GIP Node Check Request to the drive (document 2.3)."""


@CATALOGUE.message(GIP)
class CheckDriveResponse(NamedTuple):
    """GIP Node Check Response of the drive (document 2.3)."""


StopMessage: TypeAlias = EmergencyShutdown | EmergencyStop | StopDrive


class Position(NamedTuple):
    """How a position is requested: its record in the object dictionary, its messages, and the robot it is about."""

    record: str
    request: Message
    response: type[PositionResponse]
    source: Source


POSITIONS = (
    Position("Navi position", NaviPositionRequest(), NaviPositionResponse, Source.INTERNAL),
    Position("Kalman position", KalmanPositionRequest(), KalmanPositionResponse, Source.INTERNAL),
    Position("Confederate position", ConfederatePositionRequest(), ConfederatePositionResponse, Source.CONFEDERATE),
    Position("Enemy 1 position", Enemy1PositionRequest(), Enemy1PositionResponse, Source.ENEMY_1),
    Position("Enemy 2 position", Enemy2PositionRequest(), Enemy2PositionResponse, Source.ENEMY_2),
)
"""All positions, in the order in which the core asks for them."""

SOURCES: Mapping[type[Message], Source] = {each.response: each.source for each in POSITIONS}
"""The source of each response; a response with another source must be ignored."""

__all__ = [each.__name__ for each in CATALOGUE.types]
