"""The scene: what there is to draw, each thing with its layer and the time in which it is there.

It is the same for a file, which shows what is there in the end, and for the page, which shows a moment: `field.js`
paints the drawings as they are, and moves the robots' where their messages say.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import dist
from typing import NamedTuple

from eurobot_od.robot.model.messages import (
    SOURCES,
    KalmanPositionResponse,
    NaviPositionResponse,
    PositionResponse,
    StartConfigurationSet,
)
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Barrier, Facts, Field, Start
from eurobot_od.robot.model.values import OURS, Outcome, TeamColour
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import RecordedGoto, RecordedStop, TouchMark
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint

GRID_STEP = 500

MARGIN = 40
"""From the border to the numbers of an axis, and half of it from a zone's edge to its name, mm."""

NAMED = 100
"""A barrier has its whole name on it from this radius on, mm, else its number."""


def on_paper(field: Field, x: float, y: float) -> PaperPoint:
    """Return where a place of the field is drawn: y grows upwards on the field and downwards on paper."""
    # The document's origin is the lower left corner of the field, SVG's the upper left one of the sheet.
    return x, field.height - y


def ground(facts: Facts, team: TeamColour | None = None) -> str:
    """Draw the field, its origin the upper left corner; the start place of `team` is the one that is marked."""
    field, trees = facts.field, facts.field.trees
    return svg.group(
        svg.rectangle((0, 0), field.width, field.height, fill=style.SURFACE),
        *_grid(field),
        *(_start(field, colour, start, colour is team) for colour, start in field.starts.items()),
        *(svg.moved(on_paper(field, *each.point), _barrier(each)) for each in facts.barriers),
        svg.rectangle((0, 0), field.width, field.height, fill="none", stroke=style.INK, stroke_width=field.border),
        *(svg.circle(on_paper(field, *each), trees.radius, fill=style.TREE) for each in trees.places),
    )


def _grid(field: Field) -> Iterator[str]:
    """Draw lines and their numbers."""
    for x in range(0, int(field.width) + 1, GRID_STEP):
        yield svg.line((x, 0), (x, field.height), stroke=style.GRID, stroke_width=3)
        yield _small((x, field.height + MARGIN), str(x), style.PALE, "middle", "hanging")
    for y in range(0, int(field.height) + 1, GRID_STEP):
        yield svg.line((0, y), (field.width, y), stroke=style.GRID, stroke_width=3)
        yield _small((-MARGIN, field.height - y), str(y), style.PALE, "end", "middle")


def _small(place: PaperPoint, words: str, fill: str, anchor: str, baseline: str) -> str:
    return style.label(place, words, fill, style.SMALL, anchor, dominant_baseline=baseline)


def _start(field: Field, colour: TeamColour, start: Start, is_ours: bool) -> str:
    """Draw the zone that a robot starts from."""
    left, lower, right, upper = start.zone
    paint, corner = style.team_colour(colour), on_paper(field, left, upper)
    opacity, width, dashes = (0.3, 10, None) if is_ours else (0.12, 4, "20 12")
    look = {"fill": paint, "fill_opacity": opacity, "stroke": paint, "stroke_width": width, "stroke_dasharray": dashes}
    # Towards the nearer border, where larger letters do not run out of the field.
    x, anchor = (left + MARGIN / 2, "start") if left < field.width / 2 else (right - MARGIN / 2, "end")
    name = _small((x, corner[1] + MARGIN / 2), f"start {colour.name.lower()}", style.INK, anchor, "hanging")
    return svg.group(svg.rectangle(corner, right - left, upper - lower, **look), name)


def _barrier(barrier: Barrier) -> str:
    """Draw a barrier with its name."""
    radius = barrier.kind.radius
    # A small barrier has no room for its name.
    words = barrier.name if radius > NAMED else barrier.name.rpartition(" ")[2]
    # The edge is for where the letters are larger than the barrier, on a phone.
    look = {"font_weight": "bold", "stroke": svg.INK, "stroke_width": 7, "paint_order": "stroke"}
    name = svg.text((0, 13), words, fill=svg.PAPER, font_size=36, text_anchor="middle", **look)
    return svg.group(style.barrier_shape(barrier.kind, radius), name)


LAYERS = ("rings", "trails", "robots", "routes", "targets", "marks", "names")
"""From the ground up: what explains the paths is not hidden below them."""

RINGS, TRAILS, ROBOTS, ROUTES, TARGETS, MARKS, ROBOT_NAMES = LAYERS


