"""A device without a node-ID: found, identified and configured by LSS, and what it keeps over a reset (CiA 305)."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from eurobot_od.client import lss
from eurobot_od.client.lss import perform
from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.objects import FileStore
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import LssState
from tests.client.wired import wired

DOCS = Path(__file__).parents[2] / "docs"
MOTOR, SERVO = DOCS / "motor.eds", DOCS / "servo.eds"
IDENTITY = Identity(0, 5, 0x10000, 1234)
BOOT_UP = Frame(0x705, b"\0")
SERIAL = (0x1018, 4)


def motor(
    node_id: int = 255, store: FileStore | None = None, serial: int = 1234, file: Path = MOTOR
) -> SimulatedDevice:
    """Return a motor, or the device of another file, that is switched on with a node-ID."""
    dictionary = Dictionary.load(file, 127)
    slave = LssSlave.of(dictionary, Commissioning(node_id), serial)
    device = SimulatedDevice(dictionary, store=store, lss=slave, given={SERIAL: serial})
    device.start(0.0)
    return device


def ask(device: SimulatedDevice, text: str, now: float = 1.0) -> str:
    """Send a request, filled with zeros, and return the answers without those at their end."""
    request = bytes.fromhex(text).ljust(8, b"\0")
    return " ".join(str(each) for each in device.receive(Frame(0x7E5, request), now))


def configured(node_id: int) -> SimulatedDevice:
    """Return a device that LSS has given a node-ID, in waiting state."""
    device = motor()
    for request in ("04 01", f"11 {node_id:02X}", "04 00"):
        ask(device, request)
    return device


# A device without a node-ID


def test_without_a_node_id_it_sends_nothing_and_hears_only_lss() -> None:
    device = motor()
    assert (device.device.node_id, device.device.state) == (255, NmtState.INITIALISING)
    assert device.device.identifiers == [0x7E5]
    assert device.next_wakeup == inf
    assert device.receive(Frame(0x000, b"\x01\x00"), 1.0) == []  # NMT: start all


def test_a_device_boots_with_its_node_id_once_configuring_has_ended() -> None:
    device = motor()
    ask(device, "04 01")
    assert ask(device, "11 05") == "7E4#1100000000000000"
    assert device.device.node_id == 255
    assert device.receive(Frame(0x7E5, bytes.fromhex("0400000000000000")), 1.0) == [BOOT_UP]
    assert (device.device.node_id, device.device.state) == (5, NmtState.PRE_OPERATIONAL)
    assert device.device.objects.number((0x1800, 1)) & 0x7FF == 0x185  # $NODEID+0x180 of its file


def test_a_configured_device_takes_its_new_node_id_with_a_reset_of_the_communication() -> None:
    device = configured(5)
    for request in ("04 01", "11 09", "04 00"):
        ask(device, request)
    assert device.device.node_id == 5
    assert device.receive(Frame(0x000, b"\x82\x05"), 2.0) == [Frame(0x709, b"\0")]


def test_a_reset_of_the_node_goes_back_to_what_was_stored() -> None:
    device = configured(5)
    assert device.receive(Frame(0x000, b"\x81\x05"), 2.0) == []
    assert (device.device.node_id, device.device.state) == (255, NmtState.INITIALISING)
    for request in ("04 01", "11 06", "17", "11 07", "04 00"):
        ask(device, request)
    assert device.device.node_id == 7
    assert device.receive(Frame(0x000, b"\x81\x07"), 3.0) == [Frame(0x706, b"\0")]


def test_a_device_whose_node_id_is_taken_away_falls_silent_at_its_reset() -> None:
    device = configured(5)
    device.receive(Frame(0x605, bytes.fromhex("2B17100064000000")), 1.0)  # a heartbeat each 100 ms
    for request in ("04 01", "11 FF", "04 00"):
        ask(device, request)
    assert device.receive(Frame(0x000, b"\x82\x05"), 2.0) == []
    assert device.next_wakeup == inf


def test_lss_is_not_for_a_device_at_work() -> None:
    device = configured(5)
    device.receive(Frame(0x000, b"\x01\x05"), 1.0)
    assert ask(device, "4C") == ask(device, "04 01") == ask(device, "5E") == ""


# Services, request by request

CONFIGURING, WAITING = ("04 01",), ("04 00",)
SELECTING = ("40 00000000", "41 05000000", "42 00000100", "43 D2040000")
IDENTIFYING = ("46 00000000", "47 05000000", "48 00000100", "49 00000100", "4A D2040000", "4B D2040000")


@pytest.mark.parametrize(
    ("requests", "answer", "why"),
    [
        (SELECTING, "44", "its identity"),
        ((*SELECTING[:3], "43 D3040000"), "", "another serial number"),
        (SELECTING[1:], "", "the vendor-ID is missing"),
        ((*SELECTING[:2], SELECTING[1], *SELECTING[2:]), "", "a part comes twice"),
        ((*CONFIGURING, *SELECTING), "", "it is being configured"),
        (IDENTIFYING, "4F", "within both ranges"),
        ((*CONFIGURING, *IDENTIFYING), "4F", "identifying is for both states"),
        ((*IDENTIFYING[:4], "4A 00000000", "4B FFFFFFFF"), "4F", "any serial number"),
        ((*IDENTIFYING[:4], "4A D3040000", "4B FFFFFFFF"), "", "below the lowest serial number"),
        ((*IDENTIFYING[:2], "48 00000000", "49 FFFF0000", *IDENTIFYING[4:]), "", "above the highest revision"),
        (("4C",), "50", "it has no node-ID"),
        ((*CONFIGURING, "11 05", "4C"), "", "it has a pending one"),
        (("51 00000000 80",), "4F", "fastscan: is anybody there?"),
        (("51 00000000 80", "51 00000000 1F 00 00"), "4F", "the highest bit of the vendor-ID is 0"),
        (("51 00000000 80", "51 00000080 1F 00 00"), "", "... and not 1"),
        (("51 00000000 80", "51 05000000 00 01 02"), "", "the product code before the vendor-ID"),
        (("51 00000000 80", "51 00000000 00 00 01", "51 05000000 00 01 02"), "4F", "vendor-ID, then product code"),
        (("51 00000000 80", "51 00000000 20 00 00"), "", "no such bit"),
        (("51 00000000 80", "51 00000000 00 00 04"), "", "no such part"),
        ((*CONFIGURING, "51 00000000 80"), "", "fastscan is for waiting state"),
        ((*CONFIGURING, "11 7F"), "11", "the highest node-ID"),
        ((*CONFIGURING, "11 80"), "1101", "no node-ID"),
        ((*CONFIGURING, "11 00"), "1101", "no node-ID"),
        (("11 05",), "", "it is not being configured"),
        ((*CONFIGURING, "13 00 03"), "13", "250 kbit/s"),
        ((*CONFIGURING, "13 00 08"), "1301", "10 kbit/s, which its file excludes"),
        ((*CONFIGURING, "13 01 03"), "1301", "a table of its maker's"),
        ((*CONFIGURING, "17"), "17", "stored"),
        ((*CONFIGURING, "5A"), "5A", "vendor-ID"),
        ((*CONFIGURING, "5D"), "5DD204", "serial number"),
        ((*CONFIGURING, "5E"), "5EFF", "no node-ID"),
        ((*CONFIGURING, "11 05", "5E"), "5EFF", "a pending node-ID is not in force"),
        ((*CONFIGURING, "04 07", "5E"), "5EFF", "no such state: nothing changes"),
        ((*CONFIGURING, *WAITING, "5E"), "", "it waits again"),
        (("99",), "", "no command"),
    ],
)
def test_each_service_is_answered_as_its_state_allows(requests: tuple[str, ...], answer: str, why: str) -> None:
    device = motor()
    *before, last = requests
    for each in before:
        ask(device, each)
    assert ask(device, last).removeprefix("7E4#") == (answer and answer.ljust(16, "0")), why


def test_a_short_request_is_not_answered() -> None:
    assert motor().receive(Frame(0x7E5, bytes.fromhex("4C")), 1.0) == []


def test_while_the_bit_rate_changes_it_neither_hears_nor_sends() -> None:
    device = configured(5)
    device.receive(Frame(0x605, bytes.fromhex("2B17100064000000")), 1.0)  # a heartbeat each 100 ms
    for request in ("04 01", "13 00 03", "15 F4 01"):  # in 500 ms
        ask(device, request)
    assert device.next_wakeup == 2.0
    assert (ask(device, "5E", 1.9), device.tick(1.9)) == ("", [])
    assert device.tick(2.0) == [Frame(0x705, b"\x7f")]
    assert ask(device, "5E", 2.1) == "7E4#5E05000000000000"


# With a master, and over power-off


def test_ten_devices_are_found_and_each_is_given_a_node_id() -> None:
    devices = [motor(serial=1000 + number) for number in range(10)]
    with wired(*devices) as master:
        found = perform(master, lss.find_all())
        assert [each.serial for each in found] == list(range(1000, 1010))
        for node_id, identity in enumerate(found, 1):
            perform(master, lss.assigned(node_id, identity, None, stores=True))
        perform(master, lss.switch(LssState.WAITING))
        assert perform(master, lss.find_all()) == []
    assert [each.device.node_id for each in devices] == list(range(1, 11))


def test_stored_lss_settings_survive_power_off(tmp_path: Path) -> None:
    file = tmp_path / "motor.dcf"
    device = motor(store=FileStore(file, Dictionary.load(MOTOR, 127)))
    for request in ("04 01", "11 05", "13 00 03", "17"):
        ask(device, request)
    store = FileStore(file, Dictionary.load(MOTOR, 127))
    assert store.commissioned == (5, 250)
    assert motor(store.commissioned.node_id, store).device.node_id == 5


def test_the_absence_of_a_node_id_is_stored(tmp_path: Path) -> None:
    file = tmp_path / "motor.dcf"
    device = motor(5, FileStore(file, Dictionary.load(MOTOR, 127)))
    for request in ("04 01", "11 FF", "17"):
        ask(device, request)
    store = FileStore(file, Dictionary.load(MOTOR, 127))
    assert store.commissioned == (255, 500)
    assert motor(255, store).device.storage.refused == ()


def test_a_device_that_cannot_store_says_so(tmp_path: Path) -> None:
    device = motor(store=FileStore(tmp_path / "nowhere" / "motor.dcf", Dictionary.load(MOTOR, 127)))
    ask(device, "04 01")
    assert ask(device, "17") == "7E4#1702000000000000"


def test_saving_parameters_keeps_the_node_id_that_lss_has_stored(tmp_path: Path) -> None:
    file = tmp_path / "motor.dcf"
    device = motor(store=FileStore(file, Dictionary.load(SERVO, 127)), file=SERVO)
    for request in ("04 01", "11 05", "17", "11 06", "04 00"):
        ask(device, request)
    saved = device.receive(Frame(0x606, bytes.fromhex("2310100173617665")), 1.0)
    assert saved == [Frame(0x586, bytes.fromhex("6010100100000000"))]
    assert FileStore(file, Dictionary.load(SERVO, 127)).commissioned == (5, 500)


def test_no_device_has_another_ones_identity() -> None:
    with wired(motor()) as master, pytest.raises(RemoteError, match="no device has the identity"):
        perform(master, lss.assigned(5, IDENTITY._replace(serial=1235), None, stores=False))
