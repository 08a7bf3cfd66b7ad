"""Results of the analysis for each message, in usual units: as a table, as plain data and as a chart."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from math import ceil, floor, log10
from typing import Any, NamedTuple

from eurobot_od.support import svg
from eurobot_od.support.texts import columns
from eurobot_od.traffic.load.analysis import MICROSECONDS, MessageSet, PeriodicMessage, analysed

NO_BOUND = "no bound"
MISSED = "MISSED"


class BoundRow(NamedTuple):
    """A message and what is proved of it, times in us: `response` is None without a bound.

    `blocking` names the less urgent message that can hold the bus, `inversion` the one of its own node that can keep it
    out of the mailboxes; empty if there is none.
    """

    message: PeriodicMessage
    response: int | None
    blocking: str
    inversion: str

    @property
    def margin(self) -> int | None:
        """What is left of the deadline, us; negative if it can be missed, None without a bound."""
        return None if self.response is None else self.message.deadline - self.response

    @property
    def holds(self) -> bool:
        """Whether the deadline is always met."""
        return self.margin is not None and self.margin >= 0


class LoadReport(NamedTuple):
    """A set at a bit rate, bit/s: share `load` of the bus, longest `busy` period in us, None if it has no end."""

    bit_rate: int
    load: Fraction
    busy: int | None
    rows: tuple[BoundRow, ...]

    @property
    def holds(self) -> bool:
        """Whether all deadlines are always met."""
        return all(row.holds for row in self.rows)


def load_report(messages: MessageSet, bit_rate: int) -> LoadReport:
    """Analyse a set at a bit rate in bit/s."""
    analysis = analysed(messages, bit_rate)

    def name(place: int | None) -> str:
        return "" if place is None else messages.messages[place].name

    def microseconds(bits: int | None) -> int | None:
        # Rounded up: a bound must not get shorter on its way.
        return None if bits is None else -(-bits * MICROSECONDS // bit_rate)

    rows = tuple(
        BoundRow(message, microseconds(bound.response), name(bound.blocking), name(bound.inversion))
        for message, bound in zip(messages.messages, analysis.bounds)
    )
    periods = [bound.busy for bound in analysis.bounds]
    longest = None if None in periods else max((each for each in periods if each is not None), default=0)
    return LoadReport(bit_rate, analysis.load, microseconds(longest), rows)


# As text

HEADINGS = ("ID", "message", "from", "period", "response", "deadline", "margin", "held up by")


def table(report: LoadReport) -> Iterator[str]:
    """Write a line for each message, times in ms, and what is to be said about all of them."""
    lines: list[tuple[str, ...]] = [HEADINGS]
    for row in report.rows:
        message, left = row.message, row.margin
        lines.append(
            (
                f"{message.identifier:03X}",
                message.name,
                message.node,
                ms(message.period),
                NO_BOUND if row.response is None else ms(row.response),
                ms(message.deadline),
                MISSED if left is None else f"{MISSED} {ms(left)}" if left < 0 else ms(left),
                held_up_by(row),
            )
        )
    yield from columns(lines, "lllrrrr")
    yield ""
    yield summary(report)


def summary(report: LoadReport) -> str:
    """Say in one line how full the bus is, and whether all deadlines are met."""
    missed = sum(not row.holds for row in report.rows)
    verdict = f"{missed} of {len(report.rows)} deadlines can be missed" if missed else "all deadlines are met"
    busy = "without end" if report.busy is None else f"at most {ms(report.busy)} ms at a stretch"
    return f"{report.bit_rate / 1000:g} kbit/s, load {float(report.load):.1%}, busy {busy}: {verdict}"


def too_slow(messages: MessageSet) -> Iterator[str]:
    """Say of each bit rate that the EDS files offer, and at which deadlines can be missed, what is missed."""
    for report in (load_report(messages, each) for each in messages.offered):
        if not report.holds:
            yield f"the EDS files offer a bit rate that is too slow: {summary(report)}"


def held_up_by(row: BoundRow) -> str:
    """Say which less urgent frames a message may have to wait for."""
    parts = [row.blocking] if row.blocking else []
    parts += [f"{row.inversion} in the mailboxes"] if row.inversion else []
    return ", ".join(parts)


def ms(microseconds: int) -> str:
    """Write microseconds as milliseconds."""
    return f"{microseconds / 1000:.2f}"


# As data


def as_data(report: LoadReport) -> dict[str, Any]:
    """Return all of it as plain data; times in us."""
    return {
        "bit_rate": report.bit_rate,
        "load": round(float(report.load), 6),
        "busy_us": report.busy,
        "deadlines_met": report.holds,
        "messages": [
            {
                "name": row.message.name,
                "identifier": row.message.identifier,
                "node": row.message.node,
                "length": row.message.length,
                "bits": row.message.bits,
                "period_us": row.message.period,
                "jitter_us": row.message.jitter,
                "answers": row.message.answers or None,
                "deadline_us": row.message.deadline,
                "response_us": row.response,
                "margin_us": row.margin,
                "blocking": row.blocking or None,
                "inversion": row.inversion or None,
                "reason": row.message.reason,
            }
            for row in report.rows
        ],
    }


# As a chart: a bar for each message, up to its bound, and a mark at its deadline, on a log scale

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
