"""The picture of a match on one page in landscape: the field with everything that moved on it, and what explains it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import dist
from typing import TypeVar

from eurobot_od.robot.model.facts import Facts, RobotShape
from eurobot_od.robot.model.messages import SOURCES, PositionResponse
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.picture import style
from eurobot_od.robot.picture.ground import Sheet, ground
from eurobot_od.robot.picture.recording import OURS, PathPoint, RecordedGoto, RecordedStop, Recording, at
from eurobot_od.robot.picture.tables import column, timeline
from eurobot_od.support import svg

PAGE = (4200, 2970)
"""Width and height: the ratio of an A4 page in landscape."""

FIELD, COLUMN, TIMELINE = (190, 300), (3330, 300), (190, 2470)
"""Where the upper left corners of the three parts are."""

ROOM = (3000, 2000)
"""Width and height of the room for the field: another field is drawn smaller or larger."""

PATH_TICK = 10
"""Seconds from one mark on the path to the next."""

CLEAR = 120
"""A mark on the path keeps this distance from gotos and stops, mm."""

DISC, SIGN = 68, 78
"""How far below its place the disc of a goto is, and how far above it the sign of a stop, mm."""

THIN = 8
"""Points of a path that are nearer to each other than this are drawn as one, mm."""

SAME = 60
"""Places in the same square of this size share one mark, mm."""

SPACING = 2 * style.MARK + 8
"""Distance of discs and signs side by side, mm."""


def picture(recording: Recording, facts: Facts, title: str) -> str:
    """Draw a match as SVG, on the field that the facts say."""
    width, height = PAGE
    drawing, scale = field_drawing(recording, facts), min(ROOM[0] / facts.field.width, ROOM[1] / facts.field.height)
    if scale != 1:  # the field of another year
        drawing = svg.group(drawing, transform=f"scale({scale:.4f})")
    return svg.element(
        "svg",
        svg.rectangle((0, 0), width, height, fill=svg.PAPER),
        style.label((FIELD[0], 130), title, size=84, anchor="start", font_weight="bold"),
        style.label((FIELD[0], 215), ", ".join(_summary(recording)), fill=svg.PALE, size=46, anchor="start"),
        svg.moved(FIELD, drawing, id="field"),
        svg.moved(COLUMN, column(recording, facts)),
        svg.moved(TIMELINE, timeline(recording)),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width} {height}",
        font_family=svg.FONT,
    )


def _summary(recording: Recording) -> Iterator[str]:
    start = recording.configuration
    if recording.team is not None:
        yield f"{recording.team.name.lower()} team"
    if start is not None:
        yield _several(start.enemies, "enemy", "enemies")
        yield _several(start.confederates, "confederate", "confederates")
    reached = sum(goto.outcome is Outcome.ARRIVED for goto in recording.gotos)
    yield f"{reached} of {_several(len(recording.gotos), 'goto', 'gotos')} reached"
    yield _several(len(recording.stops), "stop", "stops")
    if recording.truth:
        yield _several(len(recording.touches), "touch", "touches")
        yield _several(sum(each.points for each in recording.scores if each.robot == OURS), "point", "points")
    yield f"{recording.end:.0f} s"


def _several(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


# The field


def field_drawing(recording: Recording, facts: Facts) -> str:
    """Draw the field and what happened on it; one unit is one millimetre, the origin its upper left corner."""
    sheet = Sheet(facts.field)
    return svg.group(
        ground(facts, recording.team, recording.passages),
        # The others first: our own path is what the picture is for, and lies on top.
        *(_other(sheet, recording, facts, whom) for whom in style.OTHERS if recording.paths.get(whom)),
        *_path(sheet, recording.path, recording.end),
        *_true_path(sheet, recording.truth),
        *(_ours(sheet, facts.body, each, style.colour_of(recording.team)) for each in recording.path[-1:]),
        # From here on what explains the paths: it must not be hidden below them.
        *_ticks(sheet, recording),
        *_gotos(sheet, recording.gotos, facts),
        *_stops(sheet, recording.stops),
        *(
            style.touch_mark(sheet.place(*each.place), each.at_fault, svg.title(each.words))
            for each in recording.touches
        ),
    )


def _ours(sheet: Sheet, body: RobotShape, where: PathPoint, colour: str) -> str:
    """Draw our robot: by its outline, with its wheels, if it has some and its heading is known."""
    centre = sheet.place(where.x, where.y)
    # Before the first position with a heading, as after a boot: a body drawn at an angle would be a guess.
    if where.angle is None:
        return style.robot_mark(centre, body.radius, None, colour)
    pose = Pose(where.x, where.y, where.angle)
    corners = [sheet.place(*each) for each in body.corners(pose)]
    wheels = ((sheet.place(*back), sheet.place(*front)) for back, front in body.tracks(pose))
    tyres = [svg.line(*ends, stroke=svg.INK, stroke_width=style.TYRE) for ends in wheels]
    return style.robot_mark(centre, body.radius, where.angle, colour, corners) + "".join(tyres)


def _points(sheet: Sheet, path: Iterable[PathPoint]) -> list[svg.PaperPoint]:
    return [sheet.place(each.x, each.y) for each in path]


def _path(sheet: Sheet, path: list[PathPoint], end: float) -> Iterator[str]:
    """Draw the path in pieces, each in the colour of its time, on a light ground that sets it off."""
    # One line below all pieces: each piece with an edge of its own would show where they meet.
    if len(path) > 1:
        yield svg.polyline(
            _points(sheet, path), fill="none", stroke=svg.PAPER, stroke_width=24, stroke_linejoin="round"
        )
    for one, two in pairwise(path):
        colour = style.colour_at(two.time / end if end else 0.0)
        yield svg.line(*_points(sheet, (one, two)), stroke=colour, stroke_width=13, stroke_linecap="round")


def _true_path(sheet: Sheet, path: list[PathPoint]) -> Iterator[str]:
    """Draw the path without the points that nobody could tell from the one before."""
    points = _points(sheet, path)
    thinned = points[:1]
    for point in points:
        if dist(thinned[-1], point) >= THIN:
            thinned.append(point)
    if path:
        yield svg.polyline(thinned, fill="none", stroke=style.TRUTH, stroke_width=3.5)


def _ticks(sheet: Sheet, recording: Recording) -> Iterator[str]:
    """Mark the path every PATH_TICK seconds, but not under the marks of gotos and stops."""
    place = sheet.place
    taken = [place(each.message.x, each.message.y) for each in recording.gotos]
    # Half way to the sign, so that both the dot and the sign keep their distance.
    taken += [place(each.place.x, each.place.y + SIGN / 2) for each in recording.stops if each.place]
    for time in style.ticks(PATH_TICK, recording.end):
        where = at(recording.path, time)
        if where is not None and all(dist(place(where.x, where.y), other) > CLEAR for other in taken):
            centre = place(where.x, where.y)
            # A robot that stands has one mark, not one for each ten seconds.
            taken.append(centre)
            yield svg.circle(centre, 15, fill=svg.PAPER, stroke=style.colour_at(time / recording.end), stroke_width=7)
            yield style.halo((centre[0] + 28, centre[1] + 11), f"{time} s", anchor="start")


def _other(sheet: Sheet, recording: Recording, facts: Facts, whom: type[PositionResponse]) -> str:
    """Draw where another robot was seen, and itself where it was seen last."""
    name, colour, dashes = style.OTHERS[whom]
    path = recording.paths[whom]
    last = sheet.place(path[-1].x, path[-1].y)
    return svg.group(
        svg.title(name),
        svg.polyline(
            _points(sheet, path),
            fill="none",
            stroke=colour,
            stroke_width=5,
            stroke_dasharray=dashes,
            stroke_opacity=0.55,
        ),
        style.robot_mark(last, diameter(recording, facts, whom) / 2, None, colour),
        style.halo((last[0], last[1] + 10), name, fill=colour),
    )


def diameter(recording: Recording, facts: Facts, whom: type[PositionResponse]) -> float:
    """Return the diameter of another robot in mm: an enemy's from the start configuration, else what the facts say."""
    field = f"{style.OTHERS[whom][0].replace(' ', '_')}_diameter"
    return 10 * getattr(recording.configuration, field, 0) or 2 * facts.others[SOURCES[whom]].radius


