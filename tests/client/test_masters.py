"""Masters that receive all the time: a bus that is lost and comes back, threads at one node, frames of no interest."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from functools import partial
from math import inf

import can
import pytest

from eurobot_od.client.master import PeriodicTask
from eurobot_od.client.masters import LoopMaster, OwnFeed, SharedFeed, ThreadedMaster
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from tests.bus.live.loose import LONG, Cable, until
from tests.client.peers import new_channel, open_bus
from tests.client.servo import live_servos


def test_a_bus_that_is_lost_is_told_and_opened_again_and_what_was_periodic_goes_on() -> None:
    cable = Cable(new_channel())
    master = ThreadedMaster(OwnFeed(cable.open))
    with open_bus(cable.channel) as other:
        task = PeriodicTask(master, [Frame(0x080)], 0.01)
        ended = PeriodicTask(master, [Frame(0x123)], 0.01)
        master.periodic += [task, ended]
        ended.stop()
        cable.error = OSError("pulled out")
        with pytest.raises(BusError, match="pulled out"):
            master.pump(LONG)
        with pytest.raises(BusError, match="pulled out"):
            master.send(0x100, b"")
        cable.error = None
        until(lambda: master.failure is None)
        while other.recv(0) is not None:  # what was sent before
            pass
        assert {message.arbitration_id for _ in range(3) if (message := other.recv(LONG))} == {0x080}
        master.close()
        while other.recv(0) is not None:
            pass
        assert other.recv(0.05) is None
    assert all(bus.closed for bus in cable.buses)


def test_an_endless_wait_raises_when_the_bus_is_lost() -> None:
    cable, waits, heard = Cable(new_channel()), threading.Event(), list[BusError]()
    master = ThreadedMaster(OwnFeed(cable.open))

    def never() -> bool:
        waits.set()
        return False

    def wait() -> None:
        try:
            master.pump(inf, never)
        except BusError as error:
            heard.append(error)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    assert waits.wait(LONG)
    cable.error = OSError("pulled out")
    thread.join(LONG)
    assert [str(each) for each in heard] == [str(master.failure)] != ["None"]
    master.close()


def test_threads_take_turns_at_one_node() -> None:
    with live_servos(5) as channel:
        master, found = ThreadedMaster(OwnFeed(partial(open_bus, channel)), LONG), list[bytes]()

        def read() -> None:
            found.extend(master.node(5).upload((0x1008, 0)) for _ in range(5))

        threads = [threading.Thread(target=read) for _ in range(3)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        assert found == [b"Servo 100"] * 15
        master.close()


def test_only_classic_data_frames_with_short_identifiers_are_heard() -> None:
    channel, heard = new_channel(), list[int]()
    with open_bus(channel) as shared, open_bus(channel) as other:
        master = ThreadedMaster(SharedFeed(shared))
        with master.observed(lambda cob_id, *_: heard.append(cob_id)):
            other.send(can.Message(arbitration_id=0x101, is_extended_id=True))
            other.send(can.Message(arbitration_id=0x102, is_extended_id=False, is_remote_frame=True))
            other.send(can.Message(arbitration_id=0x103, is_extended_id=False))
            assert master.pump(LONG, lambda: bool(heard))
        master.close()
        other.send(can.Message(arbitration_id=0x104, is_extended_id=False))
        assert shared.recv(LONG) is not None  # it is still open, and nobody else reads it
    assert heard == [0x103]


class Hasty(SharedFeed):
    """A feed whose node boots and sends a heartbeat before `send` of a reset returns."""

    def start(self, seen: Callable[[float, Frame], object], *_: object) -> None:
        self._seen = seen

    def send(self, frame: Frame) -> None:
        if frame.data[0] == NmtCommand.RESET_NODE:
            for state in (NmtState.INITIALISING, NmtState.OPERATIONAL):
                self._seen(0.0, Frame(0x705, bytes([state])))

    def stop(self) -> None:
        """Nothing runs."""


def test_a_boot_up_counts_that_a_heartbeat_has_followed_already(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.client.master.BOOT_WAIT", 0.05)
    with open_bus(new_channel()) as bus:
        master = ThreadedMaster(Hasty(bus))
        master.node(5).reset()
        assert master.states == {5: NmtState.OPERATIONAL}
        master.close()


def test_somebody_elses_notifier_has_no_listener_of_ours_at_the_end() -> None:
    channel = new_channel()
    with open_bus(channel) as bus, open_bus(channel) as other:
        notifier = can.Notifier(bus, [], timeout=0.01)
        master = ThreadedMaster(SharedFeed(bus, notifier))
        assert len(notifier.listeners) == 1
        master.close()
        assert not notifier.listeners
        notifier.add_listener(heard := can.BufferedReader())
        other.send(can.Message(arbitration_id=5))
        assert heard.get_message(LONG) is not None
        notifier.stop()


def test_each_frame_counts_in_an_event_loop_even_if_the_next_contradicts_it() -> None:
    async def main(bus: can.BusABC) -> bool:
        feed = Hasty(bus)
        master = LoopMaster(feed)
        waiting = asyncio.ensure_future(master.pump.steps(0.2, lambda: master.states.get(5) is NmtState.INITIALISING))
        await asyncio.sleep(0)
        feed.send(Frame(0x000, bytes([NmtCommand.RESET_NODE, 5])))
        return await waiting

    with open_bus(new_channel()) as bus:
        assert asyncio.run(main(bus))


def test_nobody_observes_after_an_error_and_no_thread_is_left_at_the_end() -> None:
    before = set(threading.enumerate())
    with open_bus(new_channel()) as bus:
        master = ThreadedMaster(Hasty(bus))
        with pytest.raises(ZeroDivisionError), master.observed(lambda *_: None):
            raise ZeroDivisionError
        assert not master.observers
        master.close()
    assert set(threading.enumerate()) == before
