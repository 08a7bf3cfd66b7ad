"""Stock canopen as master of live nodes on an in-process bus: it reads, configures, resets, and the bus follows."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import can
import canopen
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.controller import Report
from eurobot_od.device.simulated import SimulatedDevice
from tests.device import io_module
from tests.kit import lift
from tests.kit.lift import CheckCabinRequest

PATIENCE = 60.0
"""Time after which no answer is expected, in s."""


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.name)


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set the timeout of stock canopen above its 0.3 s, for a busy machine."""
    monkeypatch.setattr("canopen.sdo.client.SdoClient.RESPONSE_TIMEOUT", PATIENCE)


def bus(channel: str) -> can.BusABC:
    return can.Bus(interface="virtual", channel=channel)


class FilteringBus(VirtualBus):
    """A bus whose driver has filters of its own."""

    def _apply_filters(self, filters: Any) -> None:
        """Take the filters, as a driver does that hands them to its hardware."""


def connected(network: canopen.Network) -> canopen.Network:
    """Connect a network whose notifier ends quickly."""
    network.NOTIFIER_CYCLE = 0.05
    return network.connect()


@pytest.fixture
def cabin(channel: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Live]:
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", (__name__, FilteringBus.__name__))
    with Live.node(FilteringBus(channel), lift.node("cabin")) as live:
        yield live


@pytest.fixture
def network(channel: str) -> Iterator[canopen.Network]:
    with canopen.Network(bus(channel)) as network:
        yield connected(network)


class Expected:
    """Waits for a frame with one COB-ID."""

    def __init__(self, network: canopen.Network, cob_id: int) -> None:
        self._came = threading.Event()
        self._data = b""
        network.subscribe(cob_id, self._take)

    def _take(self, _: int, data: bytearray, __: float) -> None:
        self._data = bytes(data)
        self._came.set()

    def data(self) -> bytes:
        assert self._came.wait(PATIENCE)
        return self._data


@pytest.mark.long
@pytest.mark.usefixtures("cabin")
def test_a_master_reads_the_eds_rewrites_all_pdos_and_hears_the_boot_up(network: canopen.Network) -> None:
    remote: Any = network.add_node(2, upload_eds=True)
    for pdos in (remote.tpdo, remote.rpdo):
        pdos.read()
        pdos.save()
    boot_up = Expected(network, 0x702)
    remote.nmt.state = "RESET"
    assert boot_up.data() == b"\x00"


@pytest.mark.long
def test_a_changed_identifier_is_live_on_the_bus(network: canopen.Network, cabin: Live) -> None:
    remote: Any = network.add_node(2, upload_eds=True)
    remote.rpdo.read()
    request = next(pdo for pdo in remote.rpdo.values() if pdo.cob_id == 0x3C5)
    request.cob_id = 0x123
    request.save()
    answer = Expected(network, 0x405)
    network.send_message(0x123, b"")
    assert answer.data() == b""
    assert 0x123 in {each["can_id"] for each in cabin.bus.filters or ()}
    assert 0x3C5 not in {each["can_id"] for each in cabin.bus.filters or ()}


def test_a_listener_of_the_program_follows_a_changed_identifier(channel: str) -> None:
    live = Live.node(bus(channel), lift.node("cabin"))
    queue = live.controller.add_queue(CheckCabinRequest)
    with live, canopen.Network(bus(channel)) as network:
        connected(network)
        remote: Any = network.add_node(2, lift.dictionary("cabin").objects)
        remote.rpdo.read()
        request = next(pdo for pdo in remote.rpdo.values() if pdo.cob_id == 0x3C5)
        request.cob_id = 0x123
        request.save()
        network.send_message(0x123, b"")
        received = queue.get(PATIENCE)
    assert received is not None
    assert received.message == CheckCabinRequest()


CONTROLLER = [
    (0x004, "0001000000000000", "1081", "a receive buffer has overflown"),
    (0x004, "0010000000000000", "2081", "error passive"),
    (0x100, "0000000000000000", "4081", "restarted after bus-off"),
]
"""Error frames as Linux has them."""


