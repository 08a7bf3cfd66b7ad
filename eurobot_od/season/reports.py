"""Ready questions to a season of any devices: the SQL for a table, and its chart.

A report is a row; it finds messages by the table `messages`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

NAMED = """
WITH named AS (
    SELECT f.run, f.line, f.t, f.channel, m.message, m.answers
    FROM frames f JOIN runs r ON f.run = r.run JOIN messages m ON m.eds = r.eds AND m.cob_id = f.cob_id
)"""
"""All frames of messages, with the message's name and the name of the message that it answers."""


class ChartKind(Enum):
    """The kind of a chart."""

    BARS = "bars"
    LINES = "lines"
    HISTOGRAM = "histogram"


class Chart(NamedTuple):
    """A chart: its kind, the query for it (None: the report's), and the labels of its axes.

    BARS need a text and a number per row, LINES a number along and one or more up, a HISTOGRAM one number.
    """

    kind: ChartKind
    along: str
    up: str
    sql: str | None = None


class SeasonReport(NamedTuple):
    """A question: in words, as SQL, and as a chart."""

    title: str
    sql: str
    chart: Chart


def spread(value: str, unit: str = "ms", factor: int = 1000) -> str:
    """Return the SQL columns for the distribution of a value, in a unit."""
    shares = {"median": 0.5, "p95": 0.95, "p99": 0.99}
    quantiles = (
        f"round(quantile_cont({value}, {share}) * {factor}, 3) AS {name}_{unit}" for name, share in shares.items()
    )
    ends = (
        f"round({name}({value}) * {factor}, 3) AS {said}_{unit}" for name, said in (("min", "least"), ("max", "most"))
    )
    return ", ".join((*ends, *quantiles))


PERIODS = f"""{NAMED}, gaps AS (
    SELECT message, t - lag(t) OVER (PARTITION BY run, channel, message ORDER BY line) AS gap FROM named
)
SELECT message, count(*) AS frames, {spread("gap")}, round(stddev_samp(gap) * 1000, 3) AS jitter_ms
FROM gaps GROUP BY message ORDER BY message"""

ANSWERS = f"""{NAMED}, asked AS (SELECT * FROM named WHERE message IN (SELECT answers FROM messages)),
answered AS (
    SELECT a.message AS answer, q.run, q.line, min(a.t - q.t) AS latency
    FROM named a ASOF JOIN asked q
        ON a.run = q.run AND a.channel = q.channel AND a.answers = q.message AND a.line >= q.line
    WHERE a.answers <> '' GROUP BY ALL
),
counted AS (SELECT message, count(*) AS requests FROM asked GROUP BY message)
SELECT m.answers AS request, answer, any_value(requests) AS requests, count(*) AS answered, {spread("latency")}
FROM answered JOIN (SELECT DISTINCT message, answers FROM messages) m ON m.message = answer
JOIN counted c ON c.message = m.answers GROUP BY ALL ORDER BY request"""

BITS = "(CAST(octet_length(data) AS BIGINT) * 8 + 47)"
STUFFED = "(CAST(octet_length(data) AS BIGINT) * 8 + 47 + (octet_length(data) * 8 + 33) // 4)"
"""Bits of a classic base frame with its intermission, without stuff bits and with the maximum number."""

SECONDS = f"""
WITH seconds AS (
    SELECT f.run, f.channel, floor(t - r.start) AS second, count(*) AS frames,
        sum({BITS}) / $bitrate AS load, sum({STUFFED}) / $bitrate AS stuffed
    FROM frames f JOIN runs r ON f.run = r.run GROUP BY ALL
)"""

LOAD = f"""{SECONDS}
SELECT log, channel, CAST(sum(s.frames) AS BIGINT) AS frames, round(any_value(r."end" - r.start), 1) AS seconds,
    round(sum(load) / (max(second) + 1) * 100, 2) AS "load_%",
    round(sum(stuffed) / (max(second) + 1) * 100, 2) AS "most_%",
    round(max(load) * 100, 2) AS "peak_%", CAST(arg_max(second, (load, -second)) AS BIGINT) AS peak_second
FROM seconds s JOIN runs r ON s.run = r.run GROUP BY log, channel ORDER BY log, channel"""

LOAD_OVER_TIME = f"""{SECONDS}
SELECT second, avg(load) * 100 AS "mean of the logs", max(load) * 100 AS "highest"
FROM seconds GROUP BY second ORDER BY second"""

DAMAGE = """
SELECT log, d.kind, count(*) AS number, arg_min(line, line) AS first_line, arg_min(text, line) AS first
FROM damage d JOIN runs r ON d.run = r.run GROUP BY log, d.kind ORDER BY number DESC, log, d.kind"""


def _bars(up: str, sql: str) -> Chart:
    return Chart(ChartKind.BARS, "", up, sql)


REPORTS: Mapping[str, SeasonReport] = {
    "periods": SeasonReport(
        "Periods of messages, and their jitter",
        PERIODS,
        _bars("jitter, ms", f"SELECT message, jitter_ms FROM ({PERIODS}) WHERE jitter_ms IS NOT NULL"),
    ),
    "answers": SeasonReport(
        "From a request to its answer", ANSWERS, _bars("95 % are faster, ms", f"SELECT answer, p95_ms FROM ({ANSWERS})")
    ),
    "load": SeasonReport(
        "Bus load without stuff bits, and at most with them",
        LOAD,
        Chart(ChartKind.LINES, "second of the log", "bus load, %", LOAD_OVER_TIME),
    ),
    "damage": SeasonReport(
        "What is damaged, by log",
        DAMAGE,
        _bars("number", f"SELECT log || ': ' || kind, number FROM ({DAMAGE}) LIMIT 40"),
    ),
}
"""Reports by name; `$bitrate` is in bit/s."""
