"""A match as a file: a picture as SVG or PNG, or a page that plays it as HTML; also poses for MCAP files.

The suffix of the file selects the format.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import cos, radians, sin
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od import loading
from eurobot_od.errors import UnknownName
from eurobot_od.export.description import Drawing
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message, OutOfRange
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.model.messages import SOURCES, GotoXY
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.scene.recording import NOTHING, PathPoint, Recording, TouchMark, Truth, record, write_truth
from eurobot_od.robot.scene.scene import PAGE, sheet
from eurobot_od.support import extras
from eurobot_od.support.files import write_whole
from eurobot_od.traffic.meaning import Decoder, Meaning

if TYPE_CHECKING:  # drawing a log does not need the world
    from eurobot_od.robot.world import World


class SeenMatch(NamedTuple):
    """The frames of a match with times in s and meanings, the `decoder`, the facts, and what else is known."""

    frames: Sequence[tuple[float, Meaning]]
    decoder: Decoder
    facts: Facts
    truth: Truth = NOTHING

    @property
    def recording(self) -> Recording:
        """The match according to its messages."""
        messages = ((time, each.message) for time, each in self.frames if each.message is not None)
        return record(messages, self.truth)


def _renderer() -> ModuleType:
    """Return the module that renders SVG; raises LocalError without its extra."""
    with extras.needed("png"):
        import resvg_py
    return resvg_py


def side_by_side(matches: Mapping[str, SeenMatch], title: str) -> bytes:
    """Return a page that plays matches of one robot side by side, by one clock, each with its name.

    It opens playing, unless it is loaded again, or the browser's user wants less motion.
    """
    from eurobot_od.bus.live import BITRATE
    from eurobot_od.robot.scene.panel import field_panel, true_path, truth_events
    from eurobot_od.web.page import Columns, page

    sources, panels = [], [field_panel(next(iter(matches.values())).facts)]
    for name, match in matches.items():
        columns = Columns(name, match.decoder, BITRATE, panels)
        for time, meaning in match.frames:
            columns.take(time, meaning)
        truth = match.truth.later(-(columns.start or 0.0))
        columns.add(truth_events(truth, match.facts))
        sources.append(columns.data(true_path(truth)))
    return page(title, sources, panels, plays=True).encode()


def _png(drawing: str) -> bytes:
    """Return a drawing as PNG, with one pixel per unit of the drawing."""
    return bytes(_renderer().svg_to_bytes(svg_string=drawing, width=PAGE[0]))


PNG = ".png"
"""Suffix of the only format that needs an extra."""

PICTURE_FORMATS: Mapping[str, Callable[[SeenMatch, str], bytes]] = {
    ".svg": lambda match, title: sheet(match.recording, match.facts, title).encode(),
    ".html": lambda match, title: side_by_side({title: match}, title),
    PNG: lambda match, title: _png(sheet(match.recording, match.facts, title)),
}


def form(file: Path) -> Callable[[SeenMatch, str], bytes]:
    """Return the function that makes the file of a match with this suffix.

    Raises UnknownName for an unknown suffix, LocalError for a PNG without the extra.
    """
    suffix = file.suffix.lower()
    if suffix not in PICTURE_FORMATS:
        raise UnknownName("picture format", file.suffix or file.name, PICTURE_FORMATS)
    if suffix == PNG:
        _renderer()  # raises before a match is played
    return PICTURE_FORMATS[suffix]


def save(match: SeenMatch, file: Path, title: str) -> None:
    """Draw a match to a file; raises UnknownName for its suffix, LocalError for a PNG without the extra."""
    write_whole(file, form(file)(match, title))


# A match that was played here: its frames, and the truth of the simulated world


STEP = 0.1
"""Time between two points of the true path, in s; at its top speed a robot moves a tenth of its width meanwhile."""


def seen_match(frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> SeenMatch:
    """Return a match to draw, from its frames with their times by the world's clock."""
    robot = loading.find(options.robot)
    decode = Decoder(robot.dialects.load_all(options.dialect), robot.catalogue())
    return SeenMatch([(time, decode(frame)) for time, frame in frames], decode, world.facts, truth_of(world))


def draw(file: Path, frames: Iterable[tuple[float, Frame]], options: MatchOptions, world: World) -> None:
    """Draw a match to a file; raises OSError, UnknownName for its suffix, LocalError for a PNG without the extra."""
    save(seen_match(frames, options, world), file, f"Match, seed {options.seed}")


def truth_of(world: World) -> Truth:
    """Return what the bus does not show: our robot's true path, its touches, its points, and its strategy's texts."""
    ours = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    touches = [TouchMark(each.time, Point(each.x, each.y), str(each), each.is_fault_of(OURS)) for each in ours]
    return Truth([*_thinned(world.path)], touches, world.game.scores, world.captions)


def keep_truth(log: Path, world: World, start: float, tell: Callable[[str], object]) -> None:
    """Write what only the world knows beside the complete log of a match, whose first frame came at `start`.

    A failure does not spoil the match: `tell` is called with it.
    """
    try:
        write_truth(log, truth_of(world), start)
    except OSError as error:
        tell(f"{error.filename}: {error.strerror}: points and touches are not kept")


def _thinned(path: Iterable[tuple[float, Pose]]) -> Iterator[PathPoint]:
    last = float("-inf")
    for time, pose in path:
        if time - last >= STEP:
            last = time
            yield PathPoint(time, *pose)


# Poses in messages: Foxglove's PoseInFrame, in metres, the angle as a quaternion around the upright axis


FRAME = "field"
"""Name of the playing field's coordinate system, with the origin at the lower left."""

MILLIMETRES = 1000

TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _numbers(names: str) -> dict[str, Any]:
    return _object(**{name: {"type": "number"} for name in names})


PROPERTIES: Mapping[str, Any] = {
    "timestamp": TIME,
    "frame_id": {"type": "string"},
    "pose": _object(position=_numbers("xyz"), orientation=_numbers("xyzw")),
}


def pose(message: Message, time: dict[str, int]) -> dict[str, Any] | None:
    """Return the pose in a message; None if it has no place. An unknown heading is drawn as 0."""
    x, y, angle = (getattr(message, name) for name in ("x", "y", "angle"))
    if x is None or y is None or OutOfRange in map(type, (x, y, angle)):
        return None
    # The quaternion (0, 0, sin a/2, cos a/2) rotates by a around the vertical axis.
    half = radians(angle or 0) / 2
    position = {"x": x / MILLIMETRES, "y": y / MILLIMETRES, "z": 0.0}
    orientation = {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)}
    return {"timestamp": time, "frame_id": FRAME, "pose": {"position": position, "orientation": orientation}}


POSE = Drawing("foxglove.PoseInFrame", PROPERTIES, pose)


def drawings(protocol: Protocol) -> dict[str, Drawing]:
    """Return the drawing of each message with a pose, by the names in the loaded files."""
    return {each.name: POSE for each in protocol.bindings if each.type in (GotoXY, *SOURCES)}
