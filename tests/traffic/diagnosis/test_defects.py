"""Each rule of `diagnose` finds its defect at the right place, and leaves the near miss alone."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO

import pytest

from eurobot_od.traffic import formats
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.diagnosis.incidents import Incident
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.load import MessageSet
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.traffic.statistics import NOTHING
from tests.rows import rows
from tests.traffic.diagnosis.defects import DEFECTS, DEVICES, Log, RuleDefect, at, beats, log


def diagnosed(log: Log, devices: Iterable[str], promised: MessageSet | None = None) -> list[Incident]:
    """Return what is found in a log, read as a file of candump."""
    decoder = Decoder([DEVICES[each] for each in devices], refused=lambda _: None)
    diagnosis = Diagnosis(decoder, promised=promised or NOTHING)
    diagnosis.begin("x.log")
    text = "".join(f"({time:.6f}) can0 {frame}\n" for time, frame in log)
    for line, time, channel, raw in formats.entries(BytesIO(text.encode())):
        diagnosis.take(time, channel, raw, line)
    diagnosis.end()
    return diagnosis.incidents.sorted()


def with_followers(found: list[Incident]) -> list[Incident]:
    """Return incidents and what follows from them."""
    return [each for incident in found for each in (incident, *incident.follows)]


@rows("defect", DEFECTS)
def test_a_defect_is_found_at_its_place(defect: RuleDefect) -> None:
    (found,) = (
        each
        for each in with_followers(diagnosed(defect.broken, defect.devices, defect.promised))
        if each.rule is defect.rule
    )
    first = found.seen.places[0]
    lines = [number for number, (time, _) in enumerate(defect.broken, 1) if time >= defect.at]
    assert (round(first.time, 6), first.log) == (defect.at, "x.log")
    assert defect.broken[first.line - 1][0] == defect.at or first.line in lines


@rows("defect", DEFECTS)
def test_a_near_miss_is_not(defect: RuleDefect) -> None:
    devices = defect.devices if defect.near_devices is None else defect.near_devices
    found = diagnosed(defect.near, devices, defect.near_promised)
    assert [each.title for each in with_followers(found) if each.rule is defect.rule] == []


def test_each_rule_has_a_defect() -> None:
    elsewhere = {BusRule.FRAMES_MISSED, BusRule.BUS_SILENT}
    assert set(BusRule) - {each.rule for each in DEFECTS} == elsewhere


WAITS = at("609#2316100164000500", "589#6016100100000000", start=0.5)
"""Node 9, which has no file, is told to wait 100 ms for node 5."""


@pytest.mark.parametrize(("start", "expected"), {"": [BusRule.CONSUMER_UNFED], "709#00": [], "000#8109": []}.items())
def test_a_node_without_a_file_waits_for_whom_it_was_told_to_until_it_starts_anew(
    start: str, expected: list[BusRule]
) -> None:
    anew = at(start, "709#00", start=1.0) if start else []
    found = diagnosed(log(beats(node=9), WAITS, anew), ())
    assert [each.rule for each in found if each.rule is BusRule.CONSUMER_UNFED] == expected


LOST = log(beats(until=1), beats(node=6, until=4), at("605#4018100100000000", start=2.0))
"""A node is lost, does not answer, and is missed by node 6."""

MISSES = at("086#3081110000000000", start=1.2)


def test_consequences_of_a_lost_node_are_below_it() -> None:
    (lost,) = diagnosed(log(LOST, MISSES), ())
    assert lost.rule is BusRule.HEARTBEAT_LOST
    assert {each.rule for each in lost.follows} == {BusRule.SDO_UNANSWERED, BusRule.EMCY_RAISED}
    assert "missed: node 5, silent since 1.000 s" in lost.follows[-1].text


def test_another_node_is_not_below_it() -> None:
    found = diagnosed(log(LOST, at("607#4018100100000000", start=2.0)), ())
    assert [each.who for each in found if each.rule is BusRule.SDO_UNANSWERED] == ["node 7"]
