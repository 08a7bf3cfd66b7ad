"""What all nodes have in common: boot-up, NMT states, frames that are wrong, and when they want to be called."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from tests.kit import lift
from tests.kit.bench import Lift, put
from tests.kit.lift import (
    OFFICE,
    Brake,
    Cabin,
    CheckCabinRequest,
    CheckCabinResponse,
    CheckDoorRequest,
    ConfigureConfirm,
    EmergencyOff,
    FloorRequest,
    FloorResponse,
    Halt,
    MoveConfirm,
    MoveTo,
    PlaceRequest,
    PlaceResponse,
    Ride,
    Sensor,
    StateRequest,
    StateResponse,
    Trouble,
)

PROTOCOL = lift.protocol()
CHECK = PROTOCOL.encode(CheckCabinRequest())
ANSWER = PROTOCOL.encode(CheckCabinResponse())


def cabin() -> Cabin:
    """Return a cabin that has just been switched on."""
    node = Cabin(lift.dictionary("cabin"))
    node.start(0.0)
    return node


# Switching on


@pytest.mark.parametrize(("role", "node_id"), [("panel", 1), ("cabin", 2), ("door", 3)])
def test_a_node_boots_and_is_operational_by_itself(role: str, node_id: int) -> None:
    node = lift.node(role)
    assert node.start(0.0) == [Frame(0x700 + node_id, b"\0")]
    assert node.device.state is NmtState.OPERATIONAL


def test_before_it_is_switched_on_a_node_hears_nothing() -> None:
    assert Cabin(lift.dictionary("cabin")).receive(CHECK, 0.0) == []


@pytest.mark.parametrize(("role", "period"), [("panel", 0.25), ("cabin", 1.0), ("door", 1.0)])
def test_heartbeats_come_at_their_times_however_late_the_node_is_called(role: str, period: float) -> None:
    node = lift.node(role)
    node.start(0.0)
    assert node.next_wakeup == period
    assert node.tick(period - 0.001) == []
    assert node.tick(period + 0.1) == [Frame(0x700 + node.device.node_id, b"\x05")]
    assert node.next_wakeup == 2 * period


# Being called


def test_an_answer_is_among_the_frames_returned() -> None:
    assert cabin().receive(CHECK, 0.5) == [ANSWER]


def test_a_frame_for_another_node_is_nothing() -> None:
    assert cabin().receive(PROTOCOL.encode(CheckDoorRequest()), 0.5) == []


def test_frames_sent_from_outside_wake_the_runner() -> None:
    node, woken = cabin(), list[float]()
    node.wake = lambda: woken.append(node.now)
    node.send(CheckCabinResponse())
    assert woken
    assert node.next_wakeup == 0.0
    assert node.tick(0.1) == [ANSWER]
    assert node.next_wakeup == 1.0


def test_an_action_planned_soon_gets_the_time_of_the_next_tick() -> None:
    node, called = cabin(), list[float]()
    node.soon(called.append)
    assert node.next_wakeup == 0.0
    node.tick(0.25)
    assert called == [0.25]


def test_a_reset_forgets_what_was_planned() -> None:
    node, called = cabin(), list[float]()
    node.at(0.5, called.append)
    node.soon(called.append)
    node.reset()
    node.tick(0.9)
    assert called == []


# NMT states (CiA 301, 7.3.2)

STATES = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
}


def in_state(peer: str, command: NmtCommand) -> Lift:
    """Return a lift with a stand-in, configured, where all nodes have been commanded into an NMT state."""
    bench = Lift(peer)
    if peer == "panel":
        bench.say("panel", OFFICE)
    bench.command(peer, command)
    return bench


@pytest.mark.parametrize("command", STATES)
@pytest.mark.parametrize("stop", [EmergencyOff(), Brake(Trouble.OBSTACLE), Halt()])
def test_stops_act_in_every_nmt_state(command: NmtCommand, stop: Message) -> None:
    bench = in_state("panel", command)
    bench.say("panel", stop)
    assert bench.cabin.device.state is STATES[command]
    assert bench.cabin.stopped_by == stop
    off = isinstance(stop, EmergencyOff)
    assert (bench.cabin.is_off, bench.door.is_off) == (off, off)


@pytest.mark.parametrize("command", STATES)
@pytest.mark.parametrize("stop", [EmergencyOff(), Brake(Trouble.OVERLOAD), Halt()])
def test_stops_are_sent_in_every_nmt_state(command: NmtCommand, stop: Message) -> None:
    bench = in_state("cabin", command)
    bench.panel.send(stop)
    bench.run(0.01)
    assert bench.panel.device.state is STATES[command]
    assert bench.messages()[-1] == stop


OTHERS = [
    MoveTo(1500, Ride.NORMAL, 100),
    StateRequest(),
    FloorRequest(),
    FloorResponse(1000, 1000, 0, Sensor.MAGNET),
    PlaceRequest(),
    OFFICE,
    CheckDoorRequest(),
    CheckCabinRequest(),
]


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
@pytest.mark.parametrize("message", OTHERS)
def test_other_messages_act_in_operational_only(command: NmtCommand, message: Message) -> None:
    bench = in_state("panel", command)
    bench.say("panel", message, within=0.2)
    assert bench.messages() == [OFFICE, ConfigureConfirm(), message]
    assert (bench.cabin.height, bench.cabin.target, bench.cabin.seen) == (0.0, None, None)


def polling(command: NmtCommand) -> Lift:
    """Return a lift whose panel polls the cabin, a stand-in, each 0.6 s, and has got a command."""
    bench = Lift("cabin")
    put(bench.panel, "Polling.Polling period", 600)
    bench.panel.reset()
    bench.command("cabin", command)
    return bench


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
def test_a_node_that_is_not_operational_sends_nothing_else_and_counts_it(command: NmtCommand) -> None:
    bench = polling(command)
    bench.run(3.0)
    assert bench.messages() == []
    assert bench.panel.withheld == 5
    with pytest.raises(StateError, match=f"panel is {STATES[command].name}"):
        bench.panel.send(MoveTo(1500, Ride.NORMAL, 100))


def test_a_node_started_again_goes_on_at_its_times() -> None:
    bench = polling(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.run(5.0)
    bench.command("cabin", NmtCommand.START)
    bench.run(2.0)
    offsets = [time / 0.6 for time in bench.times(PlaceRequest)]
    assert offsets == pytest.approx([9, 10, 11], abs=0.01)


# Frames that are wrong


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "nothing"),
        (bytes(2), "cut in the middle"),
        (bytes(4), "half of the pause"),
    ],
)
def test_a_frame_that_is_too_short_is_refused_whole_and_reported(data: bytes, why: str) -> None:
    bench = Lift("panel")
    bench.say("panel", OFFICE, Frame(PROTOCOL.cob_id(MoveTo), data))
    assert bench.sent(MoveConfirm) == [], why
    assert bench.cabin.target is None
    assert bench.emergencies("cabin") == [0x8210]


def test_a_frame_that_is_too_long_is_read_and_reported() -> None:
    bench = Lift("panel")
    bench.say("panel", Frame(PROTOCOL.cob_id(StateRequest), b"\x55"))
    assert bench.messages() == [StateRequest(), StateResponse(0)]
    assert bench.emergencies("cabin") == [0x8220]


@pytest.mark.parametrize(
    ("node", "frame", "why"),
    [
        ("cabin", "108#FFFFFFFFFF", "every field of a move outside its range"),
        ("cabin", "108#B90B00", "only the height: 3001 mm"),
        ("cabin", "108#003000", "only the ride: there are three kinds"),
        ("cabin", "2C5#0600", "three doors"),
        ("door", "2C5#0600", "three doors"),
        ("cabin", "195#FFFFFF3F00", "a place outside the building"),
    ],
)
def test_a_message_out_of_range_is_counted_and_not_acted_on(node: str, frame: str, why: str) -> None:
    bench = Lift("panel")
    cob_id, _, data = frame.partition("#")
    bench.say("panel", Frame(int(cob_id, 16), bytes.fromhex(data)), within=0.5)
    assert bench.nodes[node].ignored == 1, why
    assert len(bench.log) == 1
    assert (bench.cabin.target, bench.cabin.configuration, bench.cabin.seen) == (None, None, None)


@pytest.mark.parametrize("height", [3001, 4095])
def test_a_value_out_of_range_is_no_answer(height: int) -> None:
    bench = Lift("cabin", "door")
    call = bench.panel.ask(PlaceRequest(), PlaceResponse)
    bench.run(0.01)
    data = PROTOCOL.pack("Place Response", height=height, sway=0, turn=0, sensor=0)
    bench.say("cabin", Frame(PROTOCOL.cob_id(PlaceResponse), data))
    assert not call.done()
    assert bench.panel.places == []
