"""`boot`: a master starts its slaves as CiA 302-2 says, and says why one is not there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from math import inf
from pathlib import Path

import pytest

from eurobot_od.client.boot import (
    BootedSlave,
    hear_slave,
    order_start,
    prepare_slave,
    started_state,
)
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.client.watch import Heartbeats, NodeChange, NodeEvent, NodeWatch, watch_nodes, without_heartbeat
from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import HEARTBEAT_TIME
from tests.client.peers import boot_slave, start_slave
from tests.client.wired import wired
from tests.eds_text import DEVICE_TYPE, record, variable

NOW = datetime(2026, 11, 1, 12)
TYPE = variable("1000", "Device type", "UNSIGNED32", "0x191")
NUMBERS = ((1, "Vendor-ID"), (2, "Product code"), (3, "Revision number"), (4, "Serial number"))
TEXT = (
    TYPE
    + record(0x1018, "Identity", (0, "UNSIGNED8", "4"), *((sub, "UNSIGNED32", f"0x1{sub}") for sub, _ in NUMBERS))
    + variable("1017", "Producer heartbeat time", "UNSIGNED16", "100")
    + record(0x1020, "Verify configuration", *((sub, "UNSIGNED32", "0") for sub in (1, 2)))
    + variable("2000", "Speed", "INTEGER16", "5")
)
LISTS = "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
COMMISSIONED = "[DeviceComissioning]\nNodeID=5\nBaudrate=500\n"


@contextmanager
def slave(text: str = TEXT) -> Iterator[RemoteNode]:
    with SimulatedNetwork() as network:
        network.simulate(Dictionary.read(text.encode(), Path("a.eds"), 5))
        yield network[5]._node


def booted(text: str, wanted: str) -> BootedSlave:
    """Boot a slave of one file by another."""
    with slave(text) as node:
        return boot_slave(node, Dictionary.read(wanted.encode(), Path("a.dcf"), 5), NOW)


def test_a_slave_that_is_as_its_eds_says_boots_and_starts() -> None:
    with slave() as node:
        dictionary = Dictionary.read(TEXT.encode(), Path("a.eds"), 5)
        found = boot_slave(node, dictionary, NOW)
        assert found.failed is None
        assert found.done == (
            "reset",
            "identity as in its file",
            "an EDS: its own configuration",
            "heartbeat every 100 ms",
        )
        assert start_slave(node, found, dictionary) is NmtState.OPERATIONAL


WITHOUT = TEXT.replace(variable("1017", "Producer heartbeat time", "UNSIGNED16", "100"), "")


def test_a_slave_without_heartbeat_and_guarding_says_no_state() -> None:
    with slave(WITHOUT) as node:
        dictionary = Dictionary.read(WITHOUT.encode(), Path("a.eds"), 5)
        found = boot_slave(node, dictionary, NOW)
        assert (found.failed, found.heartbeat) == (None, 0)
        assert start_slave(node, found, dictionary) is None


OFF = TEXT.replace("DefaultValue=100\n", "DefaultValue=0\n")


def test_a_heartbeat_that_is_off_stays_off_and_no_state_is_said() -> None:
    with slave(OFF) as node:
        dictionary = Dictionary.read(OFF.encode(), Path("a.eds"), 5)
        found = boot_slave(node, dictionary, NOW)
        assert (found.done[-1], found.heartbeat) == ("no heartbeat", 0)
        assert start_slave(node, found, dictionary) is None
        assert node.upload(HEARTBEAT_TIME) == bytes(2)


CONFIGURED = TEXT.replace("DefaultValue=5\n", "DefaultValue=5\nParameterValue=7\n") + LISTS + COMMISSIONED
STAMPED = CONFIGURED.replace("Entry 1\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\n",
    "Entry 1\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\nParameterValue=15\n").replace(
    "Entry 2\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\n",
    "Entry 2\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\nParameterValue=16\n")  # fmt: skip


def test_a_dcf_is_loaded_into_a_slave_without_it() -> None:
    with slave() as node:
        found = boot_slave(node, Dictionary.read(CONFIGURED.encode(), Path("a.dcf")), NOW)
        assert found.failed is None
        assert found.done[2] == "configured: 1 object changed"
        assert node.upload((0x2000, 0)) == b"\7\0"


def test_the_dcf_of_another_node_of_its_kind_is_loaded_into_a_slave() -> None:
    with slave() as node:
        text = CONFIGURED.replace("NodeID=5", "NodeID=9")
        assert boot_slave(node, Dictionary.read(text.encode(), Path("a.dcf")), NOW).failed is None
        assert node.upload((0x2000, 0)) == b"\7\0"


def test_an_eds_that_is_commissioned_for_another_node_is_an_eds() -> None:
    """Editors leave the section in an EDS; without a ParameterValue there is nothing in it to load."""
    wanted = TEXT + LISTS + COMMISSIONED.replace("NodeID=5", "NodeID=9")
    assert booted(TEXT, wanted).done[2] == "no ParameterValue: its own configuration"


def test_a_slave_whose_0x1020_is_the_dcfs_is_not_configured_again() -> None:
    assert STAMPED.count("ParameterValue") == 3
    stamped = STAMPED.replace("ParameterValue=7\n", "").replace(COMMISSIONED, "").replace(LISTS, "")
    with slave(stamped) as node:
        found = boot_slave(node, Dictionary.read(STAMPED.encode(), Path("a.dcf")), NOW)
        assert found.done[2] == "configured already (0x1020)"
        assert node.upload((0x2000, 0)) == b"\5\0"


EMCY_CHOSEN = variable("1014", "COB-ID EMCY", "UNSIGNED32", "$NODEID+0x80", "ParameterValue=0x123\n")

UNFIT = [
    ("another device type", TEXT.replace("0x191", "0x192"), "error C: device type 0x00000191, its file has 0x00000192"),
    ("another vendor", TEXT.replace("0x11", "0x21"), "error D: vendor 0x00000011, its file has 0x00000021"),
    ("another product", TEXT.replace("0x12\n", "0x22\n"), "error M: product 0x00000012, its file has 0x00000022"),
    ("another revision", TEXT.replace("0x13", "0x23"), "error N: revision 0x00000013, its file has 0x00000023"),
    ("another serial number", TEXT.replace("0x14", "0x24"), "error O: serial 0x00000014, its file has 0x00000024"),
    (
        "a DCF of another node, with a COB-ID that somebody chose",
        CONFIGURED.replace("NodeID=5", "NodeID=9") + EMCY_CHOSEN,
        "error J: a.dcf: is of node 9; these COB-IDs do not follow the node-ID: 0x1014:0 EMCY 0x123; "
        "for node 5 keep them (--keep-cob-ids), or move them by -4 (--move-cob-ids)",
    ),
]


@pytest.mark.parametrize(("wanted", "words"), [row[1:] for row in UNFIT], ids=[row[0] for row in UNFIT])
def test_a_slave_that_is_another_does_not_boot(wanted: str, words: str) -> None:
    assert str(booted(TEXT, wanted).failed) == words


def test_a_slave_that_is_not_there_does_not_boot() -> None:
    with slave() as node:
        absent = RemoteNode(node.master, 9)
        found = boot_slave(absent, Dictionary.read(TEXT.encode(), Path("a.eds"), 9), NOW)
    assert str(found.failed).startswith("error B: ")
    assert found.done == ()


def test_many_slaves_are_waited_for_at_once() -> None:
    """The wait for heartbeats does not grow with the number of slaves, as it would one after the other."""
    dictionary = Dictionary.read(TEXT.encode(), Path("a.eds"), 5)
    with SimulatedNetwork() as network:
        for node_id in range(1, 31):
            network.simulate(Dictionary.read(TEXT.encode(), Path("a.eds"), node_id))
        nodes = [network[each]._node for each in range(1, 31)]
        clock = nodes[0].master.clock
        slaves = [prepare_slave(each, dictionary, NOW) for each in nodes]
        began = clock()
        assert not any(slave.failed for slave in map(hear_slave, nodes, slaves))
        assert [order_start(*each, dictionary) for each in zip(nodes, slaves)] == slaves
        states = {*map(started_state, nodes, slaves)}
        assert states == {NmtState.OPERATIONAL}
        assert clock() - began < 0.3  # each has a heartbeat in 100 ms


FOUND, BOOTED, LOST, BACK = NodeChange.FOUND, NodeChange.BOOTED, NodeChange.LOST, NodeChange.BACK


@pytest.mark.parametrize(
    ("period", "beats", "deadline"),
    [
        (1.0, [], inf),  # not heard yet: not lost either
        (1.0, [5.0], 7.0),  # twice the period that it should have
        (0.0, [5.0], inf),  # one heartbeat says nothing of a period
        (0.0, [5.0, 5.5], 6.5),  # what is heard does
        (1.0, [5.0, 15.0], 35.0),  # and counts more than what it should be
        (0.0, [1.0, 1.1, 1.2, 61.2, 61.3], 61.5),  # a long silence is not a period
    ],
)
def test_the_deadline_of_a_pulse(period: float, beats: list[float], deadline: float) -> None:
    pulse = Heartbeats(period)
    for beat in beats:
        pulse.beat(beat)
    assert pulse.deadline == pytest.approx(deadline)


def test_the_first_heartbeat_after_a_boot_up_says_nothing_of_the_period() -> None:
    pulse = Heartbeats()
    pulse.boot(1.0)
    pulse.beat(1.1)
    assert pulse.deadline == inf
    pulse.beat(2.1)
    assert pulse.deadline == pytest.approx(4.1)


class Beating:
    """A station that sends error control frames at given times; guarded, it answers while it is `alive`."""

    def __init__(self, beats: list[tuple[float, bytes]], alive: range = range(0), stuck: bool = False) -> None:
        self._beats, self._alive, self._stuck = list(beats), alive, stuck
        self._toggle = 0

    @property
    def next_wakeup(self) -> float:
        return self._beats[0][0] if self._beats else inf

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return []

    def tick(self, now: float) -> list[Frame]:
        _, data = self._beats.pop(0)
        self._toggle = 0 if data == b"\0" else self._toggle
        return [Frame(0x705, data)]

    def asked(self, cob_id: int, now: float) -> list[Frame]:
        if cob_id != 0x705 or int(now) not in self._alive:
            return []
        data = bytes([self._toggle | NmtState.STOPPED])
        self._toggle ^= 0 if self._stuck else 0x80
        return [Frame(0x705, data)]


def seen(station: Beating, end: float, **options: object) -> list[tuple[float, NodeChange]]:
    """Watch a bus with this station to a time; return when what happened to node 5."""
    events: list[NodeEvent] = []
    with wired(station) as master:
        watch_nodes(master, NodeWatch(events.append, **options), end)  # type: ignore[arg-type]
    assert {event.node_id for event in events} <= {5}
    return [(round(event.time, 1), event.change) for event in events]


def beats(*times: float) -> list[tuple[float, bytes]]:
    return [(time, b"\x05") for time in times]


@pytest.mark.parametrize(
    ("frames", "happened"),
    [
        (beats(1, 2, 3, 4, 5, 6, 7, 8), [(1.0, FOUND)]),
        (beats(1, 2, 3), [(1.0, FOUND), (5.0, LOST)]),
        (beats(1, 2, 3, 7, 8), [(1.0, FOUND), (5.0, LOST), (7.0, BACK)]),
        ([*beats(1, 2), (7, b"\0"), *beats(7.1, 8.1)], [(1.0, FOUND), (4.0, LOST), (7.0, BOOTED)]),
        ([(1, b"\0"), (3, b"\0")], [(1.0, BOOTED), (3.0, BOOTED)]),  # without heartbeat it is never lost
        ([(1, b""), (2, b"\5\5"), (3, b"\x33")], []),  # no error control frames
    ],
)
def test_changes_of_a_node_are_reported(
    frames: list[tuple[float, bytes]], happened: list[tuple[float, NodeChange]]
) -> None:
    assert seen(Beating(frames), 9.0) == happened


def test_a_node_that_has_to_be_there_is_lost_if_it_is_not_heard() -> None:
    assert seen(Beating(beats(4)), 5.0, expected=[5], patience=3.0) == [(3.0, LOST), (4.0, BACK)]


@pytest.mark.parametrize(
    ("station", "happened"),
    [
        (Beating([], range(10)), [(0.0, FOUND)]),
        (Beating([], range(4)), [(0.0, FOUND), (5.0, LOST)]),  # asked at 3 s for the last time with an answer
        (Beating([], range(5, 9)), [(2.0, LOST), (5.0, BACK)]),
        (Beating([], range(10), stuck=True), [(0.0, FOUND), (2.0, LOST)]),
        # The answer at 3 s, the first after its boot-up, has the toggle bit 0 as the one at 2 s had.
        (Beating([(2.5, b"\0")], range(4)), [(0.0, FOUND), (2.5, BOOTED), (5.0, LOST)]),
    ],
)
def test_a_guarded_node_is_asked_and_has_to_toggle(station: Beating, happened: list[tuple[float, NodeChange]]) -> None:
    assert seen(station, 6.5, guarded={5: 1.0}) == happened


def test_a_node_with_a_heartbeat_is_not_guarded() -> None:
    """It does not answer: guarded, it would be lost between two heartbeats."""
    heartbeat = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", "1000")
    texts = {5: heartbeat, 6: DEVICE_TYPE, 7: heartbeat.replace("=1000", "=0")}
    events: list[NodeEvent] = []
    with SimulatedNetwork() as network:
        for node_id, text in texts.items():
            network.simulate(Dictionary.read(text.encode(), Path("a.eds"), node_id))
        master = network[5]._node.master
        guarded = without_heartbeat(master, [*texts, 8])
        watch = NodeWatch(events.append, expected=[5], guarded=dict.fromkeys(guarded, 0.2))
        watch_nodes(master, watch, master.clock() + 4)
    assert guarded == [6, 7, 8]
    assert [event.change for event in events if event.node_id == 5] == [FOUND]


def test_an_event_has_the_last_state() -> None:
    events: list[NodeEvent] = []
    watch = NodeWatch(events.append, periods={5: 1.0})
    watch.receive(5, b"\x7f", 1.0)
    watch.tick(4.0)
    assert events == [
        NodeEvent(1.0, 5, FOUND, NmtState.PRE_OPERATIONAL),
        NodeEvent(4.0, 5, LOST, NmtState.PRE_OPERATIONAL),
    ]
