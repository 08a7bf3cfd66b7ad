"""The chart of response times: a bar for each message, up to its bound, and a mark at its deadline, on a log scale."""

from __future__ import annotations

from math import ceil, floor, log10

from eurobot_od.support import svg
from eurobot_od.traffic.load.report import NO_BOUND, BoundRow, LoadReport, ms, summary

LEFT, TOP, ROW, PLOT, RIGHT, BOTTOM = 320, 76, 20, 620, 84, 44
"""Margins, height of a row, width of the plot; one unit is a pixel of a screen."""

BAR = 12

LEGEND = "bar: worst-case response time; upright mark: deadline"


def decades(report: LoadReport) -> range:
    """Return the powers of ten of the microseconds that the chart reaches from and to, one line each."""
    times = [t for row in report.rows for t in (row.response, row.message.deadline) if t]
    low = floor(log10(min(times, default=1) / 2))  # so that the shortest bar can be seen
    return range(low, max(ceil(log10(max(times, default=1))), low + 1) + 1)


def chart(report: LoadReport, title: str) -> str:
    """Return the chart as an SVG document."""
    powers, bottom = decades(report), TOP + ROW * len(report.rows)
    scale = svg.Axis(powers[0], powers[-1], LEFT, LEFT + PLOT)
    return svg.document(
        title,
        svg.heading(title),
        svg.text((20, 50), summary(report), font_size=svg.TEXT, fill=svg.PALE),
        *svg.axis_across(((scale.at(power), f"{10**power / 1000:g} ms") for power in powers), TOP, bottom),
        svg.text((LEFT, bottom + 38), LEGEND, font_size=svg.TEXT, fill=svg.PALE),
        *(_row(row, scale, TOP + ROW * place) for place, row in enumerate(report.rows)),
        width=LEFT + PLOT + RIGHT,
        height=bottom + BOTTOM,
    )


def _row(row: BoundRow, scale: svg.Axis, y: int) -> str:
    message, colour = row.message, svg.BLUE if row.holds else svg.RED
    end = LEFT + PLOT if row.response is None else scale.at(log10(row.response))  # no bound: as far as there is room
    deadline, foot = scale.at(log10(message.deadline)), y + BAR
    words = f"{message.identifier:03X}  {message.name}"
    response = NO_BOUND if row.response is None else f"{ms(row.response)} ms"
    return svg.group(
        svg.title(f"{words}: response {response}, deadline {ms(message.deadline)} ms"),
        svg.text((LEFT - 10, foot - 1), words, font_size=svg.TEXT, fill=svg.INK, text_anchor="end"),
        svg.rectangle((LEFT, y), max(end - LEFT, 1.0), BAR, fill=colour),
        svg.line((deadline, y - 3), (deadline, y + BAR + 3), stroke=svg.INK, stroke_width=2),
        svg.text((LEFT + PLOT + 8, foot - 1), response, font_size=svg.TEXT, fill=colour),
    )
