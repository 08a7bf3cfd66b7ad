"""The picture of a match that was played here: what was on the bus, and what the world knows besides."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from eurobot_od.frame import Frame
from eurobot_od.robot.field import HEIGHT, WIDTH, Point, Pose
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.picture.files import save
from eurobot_od.robot.picture.recording import Recording, ScoredTask, TouchMark, Truth, record_frames
from eurobot_od.robot.protocol import decoder
from eurobot_od.robot.world import World
from eurobot_od.robot.world.bodies import BORDER, Body, Weight
from eurobot_od.robot.world.world import OURS, Touch


def recorded(frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> Recording:
    """Return what is to be drawn of a match, from its frames with their times by the world's clock."""
    return record_frames(frames, decoder(options.dialect), truth_of(world))


def draw(file: Path, frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> None:
    """Draw a match into a file; raises OSError, UnknownName for its suffix, LocalError for a PNG without the extra."""
    save(recorded(frames, options, world), file, f"Match, seed {options.seed}")


def truth_of(world: World) -> Truth:
    """Return what nobody could see on the bus: where our robot was, what it touched, how it made its points."""
    ours = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    touches = [TouchMark(each.time, _place(each, world), str(each), each.is_fault_of(OURS)) for each in ours]
    return Truth(world.path, touches, [ScoredTask(*score) for score in world.game.scores])


def _place(touch: Touch, world: World) -> Point:
    """Return where two bodies met: at the robot's edge, towards the other one."""
    body, here = world.robots[touch.robot], _pose_at(touch.robot, touch.time, world)
    other = _centre(touch, here, world)
    heading = here.bearing(other) if other != here.point else here.angle
    return Pose(*here.point, heading).moved(min(body.radius, here.distance(other)), 0).point


def _centre(touch: Touch, here: Pose, world: World) -> Point:
    """Return what a robot has at its front when it touches something; what is light is pushed, and so it is ahead."""
    if touch.thing in world.robots:
        return _pose_at(touch.thing, touch.time, world).point
    if touch.thing == BORDER:
        return _nearest_edge(here.point)
    fixed: dict[str, Body] = {each.name: each for each in world.things if each.weight is Weight.FIXED}
    return fixed[touch.thing].point if touch.thing in fixed else here.moved(world.robots[touch.robot].radius, 0).point


def _pose_at(robot: str, time: float, world: World) -> Pose:
    pose = world.pose(robot, world.clock() - time)
    assert pose is not None  # it has touched something
    return pose


def _nearest_edge(point: Point) -> Point:
    edges = (Point(0, point.y), Point(WIDTH, point.y), Point(point.x, 0), Point(point.x, HEIGHT))
    return min(edges, key=lambda edge: Pose(*point, 0).distance(edge))
