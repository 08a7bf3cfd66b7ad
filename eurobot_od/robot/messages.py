"""The 23 messages of the document's Table 5.

Rule of this file: meaning only. Millimetres, degrees, milliseconds, enums and None for "unknown"; no identifier,
no bit position and no width, which come from the EDS files.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple, TypeAlias, TypeVar, get_args, get_type_hints

from eurobot_od.errors import UnknownName
from eurobot_od.pdo.kinds import Angle, BarrierFlags, Choice, Coordinate, Heading, Kind, Remaining
from eurobot_od.robot.values import BARRIER_NAMES as BARRIER_NAMES
from eurobot_od.robot.values import Barriers as Barriers
from eurobot_od.robot.values import Direction as Direction
from eurobot_od.robot.values import GotoFault as GotoFault
from eurobot_od.robot.values import Obstacle as Obstacle
from eurobot_od.robot.values import OutOfRange as OutOfRange
from eurobot_od.robot.values import Passage as Passage
from eurobot_od.robot.values import Route as Route
from eurobot_od.robot.values import Source as Source
from eurobot_od.robot.values import TeamColour as TeamColour


def _equal(self: object, other: object) -> bool:
    return type(self) is type(other) and tuple.__eq__(self, other)  # type: ignore[operator]


def _unequal(self: object, other: object) -> bool:
    return not _equal(self, other)


_Class = TypeVar("_Class", bound=type)


def _message(cls: _Class) -> _Class:
    """Make equality depend on the type: tuples alone would call a Goto Confirm equal to a Stop Drive."""
    cls.__eq__, cls.__ne__ = _equal, _unequal  # type: ignore[method-assign, assignment]
    return cls


Millimetres: TypeAlias = Annotated[int, Kind("mm")]
Degrees: TypeAlias = Annotated[int, Angle("deg")]
MaybeDegrees: TypeAlias = Annotated["int | None", Heading("deg")]
MaybeMillimetres: TypeAlias = Annotated["int | None", Coordinate("mm")]
MaybeSource: TypeAlias = Annotated["Source | OutOfRange", Choice(Source)]


@_message
class EmergencyShutdown(NamedTuple):
    """GTP Stop to all nodes: the mushroom was hit (document 4.2.2); nodes keep their safe state."""


@_message
class EmergencyStop(NamedTuple):
    """GTP Extended Stop: brake now because of an obstacle (document 2.1, 4.2.2)."""

    obstacle: Annotated[Obstacle | OutOfRange, Choice(Obstacle)]


@_message
class StopDrive(NamedTuple):
    """GTP Stop: brake and forget the goto (document 2.1)."""


@_message
class GotoXY(NamedTuple):
    """GTP Goto: drive to x, y and turn to angle (document 2.1, Table 1); the newest goto wins.

    `speed` in percent of the drive's maximum. `barriers` are optional on the wire; `direction` and `route` exist
    only where the EDS maps them.
    """

    x: Millimetres
    y: Millimetres
    angle: Degrees
    speed: Annotated[int, Kind("%")]
    barriers: Annotated[Barriers, BarrierFlags()] = Barriers(0)
    direction: Annotated[Direction, Choice(Direction)] = Direction.FORWARD
    route: Annotated[Route, Choice(Route)] = Route.PLANNED


@_message
class GotoConfirm(NamedTuple):
    """GTP Goto ACK: the goto was received (document 2.1)."""


@_message
class GotoStateRequest(NamedTuple):
    """GTP State Request: how long until the goto is done? (document 2.1)."""


@_message
class GotoStateResponse(NamedTuple):
    """GTP State Response: remaining time in ms, 0 arrived, None unknown, or a GotoFault (document Table 1)."""

    time: Annotated[int | GotoFault | None, Remaining("ms")]


@_message
class NaviPositionRequest(NamedTuple):
    """ELP: navigation, send the raw position of our robot to the drive (document 4.2.2 Navigation)."""


@_message
class NaviPositionResponse(NamedTuple):
    """ELP: raw position of our robot, navigation to drive (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@_message
class KalmanPositionRequest(NamedTuple):
    """ELP: drive, send the filtered position of our robot to the core (document 4.2.2 Position)."""


@_message
class KalmanPositionResponse(NamedTuple):
    """ELP: filtered position of our robot, drive to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@_message
class Enemy1PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 1? (document Table 5)."""


@_message
class Enemy1PositionResponse(NamedTuple):
    """ELP: position of enemy 1, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@_message
class Enemy2PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 2? (document Table 5)."""


@_message
class Enemy2PositionResponse(NamedTuple):
    """ELP: position of enemy 2, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@_message
class ConfederatePositionRequest(NamedTuple):
    """ELP: navigation, where is the confederate? (document Table 5)."""


@_message
class ConfederatePositionResponse(NamedTuple):
    """ELP: position of the confederate, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@_message
class StartConfigurationSet(NamedTuple):
    """GIP: team colour, number of enemies and confederates, the enemies' diameters in cm (document Table 3)."""

    team_colour: Annotated[TeamColour, Choice(TeamColour)]
    enemies: Annotated[int, Kind()]
    confederates: Annotated[int, Kind()]
    enemy_1_diameter: Annotated[int, Kind("cm")]
    enemy_2_diameter: Annotated[int, Kind("cm")]


@_message
class StartConfigurationConfirm(NamedTuple):
    """GIP: the start configuration was received; sent by drive and navigation alike (document Table 5)."""


@_message
class CheckNaviRequest(NamedTuple):
    """GIP Node Check Request to the navigation (document 2.3)."""


@_message
class CheckNaviResponse(NamedTuple):
    """GIP Node Check Response of the navigation (document 2.3)."""


@_message
class CheckDriveRequest(NamedTuple):
    """GIP Node Check Request to the drive (document 2.3)."""


@_message
class CheckDriveResponse(NamedTuple):
    """GIP Node Check Response of the drive (document 2.3)."""


PositionResponse: TypeAlias = (
    NaviPositionResponse
    | KalmanPositionResponse
    | Enemy1PositionResponse
    | Enemy2PositionResponse
    | ConfederatePositionResponse
)
Message: TypeAlias = (
    EmergencyShutdown
    | EmergencyStop
    | StopDrive
    | GotoXY
    | GotoConfirm
    | GotoStateRequest
    | GotoStateResponse
    | NaviPositionRequest
    | KalmanPositionRequest
    | Enemy1PositionRequest
    | Enemy2PositionRequest
    | ConfederatePositionRequest
    | PositionResponse
    | StartConfigurationSet
    | StartConfigurationConfirm
    | CheckNaviRequest
    | CheckNaviResponse
    | CheckDriveRequest
    | CheckDriveResponse
)
MessageT = TypeVar("MessageT", bound=Message)

TYPES: tuple[type[Message], ...] = get_args(Message)
"""The 23 message types."""

_BY_NAME = {each.__name__.casefold(): each for each in TYPES}


def type_named(name: str) -> type[Message]:
    """Return the message type for a name as the document writes it, `Goto XY`; case and spaces do not matter.

    Raises UnknownName.
    """
    try:
        return _BY_NAME[name.replace(" ", "").replace("-", "").replace("_", "").casefold()]
    except KeyError:
        raise UnknownName("message", name) from None


def field_name(parameter_name: str) -> str:
    """Return the field for an EDS ParameterName: `X position` is `x`, `Enemy 1 diameter` is `enemy_1_diameter`."""
    return parameter_name.lower().removesuffix(" position").replace(" ", "_")


def _annotated(message_type: type[Message]) -> Mapping[str, Kind]:
    hints = get_type_hints(message_type, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in message_type._fields}


_KINDS = {each: _annotated(each) for each in TYPES}


def kinds(message_type: type[Message]) -> Mapping[str, Kind]:
    """Return the kind of every field of a message type, in their order."""
    return _KINDS[message_type]


SERVICES: Mapping[str, tuple[type[Message], ...]] = {
    "GTP": (EmergencyShutdown, EmergencyStop, StopDrive, GotoXY, GotoConfirm, GotoStateRequest, GotoStateResponse),
    "ELP": tuple(each for each in TYPES if each.__name__.endswith(("PositionRequest", "PositionResponse"))),
    "GIP": (
        StartConfigurationSet,
        StartConfigurationConfirm,
        CheckNaviRequest,
        CheckNaviResponse,
        CheckDriveRequest,
        CheckDriveResponse,
    ),
}
"""The messages of the document's three protocols: Goto, Estimated Location, General Information (Table 5)."""

_SERVICE = {each: service for service, types in SERVICES.items() for each in types}


def service(message_type: type[Message]) -> str:
    """Return the protocol that a message type belongs to: `GTP`, `ELP` or `GIP` (document Table 5)."""
    return _SERVICE[message_type]


def is_flagged(message: Message) -> bool:
    """Tell whether any value of a received message is out of range."""
    return OutOfRange in map(type, message)


def flagged_fields(message: Message) -> list[str]:
    """Return the fields of a received message whose value is out of range; empty if all may be acted on."""
    return [name for name, value in zip(message._fields, message) if isinstance(value, OutOfRange)]


def describe(message: Message) -> str:
    """Write a message's fields for a person, without those that have their default: `x=1200 mm, angle=90 deg`."""
    defaults = type(message)._field_defaults
    return ", ".join(
        f"{name}={kind.text(value)}"
        for (name, kind), value in zip(kinds(type(message)).items(), message)
        if name not in defaults or value != defaults[name]
    )
