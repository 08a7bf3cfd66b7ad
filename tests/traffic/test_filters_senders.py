"""Filters by who sends: messages of one sender and of several, services, and what nobody is known to send."""

from __future__ import annotations

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.frame import Frame
from eurobot_od.traffic.filters import by_sender
from tests.kit import plant

PROTOCOL = plant.protocol()
OUTLINES = plant.load_all()
MOVE, STATE = (Frame(PROTOCOL.cob_id(name)) for name in ("Move To", "Move State Response"))
SHARED = Frame(PROTOCOL.cob_id("Order Confirm"))  # of lift and scale
HEARTBEAT, EMCY, ANSWER = Frame(0x702), Frame(0x082), Frame(0x582)  # of the lift, node-ID 2
NMT, REQUEST, NOTHING = Frame(0x000), Frame(0x602), Frame(0x7E6)  # of nobody that is known
ALL = (MOVE, STATE, SHARED, HEARTBEAT, EMCY, ANSWER, NMT, REQUEST, NOTHING)


@pytest.mark.parametrize(
    ("only", "without", "wanted"),
    [
        ([], [], ALL),
        (["lift"], [], (STATE, SHARED, HEARTBEAT, EMCY, ANSWER)),
        (["Panel", "lift"], [], (MOVE, STATE, SHARED, HEARTBEAT, EMCY, ANSWER)),
        ([], ["lift"], (MOVE, SHARED, NMT, REQUEST, NOTHING)),
        ([], ["lift", "scale"], (MOVE, NMT, REQUEST, NOTHING)),
    ],
)
def test_frames_are_wanted_by_their_senders(only: list[str], without: list[str], wanted: tuple[Frame, ...]) -> None:
    wants = by_sender(OUTLINES, PROTOCOL, only, without)
    assert tuple(filter(wants, ALL)) == wanted


def test_an_unknown_node_is_an_error() -> None:
    with pytest.raises(UnknownName, match="unknown node 'motor'"):
        by_sender(OUTLINES, PROTOCOL, ["motor"], [])