class Item(NamedTuple):
    """A drawing on the field, its origin the upper left corner, from `begin` to `end` in s; None if it stays."""

    layer: str
    drawing: str
    begin: float
    end: float | None = None

    def later(self, by: float) -> Item:
        """Return the same `by` s later."""
        return self._replace(begin=self.begin + by, end=None if self.end is None else self.end + by)


# What happens

DISC, SIGN = 68, 78
"""How far below its place the disc of a goto is, and how far above it the sign of a stop, mm."""

CLEAR = 120
"""Nearer to the border than this there is no room for a disc or a sign, mm."""

SPACING = 2 * style.MARK + 8
"""Distance of signs, mm, which do not cover each other."""


class MatchScene:
    """Draws what happens on a field; a mark keeps its place, also if it is drawn anew."""

    def __init__(self, facts: Facts) -> None:
        self._facts, self._field = facts, facts.field
        self._signs: dict[tuple[str, object], PaperPoint] = {}

    def goto(self, goto: RecordedGoto, route: Iterable[Point] = ()) -> Iterator[Item]:
        """Draw a goto: the barriers and the way while it is under way, its disc from then on."""
        asked, sent, ended = goto.message, goto.sent, goto.ended
        for barrier, passage in self._facts.flagged(asked.barriers):
            ring = style.ring_mark(barrier.kind.radius + style.RING, passage, svg.title(barrier.name))
            yield Item(RINGS, svg.moved(on_paper(self._field, *barrier.point), ring), sent, ended)
        if points := [on_paper(self._field, *each) for each in route]:
            yield Item(ROUTES, way_mark(points), sent, ended)
        place = on_paper(self._field, asked.x, asked.y)
        yield Item(TARGETS, svg.moved(place, style.target_mark(asked.angle)), sent, ended)
        # At the lower edge there is room above the place only.
        away = -DISC if place[1] > self._field.height - CLEAR else DISC
        disc = self._aside("goto", goto.number, place, away)
        words = f"{goto.words}, barriers {self._facts.words(asked.barriers)}, at {sent:.1f} s"
        running = style.goto_mark(goto.number, None, svg.title(f"{words}: under way"))
        yield _mark(place, svg.moved(disc, running), begin=sent, end=ended)
        if ended is not None:
            over = style.goto_mark(goto.number, goto.outcome, svg.title(f"{words}: {goto.ending}"))
            yield _mark(place, svg.moved(disc, over), begin=ended)

    def stop(self, stop: RecordedStop) -> Iterator[Item]:
        """Draw a stop as a dot, and above it its sign; nothing if nobody knows where it was."""
        if stop.place is not None:
            place = on_paper(self._field, stop.place.x, stop.place.y)
            sign = self._aside("stop", stop.letter, place, SIGN if place[1] < CLEAR else -SIGN)
            yield _mark(
                place,
                svg.line(style.CENTRE, sign, stroke=style.STOP, stroke_width=5),
                svg.circle(style.CENTRE, 13, fill=style.STOP, stroke=style.PAPER, stroke_width=4),
                svg.moved(sign, style.stop_mark(stop.letter, svg.title(f"{stop.words}, at {stop.time:.1f} s"))),
                begin=stop.time,
            )

    def touch(self, touch: TouchMark) -> Item:
        """Draw a touch."""
        burst = style.touch_mark(touch.at_fault, svg.title(touch.words))
        return _mark(on_paper(self._field, *touch.place), burst, begin=touch.time)

    def _aside(self, kind: str, name: object, place: PaperPoint, away: float) -> PaperPoint:
        """Return where a sign stands, seen from its place: `away` below it, and aside if another one is there."""
        if (kind, name) not in self._signs:
            row = [(place[0] + each, place[1] + away) for each in self._row(place[0])]
            free = (each for each in row if all(dist(each, other) > SPACING - 1 for other in self._signs.values()))
            self._signs[kind, name] = next(free, row[len(self._signs) % len(row)])
        x, y = self._signs[kind, name]
        return x - place[0], y - place[1]

    def _row(self, middle: float) -> list[float]:
        """Return how far from the middle of a row its signs are, by turns to both sides; all are on the field."""
        first, last = SPACING - middle, self._field.width - SPACING - middle
        begin, steps = min(max(0, first), last), int(self._field.width / SPACING)
        row = [each for n in range(-steps, steps + 1) if first <= (each := begin + n * SPACING) <= last] or [begin]
        return sorted(row, key=lambda each: (abs(each - begin), each < begin))


