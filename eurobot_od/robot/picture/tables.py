"""What stands next to the field: legend, tables of gotos and stops, and the time line below.

Rule of this file: what does not fit is said to be left out, never drawn over the edge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from eurobot_od import svg
from eurobot_od.robot.field import WIDTH, BarrierKind
from eurobot_od.robot.picture import style
from eurobot_od.robot.picture.ground import barrier_shape, passage_ring
from eurobot_od.robot.picture.recording import RecordedGoto, RecordedStop, Recording
from eurobot_od.robot.values import Outcome, Passage
from eurobot_od.svg import PaperPoint

ROW, LEGEND_ROW = 45, 64
ROWS = 34
"""How many rows the two tables have room for."""

TIME_TICK = 10
"""Seconds between two marks on the time line."""


def column(recording: Recording) -> str:
    """Draw legend and tables, one below the other."""
    legend = list(_legend(recording))
    below = LEGEND_ROW * len(legend) + 90
    stops = min(len(recording.stops), max(ROWS // 3, ROWS - len(recording.gotos)))
    gotos = min(len(recording.gotos), ROWS - stops)
    return svg.group(
        *(svg.moved((0, LEGEND_ROW * row), each) for row, each in enumerate(legend)),
        svg.moved((0, below), _table("Gotos", GOTO_COLUMNS, recording.gotos, gotos)),
        svg.moved((0, below + ROW * (gotos + 4)), _table("Stops", STOP_COLUMNS, recording.stops, stops)),
    )


# Legend

SAMPLE = (45.0, 30.0)
"""Middle of the sample next to a line of the legend."""


def _legend(recording: Recording) -> Iterator[str]:
    pieces = ((step * 10, step / 8) for step in range(9))
    ramp = (svg.line((x, 30), (x + 11, 30), stroke=style.colour_at(share), stroke_width=15) for x, share in pieces)
    yield _explained("our path, darker is later", *ramp)
    if recording.truth:
        yield _explained("our path, as it really was", _stroke(style.TRUTH, 6, None))
    yield _explained("place and angle of gotos", style.target_mark(SAMPLE, [0]))
    yield _explained("goto, reached", style.goto_mark(SAMPLE, 1, Outcome.ARRIVED))
    yield _explained("goto, not reached", style.goto_mark(SAMPLE, 2, Outcome.STOPPED))
    yield _explained("stop", style.stop_mark(SAMPLE, "A"))
    for whom, (name, colour, dashes) in style.OTHERS.items():
        if recording.paths.get(whom):
            yield _explained(f"{name}, seen last as a disc", _stroke(colour, 7, dashes))
    yield _explained("fire", barrier_shape(BarrierKind.FIRE, SAMPLE, 30))
    yield _explained("fire pool", barrier_shape(BarrierKind.POOL, SAMPLE, 26))
    for passage in sorted(set(recording.passages.values())):
        yield _explained(f"{style.PASSAGES[passage][0]}, in some goto", passage_ring(SAMPLE, 22, Passage(passage)))


def _explained(words: str, *sample: str) -> str:
    return svg.group(*sample, style.label((125, 43), words, anchor="start"))


def _stroke(colour: str, width: float, dashes: str | None) -> str:
    return svg.line((0, 30), (90, 30), stroke=colour, stroke_width=width, stroke_dasharray=dashes)


# Tables


class TableColumn(NamedTuple):
    """A column: where it stands, how it is aligned, its heading, and what it says of a row."""

    x: int
    anchor: str
    heading: str
    words: Callable[..., str]

    def cell(self, row: int, words: str, fill: str) -> str:
        """Write words into a row, counted from the table's heading."""
        return style.label((self.x, row * ROW), words, fill=fill, size=style.SMALL, anchor=self.anchor)


def _ended(goto: RecordedGoto) -> str:
    return goto.ending if goto.ended is None else f"{goto.ending} {goto.ended - goto.sent:.1f} s"


GOTO_COLUMNS = (
    TableColumn(45, "end", "no", lambda goto: str(goto.number)),
    TableColumn(160, "end", "at s", lambda goto: f"{goto.sent:.1f}"),
    TableColumn(365, "end", "to mm", lambda goto: f"{goto.message.x}, {goto.message.y}"),
    TableColumn(455, "end", "deg", lambda goto: str(goto.message.angle)),
    TableColumn(540, "end", "%", lambda goto: str(goto.message.speed)),
    TableColumn(565, "start", "", _ended),
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

TIME_Y, GOTO_Y, STOP_Y = 0, 80, 200
BAR, GOTO_BAR = 30, 70
SIGN_WIDTH = 2 * style.MARK + 12
NARROW = 48
"""A bar up to this wide has its number above it."""


def timeline(recording: Recording) -> str:
    """Draw the time from left to right: the path's colours, the gotos as bars, the stops."""
    end = max(recording.end, 1.0)

    def x(time: float) -> float:
        return WIDTH * time / end

    return svg.group(
        *_seconds(end, x),
        *(_bar(goto, x, end) for goto in recording.gotos),
        *(style.stop_mark(where, letter) for where, letter in _signs(recording.stops, x)),
        style.label((WIDTH, STOP_Y + 150), "time in s; bars: gotos, green if reached", fill=style.PALE, anchor="end"),
    )


def _seconds(end: float, x: Callable[[float], float]) -> Iterator[str]:
    pieces = 90
    for piece in range(pieces):
        start = WIDTH * piece / pieces
        yield svg.rectangle((start, TIME_Y), WIDTH / pieces + 1, BAR, fill=style.colour_at(piece / pieces))
    for time in (0, *style.ticks(TIME_TICK, end)):
        yield svg.line((x(time), TIME_Y), (x(time), STOP_Y + 85), stroke=style.GRID, stroke_width=3)
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
            yield (left, STOP_Y + 40), stop.letter


def _bar(goto: RecordedGoto, x: Callable[[float], float], end: float) -> str:
    left, right = x(goto.sent), x(end if goto.ended is None else goto.ended)
    width = max(right - left - 4, 6)
    colour = style.OUTCOMES[goto.outcome]
    bar = svg.rectangle((left, GOTO_Y), width, GOTO_BAR, fill=colour, fill_opacity=0.25, stroke=colour, stroke_width=5)
    inside = width > NARROW
    middle: PaperPoint = (left + width / 2, GOTO_Y + (46 if inside else -9))
    return svg.group(bar, style.label(middle, str(goto.number), size=36 if inside else 28, font_weight="bold"))
