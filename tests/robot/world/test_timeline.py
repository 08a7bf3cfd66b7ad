"""The timeline: events in the order they are told, each shown once, and how a line reads."""

from __future__ import annotations

from eurobot_od.robot.world.timeline import EventKind, MatchEvent, Timeline
from tests.rows import rows


def test_events_are_shown_as_they_come() -> None:
    shown: list[MatchEvent] = []
    clock = iter([0.5, 1.25])
    timeline = Timeline(lambda: next(clock), shown.append)
    timeline.tell(EventKind.GOTO, "tree", speed=80)
    timeline.tell(EventKind.ARRIVED, "after 1 s")
    assert shown == [
        MatchEvent(0.5, EventKind.GOTO, "tree", {"speed": 80}),
        MatchEvent(1.25, EventKind.ARRIVED, "after 1 s"),
    ]


@rows("kind", EventKind)
def test_lines_stand_below_each_other(kind: EventKind) -> None:
    line = str(MatchEvent(12.3456, kind, "text"))
    assert line.startswith("   12.346 s  " + kind.value)
    assert line.index("text") == 24


def test_as_data_what_an_event_tells_stands_next_to_when_and_what_it_was() -> None:
    event = MatchEvent(0.12345678, EventKind.GIVEN_UP, "text", {"seconds": 2})
    assert event.as_data() == {"time": 0.123457, "kind": "given up", "text": "text", "seconds": 2}
