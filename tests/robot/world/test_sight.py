"""What is ahead of a robot: any part of a body within distance and angle."""

from __future__ import annotations

import pytest

from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.nodes.node import Detection
from eurobot_od.robot.world.bodies import Body, RobotBody, Weight, nearest_ahead


def robot(x: float, y: float, angle: float = 0.0) -> RobotBody:
    body = RobotBody(f"at {x}", Point(0, 0), 140.0, Weight.ROBOT)
    body.place(Pose(x, y, angle))
    return body


@pytest.mark.parametrize(
    ("other", "seen", "why"),
    [
        (robot(1500, 1000), Detection(Obstacle.ENEMY, 220.0, 0.0), "ahead"),
        (robot(2000, 1000), None, "too far away"),
        (robot(500, 1000), None, "behind"),
        (robot(1000, 1500), None, "to the left"),
        (
            robot(1400, 1300),
            Detection(Obstacle.ENEMY, 220.0, 36.87),
            "only its edge is in sight",
        ),
        (robot(1400, 700), Detection(Obstacle.ENEMY, 220.0, -36.87), "its edge, to the right"),
        (robot(1200, 1000), Detection(Obstacle.ENEMY, 0.0, 0.0), "closer than close"),
        (
            Body("thing", Point(1400, 1000), 30.0, Weight.LIGHT),
            Detection(Obstacle.OBJECT, 230.0, 0.0),
            "a thing is no robot",
        ),
    ],
)
def test_the_nearest_body_ahead_is_detected(other: Body, seen: Detection | None, why: str) -> None:
    found = nearest_ahead(robot(1000, 1000), [other], 700.0, 30.0)
    assert (found and found.obstacle) is (seen and seen.obstacle), why
    assert (found or ())[1:] == pytest.approx((seen or ())[1:], abs=0.01), why


def test_the_nearest_other_robot_is_seen() -> None:
    looking, near, far = robot(1000, 1000), robot(1400, 1000), robot(1600, 1000)
    seen = nearest_ahead(looking, [far, looking, near], 700.0, 30.0)
    assert seen is not None
    assert seen.distance == pytest.approx(120.0)
