"""Heartbeats of a device that sends its EDS in blocks, on slow and on busy buses."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import pytest

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.sdo.client import block_upload
from eurobot_od.sdo.wire import BLOCK_SEGMENTS
from tests.kit import lift
from tests.kit.bench import Peer
from tests.kit.lift import Cabin

PERIODS = {0x702: 1.0, 0x701: 0.2}
"""Of the cabin's heartbeat, which sends the blocks, and of the master's, s."""

PROCESSING = 100e-6
"""Time until a node processes a frame, in s."""

SEGMENT_BITS = 135
"""Of a frame with 8 bytes, with all stuff bits and the space after it."""

EDS_OF_DRIVE = (0x1021, 0)


class Reader(Peer):
    """Reads an object in blocks."""

    def __init__(self, dictionary: Dictionary) -> None:
        super().__init__(dictionary)
        self.transfer = block_upload(EDS_OF_DRIVE, wait=5.0)

    def ask(self, now: float) -> None:
        self.say(*(Frame(0x602, each) for each in self.transfer.start(now)))

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        answers = self.transfer.receive(frame.data, now) if frame.cob_id == 0x582 else []
        return [Frame(0x602, each) for each in answers]


class Chatter(Peer):
    """Fills a share of the bus with frames that go before all of SDO's."""

    def __init__(self, dictionary: Dictionary, pause: float) -> None:
        super().__init__(dictionary)
        self._pause = pause

    def start(self, now: float) -> list[Frame]:
        frames = super().start(now)
        self.chat(now)
        return frames

    def chat(self, now: float) -> None:
        self.say(Frame(0x205, bytes(8)))
        self.at(now + self._pause, self.chat)


@pytest.mark.long
@pytest.mark.parametrize("load", [0.0, 0.5], ids=["alone", "beside a load of 50 %"])
@pytest.mark.parametrize("bitrate", [50_000, 125_000, 250_000])
def test_a_block_upload_delays_no_heartbeat_by_more_than_its_block(bitrate: int, load: float) -> None:
    network, heard = Simulation(bitrate), defaultdict[int, list[float]](list)
    network.observers.append(lambda time, frame: heard[frame.cob_id].append(time))
    master, cabin = Reader(lift.dictionary("panel")), Cabin(lift.dictionary("cabin"))
    nodes: list[Node] = [cabin, master]
    if load:
        nodes.append(Chatter(lift.dictionary("door"), SEGMENT_BITS / bitrate / load))
    for node in nodes:
        network.attach(node, processing=PROCESSING)
    network.run(0.1)
    master.ask(0.1)
    network.run(4.0)
    assert len(heard[0x582]) > 5 * BLOCK_SEGMENTS
    block = BLOCK_SEGMENTS * SEGMENT_BITS / bitrate / (1 - load)
    own, masters = ([b - a for a, b in pairwise([*heard[cob_id], network.now])] for cob_id in PERIODS)
    assert max(own) < PERIODS[0x702] + 10 * SEGMENT_BITS / bitrate / (1 - load)  # it goes before its own segments
    if not load:  # else what goes before all of SDO may take the moments between two blocks, the only ones for 0x701
        assert max(masters) < 1.5 * PERIODS[0x701] + block
