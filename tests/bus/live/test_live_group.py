"""Several devices on one bus in one thread, and a master that starts them there."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from itertools import count
from math import inf
from pathlib import Path

import can
import pytest

from eurobot_od.bus.live.live import LiveGroup
from eurobot_od.controller import Event, Report
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.device.station import NodeGroup
from eurobot_od.errors import BusError
from eurobot_od.od.dictionary import Dictionary
from tests.client.peers import boot_slave, master_on, new_channel, open_bus, start_slave
from tests.eds_text import DEVICE_TYPE, variable

GUARDED = DEVICE_TYPE + variable("100C", "Guard time", "UNSIGNED16", "0")
BEATING = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", "20")


@contextmanager
def running(*texts: str) -> Iterator[tuple[str, list[Dictionary]]]:
    """Run devices in a thread, from node-ID 5 on, until the end of the block."""
    channel, ended = new_channel(), threading.Event()
    files = [Dictionary.read(text.encode(), Path("a.eds"), number) for number, text in enumerate(texts, start=5)]

    def clock() -> float:
        return inf if ended.is_set() else time.perf_counter()

    live = LiveGroup(open_bus(channel), NodeGroup([SimulatedDevice(each) for each in files]), clock)
    thread = threading.Thread(target=live.run, args=(inf,))
    thread.start()
    try:
        yield channel, files
    finally:
        ended.set()
        thread.join()
        with live:
            pass


@pytest.mark.parametrize("text", [GUARDED, BEATING], ids=["node guarding", "heartbeat"])
def test_a_master_boots_devices_that_share_one_thread(text: str) -> None:
    with running(text, text, text) as (channel, files), master_on(channel) as master:
        for dictionary in files:
            node = master.node(dictionary.node_id)
            slave = boot_slave(node, dictionary, datetime.now())
            assert slave.failed is None
            assert start_slave(node, slave, dictionary) is NmtState.OPERATIONAL


LIFE_GUARDED = (
    DEVICE_TYPE
    + variable("100C", "Guard time", "UNSIGNED16", "50")
    + variable("100D", "Life time factor", "UNSIGNED8", "2")
)


def test_a_device_that_expects_to_be_guarded_on_is_not_guarded_once() -> None:
    """Else it would go back to PRE-OPERATIONAL after its life time, 0.1 s."""
    with running(LIFE_GUARDED) as (channel, [dictionary]), master_on(channel) as master:
        node = master.node(dictionary.node_id)
        slave = boot_slave(node, dictionary, datetime.now())
        assert start_slave(node, slave, dictionary) is None
        master.pump(0.5)
        master.request(0x700 + node.node_id)
        node.wait_for(NmtState.OPERATIONAL, 1.0)
        assert node.last_state is NmtState.OPERATIONAL


class Lost(can.BusABC):
    """A bus that is lost as soon as it is read."""

    channel_info = "lost"

    def __init__(self) -> None:
        super().__init__("lost")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Take it."""

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        raise OSError(19, "No such device")


def test_a_bus_that_fails_ends_it_in_one_line() -> None:
    with (
        LiveGroup(Lost(), NodeGroup([SimulatedDevice(Dictionary.read(GUARDED.encode(), Path("a.eds"), 5))])) as live,
        pytest.raises(BusError, match=r"^the bus lost failed: .*No such device$"),
    ):
        live.run(inf)


class Full(Lost):
    """A bus whose driver has no room for a frame."""

    def __init__(self) -> None:
        super().__init__()
        self.tries = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.tries += 1
        if self.tries == 100:
            raise OSError("tried for ever")
        raise can.CanOperationError("no room")


def test_a_driver_that_takes_no_frame_for_a_second_ends_it() -> None:
    seconds = count(0.0, 0.25)
    group = NodeGroup([SimulatedDevice(Dictionary.read(BEATING.encode(), Path("a.eds"), 5))])
    with (
        LiveGroup(Full(), group, lambda: next(seconds)) as live,
        pytest.raises(BusError, match=r"has taken no frame for 1\.0 s: no room"),
    ):
        live.run(inf)


class Once(Lost):
    """A bus that works, and takes all frames to a list."""

    channel_info = "once"

    def __init__(self, sent: list[int], *heard: can.Message) -> None:
        super().__init__()
        self.sent, self.heard = sent, iter(heard)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg.arbitration_id)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return next(self.heard, None), False


BEAT = can.Message(arbitration_id=0x70A, is_extended_id=False)
FOREIGN = (
    can.Message(arbitration_id=0x70A),  # 29 bits
    can.Message(arbitration_id=0x20, is_extended_id=False, is_error_frame=True),
    can.Message(arbitration_id=0x70A, is_extended_id=False, is_fd=True),
)


def test_only_classic_frames_with_11_bits_are_received() -> None:
    seconds, group = count(0.0, 0.25), NodeGroup([])
    with LiveGroup(Once([], *FOREIGN, BEAT), group, lambda: next(seconds)) as live:
        live.run(10.0)
    assert live.received == 1


class Kept(Once):
    """A bus that cannot be shut down."""

    def shutdown(self) -> None:
        raise OSError("not yours")


def test_a_bus_that_cannot_be_shut_down_is_told_in_one_line() -> None:
    with (
        pytest.raises(BusError, match=r"^the bus once cannot be shut down: not yours$"),
        LiveGroup(Kept([]), NodeGroup([])),
    ):
        pass


def test_a_bus_on_which_nothing_more_is_heard_is_reported() -> None:
    told, seconds = list[Report](), count(0.0, 0.25)
    group = NodeGroup([SimulatedDevice(Dictionary.read(BEATING.encode(), Path("a.eds"), 5))])
    with LiveGroup(Once([], BEAT, BEAT), group, lambda: next(seconds), report=told.append) as live:
        live.run(20.0)
    assert [(each.event, each.name) for each in told] == [(Event.BUS_SILENT, "once")]


def test_a_bus_that_fails_is_opened_again_and_the_devices_go_on() -> None:
    sent, told, tries = list[int](), list[Report](), count()

    def opener() -> can.BusABC:
        if next(tries) == 0:
            raise BusError("not yet")
        return Once(sent)

    group = NodeGroup([SimulatedDevice(Dictionary.read(BEATING.encode(), Path("a.eds"), 5))])
    seconds = count(0.0, 0.05)
    with LiveGroup(Lost(), group, lambda: next(seconds), opener=opener, report=told.append) as live:
        live.run(5.0)
    assert [each.event for each in told] == [Event.BUS_FAILED, Event.BUS_BACK]
    assert str(told[0]).endswith("No such device; it is opened again")
    assert sent.count(0x705) > 1  # its heartbeat
