"""The scene: the drawings on the field, each with its layer and the time during which it is visible.

A file shows the end of a match, and the page a moment: `field.js` paints the drawings, and moves the robots' as their
messages say.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import ceil, dist
from typing import NamedTuple

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Barrier, Facts, Field, Start, Worth
from eurobot_od.robot.model.values import OURS, Outcome, TeamColour
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import PathPoint, RecordedGoto, RecordedStop, Recording, TouchMark, at
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint
from eurobot_od.support.texts import amount

GRID_STEP = 500

MARGIN = 40
"""Distance from the border to the numbers of an axis, in mm; half of it is from a zone's edge to its name."""

NAMED = 100
"""Minimum radius of a barrier for its whole name, in mm; a smaller one has its number."""


def on_paper(field: Field, x: float, y: float) -> PaperPoint:
    """Return where a place on the field is drawn: y grows upwards on the field and downwards on paper."""
    # The document's origin is the field's lower left corner, SVG's the upper left one.
    return x, field.height - y


def ground(facts: Facts, team: TeamColour | None = None) -> str:
    """Return the drawing of the field, with the origin at the upper left corner, and the start of `team` marked."""
    field = facts.field
    trees = facts.field.trees
    return svg.group(
        svg.rectangle((0, 0), field.width, field.height, fill=style.SURFACE),
        *_grid(field),
        *(_start(field, colour, start, colour is team) for colour, start in field.starts.items()),
        *(svg.moved(on_paper(field, *each.point), _barrier(each)) for each in facts.barriers),
        svg.rectangle((0, 0), field.width, field.height, fill="none", stroke=style.INK, stroke_width=field.border),
        *(svg.circle(on_paper(field, *each), trees.radius, fill=style.TREE) for each in trees.places),
        *_tasks(facts, team),
    )


WORTH = {
    Worth.POINTS: ("{most}", "{tries} x {points} points"),
    Worth.FRUIT: ("{most}f", "{tries} x {points} pieces of fruit"),
    Worth.HARVEST: ("{most}/f", "{most} point for each piece of fruit"),
}
"""What the sign of a task says, and what its tooltip says, by what the task is worth."""


def _tasks(facts: Facts, team: TeamColour | None) -> Iterator[str]:
    """Yield the signs of a team's tasks, without a team those of both."""
    teams = [team] if team else [*facts.field.starts]
    for task in dict.fromkeys(each for one in teams for each in facts.tasks(one).values()):
        values = {"most": task.tries * task.points, **task._asdict()}
        sign, words = (each.format_map(values) for each in WORTH[task.worth])
        about = svg.title(f"{task.name}: {words}, each by {task.chance:.0%}; {task.seconds:g} s")
        place = on_paper(facts.field, task.at.x, task.at.y)
        yield svg.moved(place, svg.group(style.task_mark(sign, about), class_="sign task"))


def _grid(field: Field) -> Iterator[str]:
    """Yield the grid lines with their numbers."""
    for x in range(0, int(field.width) + 1, GRID_STEP):
        yield svg.line((x, 0), (x, field.height), stroke=style.GRID, stroke_width=3)
        yield _small((x, field.height + MARGIN), str(x), style.PALE, "middle", "hanging")
    for y in range(0, int(field.height) + 1, GRID_STEP):
        yield svg.line((0, y), (field.width, y), stroke=style.GRID, stroke_width=3)
        yield _small((-MARGIN, field.height - y), str(y), style.PALE, "end", "middle")


def _small(place: PaperPoint, words: str, fill: str, anchor: str, baseline: str) -> str:
    return style.label(place, words, fill, style.SMALL, anchor, dominant_baseline=baseline)


