"""The chart of response times: a bar for each message, up to its bound, and a mark at its deadline, on a log scale."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, floor, log10

from eurobot_od.load.report import NO_BOUND, BoundRow, LoadReport, ms, summary
from eurobot_od.support import svg

FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
TEXT, TITLE = 13, 17
INK, PALE, GRID, PAPER = "#22262b", "#6b7178", "#e6e3d8", "#ffffff"
MET, MISSED, DEADLINE = "#2f8fd0", "#c62828", "#22262b"

LEFT, TOP, ROW, PLOT, RIGHT, BOTTOM = 320, 76, 20, 620, 84, 44
"""Margins, height of a row, width of the plot; one unit is a pixel of a screen."""

BAR = 12


class Scale:
    """From us to a place on the paper, a decade as wide as any other."""

    def __init__(self, report: LoadReport) -> None:
        times = [t for row in report.rows for t in (row.response, row.message.deadline) if t]
        self.low = floor(log10(min(times, default=1) / 2))  # so that the shortest bar is one
        self.high = max(ceil(log10(max(times, default=1))), self.low + 1)

    def x(self, time: int) -> float:
        """Return where a time is; 0 is at the left end."""
        share = (log10(max(time, 1)) - self.low) / (self.high - self.low)
        return LEFT + PLOT * min(max(share, 0.0), 1.0)

    @property
    def decades(self) -> Iterator[int]:
        """The times that get a line."""
        return (10**power for power in range(self.low, self.high + 1))


def chart(report: LoadReport, title: str) -> str:
    """Return the chart as an SVG document."""
    scale, bottom = Scale(report), TOP + ROW * len(report.rows)
    width, height = LEFT + PLOT + RIGHT, bottom + BOTTOM
    return svg.element(
        "svg",
        svg.title(title),
        svg.rectangle((0, 0), width, height, fill=PAPER),
        svg.text((20, 28), title, font_size=TITLE, font_weight="bold", fill=INK),
        svg.text((20, 50), summary(report), font_size=TEXT, fill=PALE),
        *_axis(scale, bottom),
        *(_row(row, scale, TOP + ROW * place) for place, row in enumerate(report.rows)),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width} {height}",
        width=width,
        height=height,
        font_family=FONT,
    )


def _axis(scale: Scale, bottom: int) -> Iterator[str]:
    for time in scale.decades:
        x = scale.x(time)
        yield svg.line((x, TOP - 6), (x, bottom + 4), stroke=GRID, stroke_width=1)
        yield svg.text((x, bottom + 20), f"{time / 1000:g} ms", font_size=TEXT, fill=PALE, text_anchor="middle")
    words = "bar: worst-case response time; upright mark: deadline"
    yield svg.text((LEFT, bottom + 38), words, font_size=TEXT, fill=PALE)


def _row(row: BoundRow, scale: Scale, y: int) -> str:
    message, colour = row.message, MET if row.holds else MISSED
    end = LEFT + PLOT if row.response is None else scale.x(row.response)
    deadline, foot = scale.x(message.deadline), y + BAR
    words = f"{message.identifier:03X}  {message.name}"
    response = NO_BOUND if row.response is None else f"{ms(row.response)} ms"
    return svg.group(
        svg.title(f"{words}: response {response}, deadline {ms(message.deadline)} ms"),
        svg.text((LEFT - 10, foot - 1), words, font_size=TEXT, fill=INK, text_anchor="end"),
        svg.rectangle((LEFT, y), max(end - LEFT, 1.0), BAR, fill=colour),
        svg.line((deadline, y - 3), (deadline, y + BAR + 3), stroke=DEADLINE, stroke_width=2),
        svg.text((LEFT + PLOT + 8, foot - 1), response, font_size=TEXT, fill=colour),
    )
