"""What happens on a bus, as events with their times."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from eurobot_od.client.watch import Heartbeats
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.traffic.monitor import NodeHealth
from eurobot_od.web.events import BusEvents, PageEvent
from tests.client.servo import EDS
from tests.web.test_drives import NETWORK

REMAPPED = [
    *("605#2F011A0000000000", "585#60011A0000000000"),
    *("605#23011A0120006460", "585#60011A0100000000"),
    *("605#2F011A0001000000", "585#60011A0000000000"),
]
READ, ENABLED = "605#4041600000000000", "585#4B41600037060000"


def events(*texts: str, decoder: Decoder = NETWORK) -> list[PageEvent]:
    """Return the events of frames that come a second apart."""
    following, watch = TrackingDecoder(decoder), BusEvents(decoder)
    frames = [Frame.parse(each) for each in texts]
    return [
        event
        for time, frame in enumerate(frames)
        for event in watch.take(time, float(time), following(float(time), "", frame))
    ]


def told(found: Iterable[PageEvent]) -> list[tuple[float, str, str, bool]]:
    return [(each.time, each.kind, each.text, each.wrong) for each in found]


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        (["705#00"], [(0, "boot-up", "servo, boot-up", False)]),
        (["000#0105"], [(0, "NMT", "start, servo", False)]),
        (["085#3081110000000000"], [(0, "EMCY", "servo, 0x8130 ", True)]),
        (["085#0000000000000000"], [(0, "EMCY", "servo: error cleared", False)]),
        (["605#40FF5F0000000000", "585#80FF5F0000000206"], [(1, "abort", "servo, 0x5FFF:00: 0x06020000", True)]),
        (["285#3706000000000000"], []),  # the first state is not a change
    ],
    ids=["boot-up", "NMT", "EMCY", "cleared", "abort", "first"],
)  # fmt: skip
def test_events_of_frames(frames: list[str], expected: list[tuple[float, str, str, bool]]) -> None:
    found = told(events(*frames))
    assert [(time, kind, wrong) for time, kind, _, wrong in found] == [(each[0], each[1], each[3]) for each in expected]
    assert [text for _, _, text, _ in found if not text.startswith(expected[0][2])] == []


def test_a_drive_tells_its_states_by_pdo_and_by_sdo() -> None:
    by_pdo = events("285#370600000000", "285#370600000000", "285#170600000000", "285#180600000000")
    assert told(by_pdo) == [
        (2, "drive", "servo: Quick stop active", True),
        (3, "drive", "servo: Fault", True),
    ]
    by_sdo = events("285#500600000000", READ, ENABLED)
    assert told(by_sdo) == [(2, "drive", "servo: Operation enabled", False)]


def test_only_a_further_axis_is_named() -> None:
    ready, enabled = "585#4B41600031060000", "585#4B41600037060000"
    first = events(READ, ready, READ, enabled)
    assert [each.text for each in first if each.kind == "drive"] == ["servo: Operation enabled"]
    read, *said = (each.replace("4160", "4168") for each in (READ, ready, enabled))
    second = events(read, said[0], read, said[1])
    assert [each.text for each in second if each.kind == "drive"] == ["servo, axis 2: Operation enabled"]


def test_a_pdo_that_is_mapped_otherwise_now_tells_no_state() -> None:
    assert [each for each in events("285#370600000000", *REMAPPED, "285#18060000") if each.kind == "drive"] == []


def test_nodes_are_lost_and_back() -> None:
    watch, node = BusEvents(Decoder([Dictionary.load(EDS, 5, "servo")])), NodeHealth(Heartbeats(1.0))
    nodes = {"servo": node}
    seen = []
    for time in (0.0, 1.0, 2.0, 7.0):
        seen += [*watch.look(time - 0.01, nodes)]
        node.pulse.beat(time)
        seen += [*watch.look(time, nodes)]
    assert told(seen) == [(4.0, "lost", "servo is lost", True), (7.0, "back", "servo is back", False)]
