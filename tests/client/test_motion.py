"""Stops in simulated time: beside another master, with answers lost, of a deaf drive. Enabling at rest."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import inf
from typing import Any

import pytest

from eurobot_od.bus.simulated.network import ON_TIME
from eurobot_od.client.lifeline import LOST_AFTER, arm, disarm, free_id, holds
from eurobot_od.client.motion import AxisAddress, AxisObjects, AxisStop, NodeStop, StopKind
from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.errors import DriveError
from eurobot_od.frame import Frame
from eurobot_od.od.cia402 import State
from eurobot_od.od.sdo_channels import SdoChannel
from tests.client.servo import SERVO

REQUESTS, ANSWERS = 0x605, 0x585
AXIS = AxisObjects(AxisAddress(5, 1), SdoChannel.default(5), SERVO)
ENABLED = 0x0F


@contextmanager
def turning(velocity: int = 1000, fault: str | None = None) -> Iterator[SimulatedNetwork]:
    """Run a drive that turns, in profile velocity mode."""
    kind = DRIVE_FAULTS[fault].given_to(SimulatedDrive) if fault else SimulatedDrive
    with simulated(kind(SERVO)) as network:
        network[5].drive402.velocity = velocity
        network.sleep(1)
        assert speed(network) > 0
        yield network


def speed(network: SimulatedNetwork) -> float:
    return network.devices[5].axes[0].motor.velocity  # type: ignore[attr-defined, no-any-return]


def state(network: SimulatedNetwork) -> State:
    return network.devices[5].axes[0].state  # type: ignore[attr-defined, no-any-return]


def carry_out(
    network: SimulatedNetwork,
    stop: AxisStop,
    seconds: float,
    beside: Callable[[], None] = lambda: None,
    loses: Callable[[], bool] = lambda: False,
) -> float:
    """Run a stop until it is done, or for some seconds; return how long the drive turned on."""
    master, begun, stood = network.master, network.master.clock(), inf

    def hear(cob_id: int, data: bytes, _: float) -> None:
        if not loses():
            for frame in stop.receive(Frame(cob_id, data), master.clock()) or ():
                master.send(*frame)

    with master.observed(hear):
        while not stop.done and master.clock() < begun + seconds:
            for frame in stop.due(master.clock()):
                master.send(*frame)
            beside()
            network.sleep(0.005)
            if abs(speed(network)) < 0.001:
                stood = min(stood, master.clock() - begun)
    return stood


def test_a_halt_stands_and_leaves_the_targets_at_rest() -> None:
    with turning() as network:
        stop = AxisStop(AXIS, network.master.clock(), controlword=ENABLED)
        assert carry_out(network, stop, 1) < 0.3
        assert stop.done
        assert (state(network), network[5][0x60FF].value) == (State.ENABLED, 0)


def test_without_a_controlword_of_ours_a_halt_is_a_quick_stop() -> None:
    with turning() as network:
        stop = AxisStop(AXIS, network.master.clock())
        carry_out(network, stop, 1)
        assert stop.done
        assert state(network) is State.DISABLED


def test_each_request_is_a_stop_or_comes_after_one_within_100_ms() -> None:
    """Nothing is read before the halt, and the halt is repeated whatever is lost."""
    with turning() as network:
        halts: list[float] = []
        sent: list[Frame] = []

        def note(now: float, frame: Frame) -> None:
            if frame.cob_id == REQUESTS:
                sent.append(frame)
                halts.extend([now] if frame.data[:3] == bytes.fromhex("2B4060") else [])

        network.simulation.observers.append(note)
        stop = AxisStop(AXIS, network.master.clock(), controlword=ENABLED)
        carry_out(network, stop, 1.9, loses=lambda: True)
        assert sent[0].data == bytes.fromhex("2B4060000F010000")
        assert max(late - early for early, late in pairwise(halts)) <= 0.1
        assert not stop.done


def foreign_reads(network: SimulatedNetwork, period: float) -> Callable[[], None]:
    """Return what has another master read the position each `period` seconds."""
    due = [network.master.clock()]

    def read() -> None:
        if network.master.clock() >= due[0]:
            due[0] += period
            network.master.send(REQUESTS, bytes.fromhex("4064600000000000"))

    return read


@pytest.mark.parametrize("period", [0.02, 0.1])
def test_beside_another_master_it_stands_as_quickly(period: float) -> None:
    with turning() as network:
        stop = AxisStop(AXIS, network.master.clock(), controlword=ENABLED)
        assert carry_out(network, stop, 1.5, foreign_reads(network, period)) < 0.3
        assert stop.done


@pytest.mark.parametrize("seed", range(20))
def test_with_one_frame_in_three_lost_it_stands(seed: int) -> None:
    chance = random.Random(seed)

    def is_lost() -> bool:
        return chance.random() < 1 / 3

    with turning() as network:
        network.simulation.disturb = lambda _, f: () if f.cob_id == REQUESTS and is_lost() else ON_TIME
        stop = AxisStop(AXIS, network.master.clock(), controlword=ENABLED)
        assert carry_out(network, stop, 4, loses=is_lost) < 1.0
        assert stop.done


class DeafToHalt(SimulatedDrive):
    """Does not see the halt bit, and if it is `deaf` no quick stop either."""

    deaf = False

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        words = {"2B4060000F010000": "2B4060000F000000"}
        if self.deaf:
            words["2B40600002000000"] = "2B4060000F000000"
        data = words.get(frame.data.hex().upper())
        is_target = frame.data[:3] == bytes.fromhex("23FF60")
        if frame.cob_id == REQUESTS and is_target and not any(frame.data[4:]):
            return [Frame(ANSWERS, bytes.fromhex("60FF600000000000"))]  # nor does it take a target of 0
        return super().receive(Frame(frame.cob_id, bytes.fromhex(data)) if data else frame, now)


class Deaf(DeafToHalt):
    deaf = True


@pytest.mark.parametrize(("kind", "least", "most"), [(DeafToHalt, 0.5, 0.9), (Deaf, 1.0, 1.9)])
def test_a_drive_that_does_not_obey_meets_the_next_step_of_the_ladder(
    kind: type[SimulatedDrive], least: float, most: float
) -> None:
    with simulated(kind(SERVO)) as network:
        network[5].drive402.velocity = 100
        network.sleep(1)
        stop = AxisStop(AXIS, network.master.clock(), controlword=ENABLED)
        assert least < carry_out(network, stop, 3) < most
        assert state(network) is State.DISABLED


def test_a_drive_of_which_nothing_is_heard_is_said_to_be_unknown() -> None:
    with turning() as network:
        network.simulation.disturb = lambda _, frame: () if frame.cob_id == REQUESTS else ON_TIME
        axis = network[5].drive402
        said = "halt, quick stop, disable voltage, NMT stop sent for 2.1 s, none confirmed; nothing was heard of it"
        with pytest.raises(DriveError, match=said):
            axis.halt()
        assert network.devices[5].device.state is NmtState.STOPPED
        network.sleep(1)
        assert abs(speed(network)) < 0.001, "the NMT command was heard"


def test_a_drive_in_ready_is_not_enabled_by_a_halt() -> None:
    with simulated(SimulatedDrive(SERVO)) as network:
        axis = network[5].drive402
        axis.bring_to(State.READY)
        stop = AxisStop(AXIS, network.master.clock())
        carry_out(network, stop, 1)
        assert stop.done
        assert state(network) is State.DISABLED


def test_a_node_is_stopped_until_its_heartbeat_says_so() -> None:
    stop = NodeStop(9, 0.0)
    assert stop.due(0.0) == stop.due(0.1) == [Frame(0, bytes([2, 9]))]
    stop.receive(Frame(0x709, b"\5"), 0.15)
    assert not stop.done
    assert stop.text(0.2) == "NMT stop sent for 0.2 s; its heartbeat says operational"
    stop.receive(Frame(0x709, b"\4"), 0.25)
    assert stop.done
    assert stop.due(1.0) == []


# Enabling begins at rest


LEFT_BEHIND: list[tuple[int, dict[int, Any]]] = [
    (3, {0x60FF: 1000}),
    (4, {0x6071: 200}),
    (9, {0x60FF: 1000, 0x60B1: 500}),
    (10, {0x6071: 200}),
    (8, {0x607A: 50_000}),
    (1, {0x607A: 50_000}),
]


@pytest.mark.parametrize(("mode", "objects"), LEFT_BEHIND)
def test_enabling_moves_nothing_whatever_was_left_in_the_targets(mode: int, objects: dict[int, Any]) -> None:
    with simulated(SimulatedDrive(SERVO)) as network:
        drive = network[5]
        drive[0x6060].value = mode
        for index, value in objects.items():
            drive[index].value = value
        drive.drive402.enable()
        network.sleep(1)
        assert state(network) is State.ENABLED
        assert abs(speed(network)) < 0.001
        assert abs(drive.drive402.position) <= 1


class KeepsTarget(SimulatedDrive):
    """Refuses to have its target velocity written."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == REQUESTS and frame.data[:3] == bytes.fromhex("23FF60"):
            return [Frame(ANSWERS, bytes.fromhex("80FF600021000008"))]
        return super().receive(frame, now)


