"""The 23 messages of the document's Table 5.

They have meaning only: millimetres, degrees, milliseconds, enums and None for "unknown". Identifiers, bit positions and
widths come from the EDS files.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple, TypeAlias

from eurobot_od.errors import FieldError
from eurobot_od.od.standard import ErrorCode
from eurobot_od.pdo.kinds import Catalogue, Choice, Kind, Message, OutOfRange, words_of
from eurobot_od.robot.model.kinds import Angle, BarrierFlags, Coordinate, Heading, Remaining
from eurobot_od.robot.model.values import (
    Barriers,
    Direction,
    GotoFault,
    Obstacle,
    RobotError,
    Route,
    Source,
    TeamColour,
)

CATALOGUE = Catalogue({code.value: words_of(code) for code in (ErrorCode.VALUE_OUT_OF_RANGE, *RobotError)})
"""The message types of this file by the names of their PDOs, and the words for the nodes' own error codes."""

GTP, ELP, GIP = "GTP", "ELP", "GIP"
"""The document's three protocols: Goto, Estimated Location, General Information (Table 5)."""

Millimetres: TypeAlias = Annotated[int, Kind("mm")]
Degrees: TypeAlias = Annotated[int, Angle("deg")]
MaybeDegrees: TypeAlias = Annotated["int | None", Heading("deg")]
MaybeMillimetres: TypeAlias = Annotated["int | None", Coordinate("mm")]
MaybeSource: TypeAlias = Annotated["Source | OutOfRange", Choice(Source)]


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

    time: Annotated[int | GotoFault | None, Remaining("ms")]


@CATALOGUE.message(ELP)
class NaviPositionRequest(NamedTuple):
    """ELP: navigation, send the raw position of our robot to the drive (document 4.2.2 Navigation)."""


@CATALOGUE.message(ELP)
class NaviPositionResponse(NamedTuple):
    """ELP: raw position of our robot, navigation to drive (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@CATALOGUE.message(ELP)
class KalmanPositionRequest(NamedTuple):
    """ELP: drive, send the filtered position of our robot to the core (document 4.2.2 Position)."""


@CATALOGUE.message(ELP)
class KalmanPositionResponse(NamedTuple):
    """ELP: filtered position of our robot, drive to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@CATALOGUE.message(ELP)
class Enemy1PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 1? (document Table 5)."""


@CATALOGUE.message(ELP)
class Enemy1PositionResponse(NamedTuple):
    """ELP: position of enemy 1, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@CATALOGUE.message(ELP)
class Enemy2PositionRequest(NamedTuple):
    """ELP: navigation, where is enemy 2? (document Table 5)."""


@CATALOGUE.message(ELP)
class Enemy2PositionResponse(NamedTuple):
    """ELP: position of enemy 2, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


@CATALOGUE.message(ELP)
class ConfederatePositionRequest(NamedTuple):
    """ELP: navigation, where is the confederate? (document Table 5)."""


@CATALOGUE.message(ELP)
class ConfederatePositionResponse(NamedTuple):
    """ELP: position of the confederate, navigation to core (document Table 2)."""

    x: MaybeMillimetres
    y: MaybeMillimetres
    angle: MaybeDegrees
    source: MaybeSource


DIAMETERS: Mapping[Source, str] = {Source.ENEMY_1: "enemy_1_diameter", Source.ENEMY_2: "enemy_2_diameter"}
"""The field of a start configuration with each robot's diameter."""


@CATALOGUE.message(GIP)
class StartConfigurationSet(NamedTuple):
    """GIP: team colour, number of enemies and confederates, the enemies' diameters in cm (document Table 3)."""

    team_colour: Annotated[TeamColour, Choice(TeamColour)]
    enemies: Annotated[int, Kind()]
    confederates: Annotated[int, Kind()]
    enemy_1_diameter: Annotated[int, Kind("cm")]
    enemy_2_diameter: Annotated[int, Kind("cm")]

    def includes(self, whom: Source) -> bool:
        """Tell whether a robot is in the match; ours always is."""
        if whom is Source.CONFEDERATE:
            return self.confederates >= 1
        # The document gives the number of enemies, not which: a single one is enemy 1.
        return self.enemies >= {Source.ENEMY_1: 1, Source.ENEMY_2: 2}.get(whom, 0)

    def contradiction(self) -> FieldError | None:
        """Return the contradiction in it: a diameter for an enemy that is not there; None if there is none."""
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


SOURCES: Mapping[type[Message], Source] = {
    NaviPositionResponse: Source.INTERNAL,
    KalmanPositionResponse: Source.INTERNAL,
    Enemy1PositionResponse: Source.ENEMY_1,
    Enemy2PositionResponse: Source.ENEMY_2,
    ConfederatePositionResponse: Source.CONFEDERATE,
}
"""Whose position each response has; one that names another source must not be believed."""

StopMessage: TypeAlias = EmergencyShutdown | EmergencyStop | StopDrive
PositionResponse: TypeAlias = (
    NaviPositionResponse
    | KalmanPositionResponse
    | Enemy1PositionResponse
    | Enemy2PositionResponse
    | ConfederatePositionResponse
)

__all__ = [each.__name__ for each in CATALOGUE.types]
