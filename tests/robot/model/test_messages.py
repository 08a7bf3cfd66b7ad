"""The message types: their names, fields, kinds, equality and words."""

from __future__ import annotations

from itertools import combinations

import pytest

from eurobot_od.errors import FieldError
from eurobot_od.pdo.kinds import Message, OutOfRange, describe, field_name, flagged_fields, kinds
from eurobot_od.robot.model.messages import (
    CATALOGUE,
    CheckDriveRequest,
    CheckDriveResponse,
    EmergencyStop,
    GotoConfirm,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    NaviPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Barriers, Direction, GotoFault, Obstacle, Passage, Route, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from tests.robot.document import NAMES, TABLES_4_AND_5

POSITION = ("x", "y", "angle", "source")
FIELDS = {
    "Emergency Stop": ("obstacle",),
    "Goto XY": ("x", "y", "angle", "speed", "barriers", "direction", "route"),
    "Goto State Response": ("time",),
    "Start Configuration Set": ("team_colour", "enemies", "confederates", "enemy_1_diameter", "enemy_2_diameter"),
} | {name: POSITION for name in NAMES if name.endswith("Position Response")}

GOTO = GotoXY(x=1234, y=567, angle=89, speed=75)
START = StartConfigurationSet(TeamColour.RED, 2, 1, 45, 33)


@pytest.mark.parametrize(("name", "protocol"), [(row.name, row.protocol) for row in TABLES_4_AND_5])
def test_type_has_the_fields_and_the_protocol_of_the_tables(name: str, protocol: str) -> None:
    entry = CATALOGUE.find(name)
    assert entry is not None
    assert entry.type.__name__ == name.replace(" ", "")
    assert tuple(kinds(entry.type)) == entry.type._fields == FIELDS.get(name, ())
    assert entry.group == protocol


def test_stops_act_in_every_nmt_state() -> None:
    assert {each.__name__ for each in CATALOGUE.always} == {"EmergencyShutdown", "EmergencyStop", "StopDrive"}


@pytest.mark.parametrize("name", ["Goto XY", "goto xy", "GotoXY", "goto-xy", "GOTO_XY"])
def test_type_is_found_however_its_name_is_written(name: str) -> None:
    entry = CATALOGUE.find(name)
    assert entry is not None
    assert entry.type is GotoXY


@pytest.mark.parametrize("name", ["Goto", "", "Goto X", "Message", "Kalmann Position Request"])
def test_nothing_is_found_under_another_name(name: str) -> None:
    assert CATALOGUE.find(name) is None


PARAMETERS = [
    ("X position", "x"),
    ("Y position", "y"),
    ("Angle", "angle"),
    ("Team colour", "team_colour"),
    ("Enemy 1 diameter", "enemy_1_diameter"),
]


@pytest.mark.parametrize(("parameter", "field"), PARAMETERS)
def test_field_of_a_parameter_name(parameter: str, field: str) -> None:
    assert field_name(parameter) == field


# Optional fields, and what they are when left out: no barriers, nose first, round the barriers (document 2.1).
def test_goto_needs_place_angle_and_speed_only() -> None:
    assert GOTO[4:] == (Barriers(0), Direction.FORWARD, Route.PLANNED)


def test_messages_are_equal_by_type_and_fields() -> None:
    empty = [tuple.__new__(each) for each in CATALOGUE.types if not each._fields]
    assert all(one != other for one, other in combinations(empty, 2))
    assert GotoXY(1234, 567, 89, 75) == GOTO
    assert GOTO._replace(speed=74) != GOTO
    assert tuple(GOTO) != GOTO
    here: list[Message] = [each(1, 2, 3, Source.INTERNAL) for each in (NaviPositionResponse, KalmanPositionResponse)]
    assert here[0] != here[1]


def test_messages_can_be_told_apart_in_sets() -> None:
    assert len({StopDrive(), GotoConfirm(), CheckDriveRequest(), CheckDriveResponse(), StopDrive()}) == 4
    assert (StopDrive() != StopDrive()) is False


FLAGGED: list[tuple[Message, list[str]]] = [
    (GOTO, []),
    (StopDrive(), []),
    (GOTO._replace(x=OutOfRange(4000)), ["x"]),
    (GOTO._replace(y=OutOfRange(3000), angle=OutOfRange(400)), ["y", "angle"]),
    (EmergencyStop(OutOfRange(254)), ["obstacle"]),
    (NaviPositionResponse(None, None, None, Source.INTERNAL), []),
]


@pytest.mark.parametrize(("message", "fields"), FLAGGED)
def test_flagged_fields_are_those_out_of_range(message: Message, fields: list[str]) -> None:
    assert flagged_fields(message) == fields


DESCRIBED: list[tuple[Message, str]] = [
    (StopDrive(), ""),
    (GOTO, "x=1234 mm, y=567 mm, angle=89 deg, speed=75 %"),  # what has its default is left out
    (
        GOTO._replace(barriers=Barriers.of({1: Passage.FORCED}), direction=Direction.BACKWARD, route=Route.DIRECT),
        "x=1234 mm, y=567 mm, angle=89 deg, speed=75 %, barriers=fire 1:forced, direction=backward, route=direct",
    ),
    (EmergencyStop(Obstacle.ENEMY), "obstacle=enemy"),
    (EmergencyStop(OutOfRange(254)), "obstacle=254 (out of range)"),
    (GotoStateResponse(None), "time=unknown"),
    (GotoStateResponse(GotoFault.NOT_POSSIBLE), "time=not possible"),
    (NaviPositionResponse(None, None, None, Source.ENEMY_1), "x=unknown, y=unknown, angle=unknown, source=enemy 1"),
    (
        START,
        "team_colour=red, enemies=2, confederates=1, enemy_1_diameter=45 cm, enemy_2_diameter=33 cm",
    ),
]


@pytest.mark.parametrize(("message", "text"), DESCRIBED)
def test_is_described_for_a_person(message: Message, text: str) -> None:
    assert describe(message, EurobotProtocol.load("firmware2014").binding(type(message)).kinds) == text


@pytest.mark.parametrize(
    ("enemies", "confederates", "included"),
    [
        (0, 0, {Source.INTERNAL}),
        (1, 0, {Source.INTERNAL, Source.ENEMY_1}),
        (2, 0, {Source.INTERNAL, Source.ENEMY_1, Source.ENEMY_2}),
        (0, 1, {Source.INTERNAL, Source.CONFEDERATE}),
    ],
)
def test_a_start_configuration_says_who_is_in_the_match(enemies: int, confederates: int, included: set[Source]) -> None:
    start = START._replace(enemies=enemies, confederates=confederates)
    assert {whom for whom in Source if start.includes(whom)} == included


@pytest.mark.parametrize(
    ("enemies", "diameters", "field"),
    [
        (0, (0, 0), None),
        (1, (30, 0), None),
        (2, (30, 20), None),
        (2, (0, 0), None),  # 0: nobody has measured them
        (0, (30, 0), "enemy_1_diameter"),
        (0, (0, 20), "enemy_2_diameter"),
        (1, (30, 20), "enemy_2_diameter"),
        (0, (30, 20), "enemy_1_diameter"),
    ],
)
def test_only_an_enemy_that_is_there_has_a_diameter(
    enemies: int, diameters: tuple[int, int], field: str | None
) -> None:
    wrong = StartConfigurationSet(TeamColour.RED, enemies, 0, *diameters).contradiction()
    assert (wrong.field if wrong else None) == field


def test_a_colour_as_a_text_is_refused_with_the_members_that_a_program_writes() -> None:
    protocol = EurobotProtocol.load()
    message = StartConfigurationSet("red", 0, 0, 0, 0)  # type: ignore[arg-type]
    with pytest.raises(FieldError, match=r"'red' is not allowed; allowed: TeamColour\.YELLOW, TeamColour\.RED$"):
        protocol.encode(message)
