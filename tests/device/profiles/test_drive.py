"""A simulated drive on a bus: frames in and out, PDOs as mapped, SYNC, several axes, faults on demand, connection."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.device.profiles import SimulatedDrive, simulated_kind
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import NodeRefused
from eurobot_od.frame import Frame
from eurobot_od.od.cia402 import State, state_of
from eurobot_od.od.dictionary import Dictionary
from tests.client.servo import DOCS, EDS, SERVO
from tests.device.master import NodeWire

STATUS, RPDO_POSITION, TPDO_POSITION = 0x6041, 0x305, 0x285
HOMING_ATTAINED = 1 << 12


def wired(kind: type[SimulatedDrive] = SimulatedDrive) -> NodeWire:
    wire = NodeWire(kind(SERVO))
    wire.command(NmtCommand.START)
    wire.sent()
    return wire


def state(wire: NodeWire) -> State | None:
    return state_of(wire.read(STATUS))


def enable(wire: NodeWire) -> None:
    for word in (6, 7, 15):
        wire.write(0x6040, 0, word, size=2)


def set_point(word: int, target: int) -> Frame:
    return Frame(RPDO_POSITION, word.to_bytes(2, "little") + target.to_bytes(4, "little", signed=True))


def test_the_device_type_says_what_is_simulated() -> None:
    assert simulated_kind(SERVO) is SimulatedDrive
    assert simulated_kind(SERVO, 0) is SimulatedDevice
    text = EDS.read_text(encoding="utf-8")
    nothing, module = (
        Dictionary.read(text.replace("DefaultValue=0x00020192", f"DefaultValue={told}").encode(), EDS, 5)
        for told in ("0", "0x00030191")
    )
    assert simulated_kind(nothing) is SimulatedDrive  # it has a Controlword and a Statusword
    assert simulated_kind(module) is not SimulatedDrive
    assert simulated_kind(module, 402) is SimulatedDrive


def test_an_object_without_a_value_is_as_if_it_were_not_there() -> None:
    text = EDS.read_text(encoding="utf-8")
    for default in ("DefaultValue=2000\n", "DefaultValue=12000\n"):  # following error window, maximum speeds
        text = text.replace(default, "")
    with simulated(SimulatedDrive(Dictionary.read(text.encode(), EDS, 5))) as network:
        network[5].drive402.move_to(5000, velocity=700)
        assert network[5]["Position actual value"].value == pytest.approx(5000, abs=50)


def test_a_drive_without_a_controlword_is_any_device() -> None:
    with simulated(SimulatedDrive.load(DOCS / "motor.eds", 1)) as network:
        assert network.devices[1].value("Temperature") == 20.0


def test_a_set_point_of_a_pdo_comes_with_its_target() -> None:
    wire = wired()
    enable(wire)
    wire.send(set_point(0x0F, 0))
    wire.send(set_point(0x1F, 5000))  # the controlword is mapped first
    wire.run(2)
    assert wire.read(0x6064) == 5000


def test_the_controlword_of_the_mode_before_starts_a_homing_only_when_it_is_written_again() -> None:
    wire = wired()
    enable(wire)
    wire.write(0x6040, 0, 0x1F, size=2)
    wire.write(0x6098, 0, 35, size=1)  # home is here: it is attained at once
    wire.write(0x6060, 0, 6, size=1)
    wire.run(1)
    assert not wire.read(STATUS) & HOMING_ATTAINED
    wire.write(0x6040, 0, 0x1F, size=2)
    wire.run(1)
    assert wire.read(STATUS) & HOMING_ATTAINED


def test_position_and_statusword_go_out_as_they_change() -> None:
    wire = wired()
    enable(wire)
    wire.sent()
    wire.send(set_point(0x1F, 5000))
    wire.run(2)
    positions = [int.from_bytes(each.data[2:], "little") for each in wire.sent() if each.cob_id == TPDO_POSITION]
    assert positions == sorted(positions)
    assert positions[-1] == 5000
    assert len(positions) > 30


def test_a_drive_that_stands_wants_nothing() -> None:
    wire = wired()
    enable(wire)
    wire.run(1)
    wire.sent()
    before = wire.node.next_wakeup
    wire.write(0x1017, 0, 0, size=2)  # no heartbeat either
    assert wire.node.next_wakeup > max(before, wire.now + 3600)


def test_a_value_is_that_of_the_time_at_which_it_is_read() -> None:
    wire = wired()
    enable(wire)
    wire.send(set_point(0x1F, 50_000))
    wire.run(0.5)
    first = wire.read(0x6064)
    wire.now += 0.002  # sooner than the drive would look by itself
    assert 100 < wire.read(0x6064) - first < 200  # 1000 rpm of 4096: 68 a millisecond


def test_cyclic_positions_come_with_sync() -> None:
    wire = wired()
    wire.write(0x1400 + 1, 2, 1, size=1)  # RPDO 2: with each SYNC
    wire.write(0x6060, 0, 8, size=1)
    enable(wire)
    for target in range(10, 1001, 10):
        wire.send(set_point(0x0F, target))
        wire.send(Frame(0x080))
        wire.run(0.001)
    wire.run(0.1)
    assert wire.read(0x6064) == 1000


def test_a_mode_that_is_not_simulated_is_refused_and_not_promised() -> None:
    wire = wired()
    wire.refused((0x6060, 0), 7, size=1)
    assert wire.read(0x6061) == 1
    assert wire.read(0x6502) == 0x3AD
    interpolated = EDS.read_text(encoding="utf-8").replace("DefaultValue=0x000003AD", "DefaultValue=0x000003ED")
    assert NodeWire(SimulatedDrive(Dictionary.read(interpolated.encode(), EDS, 5))).read(0x6502) == 0x3AD


# Several axes


def two_axes() -> Dictionary:
    """Return the servo with a second axis: its controlword, statusword, mode, position and velocity once more."""
    text = EDS.read_text(encoding="utf-8")
    head, _, rest = text.partition("[OptionalObjects]\nSupportedObjects=")
    count, _, rest = rest.partition("\n")
    wanted = (0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x607A, 0x6081, 0x6083, 0x6084)
    sections, listed = "", ""
    for number, index in enumerate(wanted, int(count) + 1):
        section = text.partition(f"[{index:04X}]\n")[2].partition("\n\n")[0]
        sections += f"[{index + 0x800:04X}]\n{section}\n\n".replace("ParameterName=", "ParameterName=Axis 2 ")
        listed += f"{number}=0x{index + 0x800:04X}\n"
    made = f"{head}[OptionalObjects]\nSupportedObjects={int(count) + len(wanted)}\n{listed}{rest}\n{sections}"
    return Dictionary.read(made.encode(), EDS, 5)


def test_each_axis_is_a_drive_of_its_own() -> None:
    with simulated(SimulatedDrive(two_axes())) as network:
        drive = network[5]
        for word in (6, 7, 15):
            drive[0x6840].value = word
        drive[0x687A].value = 3000
        drive[0x6840].value = 0x1F
        network.sleep(2)
        assert (drive[0x6864].value, drive[0x6064].value) == (3000, 0)
        assert state_of(drive[0x6041].value) is State.DISABLED


# Connection and reset


@pytest.fixture
def network() -> Iterator[SimulatedNetwork]:
    with simulated(SimulatedDrive(SERVO)) as made:
        made[5].nmt.start()
        made.sleep(0.1)
        for word in (6, 7, 15):
            made[5]["Controlword"].value = word
        yield made


def test_an_nmt_stop_is_a_lost_connection(network: SimulatedNetwork) -> None:
    network[5].nmt.stop()
    network.sleep(1)
    network[5].nmt.enter_pre_operational()
    network.sleep(0.1)
    assert state_of(network[5][STATUS].value) is State.FAULT
    assert network.devices[5].device.state is NmtState.PRE_OPERATIONAL


def test_a_reset_begins_anew(network: SimulatedNetwork) -> None:
    network[5]["Target position"].value = 4000
    network[5]["Controlword"].value = 0x1F
    network.sleep(2)
    network[5].nmt.reset()
    network.sleep(0.1)
    assert (network[5]["Position actual value"].value, network[5]["Controlword"].value) == (0, 0)
    assert state_of(network[5][STATUS].value) is State.DISABLED


def test_a_mode_of_the_makers_is_refused_with_the_reason(network: SimulatedNetwork) -> None:
    with pytest.raises(NodeRefused, match="incompatib"):
        network[5]["Modes of operation"].value = -3


# Faults on demand: what a master sees that enables, sets a target and waits


def seen(fault: str) -> tuple[State | None, int, bool, bool]:
    """Return the state, the error code, whether the target is reached, and whether EMCY came."""
    wire = wired(DRIVE_FAULTS[fault].given_to(SimulatedDrive))
    enable(wire)
    wire.send(set_point(0x1F, 9000))
    wire.run(3)
    emcy = any(each.cob_id == 0x085 for each in wire.sent())
    return state(wire), wire.read(0x603F), bool(wire.read(STATUS) & 0x400), emcy


SEEN = {
    "following-error": (State.FAULT, 0x8611, False, True),
    "overcurrent": (State.FAULT, 0x2310, False, True),
    "encoder-lost": (State.FAULT, 0x7305, False, True),
    "never-enables": (State.SWITCHED_ON, 0, False, False),
    "target-never-reached": (State.ENABLED, 0, False, False),
}


@pytest.mark.parametrize(("fault", "what"), SEEN.items())
def test_a_fault_is_seen(fault: str, what: tuple[State, int, bool, bool]) -> None:
    assert seen(fault) == what


def test_a_healthy_drive_shows_none_of_them() -> None:
    wire = wired()
    enable(wire)
    wire.send(set_point(0x1F, 9000))
    wire.run(3)
    assert (state(wire), wire.read(0x603F), wire.read(STATUS) & 0x400) == (State.ENABLED, 0, 0x400)


def faulty(fault: str) -> NodeWire:
    wire = wired(DRIVE_FAULTS[fault].given_to(SimulatedDrive))
    enable(wire)
    return wire


def test_quick_stop_ignored() -> None:
    wire = faulty("quick-stop-ignored")
    wire.write(0x6040, 0, 0x02, size=2)
    assert state(wire) is State.ENABLED


def test_fault_reset_ignored() -> None:
    wire = faulty("fault-reset-ignored")
    drive = wire.node
    assert isinstance(drive, SimulatedDrive)
    drive.axes[0].fault(0x1000)
    for word in (0x00, 0x80):
        wire.write(0x6040, 0, word, size=2)
    assert state(wire) is State.FAULT


def test_homing_stuck() -> None:
    wire = faulty("homing-stuck")
    wire.write(0x6060, 0, 6, size=1)
    wire.write(0x6098, 0, 24, size=1)
    wire.write(0x6040, 0, 0x1F, size=2)
    wire.run(20)
    assert wire.read(STATUS) & 0x3400 == 0


def test_enables_at_once() -> None:
    wire = wired(DRIVE_FAULTS["enables-at-once"].given_to(SimulatedDrive))
    wire.write(0x6040, 0, 0x0F, size=2)
    assert state(wire) is State.ENABLED


def test_every_fault_has_its_test() -> None:
    own = {"quick-stop-ignored", "fault-reset-ignored", "homing-stuck", "enables-at-once"}
    assert {*SEEN, *own} == {*DRIVE_FAULTS}
