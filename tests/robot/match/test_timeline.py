"""The timeline: events in the order they are told, each shown once, and how a line reads."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match.timeline import EventKind, MatchEvent, Timeline


def test_events_are_kept_and_shown_as_they_come() -> None:
    shown: list[MatchEvent] = []
    clock = iter([0.5, 1.25])
    timeline = Timeline(lambda: next(clock), shown.append)
    timeline.tell(EventKind.GOTO, "tree", speed=80)
    timeline.tell(EventKind.ARRIVED, "after 1 s")
    assert shown == [
        MatchEvent(0.5, EventKind.GOTO, "tree", {"speed": 80}),
        MatchEvent(1.25, EventKind.ARRIVED, "after 1 s"),
    ]


@pytest.mark.parametrize("kind", EventKind)
def test_lines_stand_below_each_other(kind: EventKind) -> None:
    line = str(MatchEvent(12.3456, kind, "text"))
    assert line.startswith("   12.346 s  " + kind.value)
    assert line.index("text") == 24
