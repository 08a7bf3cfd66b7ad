"""Counts of damage: each kind with its first place, worst first."""

from __future__ import annotations

from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import MAPPED_OTHERWISE, DamageCounts, Defect


def test_each_kind_is_counted_and_has_its_first_place() -> None:
    counts = DamageCounts()
    counts.add("one.log", 3, [Defect(Damage.OUT_OF_RANGE, "x"), Defect(Damage.OUT_OF_RANGE, "y")])
    counts.add("two.log", 1, [Defect(Damage.UNREADABLE, "z")])
    counts.add("two.log", 9, [])
    assert counts.total == 3
    assert [line.split() for line in counts.report()] == [
        ["1", "x", "unreadable", "first", "at", "two.log:1:", "z"],
        ["2", "x", "out", "of", "range", "first", "at", "one.log:3:", "x"],
    ]


def test_a_length_that_the_mapping_cannot_have_again_and_again_has_a_likely_reason_once() -> None:
    counts = DamageCounts()
    for number in range(3):
        assert not any("mapped otherwise" in line for line in counts.report()), number
        counts.add("one.log", number, [Defect(Damage.WRONG_LENGTH, "too short", MAPPED_OTHERWISE)])
    assert [line.strip() for line in counts.report()][1:] == [MAPPED_OTHERWISE]