def _start(field: Field, colour: TeamColour, start: Start, is_ours: bool) -> str:
    """Return the drawing of a start zone."""
    left, lower, right, upper = start.zone
    paint = style.team_colour(colour)
    corner = on_paper(field, left, upper)
    opacity, width, dashes = (0.3, 10, None) if is_ours else (0.12, 4, "20 12")
    look = {"fill": paint, "fill_opacity": opacity, "stroke": paint, "stroke_width": width, "stroke_dasharray": dashes}
    # Aligned with the nearer border, so that larger letters stay on the field.
    x, anchor = (left + MARGIN / 2, "start") if left < field.width / 2 else (right - MARGIN / 2, "end")
    name = _small((x, corner[1] + MARGIN / 2), f"start {colour.name.lower()}", style.INK, anchor, "hanging")
    return svg.group(svg.rectangle(corner, right - left, upper - lower, **look), name)


def _barrier(barrier: Barrier) -> str:
    """Return the drawing of a barrier with its name."""
    radius = barrier.kind.radius
    # A small barrier has room for its number only.
    words = barrier.name if radius > NAMED else barrier.name.rpartition(" ")[2]
    # On a phone the letters are larger than the barrier, so they have an edge.
    look = {"font_weight": "bold", "stroke": svg.INK, "stroke_width": 7, "paint_order": "stroke"}
    name = svg.text((0, 13), words, fill=svg.PAPER, font_size=36, text_anchor="middle", **look)
    return svg.group(style.barrier_shape(barrier.kind, radius), name)


LAYERS = ("rings", "trails", "robots", "routes", "targets", "marks", "names")
"""From the ground up, so that marks are not hidden by paths."""

RINGS, TRAILS, ROBOTS, ROUTES, TARGETS, MARKS, ROBOT_NAMES = LAYERS


class Item(NamedTuple):
    """A drawing on the field, with its origin at the upper left corner, from `begin` to `end` in s; None: it stays."""

    layer: str
    drawing: str
    begin: float
    end: float | None = None

    def later(self, by: float) -> Item:
        """Return the same `by` s later."""
        return self._replace(begin=self.begin + by, end=None if self.end is None else self.end + by)


# Events

DISC, SIGN = 68, 78
"""Distance of a goto's disc below its place, and of a stop's sign above it, in mm."""

CLEAR = 120
"""Minimum distance from the border for a disc or a sign, in mm."""

UNDER = 460
"""Distance from the upper edge of a start zone within which a sign could cover the zone's name, in mm.

Both are drawn larger where the field is small: three times on a phone.
"""

SPACING = 2 * style.MARK + 8
"""Minimum distance of signs, in mm."""


