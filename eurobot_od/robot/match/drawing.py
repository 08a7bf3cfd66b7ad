"""The picture of a match that was played here: what was on the bus, and what only the simulated world knows."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from eurobot_od import plugin
from eurobot_od.frame import Frame
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.panel.files import SeenMatch, save
from eurobot_od.robot.picture.recording import Recording, ScoredTask, TouchMark, Truth, record_frames
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import OURS
from eurobot_od.traffic.meaning import Decoder


def _decoder(options: MatchOptions) -> Decoder:
    robot = plugin.find(options.robot)
    return Decoder(robot.dialects.load_all(options.dialect), robot.catalogue())


def recorded(frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> Recording:
    """Return what to draw of a match, from its frames with their times by the world's clock."""
    return record_frames(frames, _decoder(options), truth_of(world))


def draw(file: Path, frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> None:
    """Draw a match into a file; raises OSError, UnknownName for its suffix, LocalError for a PNG without the extra."""
    decode = _decoder(options)
    seen = [(time, decode(frame)) for time, frame in frames]
    save(SeenMatch(seen, decode, world.facts, truth_of(world)), file, f"Match, seed {options.seed}")


def truth_of(world: World) -> Truth:
    """Return what nobody could see on the bus: where our robot was, what it touched, how it made its points."""
    ours = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    touches = [TouchMark(each.time, Point(each.x, each.y), str(each), each.is_fault_of(OURS)) for each in ours]
    return Truth(world.path, touches, [ScoredTask(*score) for score in world.game.scores])