def test_a_drive_whose_target_cannot_be_written_is_enabled_with_halt() -> None:
    with simulated(KeepsTarget(SERVO, given={(0x60FF, 0): 1000, (0x6060, 0): 3})) as network:
        network[5].drive402.enable()
        network.sleep(1)
        assert state(network) is State.ENABLED
        assert abs(speed(network)) < 0.001
        assert network[5][0x6040].value == 0x010F


def test_a_move_that_was_halted_does_not_go_on_when_the_next_one_is_ordered() -> None:
    with simulated(SimulatedDrive(SERVO)) as network:
        axis = network[5].drive402
        axis.begin_move(1_000_000, 1000)
        network.sleep(1)
        axis.halt()
        halted = axis.position
        axis.begin_move(-100, 1000, relative=True)
        network.sleep(1)
        assert axis.position < halted + 50


# The drive watches us


def test_a_drive_that_watches_us_makes_a_quick_stop_when_we_are_gone() -> None:
    with turning() as network:
        node = network.master.node(5)
        line = arm(node, [0], 126)  # and nothing is sent any more: the program is killed at once
        assert not line.lacks
        assert holds(node, line, 126)
        network.sleep(LOST_AFTER - 0.05)
        assert speed(network) > 0
        network.sleep(0.4)
        assert abs(speed(network)) < 0.001
        assert state(network) is State.DISABLED


