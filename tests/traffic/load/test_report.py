"""The report of an analysis, its chart, and the search for the limits."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest

from eurobot_od.traffic.load.chart import chart
from eurobot_od.traffic.load.message_set import MessageSet, PeriodicMessage
from eurobot_od.traffic.load.report import LoadReport, as_data, load_report, table
from eurobot_od.traffic.load.sweep import limits, sentences, with_messages, with_nodes

RATE = 100_000
"""bit/s: 10 us for a bit."""

QUICK = PeriodicMessage("Quick", 0x010, 0, 10_000, 1_200, "a", jitter=100)
LONG = PeriodicMessage("Long", 0x700, 8, 20_000, 20_000, "b")
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
    others = tuple(PeriodicMessage(f"Other {n}", n, 8, 100_000, 100_000, "a") for n in (0x20, 0x21))
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


# Limits


def test_the_slowest_bus_and_the_most_traffic() -> None:
    found = limits(SET, 500_000)
    assert found.slowest == 174  # 190 bits in 1200 - 100 us, all rounded to the bad side
    assert load_report(SET, 174_000).holds
    assert not load_report(SET, 173_000).holds
    assert found.percent is not None
    assert load_report(SET.faster(found.percent), 500_000).holds
    assert not load_report(SET.faster(found.percent + 1), 500_000).holds
    assert found.first_missed == "Long"


def test_how_many_more_messages_fit() -> None:
    found = limits(SET, 500_000)
    assert found.messages is not None
    for more, holds in ((0, True), (1, False)):
        assert load_report(with_messages(SET, found.messages + more, found.shortest_period), 500_000).holds is holds


def test_how_many_more_nodes_fit() -> None:
    found = limits(SET, 500_000)
    assert found.nodes is not None
    for more, holds in ((0, True), (1, False)):
        assert load_report(with_nodes(SET, found.nodes + more, found.busiest), 500_000).holds is holds


def test_what_does_not_hold_has_no_limits() -> None:
    found = limits(SET, RATE)
    assert (found.percent, found.messages, found.nodes) == (None, None, None)
    assert list(sentences(found)) == ["all deadlines are met down to 174 kbit/s", "at 100 kbit/s nothing fits any more"]


def test_what_holds_on_no_bus() -> None:
    found = limits(MessageSet((QUICK._replace(deadline=100),)), RATE)
    assert found.slowest is None
    assert next(sentences(found)) == "all deadlines are met on no classic CAN"


def test_further_messages_are_less_urgent_than_all_others_and_each_has_its_node() -> None:
    more = with_messages(SET, 2, 5_000).messages[2:]
    assert [(each.identifier, each.node, each.period) for each in more] == [
        (0x701, "further 0", 5_000),
        (0x702, "further 1", 5_000),
    ]


def test_a_further_node_has_the_mailboxes_of_the_one_it_is_like() -> None:
    more = with_nodes(SET._replace(mailboxes={"a": 3}), 2, "a")
    assert more.mailboxes == {"a": 3, "a 2": 3, "a 3": 3}
    assert [each.node for each in more.messages] == ["a", "a 2", "a 3", "b"]