class MatchScene:
    """Draws the events on a field; a mark keeps its place when it is drawn again."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self._field = facts.field
        self._signs: dict[tuple[str, object], PaperPoint] = {}

    def goto(self, goto: RecordedGoto, route: Iterable[Point] = ()) -> Iterator[Item]:
        """Yield the drawings of a goto: barriers and route while it is under way, its disc from then on."""
        asked, sent, ended = goto.message, goto.sent, goto.ended
        for barrier, passage in self._facts.flagged(asked.barriers):
            ring = style.ring_mark(barrier.kind.radius + style.RING, passage, svg.title(barrier.name))
            yield Item(RINGS, svg.moved(on_paper(self._field, *barrier.point), ring), sent, ended)
        if points := [on_paper(self._field, *each) for each in route]:
            yield Item(ROUTES, way_mark(points), sent, ended)
        place = on_paper(self._field, asked.x, asked.y)
        yield Item(TARGETS, svg.moved(place, style.target_mark(asked.angle)), sent, ended)
        # At the lower edge there is room only above the place.
        away = -DISC if place[1] > self._field.height - CLEAR else DISC
        disc = self._aside("goto", goto.number, place, away)
        words = f"{goto.words}, barriers {self._facts.words(asked.barriers)}, at {sent:.1f} s"
        running = style.goto_mark(goto.number, None, svg.title(f"{words}: under way"))
        yield _mark(place, svg.moved(disc, running), begin=sent, end=ended)
        if ended is not None:
            over = style.goto_mark(goto.number, goto.outcome, svg.title(f"{words}: {goto.ending}"))
            yield _mark(place, svg.moved(disc, over), begin=ended)

    def stop(self, stop: RecordedStop) -> Iterator[Item]:
        """Yield the drawing of a stop: a dot with its sign above; nothing if its place is unknown."""
        if stop.place is not None:
            place = on_paper(self._field, stop.place.x, stop.place.y)
            named = any(0 <= start.zone[-1] - stop.place.y < UNDER for start in self._field.starts.values())
            sign = self._aside("stop", stop.letter, place, SIGN if named or place[1] < CLEAR else -SIGN)
            yield _mark(
                place,
                svg.line(style.CENTRE, sign, stroke=style.STOP, stroke_width=5),
                svg.circle(style.CENTRE, 13, fill=style.STOP, stroke=style.PAPER, stroke_width=4),
                svg.moved(sign, style.stop_mark(stop.letter, svg.title(f"{stop.words}, at {stop.time:.1f} s"))),
                begin=stop.time,
            )

    def touch(self, touch: TouchMark) -> Item:
        """Return the drawing of a touch."""
        burst = style.touch_mark(touch.at_fault, svg.title(touch.words))
        return _mark(on_paper(self._field, *touch.place), burst, begin=touch.time)

    def _aside(self, kind: str, name: object, place: PaperPoint, away: float) -> PaperPoint:
        """Return a sign's offset from its place: `away` below it, and to the side if another sign is there."""
        if (kind, name) not in self._signs:
            row = [(place[0] + each, place[1] + away) for each in self._row(place[0])]
            free = (each for each in row if all(dist(each, other) > SPACING - 1 for other in self._signs.values()))
            self._signs[kind, name] = next(free, row[len(self._signs) % len(row)])
        x, y = self._signs[kind, name]
        return x - place[0], y - place[1]

    def _row(self, middle: float) -> list[float]:
        """Return the possible offsets of signs in a row, alternating to both sides; all are on the field."""
        first, last = SPACING - middle, self._field.width - SPACING - middle
        begin = min(max(0, first), last)
        steps = int(self._field.width / SPACING)
        row = [each for n in range(-steps, steps + 1) if first <= (each := begin + n * SPACING) <= last] or [begin]
        return sorted(row, key=lambda each: (abs(each - begin), each < begin))


def _mark(place: PaperPoint, *content: str, begin: float, end: float | None = None) -> Item:
    """Return a mark around its place, which is drawn larger where its text is."""
    return Item(MARKS, svg.moved(place, svg.group(*content, class_="sign")), begin, end)


def way_mark(points: Iterable[PaperPoint]) -> str:
    """Return the drawing of the route to a goto."""
    return svg.polyline(points, fill="none", stroke=style.GOTO, stroke_width=9, stroke_dasharray="26 18")


# Robots


