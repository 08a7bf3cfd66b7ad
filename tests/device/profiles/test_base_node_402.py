"""Stock canopen's BaseNode402 as the judge: it enables, homes and moves our simulated drive in all its modes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from interop_rows.bench import new_channel, open_bus

from eurobot_od.bus.live import Live
from eurobot_od.device.profiles import SimulatedDrive
from tests.client.servo import SERVO

NODE_ID = 5
LONGEST = 10.0
"""Timeout of a motion on a busy machine, in s; most take less than 1 s."""


class PatientMaster(BaseNode402):
    """The master that waits for an answer as long as a busy machine takes; canopen's gives up within a second."""

    TIMEOUT_SWITCH_OP_MODE = TIMEOUT_CHECK_TPDO = LONGEST
    TIMEOUT_SWITCH_STATE_FINAL = TIMEOUT_SWITCH_STATE_SINGLE = LONGEST
    TIMEOUT_RESET_FAULT = 0.05  # canopen waits it out, and then does what resets the fault


@pytest.fixture
def drive() -> Iterator[Any]:
    """Run the drive of the documentation on a bus inside the process, with canopen's master of it."""
    channel = new_channel()
    network: Any = canopen.Network()
    with Live.node(open_bus(channel), SimulatedDrive(SERVO.renumbered(NODE_ID), travel=(-4, 4))):
        network.connect(interface="virtual", channel=channel)
        master: Any = PatientMaster
        node = network.add_node(master(NODE_ID, SERVO.objects))
        node.sdo.RESPONSE_TIMEOUT = LONGEST
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        network.sync.start(0.01)  # statusword and velocity come with each SYNC
        try:
            yield node
        finally:
            network.sync.stop()
            network.disconnect()


def until(node: Any, reached: Callable[[], bool]) -> None:
    """Wait for a frame of the drive after which something is reached."""
    end = time.monotonic() + LONGEST
    while not reached():
        assert time.monotonic() < end
        node.tpdo[1].wait_for_reception(1.0)


def target_reached(node: Any) -> bool:
    return bool(node.statusword & 0x400)


def test_canopens_drive_goes_through_the_states(drive: Any) -> None:
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED", "SWITCHED ON", "SWITCH ON DISABLED"):
        drive.state = state
        assert drive.state == state


def test_canopens_drive_resets_a_fault(drive: Any) -> None:
    drive.state = "OPERATION ENABLED"
    drive.sdo[0x6065].raw = 1  # following error window
    drive.sdo[0x6066].raw = 0
    drive.sdo[0x6083].raw = 0xFFFF_FFFF  # an acceleration that no motor follows
    drive.sdo[0x607A].raw = 8000
    drive.controlword = 0x1F
    until(drive, drive.is_faulted)
    assert drive.sdo[0x603F].raw == 0x8611
    drive.reset_from_fault()
    assert drive.state == "OPERATION ENABLED"


@pytest.mark.parametrize("method", [7, 17, 18, 24, 33, 35, 37])
def test_base_node_402_homes_our_drive(drive: Any, method: int) -> None:
    drive.sdo[0x6098].raw = method
    drive.sdo[0x6099][1].raw = 600
    drive.sdo[0x6099][2].raw = 200
    drive.sdo[0x609A].raw = 60_000
    assert drive.homing(timeout=LONGEST)
    assert drive.is_homed()
    assert abs(drive.sdo[0x6064].raw) < 200  # at home, but for the way in which it has stopped


def test_canopens_drive_homes_again_after_other_modes(drive: Any) -> None:
    drive.sdo[0x6098].raw = 35
    for _ in range(2):
        assert drive.homing(timeout=LONGEST)
        drive.op_mode = "PROFILED POSITION"  # canopen leaves bit 4 set
        assert drive.is_homed(restore_op_mode=True)


def test_canopens_drive_moves_to_positions(drive: Any) -> None:
    drive.op_mode = "PROFILED POSITION"
    drive.state = "OPERATION ENABLED"
    for target in (4000, -500):
        drive.sdo[0x607A].raw = target
        drive.controlword = 0x3F
        until(drive, lambda: drive.statusword & 0x1000 != 0)
        drive.controlword = 0x0F
        until(drive, lambda: target_reached(drive))
        assert drive.sdo[0x6064].raw == pytest.approx(target, abs=50)  # the position window


def test_canopens_drive_turns_at_velocities(drive: Any) -> None:
    drive.op_mode = "PROFILED VELOCITY"
    drive.state = "OPERATION ENABLED"
    drive.sdo[0x60FF].raw = 60
    until(drive, lambda: drive.tpdo[1]["Velocity actual value"].raw == 60)
    drive.sdo[0x60FF].raw = 0
    until(drive, lambda: drive.tpdo[1]["Velocity actual value"].raw == 0)


def test_canopens_drive_follows_a_position_with_each_sync(drive: Any) -> None:
    drive.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    drive.state = "OPERATION ENABLED"
    for target in range(0, 2001, 50):
        drive.sdo[0x607A].raw = target
        drive.tpdo[1].wait_for_reception(1.0)
    until(drive, lambda: drive.sdo[0x6064].raw == 2000)


def test_canopens_drive_follows_a_velocity_with_each_sync(drive: Any) -> None:
    drive.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
    drive.state = "OPERATION ENABLED"
    drive.sdo[0x60FF].raw = -60
    until(drive, lambda: drive.tpdo[1]["Velocity actual value"].raw == -60)


def test_a_mode_that_the_drive_cannot_is_not_taken(drive: Any) -> None:
    drive.op_mode = "PROFILED VELOCITY"
    with pytest.raises(TypeError, match="not suppported"):  # 0x6502 does not have its bit
        drive.op_mode = "INTERPOLATED POSITION"
    with pytest.raises(canopen.SdoAbortedError):
        drive.sdo[0x6060].raw = 7
    assert drive.op_mode == "PROFILED VELOCITY"


def test_canopens_drive_turns_with_a_torque(drive: Any) -> None:
    drive.op_mode = "PROFILED TORQUE"
    drive.state = "OPERATION ENABLED"
    drive.sdo[0x6087].raw = 0  # no slope
    drive.sdo[0x6071].raw = 40
    until(drive, lambda: drive.sdo[0x6077].raw == 40 and drive.sdo[0x606C].raw > 0)
    drive.sdo[0x6071].raw = 0
    until(drive, lambda: drive.sdo[0x606C].raw == 0)
