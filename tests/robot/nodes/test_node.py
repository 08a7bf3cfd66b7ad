"""What no node believes: positions of another robot, and values out of range (decision 17)."""

from __future__ import annotations

import pytest

from eurobot_od.frame import Frame
from eurobot_od.robot.model.messages import (
    ConfederatePositionResponse,
    Enemy1PositionResponse,
    Enemy2PositionResponse,
    GotoConfirm,
    KalmanPositionResponse,
    NaviPositionResponse,
    PositionResponse,
)
from eurobot_od.robot.model.values import (
    RobotError,
    Source,
)
from tests.robot.nodes.driving import (
    ready,
)
from tests.robot.nodes.harness import PROTOCOL, Bench

# Each position, who may be in it, and who says it.
OWN: list[tuple[type[PositionResponse], Source, str]] = [
    (KalmanPositionResponse, Source.INTERNAL, "drive"),
    (ConfederatePositionResponse, Source.CONFEDERATE, "navigation"),
    (Enemy1PositionResponse, Source.ENEMY_1, "navigation"),
    (Enemy2PositionResponse, Source.ENEMY_2, "navigation"),
]


@pytest.mark.parametrize(
    ("kind", "right", "name", "wrong"), [(*each, wrong) for each in OWN for wrong in Source if wrong is not each[1]]
)
def test_17_a_position_of_another_robot_is_dropped_counted_and_told_once(
    kind: type[PositionResponse], right: Source, name: str, wrong: Source
) -> None:
    half = ready("drive", "navigation")
    half.run(1.0)
    before = half.core.positions.copy()
    half.say(name, kind(1, 2, 3, wrong), kind(4, 5, 6, wrong))
    assert half.core.positions == before
    assert half.core.ignored == 2
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE]
    half.say(name, kind(7, 8, 9, right))
    assert half.core.positions[kind].position == kind(7, 8, 9, right)
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE, 0]
    half.say(name, kind(1, 2, 3, wrong))
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE, 0, RobotError.WRONG_SOURCE]


def test_17_a_position_of_another_robot_answers_no_question(half: Bench) -> None:
    call = half.core.position()
    half.run(0.01)
    half.say("drive", KalmanPositionResponse(1, 2, 3, Source.ENEMY_1))
    assert not call.done()
    half.say("drive", KalmanPositionResponse(1, 2, 3, Source.INTERNAL))
    assert call.done()


def test_17_the_drive_drops_a_navigation_position_of_another_robot() -> None:
    bench = Bench("navigation")
    bench.configure()
    before = bench.pose()
    bench.say("navigation", *[NaviPositionResponse(1000, 1000, 90, Source.ENEMY_1)] * 9)
    assert bench.pose() == before
    assert bench.drive.ignored == 9
    assert bench.emergencies("drive") == [RobotError.WRONG_SOURCE]
    bench.say("navigation", NaviPositionResponse(210, 1800, 0, Source.INTERNAL))
    assert bench.pose() != before
    assert bench.emergencies("drive") == [RobotError.WRONG_SOURCE, 0]


def raw(name: str, **values: int) -> Frame:
    return Frame(PROTOCOL.cob_id(name), PROTOCOL.pack(name, **values))


OUTSIDE: list[tuple[str, str, Frame, str]] = [
    ("drive", "core", raw("Kalman Position Response", x=3001, y=0, angle=0, source=0), "x"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=2001, angle=0, source=0), "y"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=0, angle=360, source=0), "angle"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=0, angle=0, source=9), "a source that is reserved"),
    ("navigation", "core", raw("Enemy 1 Position Response", x=4095, y=0, angle=0, source=2), "another type"),
]


@pytest.mark.parametrize(("name", "hearer", "frame", "why"), OUTSIDE, ids=[each[-1] for each in OUTSIDE])
def test_17_a_value_out_of_range_is_told_once_for_each_type(
    half: Bench, name: str, hearer: str, frame: Frame, why: str
) -> None:
    half.say(name, frame, frame, frame)
    assert half.emergencies(hearer) == [0xFF00], why
    half.say("drive", raw("Goto State Response", time=0x0FFFFE + 3))
    assert half.emergencies(hearer)[1:] in ([], [0xFF00])
    half.say(name, frame)
    assert half.emergencies(hearer).count(0xFF00) <= 2


def test_17_a_goto_out_of_range_is_told_by_the_drive_and_moves_nothing() -> None:
    bench = Bench("core")
    frame = raw("Goto XY", x=3001, y=0, angle=0, speed=50, barriers=0)
    bench.say("core", frame, frame)
    assert bench.emergencies("drive") == [0xFF00]
    assert not bench.drive.moving
    assert bench.sent(GotoConfirm) == []