class Look(NamedTuple):
    """The drawing of a robot around its centre, facing along x: `turned`, and `round` for an unknown heading.

    `message` has its position. `trail`: whether its path is drawn.
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
        """Return the robot at a place on paper, with its heading in degrees, counter-clockwise."""
        if angle is None:
            return svg.moved(place, self.round)
        turned = svg.group(self.turned, transform=f"rotate({svg.number(-angle)})")
        return svg.moved(place, turned)


RAW = 40
"""Radius of the ring for the raw position from the navigation, in mm."""


def looks(facts: Facts, start: messages.StartConfigurationSet | None) -> Iterator[Look]:
    """Yield the drawings of the robots in a match with this start configuration."""
    team = start.team_colour if start is not None and isinstance(start.team_colour, TeamColour) else None
    body = facts.body
    colour = style.team_colour(team)
    here = Pose(0, 0, 0)
    outline = [(x, -y) for x, y in body.corners(here)]
    wheels = (((x1, -y1), (x2, -y2)) for (x1, y1), (x2, y2) in body.tracks(here))
    tyres = [svg.line(*ends, stroke=style.INK, stroke_width=style.TYRE) for ends in wheels]
    ours = style.robot_mark(body.radius, colour, None, outline, _front(body.radius, colour), *tyres)
    # For an unknown heading, such as after a boot.
    plain = style.robot_mark(body.radius, colour)
    yield Look(OURS, messages.KalmanPositionResponse.__name__, colour, body.radius, ours, plain)
    ring = svg.circle(style.CENTRE, RAW, fill="none", stroke=colour, stroke_width=4, stroke_dasharray="10 8")
    raw = svg.group(ring, _front(RAW, colour, 4))
    yield Look("raw position", messages.NaviPositionResponse.__name__, colour, RAW, raw, ring, trail=False)
    for whom, (name, dashes) in style.OTHERS.items():
        paint = style.colour_of(name)
        radius = _radius(facts, start, whom)
        disc = style.robot_mark(radius, paint, dashes)
        heading = style.robot_mark(radius, paint, dashes, (), _front(radius, paint))
        yield Look(name, whom.__name__, paint, radius, heading, disc, dashes)


def _front(radius: float, colour: str, width: float = 12) -> str:
    return svg.line(style.CENTRE, (radius, 0), stroke=colour, stroke_width=width)


def _radius(facts: Facts, start: messages.StartConfigurationSet | None, whom: type[messages.PositionResponse]) -> float:
    """Return the radius of another robot in mm, by the start configuration, otherwise by the facts."""
    field = messages.DIAMETERS.get(messages.SOURCES[whom], "")
    return 5.0 * (getattr(start, field, None) or 0) or facts.others[messages.SOURCES[whom]].radius


# Legend


class Explained(NamedTuple):
    """A line of the legend: a drawing of at most 90 x 90 around its centre, and its meaning."""

    words: str
    drawing: str


def legend(facts: Facts) -> Iterator[Explained]:
    """Yield the marks of a match, and what stands on the field, with their meanings."""
    yield Explained("place and angle of a goto", style.target_mark(0))
    yield Explained("goto, reached", style.goto_mark(1, Outcome.ARRIVED))
    yield Explained("goto, not reached", style.goto_mark(2, Outcome.STOPPED))
    yield Explained("stop", style.stop_mark("A"))
    for passage, (words, *_) in style.PASSAGES.items():
        yield Explained(words, style.ring_mark(26, passage))
    yield from things(facts)


def things(facts: Facts) -> Iterator[Explained]:
    """Yield what stands on the field, with its meaning."""
    if facts.red_tasks:
        yield Explained("task: points at most, or f: fruit", style.task_mark("6"))
    for kind in dict.fromkeys(each.kind for each in facts.barriers):
        yield Explained(kind.name, style.barrier_shape(kind, 28))
    if facts.field.trees.places:
        yield Explained("tree", svg.circle(style.CENTRE, 26, fill=style.TREE))


ROW = 58
"""Height of a line of the legend."""


def column(recording: Recording, facts: Facts) -> str:
    """Return the drawing of a match's legend."""
    rows = enumerate((*_of_match(recording), *legend(facts)))
    return svg.group(*(svg.moved((0, ROW * row), _row_of(each)) for row, each in rows))


def _row_of(explained: Explained) -> str:
    words = style.label((125, 43), explained.words, anchor="start")
    return svg.group(svg.moved((45, 30), explained.drawing), words)


def _of_match(recording: Recording) -> Iterator[Explained]:
    pieces = ((step * 10 - 45, step / 8) for step in range(9))
    ramp = (svg.line((x, 0), (x + 11, 0), stroke=style.colour_at(share), stroke_width=15) for x, share in pieces)
    yield Explained("our path, darker is later", svg.group(*ramp))
    if recording.truth.path:
        yield Explained("our path, as it really was", _stroke(style.TRUTH, 6, None))
    for whom, (name, dashes) in style.OTHERS.items():
        if recording.paths.get(whom):
            yield Explained(f"{name}, seen last as a disc", _stroke(style.colour_of(name), 7, dashes))
    if recording.truth.touches:
        yield Explained("touch; filled: we drove into it", style.touch_mark(at_fault=True))


def _stroke(colour: str, width: float, dashes: str | None) -> str:
    return svg.line((-45, 0), (45, 0), stroke=colour, stroke_width=width, stroke_dasharray=dashes)


PAGE = (4200, 2460)
"""Width and height."""

