"""Laws of the nodes: no frame brings them down, and what they plan is noted."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.objects import data_type
from tests.kit import lift
from tests.kit.devices import AXIS_DRIVE, IO, IO_MODULE, MOTOR, SERVO

NODE_ID = 2
PAUSES = st.sampled_from([0.0, 0.001, 0.05, 0.2, 0.6, 2.5])
COB_IDS = [each.cob_id for each in lift.protocol().bindings]
SERVICES = [0x000, 0x080, 0x202, 0x302, 0x601, 0x602, 0x603, 0x702]
frames = st.builds(
    Frame,
    st.one_of(st.sampled_from(COB_IDS), st.sampled_from(SERVICES), st.integers(0, 0x7FF)),
    st.binary(max_size=8),
)

NODES: Mapping[str, Callable[[], Node]] = {
    **{name: lambda name=name: lift.node(name) for name in lift.ROLES},  # type: ignore[misc]
    **{
        file.stem: lambda file=file: SimulatedDevice.load(file, NODE_ID)  # type: ignore[misc]
        for file in (MOTOR, SERVO, IO, IO_MODULE, AXIS_DRIVE)
    },
}


def writes(node: Node) -> st.SearchStrategy[Frame]:
    """SDO requests that write any value to an object of the node's own, with the length of its type."""
    own = [
        (index, subindex, size)
        for index, members in node.device.dictionary.members.items()
        if index >= 0x2000
        for subindex, member in members.items()
        if 0 < (size := data_type(member).size or 0) <= 4
    ]

    def request(target: tuple[int, int, int], value: int) -> Frame:
        index, subindex, size = target
        content = index.to_bytes(2, "little") + bytes([subindex]) + value.to_bytes(4, "little")
        return Frame(0x600 + node.device.node_id, bytes([0x23 | 4 - size << 2]) + content)

    return st.builds(request, st.sampled_from(own), st.integers(0, 3) | st.integers(0, 0xFFFFFF))


def is_frame(frame: Frame) -> bool:
    """Return whether a bus can carry it."""
    return 0 <= frame.cob_id <= 0x7FF and len(frame.data) <= 8


@pytest.mark.parametrize("made", NODES.values(), ids=NODES)
@given(draws=st.data())
def test_no_frame_brings_a_node_down(made: Callable[[], Node], draws: st.DataObject) -> None:
    node, now = made(), 0.0
    node.start(now)
    for pause, frame in draws.draw(st.lists(st.tuples(PAUSES, st.one_of(frames, writes(node))), max_size=20)):
        now += pause
        sent = node.tick(now)
        node.device.plan.soonest = node.next_wakeup  # as whoever keeps the time has looked
        sent += node.receive(frame, now)
        assert all(map(is_frame, sent))
        assert node.device.plan.soonest <= node.next_wakeup
