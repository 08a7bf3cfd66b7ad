"""The simulated bus: arbitration, bit times, merged frames, losses, and who hears what."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Event
from eurobot_od.robot.messages import CheckDriveRequest, CheckDriveResponse, EmergencyShutdown, GotoXY, StopDrive
from eurobot_od.robot.nodes import ROLES, Drive
from eurobot_od.simulation.bits import frame_bits
from eurobot_od.simulation.network import Network
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, Peer

GOTO = PROTOCOL.encode(GotoXY(1500, 1000, 90, 80))


class Wire:
    """Stand-ins for the three nodes on a bus that is idle at 0.1 s, and the frames since."""

    def __init__(self) -> None:
        self.network = Network()
        self.core, self.drive, self.navigation = (Peer(DICTIONARIES[name]) for name in ROLES)
        self.stations = [self.network.attach(node) for node in (self.core, self.drive, self.navigation)]
        self.network.run(0.1)
        self.frames: list[tuple[float, Frame]] = []
        self.network.observers.append(lambda time, frame: self.frames.append((time, frame)))

    def run(self, until: float) -> list[Frame]:
        self.network.run(until)
        return [frame for _, frame in self.frames]


# Arbitration


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_the_lowest_cob_id_of_all_mailboxes_wins(order: tuple[int, int, int]) -> None:
    wire = Wire()
    nodes = [wire.core, wire.drive, wire.navigation]
    frames = [Frame(0x001), Frame(0x00C), Frame(0x380)]
    for node, frame in zip((nodes[index] for index in order), frames):
        node.say(frame)
    assert wire.run(0.2) == frames


def test_a_frame_on_the_wire_is_not_interrupted() -> None:
    wire = Wire()
    wire.core.say(GOTO)
    wire.network.advance(0.1)
    wire.network.run(0.1001)  # in the midst of it
    wire.drive.say(Frame(0x001))
    assert wire.run(0.2) == [GOTO, Frame(0x001)]


def test_a_nodes_own_frames_leave_by_their_priority() -> None:
    wire = Wire()
    wire.core.say(CheckDriveRequest(), GOTO, EmergencyShutdown())
    assert wire.run(0.2) == [PROTOCOL.encode(EmergencyShutdown()), GOTO, PROTOCOL.encode(CheckDriveRequest())]


def test_equal_frames_merge_into_one_and_count_as_sent_by_both() -> None:
    wire = Wire()
    frame = Frame(0x300)
    wire.drive.say(frame)
    wire.navigation.say(frame)
    before = [station.gatekeeper.mailboxes.statistics().completed for station in wire.stations]
    assert wire.run(0.2) == [frame]
    after = [station.gatekeeper.mailboxes.statistics().completed for station in wire.stations]
    assert [later - earlier for earlier, later in zip(before, after)] == [0, 1, 1]


def test_frames_of_one_identifier_and_other_data_do_not_merge() -> None:
    wire = Wire()
    wire.drive.say(Frame(0x6F0, b"\x02"))
    wire.navigation.say(Frame(0x6F0, b"\x01"))
    assert wire.run(0.2) == [Frame(0x6F0, b"\x01"), Frame(0x6F0, b"\x02")]


def test_equal_frames_of_one_node_both_go_out() -> None:
    wire = Wire()
    wire.core.say(StopDrive(), StopDrive())
    assert len(wire.run(0.2)) == 2


def test_a_frame_left_to_a_gatekeeper_from_outside_leaves_at_once() -> None:
    wire = Wire()
    wire.stations[0].gatekeeper.mailboxes.submit(GOTO, wire.network.now)
    assert wire.network.next_event == wire.network.now
    assert wire.run(0.101) == [GOTO]


# Time


@pytest.mark.parametrize("bitrate", [125_000, 500_000, 1_000_000])
def test_a_frame_takes_its_bits_at_the_bitrate(bitrate: int) -> None:
    network, times = Network(bitrate), list[float]()
    peer = Peer(DICTIONARIES["core"])
    network.attach(peer)
    network.run(0.1)
    network.observers.append(lambda time, _: times.append(time))
    peer.say(GOTO, GOTO)
    network.run(0.2)
    duration = frame_bits(GOTO) / bitrate
    assert times == pytest.approx([0.1 + duration, 0.1 + 2 * duration])


def test_time_goes_on_without_events() -> None:
    network = Network()
    assert network.next_event == inf
    assert not network.advance(5.0)
    assert network.now == 5.0


def test_time_never_goes_back() -> None:
    network = Network()
    network.run(5.0)
    network.run(3.0)
    assert network.now == 5.0


def test_nodes_boot_when_they_are_switched_on_and_hear_nothing_before() -> None:
    network, frames = Network(), list[tuple[float, Frame]]()
    network.observers.append(lambda time, frame: frames.append((round(time, 3), frame)))
    core, drive = Peer(DICTIONARIES["core"]), Drive(DICTIONARIES["drive"])
    network.attach(core)
    network.attach(drive, start=0.5)
    network.run(0.1)
    core.say(CheckDriveRequest())
    network.run(0.6)
    core.say(CheckDriveRequest())
    network.run(0.7)
    check, answer = PROTOCOL.encode(CheckDriveRequest()), PROTOCOL.encode(CheckDriveResponse())
    assert frames == [
        (0.0, Frame(0x701, b"\0")),
        (0.1, check),
        (0.25, Frame(0x701, b"\5")),
        (0.5, Frame(0x701, b"\5")),
        (0.5, Frame(0x702, b"\0")),
        (0.6, check),
        (0.6, answer),
    ]


def test_a_sender_does_not_hear_its_own_frame() -> None:
    wire = Wire()
    heard = [station.gatekeeper.statistics().unheard for station in wire.stations]
    wire.core.say(Frame(0x6FF))
    wire.run(0.2)
    after = [station.gatekeeper.statistics().unheard for station in wire.stations]
    assert [later - earlier for earlier, later in zip(heard, after)] == [0, 1, 1]


# Losses


def test_a_frame_that_finds_no_mailbox_for_50_ms_is_dropped_and_reported() -> None:
    wire = Wire()
    urgent = [Frame(0x680, bytes(8))] * 300
    wire.core.say(*urgent, Frame(0x6FF))
    wire.run(0.2)
    drops = [report for report in wire.network.reports if report.event is Event.FRAME_DROPPED]
    assert "0x6FF" in {report.name for report in drops}
    assert {round(report.timestamp, 3) for report in drops} == {0.15}
    assert len(wire.frames) + len(drops) == len(urgent) + 1


@pytest.mark.parametrize("count", [1, 3, 100])
def test_what_can_leave_in_50_ms_is_not_lost(count: int) -> None:
    wire = Wire()
    wire.core.say(*(Frame(0x680 + number, bytes(8)) for number in range(count)))
    assert len(wire.run(0.2)) == count
    assert wire.network.reports == []