FIELD, COLUMN = (190, 300), (3330, 300)
"""Upper left corners of field and legend."""

ROOM = (3000, 2000)
"""Width and height of the room for the field, to which another field is scaled."""

PATH_TICK, MOST_TICKS = 10, 60
"""Time between two marks on the path, in s, and maximum number of marks, as a log may have a wrong time."""


def sheet(recording: Recording, facts: Facts, title: str) -> str:
    """Return an SVG of a match."""
    width, height = PAGE
    drawing = field_drawing(recording, facts)
    scale = min(ROOM[0] / facts.field.width, ROOM[1] / facts.field.height)
    if scale != 1:  # another field
        drawing = svg.group(drawing, transform=f"scale({scale:.4f})")
    return svg.element(
        "svg",
        svg.rectangle((0, 0), width, height, fill=svg.PAPER),
        style.label((FIELD[0], 130), title, svg.INK, size=84, anchor="start", font_weight="bold"),
        style.label((FIELD[0], 215), ", ".join(_summary(recording)), fill=svg.PALE, size=46, anchor="start"),
        style.printed(svg.moved(FIELD, drawing, id="field")),
        style.printed(svg.moved(COLUMN, column(recording, facts))),
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
    """Return the drawing of the field with all events; one unit is one mm, the origin its upper left corner."""
    drawn: dict[str, list[str]] = {layer: [] for layer in LAYERS}
    for item in _in_the_end(recording, facts):
        drawn[item.layer].append(item.drawing)
    # Without repetitions, as gotos may share barriers and places.
    return svg.group(ground(facts, recording.team), *(svg.group(*dict.fromkeys(each)) for each in drawn.values()))


def _in_the_end(recording: Recording, facts: Facts) -> Iterator[Item]:
    """Yield the drawings at the end of a match, with all barriers and targets of gotos."""
    scene = MatchScene(facts)
    field = facts.field
    robots = {each.message: each for each in looks(facts, recording.configuration)}
    seen = [(robots[kind.__name__], path) for kind, path in recording.paths.items()]
    # The others first, so that our own path is on top.
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
    """Yield the path of another robot."""
    line = {"stroke": look.colour, "stroke_width": 5, "stroke_dasharray": look.dashes, "stroke_opacity": 0.55}
    yield svg.group(svg.title(look.name), svg.polyline(_points(field, path), fill="none", **line))


def _own_path(field: Field, path: list[PathPoint], end: float) -> Iterator[str]:
    """Yield our path in pieces, each in the colour of its time, on a light background."""
    # One background line for all pieces, so that their ends are invisible.
    if len(path) > 1:
        ground = {"stroke": style.PAPER, "stroke_width": 24, "stroke_linejoin": "round"}
        yield svg.polyline(_points(field, path), fill="none", **ground)
    for one, two in pairwise(path):
        colour = style.colour_at(two.time / end if end else 0.0)
        yield svg.line(*_points(field, (one, two)), stroke=colour, stroke_width=13, stroke_linecap="round")


def _ticks(field: Field, recording: Recording) -> Iterator[str]:
    """Yield marks on the path every PATH_TICK s, but not near the marks of gotos and stops."""
    taken = [on_paper(field, each.message.x, each.message.y) for each in recording.gotos]
    # Half way to the sign, to keep clear of the dot and the sign.
    taken += [on_paper(field, each.place.x, each.place.y + SIGN / 2) for each in recording.stops if each.place]
    step = PATH_TICK * max(ceil(recording.end / PATH_TICK / MOST_TICKS), 1)
    for time in range(step, int(recording.end) + 1, step):
        where = at(recording.path, time)
        centre = where and on_paper(field, where.x, where.y)
        if centre and all(dist(centre, other) > CLEAR for other in taken):
            # A standing robot has one mark only.
            taken.append(centre)
            yield svg.circle(centre, 15, fill=style.PAPER, stroke=style.colour_at(time / recording.end), stroke_width=7)
            yield style.halo((centre[0] + 28, centre[1] + 11), f"{time} s", anchor="start")