@pytest.mark.parametrize(("identifier", "data", "code", "why"), CONTROLLER)
def test_controller_errors_become_emergencies(
    channel: str, network: canopen.Network, identifier: int, data: str, code: str, why: str
) -> None:
    emergency = Expected(network, 0x082)
    message = can.Message(
        arbitration_id=identifier, data=bytes.fromhex(data), is_error_frame=True, is_extended_id=False
    )
    assert network.bus is not None
    with Live.node(bus(channel), lift.node("cabin")):
        network.bus.send(message)
        assert emergency.data()[:2] == bytes.fromhex(code), why


# Anybody's device


@pytest.fixture
def module(channel: str) -> Iterator[Live]:
    with Live.node(bus(channel), SimulatedDevice(io_module.dictionary())) as live:
        yield live


@pytest.fixture
def eds(tmp_path: Path) -> str:
    file = tmp_path / "module.eds"
    file.write_text(io_module.TEXT, encoding="ascii")
    return str(file)


CHANGED, CYCLICAL, REQUESTED = 0x185, 0x285, 0x385


@pytest.mark.usefixtures("module")
def test_a_master_uses_every_transfer_with_anybodys_device(network: canopen.Network, eds: str) -> None:
    remote: Any = network.add_node(5, eds)
    channel = remote.sdo["Channel"]
    channel[1].raw = -1234
    assert (channel[1].raw, channel[2].raw, channel[3].raw, channel[4].raw) == (-1234, 1.5, True, "valve A")
    content = bytes(range(256)) * 5
    remote.sdo.download(0x2200, 0, content)
    assert remote.sdo.upload(0x2200, 0) == content
    with remote.sdo["Firmware"].open("wb", size=2000, block_transfer=True) as file:
        file.write(bytes(2000))
    with remote.sdo["Firmware"].open("rb", block_transfer=True) as file:
        assert file.read() == bytes(2000)
    with pytest.raises(canopen.SdoAbortedError, match="Object does not exist"):
        remote.sdo.upload(0x4000, 0)


@pytest.mark.usefixtures("module")
def test_a_master_switches_anybodys_device_and_hears_its_heartbeat(network: canopen.Network, eds: str) -> None:
    remote: Any = network.add_node(5, eds)
    remote.sdo["Producer heartbeat time"].raw = 20
    for state in ("OPERATIONAL", "STOPPED", "PRE-OPERATIONAL"):
        remote.nmt.state = state
        heard = {remote.nmt.wait_for_heartbeat(PATIENCE) for _ in range(3)}
        assert state in heard


@pytest.mark.usefixtures("module")
def test_a_master_hears_changes_syncs_and_asks(network: canopen.Network, eds: str) -> None:
    remote: Any = network.add_node(5, eds)
    remote.tpdo.read()
    changed = Expected(network, CHANGED)
    remote.nmt.state = "OPERATIONAL"
    assert changed.data() == bytes.fromhex("fbff0000")
    changed = Expected(network, CHANGED)
    network.send_message(0x205, b"\x07\x00")
    assert changed.data() == bytes.fromhex("fbff0700")
    cyclical = Expected(network, CYCLICAL)
    network.sync.transmit()
    assert cyclical.data() == bytes.fromhex("0000c03f01")
    requested = Expected(network, REQUESTED)
    remote.tpdo[3].remote_request()
    assert requested.data() == b"valve A\0"


@pytest.mark.usefixtures("module")
def test_a_master_guards_anybodys_device(network: canopen.Network) -> None:
    for answer in (b"\x7f", b"\xff"):
        guarded = Expected(network, 0x705)
        network.send_message(0x705, b"", remote=True)
        assert guarded.data() == answer


def test_a_program_that_fails_at_a_remote_frame_is_reported_and_the_device_restarted(channel: str) -> None:
    class Broken(SimulatedDevice):
        READERS: ClassVar = {"Channel.Entry 4": lambda _: 1 / 0}

    reports: list[Report] = []
    live = Live.node(bus(channel), Broken(io_module.dictionary()), report=reports.append)
    with live, canopen.Network(bus(channel)) as network:
        connected(network)
        network.send_message(0x000, b"\x01\x05")
        booted = Expected(network, 0x705)
        network.send_message(REQUESTED, b"", remote=True)
        assert booted.data() == b"\x00"
    assert any("division by zero" in report.text for report in reports)
