"""Touches as our robot sees them: what it was, who drove into whom, and what should not have been touched."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match.summary import RobotTouch, Touched, counts, touches_of
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.world.bodies import BORDER, Touch, standing
from eurobot_od.robot.world.world import NAMES

FACTS = robot_file.read()

FAST, STANDS = 300.0, 0.0


@pytest.mark.parametrize("name", [*(each.name for each in standing(FACTS.barriers)), BORDER, OURS, *NAMES.values()])
def test_everything_on_the_field_has_a_kind(name: str) -> None:
    assert RobotTouch(0.0, name, False, False).kind is not Touched.OTHER


def test_an_unknown_body_has_the_kind_something_else() -> None:
    assert RobotTouch(0.0, "fallen thing", False, False).kind is Touched.OTHER


@pytest.mark.parametrize(
    ("touch", "seen"),
    [
        (Touch(1.0, OURS, "fire 1", FAST, 0.0, 500.0, 600.0), ("fire 1", True, False)),
        (Touch(1.0, OURS, "enemy 1", FAST, STANDS, 500.0, 600.0), ("enemy 1", True, False)),
        (Touch(1.0, OURS, "enemy 1", FAST, FAST, 500.0, 600.0), ("enemy 1", True, True)),
        (Touch(1.0, "enemy 1", OURS, FAST, STANDS, 500.0, 600.0), ("enemy 1", False, True)),
        (Touch(1.0, "enemy 1", OURS, FAST, FAST, 500.0, 600.0), ("enemy 1", True, True)),
        (Touch(1.0, OURS, "pool 1", STANDS, 0.0, 500.0, 600.0), ("pool 1", False, False)),  # it was pushed there
    ],
)
def test_the_robot_that_drove_into_the_other_is_at_fault(touch: Touch, seen: tuple[str, bool, bool]) -> None:
    (mine,) = touches_of(OURS, [touch, Touch(2.0, "enemy 1", "enemy 2", FAST, FAST, 500.0, 600.0)])
    assert mine == RobotTouch(1.0, *seen)


@pytest.mark.parametrize(
    ("touch", "wrong"),
    [
        (RobotTouch(1.0, "fire 1", True, False), False),  # they are light, and in the way
        (RobotTouch(1.0, "fire 1", True, False, forced=True), True),
        (RobotTouch(1.0, "pool 1", False, False, forced=True), True),
        (RobotTouch(1.0, "pool 1", False, False), False),
        (RobotTouch(1.0, "pool 1", True, False), True),
        (RobotTouch(1.0, BORDER, True, False), True),
        (RobotTouch(1.0, "enemy 1", True, False), True),
        (RobotTouch(1.0, "enemy 1", True, True), False),
        (RobotTouch(1.0, "enemy 1", False, True), False),
        (RobotTouch(1.0, "fallen thing", True, False), False),
    ],
)
def test_whether_a_touch_is_wrong_depends_on_what_was_touched(touch: RobotTouch, wrong: bool) -> None:
    assert touch.is_wrong is wrong


def test_touches_are_counted_by_kind() -> None:
    things_met = ["enemy 1", "pool 1", "confederate", "pool 2"]
    assert counts(RobotTouch(1.0, each, True, False) for each in things_met) == {"pool": 2, "robot": 2}
    assert counts([]) == {}