def test_lifeline_restores_all_changed_objects() -> None:
    with simulated(SimulatedDrive(SERVO, given={(0x1016, 1): 0x0001_0000 | 1000, (0x6007, 0): 2})) as network:
        node, drive = network.master.node(5), network[5]
        line = arm(node, [0], 127)
        assert [drive[0x1016, sub].value for sub in (1, 2)] == [0x0001_03E8, 0x007F_0200], "the free entry"
        disarm(node, line)
        assert ([drive[0x1016, sub].value for sub in (1, 2)], drive[0x6007].value) == ([0x0001_03E8, 0], 2)


def test_an_entry_that_a_killed_program_has_left_is_taken_again() -> None:
    with simulated(SimulatedDrive(SERVO)) as network:
        node = network.master.node(5)
        first = arm(node, [0], 127)
        second = arm(node, [0], 127)
        assert first.entry == second.entry
        disarm(node, second)
        assert network[5][0x1016, 1].value == 0


@pytest.mark.parametrize("code", [0, 1, 2, 3])
def test_changes_of_a_killed_program_are_restored_by_the_next_one(code: int) -> None:
    with simulated(SimulatedDrive(SERVO, given={(0x6007, 0): code})) as network:
        node = network.master.node(5)
        arm(node, [0], 127)
        assert network[5][0x6007].value == 3
        for _ in range(2):  # the second one is killed, too
            line = arm(node, [0], 127)
            assert not line.left
        disarm(node, line)
        assert (network[5][0x6007].value, network[5][0x1016, 1].value) == (code, 0)


def test_unknown_former_values_of_a_killed_program_are_reported() -> None:
    with simulated(SimulatedDrive(SERVO, given={(0x6007, 0): -5})) as network:
        node = network.master.node(5)
        assert not arm(node, [0], 127).left
        assert arm(node, [0], 127).left.startswith("a program that was killed has left 3 in 0x6007")


def test_our_node_id_is_one_that_nobody_else_has() -> None:
    assert free_id([]) == 127
    assert free_id([127, 126, 5]) == 125
    assert free_id([30], 30) == 29
    assert free_id(range(1, 31), 30) == 127
    assert StopKind("halt") is StopKind.HALT
