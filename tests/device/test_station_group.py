"""A group of nodes on one connection: each hears the others and what comes from outside."""

from __future__ import annotations

from pathlib import Path

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.device.station import MOST_AT_ONCE, NodeGroup
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from tests.eds_text import DEVICE_TYPE, pdo, variable

SENDER = DEVICE_TYPE + variable("2000", "Speed", "INTEGER16", "5") + pdo(0x1800, "0x20000010", settings={2: "255"})
GUARDED = variable("100C", "Guard time", "UNSIGNED16", "0")
HEARTBEAT = variable("1017", "Producer heartbeat time", "UNSIGNED16", "100")
START = Frame(0, bytes([1, 0]))


def device(node_id: int, text: str = SENDER) -> SimulatedDevice:
    return SimulatedDevice(Dictionary.read(text.encode(), Path("a.eds"), node_id))


def receiver(node_id: int, cob_id: int, more: str = "") -> SimulatedDevice:
    hears = variable("2000", "Speed", "INTEGER16", "0") + pdo(0x1400, "0x20000010", cob_id=f"0x{cob_id:X}")
    return device(node_id, DEVICE_TYPE + hears + more)


def test_all_boot_up_and_obey_one_command() -> None:
    group = NodeGroup([device(5), device(6)])
    assert group.start(0.0) == [Frame(0x705, b"\0"), Frame(0x706, b"\0")]
    assert group.receive(START, 0.1) == [Frame(0x185, b"\5\0"), Frame(0x186, b"\5\0")]


def test_a_frame_of_one_station_reaches_the_others_and_the_bus_once() -> None:
    sender, hearer, other = device(5), receiver(6, 0x185), receiver(7, 0x195)
    group = NodeGroup([sender, hearer, other])
    group.start(0.0)
    assert group.receive(START, 0.1) == [Frame(0x185, b"\5\0")]
    assert [each.value("Speed") for each in (hearer, other)] == [5, 0]


def test_a_remote_frame_asks_the_node_that_is_meant() -> None:
    group = NodeGroup([device(5, SENDER + GUARDED), device(6)])
    group.start(0.0)
    assert group.receive(RemoteFrame(0x705, b"\0"), 0.1) == [Frame(0x705, b"\x7f")]
    assert group.receive(RemoteFrame(0x706, b"\0"), 0.1) == []


def test_each_wakes_the_group_at_its_time() -> None:
    group = NodeGroup([device(5), device(6, SENDER + HEARTBEAT)])
    group.start(0.0)
    assert group.next_wakeup == 0.1
    assert group.tick(0.05) == []
    assert group.tick(0.1) == [Frame(0x706, b"\x7f")]
    assert round(group.next_wakeup, 3) == 0.2


def test_an_identifier_that_a_master_moves_is_heard_at_its_new_place() -> None:
    hearer = receiver(6, 0x185)
    group = NodeGroup([hearer])
    group.start(0.0)
    group.receive(START, 0.1)
    for entry in (0x80000185, 0x199):
        group.receive(Frame(0x606, bytes.fromhex("23001401") + entry.to_bytes(4, "little")), 0.2)
    group.receive(Frame(0x185, b"\7\0"), 0.3)
    assert hearer.value("Speed") == 0
    group.receive(Frame(0x199, b"\7\0"), 0.3)
    assert hearer.value("Speed") == 7


def test_two_that_answer_each_other_for_ever_do_not_stop_the_time() -> None:
    class Echo(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            super().receive(frame, now)
            answers = {0x185: [Frame(0x195)], 0x195: [Frame(0x185)]}
            return answers.get(frame.cob_id, [])

    def echo(node_id: int, cob_id: int) -> Echo:
        text = (
            DEVICE_TYPE
            + variable("2000", "Speed", "INTEGER16", "0")
            + pdo(0x1400, "0x20000010", cob_id=f"0x{cob_id:X}")
        )
        return Echo(Dictionary.read(text.encode(), Path("a.eds"), node_id))

    group = NodeGroup([echo(5, 0x185), echo(6, 0x195)])
    group.start(0.0)
    sent = group.receive(Frame(0x185, b"\0\0"), 1.0)
    assert len(sent) == MOST_AT_ONCE - 1
    assert group.next_wakeup == 1.0
