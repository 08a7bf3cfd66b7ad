"""Laws of the nodes: no frame brings them down, a stop has the last word, nothing moves after a shutdown."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.objects import data_type
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import EmergencyShutdown, EmergencyStop, GotoConfirm, GotoXY, StopDrive
from eurobot_od.robot.model.values import Barriers, Obstacle, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive
from eurobot_od.robot.nodes.motion import AT_REST
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Wheels

COB_IDS = [binding.cob_id for binding in PROTOCOL.bindings]

pauses = st.sampled_from([0.0, 0.001, 0.05, 0.2, 0.6, 2.5])
frames = st.builds(
    Frame,
    st.one_of(st.sampled_from(COB_IDS), st.sampled_from([0x000, 0x601, 0x602, 0x702]), st.integers(0, 0x7FF)),
    st.binary(max_size=8),
)
DATA = [
    (node.node_id, index, subindex, data_type(member).size)
    for node in DICTIONARIES.values()
    for index, members in node.members.items()
    if index in range(0x2000, 0x2100)
    for subindex, member in members.items()
]
"""What messages carry, in all nodes: node-ID, index, sub-index and size in bytes."""


def sdo_write(target: tuple[int, int, int, int], value: int) -> Frame:
    """Return the SDO request that writes a value."""
    node_id, index, subindex, size = target
    content = index.to_bytes(2, "little") + bytes([subindex]) + value.to_bytes(4, "little")
    return Frame(0x600 + node_id, bytes([0x23 | 4 - size << 2]) + content)


values = st.one_of(st.integers(0, 3), st.integers(0, 3000), st.integers(0, 0xFFFFFF))
writes = st.builds(sdo_write, st.sampled_from(DATA), values)
gotos = st.tuples(
    st.integers(0, 3000),
    st.integers(0, 2000),
    st.integers(0, 359),
    st.integers(0, 100),
    st.integers(0, 0xFFFF).map(Barriers),
).map(lambda values: GotoXY(*values))
stops = st.sampled_from([StopDrive(), EmergencyStop(Obstacle.OBJECT), EmergencyStop(Obstacle.ENEMY)])
calls: st.SearchStrategy[Callable[[Core], object]] = st.sampled_from(
    [
        Core.check_nodes,
        lambda core: core.configure_start(TeamColour.RED, 2, 1),
        lambda core: core.goto(1500, 1000, 90, 80),
        lambda core: core.goto(1500, 1000, 90, 80).cancel(),
        Core.position,
        Core.stop,
        lambda core: core.emergency_stop(Obstacle.ENEMY),
        Core.emergency_shutdown,
    ]
)


def is_frame(frame: Frame) -> bool:
    return 0 <= frame.cob_id <= 0x7FF and len(frame.data) <= 8


@pytest.mark.parametrize("role", ROLES)
@given(steps=st.lists(st.tuples(pauses, st.one_of(frames, writes)), max_size=20))
def test_no_frame_brings_a_node_down(role: str, steps: list[tuple[float, Frame]]) -> None:
    node = ROLES[role](DICTIONARIES[role])
    now = 0.0
    node.start(now)
    for pause, frame in steps:
        now += pause
        sent = node.tick(now)
        node.device.plan.soonest = node.next_wakeup  # as whoever keeps the time has looked
        sent += node.receive(frame, now)
        assert all(map(is_frame, sent))
        assert node.device.plan.soonest <= node.next_wakeup


@given(steps=st.lists(st.tuples(pauses, st.one_of(calls, frames)), max_size=20))
def test_no_order_of_calls_and_frames_brings_the_core_down(
    steps: list[tuple[float, Callable[[Core], object] | Frame]],
) -> None:
    core = Core(DICTIONARIES["core"])
    now = 0.0
    core.start(now)
    for pause, step in steps:
        now += pause
        core.tick(now)
        if isinstance(step, Frame):
            core.receive(step, now)
            continue
        with suppress(LocalError):  # told to the caller: not operational, or shut down
            step(core)


class Ride:
    """A drive at the red team's start place, and how far its wheels have gone."""

    def __init__(self) -> None:
        self.wheels = Wheels()
        self.now = 0.0
        self.drive = Drive(DICTIONARIES["drive"], self.wheels)
        self.sent = self.drive.start(0.0)
        self.say(RED)

    def say(self, message: Message | Frame) -> None:
        frame = message if isinstance(message, Frame) else PROTOCOL.encode(message)
        self.sent = self.drive.receive(frame, self.now)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while (wakeup := self.drive.next_wakeup) <= end:
            self.now = wakeup
            self.drive.tick(wakeup)
        self.now = end

    @property
    def steps(self) -> int:
        return len(self.wheels.commands)


@given(rides=st.lists(st.tuples(gotos, pauses), min_size=1, max_size=5), stop=stops)
def test_after_a_stop_the_robot_comes_to_rest(rides: list[tuple[GotoXY, float]], stop: Message) -> None:
    ride = Ride()
    for goto, pause in rides:
        ride.say(goto)
        ride.run(pause)
    ride.say(stop)
    ride.run(0.4)  # 800 mm/s at 2400 mm/s2, 240 deg/s at 720 deg/s2
    assert (ride.drive.moving, ride.drive.goto) == (False, None)
    assert set(ride.wheels.commands[-1:]) <= {AT_REST}
    steps = ride.steps
    ride.run(5.0)
    assert ride.steps == steps


RELEASES = {PROTOCOL.cob_id("Start Configuration Set"), 0x000}
"""COB-IDs that may end the safe state: a start configuration, an NMT command."""


@given(goto=gotos, messages=st.lists(st.one_of(gotos, stops, frames.filter(lambda f: f.cob_id not in RELEASES))))
def test_after_a_shutdown_nothing_moves_and_no_goto_is_confirmed(goto: GotoXY, messages: list[Message | Frame]) -> None:
    ride = Ride()
    ride.say(goto)
    ride.run(1.0)
    ride.say(EmergencyShutdown())
    ride.run(0.5)
    assert ride.wheels.commands[-1] == AT_REST
    for message in messages:
        steps = ride.steps
        ride.say(message)
        assert PROTOCOL.cob_id(GotoConfirm) not in [frame.cob_id for frame in ride.sent]
        ride.run(0.1)
        assert set(ride.wheels.commands[steps:]) <= {AT_REST}
    assert ride.drive.safe


@pytest.mark.parametrize("command", NmtCommand)
def test_an_nmt_command_never_moves_a_robot_at_rest(command: NmtCommand) -> None:
    ride = Ride()
    ride.say(Frame(0x000, bytes([command, 0])))
    ride.run(1.0)
    assert set(ride.wheels.commands) <= {AT_REST}
