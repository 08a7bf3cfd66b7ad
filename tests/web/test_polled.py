"""An object that is read again and again, as data."""

from __future__ import annotations

from eurobot_od.od.objects import find_one
from eurobot_od.web.polled import PolledObject


def test_its_time_is_told_to_a_tenth_of_a_millisecond() -> None:
    polled = PolledObject(5, find_one("0x1017", None), time=1.23456, value=1000)
    assert polled.shown() == {"time": 1.2346, "value": 1000, "trouble": ""}
