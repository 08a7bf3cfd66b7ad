"""The picture of a match that was played here: what was on the bus, and what only the simulated world knows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from eurobot_od import plugin
from eurobot_od.frame import Frame
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.scene.files import SeenMatch, save
from eurobot_od.robot.scene.recording import PathPoint, ScoredTask, TouchMark, Truth
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import OURS
from eurobot_od.traffic.meaning import Decoder

STEP = 0.1
"""Seconds between two places of the true path: a tenth of what a robot is wide at its top speed."""


def seen_match(frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> SeenMatch:
    """Return what to draw of a match, from its frames with their times by the world's clock."""
    robot = plugin.find(options.robot)
    decode = Decoder(robot.dialects.load_all(options.dialect), robot.catalogue())
    return SeenMatch([(time, decode(frame)) for time, frame in frames], decode, world.facts, truth_of(world))


def draw(file: Path, frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> None:
    """Draw a match into a file; raises OSError, UnknownName for its suffix, LocalError for a PNG without the extra."""
    save(seen_match(frames, options, world), file, f"Match, seed {options.seed}")


def truth_of(world: World) -> Truth:
    """Return what nobody could see on the bus: where our robot was, what it touched, how it made its points."""
    ours = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    touches = [TouchMark(each.time, Point(each.x, each.y), str(each), each.is_fault_of(OURS)) for each in ours]
    return Truth([*_thinned(world.path)], touches, [ScoredTask(*score) for score in world.game.scores])


def _thinned(path: Iterable[tuple[float, Pose]]) -> Iterator[PathPoint]:
    last = float("-inf")
    for time, pose in path:
        if time - last >= STEP:
            last = time
            yield PathPoint(time, *pose)
