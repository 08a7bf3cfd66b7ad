"""The report of an analysis, and its chart."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest

from eurobot_od.traffic.load import LoadReport, MessageSet, PeriodicMessage, as_data, chart, decades, load_report, table

RATE = 100_000
"""bit/s: 10 us for a bit."""

QUICK = PeriodicMessage.of("Quick", 0x010, 0, "a")._replace(period=10_000, deadline=1_200, jitter=100)
LONG = PeriodicMessage.of("Long", 0x700, 8, "b").every(20_000)
SET = MessageSet((QUICK, LONG))


@pytest.fixture
def report() -> LoadReport:
    return load_report(SET, RATE)


def test_times_are_microseconds(report: LoadReport) -> None:
    quick, long = report.rows
    assert (quick.response, quick.margin, quick.blocking) == (2_000, -800, "Long")  # 100 us, 135 bits, 55 bits
    assert (long.response, long.margin, long.blocking) == (1_900, 18_100, "")
    assert report.busy == 1_900
    assert float(report.load) == pytest.approx(0.1225)
    assert (quick.holds, long.holds, report.holds) == (False, True, False)


@pytest.mark.parametrize(("deadline", "holds"), [(1_900, True), (1_899, False)])
def test_a_deadline_holds_to_the_microsecond(deadline: int, holds: bool) -> None:
    assert (
        load_report(MessageSet((QUICK._replace(deadline=5_000), LONG._replace(deadline=deadline))), RATE).holds is holds
    )


def test_table(report: LoadReport) -> None:
    heading, quick, long, _, summary = table(report)
    assert heading.split() == ["ID", "message", "from", "period", "response", "deadline", "margin", "held", "up", "by"]
    assert quick.split() == ["010", "Quick", "a", "10.00", "2.00", "1.20", "MISSED", "-0.80", "Long"]
    assert long.split() == ["700", "Long", "b", "20.00", "1.90", "20.00", "18.10"]
    assert summary == "100 kbit/s, load 12.2%, busy at most 1.90 ms at a stretch: 1 of 2 deadlines can be missed"


def test_an_overload_is_told() -> None:
    report = load_report(SET, 5_000)
    lines = list(table(report))
    assert (report.busy, report.holds) == (None, False)
    assert "no bound" in lines[2]
    assert "load 245.0%, busy without end" in lines[-1]


def test_mailboxes_are_told() -> None:
    others = tuple(PeriodicMessage.of(f"Other {n}", n, 8, "a").every(100_000) for n in (0x20, 0x21))
    line = list(table(load_report(MessageSet((QUICK, *others), {"a": 2}), RATE)))[1]
    assert line.endswith("Other 32, Other 32 in the mailboxes")


def test_data_goes_through_json(report: LoadReport) -> None:
    data = json.loads(json.dumps(as_data(report)))
    assert (data["bit_rate"], data["deadlines_met"], data["busy_us"]) == (RATE, False, 1_900)
    assert [each["response_us"] for each in data["messages"]] == [2_000, 1_900]


@pytest.mark.parametrize("rate", [RATE, 5_000, 1_000_000])
def test_the_chart_has_every_message(rate: int) -> None:
    root = ElementTree.fromstring(chart(load_report(SET, rate), "A <bus>"))
    texts = [each.text for each in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts[0] == "A <bus>"
    assert {"010  Quick", "700  Long"} <= set(texts)


def test_the_chart_of_nothing_is_one() -> None:
    ElementTree.fromstring(chart(load_report(MessageSet(()), RATE), "nothing"))


@pytest.mark.parametrize(
    ("rate", "deadline", "lines"),
    [
        (500_000, 1_000, [100, 1_000]),  # the frame takes 270 us
        (500_000, 1_001, [100, 1_000, 10_000]),
        (1_000_000, 1_000, [10, 100, 1_000]),  # 135 us: at 100 its bar would be too short
        (1_000_000, 100, [10, 100, 1_000]),
        (1_000_000, 300_000, [10, 100, 1_000, 10_000, 100_000, 1_000_000]),
    ],
)
def test_decades_are_as_many_as_the_times_need(rate: int, deadline: int, lines: list[int]) -> None:
    message = LONG._replace(period=500_000, deadline=deadline)
    assert [10**power for power in decades(load_report(MessageSet((message,)), rate))] == lines