def _gotos(sheet: Sheet, gotos: Iterable[RecordedGoto], facts: Facts) -> Iterator[str]:
    """Draw each place that gotos led to once, and below it a disc for each of them."""
    for (x, y), here in _by_place((sheet.place(each.message.x, each.message.y), each) for each in gotos):
        # At the lower edge there is room above the place only.
        below = y - DISC if y > sheet.height - CLEAR else y + DISC
        yield style.target_mark((x, y), sorted({each.message.angle for each in here}))
        for centre, goto in _side_by_side(sheet, (x, below), here):
            asked, sent = goto.message, f"goto {goto.number} at {goto.sent:.1f} s"
            where = (
                f"{asked.x}, {asked.y} mm, {asked.angle} deg, {asked.speed} %, barriers {facts.words(asked.barriers)}"
            )
            yield style.goto_mark(centre, goto.number, goto.outcome, svg.title(f"{sent}: {where}: {goto.ending}"))


def _stops(sheet: Sheet, stops: Iterable[RecordedStop]) -> Iterator[str]:
    """Draw each place of stops as a dot, and above it a sign for each of them."""
    for (x, y), here in _by_place((sheet.place(each.place.x, each.place.y), each) for each in stops if each.place):
        above = y + SIGN if y < CLEAR else y - SIGN
        yield svg.line((x, y), (x, above), stroke=style.STOP, stroke_width=5)
        yield svg.circle((x, y), 13, fill=style.STOP, stroke=svg.PAPER, stroke_width=4)
        for centre, stop in _side_by_side(sheet, (x, above), here):
            words = f"{stop.letter}: {stop.name}, {stop.reason}, at {stop.time:.1f} s"
            yield style.stop_mark(centre, stop.letter, svg.title(words))


Placed = TypeVar("Placed")


def _by_place(things: Iterable[tuple[svg.PaperPoint, Placed]]) -> Iterable[tuple[svg.PaperPoint, list[Placed]]]:
    """Bring together what is at the same place; it is drawn where the first of them is."""
    found: dict[tuple[int, int], tuple[svg.PaperPoint, list[Placed]]] = {}
    for where, thing in things:
        # Squares, not distances: it takes one pass, and a chain of places each near the next one does not become one
        # place.
        square = round(where[0] / SAME), round(where[1] / SAME)
        found.setdefault(square, (where, []))[1].append(thing)
    return found.values()


def _side_by_side(
    sheet: Sheet, middle: svg.PaperPoint, things: Sequence[Placed]
) -> Iterator[tuple[svg.PaperPoint, Placed]]:
    """Yield things with places in a row around `middle`, moved so that all are on the field."""
    half = SPACING * (len(things) - 1) / 2
    # A row that hung over the edge would cover the table beside the field.
    x = min(max(middle[0], half + SPACING), sheet.width - half - SPACING)
    for number, thing in enumerate(things):
        yield (x - half + number * SPACING, middle[1]), thing
