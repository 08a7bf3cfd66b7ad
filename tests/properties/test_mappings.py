"""Any mapping of Goto XY that a master may configure: core and drive still understand each other."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.frame import Frame
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.values import Barriers, Direction, Route
from tests.device.master import wired

CORE, DRIVE = wired("core"), wired("drive")
NARROWEST = {1: 12, 2: 11, 3: 9, 4: 7, 5: 16}
WIDEST = {1: 16, 2: 16, 3: 16, 4: 8, 5: 16}
"""Bits of x, y, angle, speed and barriers by sub-index: what their values need, what their types have."""

widths = st.fixed_dictionaries({sub: st.integers(NARROWEST[sub], WIDEST[sub]) for sub in WIDEST})
mappings = st.tuples(widths, st.permutations(sorted(WIDEST))).filter(lambda drawn: sum(drawn[0].values()) <= 64)
gotos = st.builds(
    GotoXY,
    x=st.integers(0, 3000),
    y=st.integers(0, 2000),
    angle=st.integers(0, 359),
    speed=st.integers(0, 100),
    barriers=st.integers(0, 0xFFFF).map(Barriers),
    direction=st.just(Direction.FORWARD),
    route=st.just(Route.PLANNED),
)


@given(mappings, st.integers(0x401, 0x57F), gotos)
def test_a_goto_survives_every_mapping(mapping: tuple[dict[int, int], list[int]], cob_id: int, goto: GotoXY) -> None:
    bits, order = mapping
    entries = [0x2000_0000 | subindex << 8 | bits[subindex] for subindex in order]
    CORE.map_pdo(0x1803, cob_id, *entries)
    DRIVE.map_pdo(0x1403, cob_id, *entries)
    frame = CORE.device.transmit(goto)
    assert (frame.cob_id, len(frame.data)) == (cob_id, (sum(bits.values()) + 7) // 8)
    assert DRIVE.send(frame).message == goto
    assert [DRIVE.read(0x2000, subindex) for subindex in sorted(WIDEST)] == list(goto[:5])
    assert DRIVE.send(Frame(0x008, bytes(8))).message is None
