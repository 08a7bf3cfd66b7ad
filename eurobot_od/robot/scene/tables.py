"""What stands next to the field: legend, tables of gotos and stops, and the time line below.

What does not fit is left out, and the sheet says so; nothing is drawn over the edge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from math import ceil
from typing import NamedTuple

from eurobot_od.robot.model.facts import Facts
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import OURS, RecordedGoto, RecordedStop, Recording, ScoredTask
from eurobot_od.robot.scene.scene import legend
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint

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
    end, (_, touches, scores) = max(recording.end, 1.0), recording.truth
    x = svg.Axis(0, end, 0, WIDTH).at
    ours = "; line: our points" if scores else ""
    other = ", dashed: the other robot's" if any(each.robot != OURS for each in scores) else ""
    caption = f"time in s; bars: gotos, green if reached{ours}{other}"
    return svg.group(
        *_seconds(end, x),
        *_bars(recording.gotos, x, end),
        *(svg.moved(where, style.stop_mark(letter)) for where, letter in _signs(recording.stops, x)),
        *(svg.moved((x(each.time), TIME_Y + BAR / 2), style.touch_mark(each.at_fault)) for each in touches),
        *_points(recording, x),
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


def _points(recording: Recording, x: Callable[[float], float]) -> Iterator[str]:
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
