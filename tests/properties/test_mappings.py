"""Any mapping of Move To that a master may configure: sender and receiver still understand each other."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.frame import Frame
from tests.device.master import wired
from tests.kit.lift import Doors, MoveTo, Ride

PANEL, CABIN = wired("panel"), wired("cabin")
NARROWEST = {1: 12, 2: 2, 3: 7, 4: 10}
WIDEST = {1: 16, 2: 8, 3: 16, 4: 16}
"""Bits of height, ride, speed and pause by sub-index: what their values need, what their types have."""

widths = st.fixed_dictionaries({sub: st.integers(NARROWEST[sub], WIDEST[sub]) for sub in WIDEST})
mappings = st.tuples(widths, st.permutations(sorted(WIDEST)))
moves = st.builds(
    MoveTo,
    height=st.integers(0, 3000),
    ride=st.sampled_from(Ride),
    speed=st.integers(0, 100),
    pause=st.integers(0, 600),
    doors=st.just(Doors.CLOSED),
)


@given(mappings, st.integers(0x406, 0x57F), moves)
def test_a_message_survives_every_mapping(mapping: tuple[dict[int, int], list[int]], cob_id: int, move: MoveTo) -> None:
    bits, order = mapping
    entries = [0x2000_0000 | subindex << 8 | bits[subindex] for subindex in order]
    PANEL.map_pdo(0x1803, cob_id, *entries)
    CABIN.map_pdo(0x1403, cob_id, *entries)
    frame = PANEL.device.pdo_service.transmit(move)
    assert (frame.cob_id, len(frame.data)) == (cob_id, (sum(bits.values()) + 7) // 8)
    assert CABIN.send(frame).message == move
    assert [CABIN.read(0x2000, subindex) for subindex in sorted(WIDEST)] == list(move[:4])
    assert CABIN.send(Frame(0x108, bytes(5))).message is None
