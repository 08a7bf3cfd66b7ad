"""The drawing of a match on one page in landscape: the field with everything that moved on it, and what explains it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from math import ceil, dist
from typing import NamedTuple

from eurobot_od.robot.model.robot_file import Facts, Field
from eurobot_od.robot.model.values import OURS, Outcome
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import PathPoint, RecordedGoto, RecordedStop, Recording, ScoredTask, at
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
    ground,
    legend,
    looks,
    on_paper,
)
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint
from eurobot_od.support.texts import amount

ROW, LEGEND_ROW = 45, 58
WIDTH = 3000
"""Width of the time line."""

HEIGHT = 2640
"""From the legend's first line to the foot of the page."""

HEADS = 6
"""Rows taken up by headings, gaps, and the lines that say what is left out."""

TIME_TICK, MOST_TICKS = 10, 60
"""Seconds between two marks, and the most of them: one far-off time in a log must not make it draw for ever."""


def column(recording: Recording, facts: Facts) -> str:
    """Draw legend and tables, one below the other."""
    legend = list(_legend(recording, facts))
    below = LEGEND_ROW * len(legend) + 90
    rows = (HEIGHT - below) // ROW - HEADS
    # Stops get a third of the rows in any case, and whatever the gotos leave free.
    stops = min(len(recording.stops), max(rows // 3, rows - len(recording.gotos)))
    gotos = min(len(recording.gotos), rows - stops)
    return svg.group(
        *(svg.moved((0, LEGEND_ROW * row), each) for row, each in enumerate(legend)),
        svg.moved((0, below), _table("Gotos", GOTO_COLUMNS, recording.gotos, gotos)),
        svg.moved((0, below + ROW * (gotos + 4)), _table("Stops", STOP_COLUMNS, recording.stops, stops)),
    )


def ticks(tick: int, end: float) -> range:
    """Return the times up to the end that are marked: every `tick` seconds, more seldom where that were too many."""
    step = tick * max(ceil(end / tick / MOST_TICKS), 1)
    return range(step, int(end) + 1, step)


# Legend


def _legend(recording: Recording, facts: Facts) -> Iterator[str]:
    pieces = ((step * 10 - 45, step / 8) for step in range(9))
    ramp = (svg.line((x, 0), (x + 11, 0), stroke=style.colour_at(share), stroke_width=15) for x, share in pieces)
    yield _explained("our path, darker is later", *ramp)
    if recording.truth.path:
        yield _explained("our path, as it really was", _stroke(style.TRUTH, 6, None))
    for whom, (name, dashes) in style.OTHERS.items():
        if recording.paths.get(whom):
            yield _explained(f"{name}, seen last as a disc", _stroke(style.colour_of(name), 7, dashes))
    if recording.truth.touches:
        yield _explained("touch; filled: we drove into it", style.touch_mark(at_fault=True))
    yield from (_explained(*each) for each in legend(facts))


def _explained(words: str, *sample: str) -> str:
    return svg.group(svg.moved((45, 30), *sample), style.label((125, 43), words, anchor="start"))


def _stroke(colour: str, width: float, dashes: str | None) -> str:
    return svg.line((-45, 0), (45, 0), stroke=colour, stroke_width=width, stroke_dasharray=dashes)


# Tables


class TableColumn(NamedTuple):
    """A column: where it stands, how it is aligned, its heading, and what it says about a row."""

    x: int
    anchor: str
    heading: str
    words: Callable[..., str]

    def cell(self, row: int, words: str, fill: str) -> str:
        """Write words into a row, counted from the table's heading."""
        return style.label((self.x, row * ROW), words, fill=fill, size=style.SMALL, anchor=self.anchor)


GOTO_COLUMNS = (
    TableColumn(45, "end", "no", lambda goto: str(goto.number)),
    TableColumn(160, "end", "at s", lambda goto: f"{goto.sent:.1f}"),
    TableColumn(365, "end", "to mm", lambda goto: f"{goto.message.x}, {goto.message.y}"),
    TableColumn(455, "end", "deg", lambda goto: str(goto.message.angle)),
    TableColumn(540, "end", "%", lambda goto: str(goto.message.speed)),
    TableColumn(
        565,
        "start",
        "",
        lambda goto: goto.ending if goto.ended is None else f"{goto.ending} {goto.ended - goto.sent:.1f} s",
    ),
)
STOP_COLUMNS = (
    TableColumn(45, "end", "", lambda stop: stop.letter),
    TableColumn(160, "end", "at s", lambda stop: f"{stop.time:.1f}"),
    TableColumn(195, "start", "", lambda stop: f"{stop.name}: {stop.reason}"),
)


def _table(heading: str, columns: Sequence[TableColumn], rows: Sequence[object], shown: int) -> str:
    """Draw the first `shown` rows; if there are more, the line below says how many."""
    lines = [svg.text((0, 0), heading, font_size=style.TEXT, font_weight="bold", fill=style.INK)]
    lines += [column.cell(1, column.heading, style.PALE) for column in columns]
    for row, each in enumerate(rows[:shown], 2):
        lines += [column.cell(row, column.words(each), style.INK) for column in columns]
    if len(rows) > shown:
        more, place = f"and {len(rows) - shown} more", (195, (shown + 2) * ROW)
        lines.append(style.label(place, more, fill=style.PALE, anchor="start"))
    return svg.group(*lines)


# Time line

TIME_Y, GOTO_Y, STOP_Y, SCORE_Y = 0, 70, 160, 250
BAR, GOTO_BAR, SCORE_BAR = 30, 55, 130
SIGN_WIDTH = 2 * style.MARK + 12
NARROW = 48
"""A bar up to this wide has its number above it."""


def timeline(recording: Recording) -> str:
    """Draw the time from left to right: the path's colours, the gotos as bars, the stops."""
    # A log of one frame has no length, and everything on the line is divided by it.
    end, (_, touches, scores, _) = max(recording.end, 1.0), recording.truth
    x = svg.Axis(0, end, 0, WIDTH).at
    ours = "; line: our points" if scores else ""
    other = ", dashed: the other robot's" if any(each.robot != OURS for each in scores) else ""
    caption = f"time in s; bars: gotos, green if reached{ours}{other}"
    return svg.group(
        *_seconds(end, x),
        *_bars(recording.gotos, x, end),
        *(svg.moved(where, style.stop_mark(letter)) for where, letter in _signs(recording.stops, x)),
        *(svg.moved((x(each.time), TIME_Y + BAR / 2), style.touch_mark(each.at_fault)) for each in touches),
        *_point_texts(recording, x),
        style.label((WIDTH, CAPTION_Y), caption, fill=style.PALE, size=style.SMALL, anchor="end"),
    )


def _seconds(end: float, x: Callable[[float], float]) -> Iterator[str]:
    pieces = 90
    for piece in range(pieces):
        start = WIDTH * piece / pieces
        # One unit wider: renderers show a light line between two that only touch.
        yield svg.rectangle((start, TIME_Y), WIDTH / pieces + 1, BAR, fill=style.colour_at(piece / pieces))
    for time in (0, *ticks(TIME_TICK, end)):
        yield svg.line((x(time), TIME_Y), (x(time), SCORE_Y + SCORE_BAR), stroke=style.GRID, stroke_width=3)
        yield style.label((x(time), TIME_Y - 14), str(time), fill=style.PALE, size=style.SMALL)


def _signs(stops: Sequence[RecordedStop], x: Callable[[float], float]) -> Iterator[tuple[PaperPoint, str]]:
    """Yield places and letters of the stops' signs, side by side where two would overlap.

    One that would come to stand far from its time is left out; the table has it.
    """
    free = 0.0
    for stop in stops:
        left = max(x(stop.time), free)
        if left - x(stop.time) <= SIGN_WIDTH:
            free = left + SIGN_WIDTH
            yield (left, STOP_Y + 38), stop.letter


def _bars(gotos: Sequence[RecordedGoto], x: Callable[[float], float], end: float) -> Iterator[str]:
    """Draw each goto as a bar with its number inside, or above a narrow one if there is room beside the one before."""
    free = 0.0
    for goto in gotos:
        left, right = x(goto.sent), x(end if goto.ended is None else goto.ended)
        # Four units narrower, so that two gotos in a row are two bars; and never so narrow that one cannot be seen.
        width, colour = max(right - left - 4, 6), style.OUTCOMES[goto.outcome]
        outline = {"fill": colour, "fill_opacity": 0.25, "stroke": colour, "stroke_width": 5}
        yield svg.rectangle((left, GOTO_Y), width, GOTO_BAR, **outline)
        middle = left + width / 2
        if width > NARROW:
            yield style.label((middle, GOTO_Y + 40), str(goto.number), size=36, font_weight="bold")
        elif middle >= free:
            free = middle + NARROW
            yield style.label((middle, GOTO_Y - 9), str(goto.number), size=28, font_weight="bold")


# Points

NAME_ROWS = (SCORE_Y + SCORE_BAR + 38, SCORE_Y + SCORE_BAR + 74)
"""Where the names of tasks stand, below each other."""

CAPTION_Y = NAME_ROWS[-1] + 40

CHARACTER = 17
"""About the width of a character of a small text."""


def _point_texts(recording: Recording, x: Callable[[float], float]) -> Iterator[str]:
    """Draw the points of each robot as steps over the time, and name the tasks that brought ours."""
    scores, ours = recording.truth.scores, style.team_colour(recording.team)
    # The scale is that of the robot with the most points, so it is known only after all of them are added up.
    totals: Counter[str] = Counter()
    for each in scores:
        totals[each.robot] += each.points
    last = float(SCORE_Y - ROW)
    for robot, total in totals.most_common():
        own = [each for each in scores if each.robot == robot]
        steps, points = [(0.0, 0)], 0
        for each in own:
            # Two corners at each time: points come at once, and the line goes straight up.
            steps += [(x(each.time), points), (x(each.time), points + each.points)]
            points += each.points
        steps.append((WIDTH, points))
        line = [(place, SCORE_Y + SCORE_BAR * (1 - height / max(totals.values()))) for place, height in steps]
        colour, dashes = (ours, None) if robot == OURS else (style.colour_of(robot), "18 12")
        last = max(line[-1][1], last + ROW)  # two that are nearly equal are written below each other
        yield svg.polyline(line, fill="none", stroke=colour, stroke_width=7, stroke_dasharray=dashes)
        yield style.label((WIDTH + 12, last + 11), str(total), fill=colour, anchor="start")
    yield from _names([each for each in scores if each.robot == OURS], x)


def _names(scores: Sequence[ScoredTask], x: Callable[[float], float]) -> Iterator[str]:
    """Write what brought points below its time, in the first row that has room; one without room is left out."""
    free = dict.fromkeys(NAME_ROWS, 0.0)
    for each in scores:
        words = f"{each.task} +{each.points}"
        left = max(x(each.time) - len(words) * CHARACTER, 0)
        row = next((row for row, begin in free.items() if begin <= left), None)
        if row is not None:
            free[row] = x(each.time) + CHARACTER
            yield svg.line((x(each.time), SCORE_Y + SCORE_BAR), (x(each.time), row), stroke=style.PALE, stroke_width=3)
            yield style.label((x(each.time) - 6, row), words, size=style.SMALL, anchor="end")


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
