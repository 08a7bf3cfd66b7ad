"""A device as its master sees it: NMT states, resets and what they restore, stored settings, its own EDS."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from eurobot_od.device.device import Device
from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.reaction import Reaction
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID, Address, Value
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import Memory, Wire, wired
from tests.kit import lift
from tests.kit.lift import CATALOGUE, CheckCabinResponse, EmergencyOff, Halt, MoveTo, Ride

SAVE, LOAD = (int.from_bytes(each, "little") for each in (b"save", b"load"))
BOOT_UP = Frame(0x702, b"\x00")
MOVE = Frame(0x108, bytes(5))
STOP = Frame(0x104)
READ_DEVICE_TYPE = Frame(0x602, bytes.fromhex("4000100000000000"))

# NMT


@pytest.mark.parametrize(
    ("startup", "state"),
    [(0x8, NmtState.OPERATIONAL), (0x0, NmtState.OPERATIONAL), (0xC, NmtState.PRE_OPERATIONAL)],
)
def test_a_device_boots_into_the_state_that_nmt_startup_says(startup: int, state: NmtState) -> None:
    store = Memory()
    store.save({(0x1F80, 0): startup}, 2)
    wire = wired(store=store)
    assert wire.sent() == [BOOT_UP]
    assert wire.device.state is state


def test_before_its_start_a_device_hears_nothing() -> None:
    device = Device(lift.dictionary("cabin"), catalogue=CATALOGUE)
    assert device.receive(STOP, 0.0).message is None
    assert device.state is NmtState.INITIALISING


COMMANDS = [
    (NmtCommand.START, 0, NmtState.OPERATIONAL, "to all"),
    (NmtCommand.STOP, 0, NmtState.STOPPED, "to all"),
    (NmtCommand.STOP, 2, NmtState.STOPPED, "to this node"),
    (NmtCommand.ENTER_PRE_OPERATIONAL, 2, NmtState.PRE_OPERATIONAL, "to this node"),
    (NmtCommand.STOP, 3, NmtState.OPERATIONAL, "to another node"),
]


@pytest.mark.parametrize(("command", "node_id", "state", "why"), COMMANDS)
def test_commands_to_a_device_or_to_all(command: NmtCommand, node_id: int, state: NmtState, why: str) -> None:
    wire = wired()
    wire.command(command, node_id)
    assert wire.device.state is state, why


@pytest.mark.parametrize("data", [b"", b"\x02", b"\x02\x00\x00", b"\x03\x00", b"\x00\x02"])
def test_unknown_nmt_commands_change_nothing(data: bytes) -> None:
    wire = wired()
    assert wire.send(Frame(NMT_COB_ID, data)) == Reaction([])
    assert wire.device.state is NmtState.OPERATIONAL


SERVICES = [
    (NmtCommand.START, True, True),
    (NmtCommand.ENTER_PRE_OPERATIONAL, False, True),
    (NmtCommand.STOP, False, False),
]


@pytest.mark.parametrize(("command", "pdos", "sdo"), SERVICES)
def test_each_state_has_its_services_and_every_state_the_stops(command: NmtCommand, pdos: bool, sdo: bool) -> None:
    wire = wired()
    wire.command(command)
    assert (wire.send(MOVE).message is not None) == pdos
    assert bool(wire.send(READ_DEVICE_TYPE).frames) == sdo
    assert wire.send(STOP).message == Halt()
    assert wire.send(Frame(0x101)).message == EmergencyOff()


def test_a_device_that_is_not_operational_sends_stops_only() -> None:
    cabin, panel = wired("cabin"), wired("panel")
    for wire in (cabin, panel):
        wire.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    with pytest.raises(StateError, match="cabin is PRE_OPERATIONAL"):
        cabin.device.pdo_service.transmit(CheckCabinResponse())
    with pytest.raises(StateError, match="panel is PRE_OPERATIONAL"):
        panel.device.pdo_service.transmit(MoveTo(0, Ride.NORMAL, 0))
    assert panel.device.pdo_service.transmit(Halt()) == STOP


def test_a_stopped_device_forgets_the_transfer_under_way() -> None:
    wire = wired()
    wire.send(Frame(0x602, bytes.fromhex("4021100000000000")))
    wire.command(NmtCommand.STOP)
    wire.command(NmtCommand.START)
    assert wire.send(Frame(0x602, bytes.fromhex("6000000000000000"))).frames[0].data[0] == 0x80


def test_heartbeats_tell_the_state() -> None:
    wire = wired()
    wire.command(NmtCommand.STOP)
    assert wire.wait(1.0).frames == [error_control(2, NmtState.STOPPED)]


def test_a_watched_node_may_get_another_time_but_not_a_second_one() -> None:
    wire = wired("panel")
    entry = wire.read(0x1016, 1)
    wire.write(0x1016, 1, entry + 1)
    assert wire.refused((0x1016, 2), entry, size=4) == AbortCode.INCOMPATIBLE


# Resets

SETTING: Address = (0x2101, 1)
HEARTBEAT: Address = (0x1017, 0)
RESETS = [
    (NmtCommand.RESET_NODE, {SETTING: 800, HEARTBEAT: 1000}, "all values are the file's again"),
    (NmtCommand.RESET_COMMUNICATION, {SETTING: 333, HEARTBEAT: 1000}, "the communication's are, a setting stays"),
]


@pytest.mark.parametrize(("command", "values", "why"), RESETS)
def test_a_reset_boots_and_restores_the_right_values(
    command: NmtCommand, values: Mapping[Address, Value], why: str
) -> None:
    wire = wired()
    wire.write(*SETTING, 333, size=2)
    wire.write(*HEARTBEAT, 222, size=2)
    wire.sent()
    reaction = wire.command(command, 2)
    assert reaction.reset is not None
    assert wire.sent() == [BOOT_UP]
    assert {address: wire.read(*address) for address in values} == values, why


@pytest.mark.parametrize("command", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_reset_restores_the_pdos(command: NmtCommand) -> None:
    wire = wired()
    before = wire.device.identifiers
    wire.write(0x1403, 1, 1 << 31 | 0x123)
    assert wire.device.identifiers != before
    wire.command(command)
    assert wire.device.identifiers == before


@pytest.mark.parametrize("command", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_new_node_id_takes_effect_with_a_reset(command: NmtCommand) -> None:
    wire = wired()
    wire.write(0x2100, 1, 42, size=1)
    assert wire.device.node_id == 2
    assert wire.command(command).frames == [error_control(42, NmtState.INITIALISING)]
    assert wire.send(READ_DEVICE_TYPE).frames == []
    (answer,) = wire.send(READ_DEVICE_TYPE._replace(cob_id=0x62A)).frames
    assert answer.cob_id == 0x5AA
    assert wire.send(Frame(0x108)).frames[0].cob_id == 0x0AA


# Stored settings


def stored(*written: tuple[Address, int, int]) -> tuple[Wire, Memory]:
    """Return a device with these values (address, value, size) written and stored, and its store."""
    store = Memory()
    wire = wired(store=store)
    for address, value, size in written:
        wire.write(*address, value, size)
    wire.write(0x1010, 1, SAVE)
    return wire, store


def test_stored_values_survive_a_reset_and_a_restart() -> None:
    wire, store = stored((SETTING, 333, 2), (HEARTBEAT, 222, 2))
    wire.write(*SETTING, 444, size=2)
    wire.command(NmtCommand.RESET_NODE)
    for each in (wire, wired(store=store)):
        assert each.read(*SETTING) == 333
        assert each.read(*HEARTBEAT) == 222


def test_stored_pdos_are_live_after_a_restart() -> None:
    wire = wired(store=(store := Memory()))
    wire.map_pdo(0x1403, 0x123, 0x20000110, 0x20000208, 0x20000308, 0x20000410)
    wire.write(0x1010, 1, SAVE)
    assert wired(store=store).device.identifiers == wire.device.identifiers


def test_the_verified_configuration_is_stored_with_it() -> None:
    _, store = stored((SETTING, 333, 2), ((0x1020, 1), 15_000, 4), ((0x1020, 2), 7, 4))
    wire = wired(store=store)
    assert (wire.read(0x1020, 1), wire.read(0x1020, 2)) == (15_000, 7)


def test_measured_values_are_not_stored() -> None:
    wire, store = stored()
    wire.send(Frame(0x108, b"\xff\xff\xff\xff\xff\xff\xff\xff"))
    wire.write(0x1010, 1, SAVE)
    assert wired(store=store).read(0x2000, 1) == 0


def test_restored_defaults_take_effect_with_a_reset() -> None:
    wire, store = stored((SETTING, 333, 2), ((0x2100, 1), 42, 1))
    assert wire.read(0x2100, 1) == 42
    wire.write(0x1011, 1, LOAD)
    assert wire.read(*SETTING) == 333
    wire.command(NmtCommand.RESET_NODE)
    assert wire.device.node_id == 2
    assert wire.device.objects.number(SETTING) == 800
    assert wired(store=store).read(*SETTING) == 800


class FullDisk(Memory):
    """A store that cannot keep anything."""

    def save(self, values: Mapping[Address, Value], node_id: int, kbit: int | None = None) -> None:
        raise OSError("no space left on device")


def test_a_store_that_fails_is_told_to_the_master() -> None:
    wire = wired(store=FullDisk())
    wire.write(*SETTING, 333, size=2)
    assert wire.refused((0x1010, 1), SAVE, size=4) == AbortCode.HARDWARE
    wire.command(NmtCommand.RESET_NODE)
    assert wire.read(*SETTING) == 800


# The EDS


@pytest.mark.parametrize("block", [False, True])
def test_a_device_serves_its_own_eds(block: bool) -> None:
    wire = wired()
    with wire.sdo.sdo.open(0x1021, 0, "rb", block_transfer=block) as served:
        assert served.read() == wire.device.dictionary.content
    assert wire.read(0x1022) == 0


def test_stock_canopen_takes_the_eds_from_the_device() -> None:
    wire = wired()
    del wire[2]
    remote = wire.add_node(2, upload_eds=True)
    assert remote.sdo["Motion"]["Maximum speed"].raw == 800
