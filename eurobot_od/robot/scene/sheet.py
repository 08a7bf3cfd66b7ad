"""The drawing of a match on one page in landscape: the field with everything that moved on it, and what explains it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import dist

from eurobot_od.robot.model.facts import Facts, Field
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.ground import ground, on_paper
from eurobot_od.robot.scene.recording import OURS, PathPoint, Recording, at
from eurobot_od.robot.scene.scene import (
    CLEAR,
    LAYERS,
    RINGS,
    ROBOT_NAMES,
    ROBOTS,
    SIGN,
    TARGETS,
    TRAILS,
    Item,
    Look,
    MatchScene,
    looks,
)
from eurobot_od.robot.scene.tables import column, ticks, timeline
from eurobot_od.support import svg
from eurobot_od.support.texts import amount

PAGE = (4200, 2970)
"""Width and height: the ratio of an A4 page in landscape."""

FIELD, COLUMN, TIMELINE = (190, 300), (3330, 300), (190, 2470)
"""Where the upper left corners of the three parts are."""

ROOM = (3000, 2000)
"""Width and height of the room for the field: another field is drawn smaller or larger."""

PATH_TICK = 10
"""Seconds from one mark on the path to the next."""


def sheet(recording: Recording, facts: Facts, title: str) -> str:
    """Draw a match as SVG, on the field that the facts say."""
    width, height = PAGE
    drawing, scale = field_drawing(recording, facts), min(ROOM[0] / facts.field.width, ROOM[1] / facts.field.height)
    if scale != 1:  # the field of another year
        drawing = svg.group(drawing, transform=f"scale({scale:.4f})")
    return svg.element(
        "svg",
        svg.rectangle((0, 0), width, height, fill=svg.PAPER),
        style.label((FIELD[0], 130), title, svg.INK, size=84, anchor="start", font_weight="bold"),
        style.label((FIELD[0], 215), ", ".join(_summary(recording)), fill=svg.PALE, size=46, anchor="start"),
        style.printed(svg.moved(FIELD, drawing, id="field")),
        style.printed(svg.moved(COLUMN, column(recording, facts))),
        style.printed(svg.moved(TIMELINE, timeline(recording))),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width} {height}",
        font_family=svg.FONT,
    )


def _summary(recording: Recording) -> Iterator[str]:
    start = recording.configuration
    if recording.team is not None:
        yield f"{recording.team.name.lower()} team"
    if start is not None:
        yield amount(start.enemies, "enemy", "enemies")
        yield amount(start.confederates, "confederate")
    reached = sum(goto.outcome is Outcome.ARRIVED for goto in recording.gotos)
    yield f"{reached} of {amount(len(recording.gotos), 'goto')} reached"
    yield amount(len(recording.stops), "stop")
    if recording.truth.path:
        yield amount(len(recording.truth.touches), "touch", "touches")
        yield amount(sum(each.points for each in recording.truth.scores if each.robot == OURS), "point")
    yield f"{recording.end:.0f} s"


# The field


def field_drawing(recording: Recording, facts: Facts) -> str:
    """Draw the field and what happened on it; one unit is one millimetre, the origin its upper left corner."""
    drawn: dict[str, list[str]] = {layer: [] for layer in LAYERS}
    for item in _in_the_end(recording, facts):
        drawn[item.layer].append(item.drawing)
    # Several gotos have the same barriers and the same place.
    return svg.group(ground(facts, recording.team), *(svg.group(*dict.fromkeys(each)) for each in drawn.values()))


def _in_the_end(recording: Recording, facts: Facts) -> Iterator[Item]:
    """Yield what is there at the end of a match, and in every time that barriers and places were asked for."""
    scene, field = MatchScene(facts), facts.field
    robots = {each.message: each for each in looks(facts, recording.configuration)}
    seen = [(robots[kind.__name__], path) for kind, path in recording.paths.items()]
    # The others first: our own path is what the picture is for, and lies on top.
    for look, path in sorted(seen, key=lambda each: each[0].name == OURS):
        trail = _own_path(field, path, recording.end) if look.name == OURS else _path(field, path, look)
        yield from (Item(TRAILS, each, 0) for each in trail)
        place = on_paper(field, path[-1].x, path[-1].y)
        yield Item(ROBOTS, look.at(place, path[-1].angle), 0)
        if look.name != OURS:
            yield Item(ROBOT_NAMES, style.halo((place[0], place[1] + 10), look.name, fill=look.colour), 0)
    if recording.truth.path:
        truth = svg.polyline(_points(field, recording.truth.path), fill="none", stroke=style.TRUTH, stroke_width=3.5)
        yield Item(TRAILS, truth, 0)
    yield from (Item(ROBOTS, each, 0) for each in _ticks(field, recording))
    happened = [each for goto in recording.gotos for each in scene.goto(goto)]
    happened += [each for stop in recording.stops for each in scene.stop(stop)]
    happened += map(scene.touch, recording.truth.touches)
    yield from (each for each in happened if each.end is None or each.layer in (RINGS, TARGETS))


def _points(field: Field, path: Iterable[PathPoint]) -> list[svg.PaperPoint]:
    return [on_paper(field, each.x, each.y) for each in path]


def _path(field: Field, path: Iterable[PathPoint], look: Look) -> Iterator[str]:
    """Draw where another robot was seen."""
    line = {"stroke": look.colour, "stroke_width": 5, "stroke_dasharray": look.dashes, "stroke_opacity": 0.55}
    yield svg.group(svg.title(look.name), svg.polyline(_points(field, path), fill="none", **line))


def _own_path(field: Field, path: list[PathPoint], end: float) -> Iterator[str]:
    """Draw the path in pieces, each in the colour of its time, on a light ground that sets it off."""
    # One line below all pieces: each piece with an edge of its own would show where they meet.
    if len(path) > 1:
        ground = {"stroke": style.PAPER, "stroke_width": 24, "stroke_linejoin": "round"}
        yield svg.polyline(_points(field, path), fill="none", **ground)
    for one, two in pairwise(path):
        colour = style.colour_at(two.time / end if end else 0.0)
        yield svg.line(*_points(field, (one, two)), stroke=colour, stroke_width=13, stroke_linecap="round")


def _ticks(field: Field, recording: Recording) -> Iterator[str]:
    """Mark the path every PATH_TICK seconds, but not under the marks of gotos and stops."""
    taken = [on_paper(field, each.message.x, each.message.y) for each in recording.gotos]
    # Half way to the sign, so that both the dot and the sign keep their distance.
    taken += [on_paper(field, each.place.x, each.place.y + SIGN / 2) for each in recording.stops if each.place]
    for time in ticks(PATH_TICK, recording.end):
        where = at(recording.path, time)
        centre = where and on_paper(field, where.x, where.y)
        if centre and all(dist(centre, other) > CLEAR for other in taken):
            # A robot that stands has one mark, not one for each ten seconds.
            taken.append(centre)
            yield svg.circle(centre, 15, fill=style.PAPER, stroke=style.colour_at(time / recording.end), stroke_width=7)
            yield style.halo((centre[0] + 28, centre[1] + 11), f"{time} s", anchor="start")
