"""What a match that was played here is drawn with: touches at the robot's edge, and points by whom they are."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from eurobot_od.robot.model.messages import GotoXY, KalmanPositionResponse, NaviPositionResponse
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import OURS, Score, Source
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.scene.files import STEP as STEP_OF_PATH
from eurobot_od.robot.scene.files import drawings, truth_of
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import RIVAL

STEP = 5.0


def driven(start: Pose, steps: int) -> World:
    """Return a world in which our robot drove straight on from somewhere."""
    now = [0.0]
    world = World(MatchOptions(enemies=0, confederates=0), lambda: now[0])
    world.robots[OURS].place(start)
    for _ in range(steps):
        now[0] += 0.01
        world.move(OURS, Odometry(STEP, 0.0), 0.01)
    return world


@pytest.mark.parametrize(
    ("start", "words", "place"),
    [
        (Pose(1300, 900, 180), "pool 1", Point(1050, 900)),
        (Pose(1500, 1700, 90), "border", Point(1500, 2000)),
        (Pose(1300, 1400, 180), "fire 1", Point(900 + 81, 1400)),
    ],
)
def test_a_touch_is_where_the_two_met(start: Pose, words: str, place: Point) -> None:
    (touch, *_) = truth_of(driven(start, 80)).touches
    assert touch.words == f"ours at 500 mm/s touched {words}"
    assert touch.at_fault
    assert math.dist(touch.place, place) < 2 * STEP


def test_the_path_is_our_robots_and_scores_keep_their_robot() -> None:
    world = driven(Pose(1500, 1000, 0), 30)
    world.game.scores.append(Score(3.0, RIVAL, "mammoth", 8))
    truth = truth_of(world)
    assert list(truth.scores) == [Score(3.0, RIVAL, "mammoth", 8)]
    steps = [round((after - before) / STEP_OF_PATH, 1) for before, after in pairwise(each.time for each in truth.path)]
    assert set(steps) <= {1.0, 1.1}, "thinned, as the world has a place every 10 ms"
    assert {tuple(each) for each in truth.path} < {(time, *pose) for time, pose in world.path}
    assert list(truth.touches) == []


def test_places_are_poses_in_metres() -> None:
    drawn = drawings(EurobotProtocol.load())
    time = {"sec": 1, "nsec": 500_000_000}
    goto = drawn["Goto XY"].of(GotoXY(1500, 500, 90, 75), time)
    assert goto is not None
    assert (goto["timestamp"], goto["pose"]["position"]) == (time, {"x": 1.5, "y": 0.5, "z": 0.0})
    half = math.sqrt(0.5)
    assert goto["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": half, "w": half})
    unsure = drawn["Kalman Position Response"].of(KalmanPositionResponse(1000, 2000, None, Source.INTERNAL), time)
    assert unsure is not None
    assert unsure["pose"]["orientation"]["w"] == 1.0
    lost = NaviPositionResponse(None, None, None, Source.INTERNAL)
    assert drawn["Navi Position Response"].of(lost, time) is None
    assert "Goto State Response" not in drawn