def _mark(place: PaperPoint, *content: str, begin: float, end: float | None = None) -> Item:
    """Return a mark that is drawn around its place; where its words are drawn larger, so is all of it."""
    return Item(MARKS, svg.moved(place, svg.group(*content, class_="sign")), begin, end)


def way_mark(points: Iterable[PaperPoint]) -> str:
    """Draw the way to a goto."""
    return svg.polyline(points, fill="none", stroke=style.GOTO, stroke_width=9, stroke_dasharray="26 18")


# Robots


class Look(NamedTuple):
    """How a robot is drawn around its middle: where it looks along x, and where its heading is unknown.

    `message` says where it is. `trail` tells whether its way is drawn.
    """

    name: str
    message: str
    colour: str
    radius: float
    turned: str
    round: str
    dashes: str | None = None
    trail: bool = True

    def at(self, place: PaperPoint, angle: float | None) -> str:
        """Draw the robot where it is on paper, with its heading in degrees, counter-clockwise."""
        if angle is None:
            return svg.moved(place, self.round)
        turned = svg.group(self.turned, transform=f"rotate({svg.number(-angle)})")
        return svg.moved(place, turned)


RAW = 40
"""Radius of the ring for what navigation alone says, mm."""


def looks(facts: Facts, start: StartConfigurationSet | None) -> Iterator[Look]:
    """Return how the robots look in a match with this start configuration."""
    team = start.team_colour if start is not None and isinstance(start.team_colour, TeamColour) else None
    body, colour, here = facts.body, style.team_colour(team), Pose(0, 0, 0)
    outline = [(x, -y) for x, y in body.corners(here)]
    wheels = (((x1, -y1), (x2, -y2)) for (x1, y1), (x2, y2) in body.tracks(here))
    tyres = [svg.line(*ends, stroke=style.INK, stroke_width=style.TYRE) for ends in wheels]
    ours = style.robot_mark(body.radius, colour, None, outline, _front(body.radius, colour), *tyres)
    # Where the heading is unknown, as after a boot, a body drawn at an angle would be a guess.
    plain = style.robot_mark(body.radius, colour)
    yield Look(OURS, KalmanPositionResponse.__name__, colour, body.radius, ours, plain)
    ring = svg.circle(style.CENTRE, RAW, fill="none", stroke=colour, stroke_width=4, stroke_dasharray="10 8")
    raw = svg.group(ring, _front(RAW, colour, 4))
    yield Look("raw position", NaviPositionResponse.__name__, colour, RAW, raw, ring, trail=False)
    for whom, (name, dashes) in style.OTHERS.items():
        paint, radius = style.colour_of(name), diameter(facts, start, whom) / 2
        disc = style.robot_mark(radius, paint, dashes)
        heading = style.robot_mark(radius, paint, dashes, (), _front(radius, paint))
        yield Look(name, whom.__name__, paint, radius, heading, disc, dashes)


def _front(radius: float, colour: str, width: float = 12) -> str:
    return svg.line(style.CENTRE, (radius, 0), stroke=colour, stroke_width=width)


def diameter(facts: Facts, start: StartConfigurationSet | None, whom: type[PositionResponse]) -> float:
    """Return the diameter of another robot in mm: an enemy's from the start configuration, else what the facts say."""
    field = f"{style.OTHERS[whom][0].replace(' ', '_')}_diameter"
    return 10 * (getattr(start, field, None) or 0) or 2 * facts.others[SOURCES[whom]].radius


# What explains it


class Explained(NamedTuple):
    """A line of the legend: what a drawing means, which is not larger than 90 x 90 around its middle."""

    words: str
    drawing: str


def legend(facts: Facts) -> Iterator[Explained]:
    """Explain the marks, and what stands on the field."""
    yield Explained("place and angle of a goto", style.target_mark(0))
    yield Explained("goto, reached", style.goto_mark(1, Outcome.ARRIVED))
    yield Explained("goto, not reached", style.goto_mark(2, Outcome.STOPPED))
    yield Explained("stop", style.stop_mark("A"))
    for passage, (words, *_) in style.PASSAGES.items():
        yield Explained(words, style.ring_mark(26, passage))
    for kind in dict.fromkeys(each.kind for each in facts.barriers):
        yield Explained(kind.name, style.barrier_shape(kind, 28))
    if facts.field.trees.places:
        yield Explained("tree", svg.circle(style.CENTRE, 26, fill=style.TREE))
