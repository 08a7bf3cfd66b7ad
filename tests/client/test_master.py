"""SDO transfers of a master: answers of every kind, silence, and a bus that fails, each as one error of ours."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from itertools import islice
from math import inf

import can
import pytest

from eurobot_od.client.configure import read_object
from eurobot_od.client.master import Master, produce, syncs, times
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError, LocalError, NoAnswer, NodeRefused, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.objects import undescribed
from eurobot_od.od.values import UNSIGNED16
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import AbortCode, ClientCommand, aborted
from tests.client.peers import line, master_on, new_channel, open_bus, peer, stock_lift
from tests.client.wired import Answerer, WiredBus, wired
from tests.device.shelf import Shelf

HEARTBEAT_TIME = (0x1017, 0)
EXPEDITED_TWO_BYTES = bytes.fromhex("4b171000e8030000")
SEGMENTED_100_BYTES = bytes.fromhex("4108100064000000")


def test_our_node_is_read_and_written() -> None:
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        assert node.upload(HEARTBEAT_TIME) == b"\xe8\x03"
        node.download(HEARTBEAT_TIME, b"\xf4\x01")
        assert node.upload(HEARTBEAT_TIME) == b"\xf4\x01"
        assert node.upload((0x1008, 0)) == b"Packaging line lift"  # in segments


def test_a_long_object_comes_by_blocks_from_our_node_and_by_segments_from_one_without_them() -> None:
    with line("lift") as channel, master_on(channel) as master:
        assert master.node(2).upload_block((0x1021, 0)).startswith(b"[FileInfo]")
    with stock_lift() as (channel, _), master_on(channel) as master:
        assert master.node(2).upload_block((0x1008, 0)) == b"Packaging line lift"


PROGRAM = bytes(range(256)) * 8
FILE = (0x2000, 0)


def written_to(*refused: int, silent: bool = False) -> tuple[bytes, list[str]]:
    """Write a program to a server that refuses these command specifiers; return what it has, and who did it."""
    shelf = Shelf()
    server, said = SdoServer(shelf), list[str]()

    def answers(frame: Frame) -> list[Frame]:
        specifier = frame.data[0] >> 5
        if specifier in refused and frame.data[1:4] == bytes([0, 0x20, 0]):
            said.append(f"refused {specifier}")
            data = [] if silent else [aborted(FILE, AbortCode.UNKNOWN_COMMAND)]
        else:
            data = server.receive(frame.data, 0.0)
        return [Frame(0x582, each) for each in data]

    wired(Answerer(answers)).node(2).download(FILE, PROGRAM)
    return shelf.objects[FILE], said


def test_many_bytes_are_written_by_blocks() -> None:
    assert written_to(ClientCommand.DOWNLOAD) == (PROGRAM, [])


@pytest.mark.parametrize("silent", [False, True])
def test_a_node_without_blocks_is_written_by_segments(silent: bool) -> None:
    assert written_to(ClientCommand.BLOCK_DOWNLOAD, silent=silent) == (PROGRAM, ["refused 6"])


def test_a_node_that_has_taken_a_block_is_not_written_anew() -> None:
    server, requests = SdoServer(Shelf()), list[bytes]()

    def answers(frame: Frame) -> list[Frame]:
        requests.append(frame.data)
        taken = server.receive(frame.data, 0.0) if len(requests) <= 128 else [aborted(FILE, AbortCode.HARDWARE)]
        return [Frame(0x582, each) for each in taken]

    with pytest.raises(NodeRefused, match="Access failed due to a hardware error"):
        wired(Answerer(answers)).node(2).download(FILE, PROGRAM)
    assert not any(data[0] >> 5 == ClientCommand.DOWNLOAD for data in requests[129:] if data[1:4] == b"\0\x20\0")


@pytest.mark.parametrize(
    ("address", "data", "code"),
    [
        ((0x5000, 0), None, 0x06020000),  # no such object
        ((0x1018, 9), None, 0x06090011),  # no such sub-index
        ((0x1018, 1), b"\0\0\0\0", 0x06010002),  # read only
        (HEARTBEAT_TIME, b"\0\0\0", 0x06070012),  # too long
    ],
)
def test_a_refusal_names_node_object_and_abort(address: tuple[int, int], data: bytes | None, code: int) -> None:
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        with pytest.raises(NodeRefused, match=f"^node 2 refused to (read|write) 0x{address[0]:04X}") as refused:
            node.upload(address, "Thing") if data is None else node.download(address, data, "Thing")
    assert refused.value.code == code
    assert "Thing" in str(refused.value)


@pytest.mark.parametrize(
    "answers",
    [
        [],  # nobody there
        [b""],  # a frame without data is not an answer
        [EXPEDITED_TWO_BYTES[:5]],  # nor is one that is too short
        [SEGMENTED_100_BYTES],  # an answer that ends after its first frame
    ],
)
def test_silence_is_no_answer(answers: list[bytes]) -> None:
    first = iter([answers])
    told = r"^no answer from node 2 within 50 ms after read 0x1008:0 Name"
    with (
        peer(lambda _: next(first, [])) as channel,
        master_on(channel, 0.05) as master,
        pytest.raises(NoAnswer, match=told),
    ):
        master.node(2).upload((0x1008, 0), "Name")


@pytest.mark.parametrize(
    "answer",
    [
        bytes.fromhex("4b18100001000000"),  # another object
        bytes.fromhex("6017100000000000"),  # the answer to a write
        bytes.fromhex("ff17100000000000"),  # no command of SDO
    ],
)
def test_answers_to_another_client_alone_are_said_with_the_silence(answer: bytes) -> None:
    with (
        peer(lambda _: [answer]) as channel,
        master_on(channel, 0.05) as master,
        pytest.raises(NoAnswer, match="no answer from node 2 within 50 ms after read 0x1017:0") as silent,
    ):
        master.node(2).upload(HEARTBEAT_TIME)
    assert silent.value.__notes__ == ["another client is asking node 2: answers came, and none was to us"]
    assert list(master.shared) == [2]


FOREIGN, MINE = bytes.fromhex("4b18100001000000"), bytes.fromhex("4b171000e8030000")


@pytest.mark.parametrize(
    "answers",
    [
        [[FOREIGN, MINE]],  # beside ours
        [[FOREIGN], [MINE]],  # in place of ours, which a read asks for once more
    ],
)
def test_a_read_beside_another_client_has_its_own_answer(answers: list[list[bytes]]) -> None:
    coming = iter(answers)
    with peer(lambda asked: next(coming, []) if asked[0] != 0x80 else []) as channel, master_on(channel, 0.1) as m:
        assert m.node(2).upload(HEARTBEAT_TIME) == b"\xe8\x03"
    assert list(m.shared) == [2]


def test_an_unknown_abort_code_is_shown() -> None:
    abort = bytes.fromhex("80171000efbeadde")
    with (
        peer(lambda _: [abort]) as channel,
        master_on(channel) as master,
        pytest.raises(NodeRefused, match=r"unknown code \(0xDEADBEEF\)"),
    ):
        master.node(2).upload(HEARTBEAT_TIME)


def test_a_bus_that_fails_is_a_bus_error() -> None:
    with master_on(new_channel()) as master:
        master.bus.shutdown()
        with pytest.raises(BusError, match="closed bus"):
            master.node(2).upload(HEARTBEAT_TIME)
        with pytest.raises(BusError, match="closed bus"):
            master.pump(1)


def test_nmt_commands_act_and_the_heartbeat_tells() -> None:
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        node.download(HEARTBEAT_TIME, b"\x0a\0")
        for command, state in (
            (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
            (NmtCommand.STOP, NmtState.STOPPED),
            (NmtCommand.START, NmtState.OPERATIONAL),
        ):
            node.command(command)
            assert node.wait_for(state, 1)
            assert node.state(1) is state


def test_a_reset_waits_for_the_boot_up() -> None:
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        node.download(HEARTBEAT_TIME, b"\x0a\0")
        node.reset()
        assert node.upload(HEARTBEAT_TIME) == b"\xe8\x03"


def test_only_classic_base_data_frames_are_heard() -> None:
    channel = new_channel()
    with Master(open_bus(channel)) as master, open_bus(channel) as sender:
        sender.send(can.Message(arbitration_id=0x702, data=b"\x05", is_extended_id=True))
        sender.send(can.Message(arbitration_id=0x702, is_remote_frame=True, is_extended_id=False))
        sender.send(can.Message(arbitration_id=0x702, data=b"\x05\0", is_extended_id=False))  # two bytes
        sender.send(can.Message(arbitration_id=0x702, data=b"\x33", is_extended_id=False))  # no state
        master.pump(0.01)
        assert master.states == {}
        sender.send(can.Message(arbitration_id=0x702, data=b"\x05", is_extended_id=False))
        assert master.pump(1, lambda: master.states == {2: NmtState.OPERATIONAL})


def test_an_answer_counts_that_came_in_time_and_is_looked_at_late() -> None:
    """The process stood still for a minute right after its request: suspended, or on a busy machine."""
    asleep = 0.0

    def answers(_: Frame) -> list[Frame]:
        nonlocal asleep
        asleep += 60.0
        return [Frame(0x582, EXPEDITED_TWO_BYTES)]

    bus = WiredBus(Answerer(answers))
    assert Master(bus, clock=lambda: bus.now + asleep).node(2).upload(HEARTBEAT_TIME) == b"\xe8\x03"


class Slow:
    """A node whose first answer comes after a second; the value of an object is how often it was read."""

    def __init__(self) -> None:
        self.next_wakeup = inf
        self._reads = 0
        self._late: list[Frame] = []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.data[0] != ClientCommand.UPLOAD << 5:
            return []
        self._reads += 1
        answer = Frame(0x582, bytes.fromhex("4f171000") + bytes([self._reads, 0, 0, 0]))
        if self._reads == 1:
            self._late, self.next_wakeup = [answer], now + 1.0
            return []
        return [*self.tick(now), answer]  # what is late is on the bus before

    def tick(self, now: float) -> list[Frame]:
        late, self._late, self.next_wakeup = self._late, [], inf
        return late


def test_an_answer_that_comes_when_nobody_waits_any_more_is_none_to_the_next_request() -> None:
    bus = WiredBus(Slow())
    node = Master(bus, 0.5, clock=lambda: bus.now).node(2)
    with pytest.raises(NoAnswer):
        node.upload(HEARTBEAT_TIME)
    bus.now += 1.0
    assert node.upload(HEARTBEAT_TIME) == b"\2"


def test_an_object_of_a_known_length_takes_no_longer_announcement() -> None:
    master = wired(Answerer(lambda frame: [Frame(0x582, SEGMENTED_100_BYTES)] if frame.data[0] == 0x40 else []))
    thing = undescribed((0x1008, 0))
    thing.data_type = UNSIGNED16.code
    with pytest.raises(RemoteError, match="is not about an object of at most 4 bytes"):
        read_object(master.node(2), thing)


@pytest.mark.parametrize(
    ("overflow", "data"),
    [(None, [b""] * 5), (2, [b"\1", b"\2", b"\1", b"\2", b"\1"]), (240, [b"\1", b"\2", b"\3", b"\4", b"\5"])],
)
def test_a_sync_may_have_a_counter(overflow: int | None, data: list[bytes]) -> None:
    assert [*islice(syncs(overflow), 5)] == [Frame(0x080, each) for each in data]


@pytest.mark.parametrize("overflow", [0, 1, 241])
def test_a_counter_ends_where_the_standard_allows(overflow: int) -> None:
    with pytest.raises(LocalError, match="2 to 240"):
        syncs(overflow)


def test_time_counts_from_1984() -> None:
    now = datetime(2014, 5, 28, 12, 0, 1, 500_000)
    assert next(times(lambda: now)) == Frame(0x100, (43_201_500).to_bytes(4, "little") + (11_105).to_bytes(2, "little"))


def test_frames_go_out_at_their_times_and_what_was_missed_is_not_made_up() -> None:
    sent: list[float] = []

    def note(_: Frame) -> list[Frame]:
        sent.append(round(bus.now, 2))
        bus.now += 0.25 if len(sent) == 2 else 0.0  # the driver hangs
        return []

    bus = WiredBus(Answerer(note))
    with Master(bus, clock=lambda: bus.now) as master:
        produce(master, islice(syncs(), 5), 0.1)
    assert sent == [0.0, 0.1, 0.4, 0.5, 0.6]


def test_frames_are_made_when_they_are_sent() -> None:
    bus = WiredBus()
    made: list[float] = []

    def frames() -> Iterator[Frame]:
        for _ in range(3):
            made.append(round(bus.now, 1))
            yield Frame(0x100)

    with Master(bus, clock=lambda: bus.now) as master:
        produce(master, frames(), 1.0)
    assert made == [0.0, 1.0, 2.0]
