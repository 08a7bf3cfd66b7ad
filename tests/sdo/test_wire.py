"""What both ends read and write: sizes, segments, blocks, abort codes."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import pytest
from canopen.sdo import constants
from canopen.sdo.exceptions import SdoAbortedError

from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.device.bound import BoundObject
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.objects import FileStore
from eurobot_od.device.simulated import ObjectName, SimulatedDevice
from eurobot_od.errors import Cause, Refused
from eurobot_od.od.values import NOT_VALID
from eurobot_od.sdo.server import TIMEOUT
from eurobot_od.sdo.wire import (
    ABORT,
    EXPEDITED,
    REMEDIES,
    SIZE_GIVEN,
    Abort,
    AbortCode,
    ClientCommand,
    Initiate,
    Reason,
    ServerCommand,
    block,
    carrying,
    initiate,
    part_in,
    reason,
    segment,
    segments_of,
)
from tests.device import io_module
from tests.device.io_module import LABEL, ON_CHANGE, TEMPERATURE
from tests.eds_text import record, variable
from tests.kit import lift
from tests.kit.lift import CATALOGUE, CheckDoorResponse, MoveTo, PlaceResponse, Sensor


@pytest.mark.parametrize("code", SdoAbortedError.CODES)
def test_every_abort_code_has_the_text_of_canopen(code: int) -> None:
    assert reason(code) == SdoAbortedError.CODES[code].replace("can not", "cannot")


def test_a_devices_own_abort_code_has_no_text() -> None:
    assert reason(0xDEADBEEF) == "unknown code"


@pytest.mark.parametrize(("ours", "prefix"), [(ClientCommand, "REQUEST"), (ServerCommand, "RESPONSE")])
def test_command_specifiers_are_canopens(ours: type[IntEnum], prefix: str) -> None:
    words = {name: frozenset(name.split("_")) for name in dir(constants)}
    theirs = {words[name] - {prefix}: getattr(constants, name) >> 5 for name in words if name.startswith(prefix)}
    assert {frozenset(each.name.replace("ABORT", "ABORTED").split("_")): each.value for each in ours} == theirs


@pytest.mark.parametrize(
    ("data", "size"),
    [
        ("4f002001 01000000", 1),
        ("43002001 01020304", 4),
        ("42002001 01020304", None),  # expedited, the size is not given
        ("41002001 00010000", 256),
        ("40002001 00000000", None),
    ],
)
def test_the_size_in_an_initiate_is_read(data: str, size: int | None) -> None:
    assert Initiate.of(bytes.fromhex(data)).size == size


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_short_content_is_expedited(size: int) -> None:
    initiate = Initiate.of(carrying(2, (0x2000, 1), bytes(range(size))))
    assert (initiate.address, initiate.size, initiate.rest[:size]) == ((0x2000, 1), size, bytes(range(size)))


@pytest.mark.parametrize("size", [0, 5, 300])
def test_long_content_is_announced_by_size(size: int) -> None:
    assert carrying(1, (0x2000, 1), bytes(size)).hex() == f"21002001{size.to_bytes(4, 'little').hex()}"


@pytest.mark.parametrize(
    ("content", "carried"), [(b"", [b""]), (b"1234567", [b"1234567"]), (b"12345678", [b"1234567", b"8"])]
)
def test_content_is_split_into_segments(content: bytes, carried: list[bytes]) -> None:
    assert [content[at : at + 7] for at in segments_of(content)] == carried
    assert [part_in(segment(3, 0x10, part, last=True)) for part in carried] == carried


def test_a_block_is_numbered_and_ends_with_the_last_of_all() -> None:
    content = bytes(8 * 7)
    assert [each[0] for each in block(content, 0, 2)] == [1, 2]
    assert [each[0] for each in block(content, 6 * 7, 2)] == [1, 0x82]
    assert [each[0] for each in block(content, 6 * 7, 127)] == [1, 0x82]
    assert [each[0] for each in block(b"", 0, 127)] == [0x81]


# The devices

MORE = (
    record(0x1003, "Error field", (0, "UNSIGNED8", "0"), (1, "UNSIGNED32", "0"))
    + record(0x1010, "Store", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "1"))
    + record(0x1016, "Consumer heartbeat", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0"), (2, "UNSIGNED32", "0"))
    + variable("2300", "Password", "UNSIGNED8", "0").replace("AccessType=rw", "AccessType=wo")
    + variable("2301", "Serial", "UNSIGNED8", "0").replace("AccessType=rw", "AccessType=ro")
    + variable("2302", "Limited", "UNSIGNED8", "5", "LowLimit=5\nHighLimit=9")
    + variable("2303", "Text", "VISIBLE_STRING", "")
    + variable("2304", "Spoilt", "UNSIGNED8", "300")
    + variable("2305", "Not for PDOs", "UNSIGNED8", "0").replace("PDOMapping=1", "PDOMapping=0")
    + variable("2306", "Only for PDOs", "UNSIGNED8", "0").replace("AccessType=rw", "AccessType=UNKNOWN")
)


class Choosy(SimulatedDevice):
    """A device whose program does not take every value, nor any while it is busy."""

    def _never(self, value: int) -> None:
        raise Refused(Cause.VALUES, f"not {value}")

    def _busy(self, _: int) -> None:
        raise Refused(Cause.STATE, "busy")

    WRITERS: ClassVar[Mapping[ObjectName, Callable[[Any, Any], object]]] = {(0x2100, 0): _never, (0x2303, 0): _busy}


class Measuring(SimulatedDevice):
    """A cabin that measures what no frame can say, and has an object of a message it has no PDO for."""

    CATALOGUE = CATALOGUE
    OBJECTS: ClassVar[Mapping[str, BoundObject]] = {
        "Place": BoundObject(read=lambda _: PlaceResponse(-1, 0, 0, Sensor.BELT)),
        "State": BoundObject(read=lambda _: CheckDoorResponse()),
        "Move to": BoundObject(write=MoveTo),
    }


def module(folder: Path) -> SimulatedDevice:
    """Make an I/O module that cannot store its settings."""
    dictionary = io_module.dictionary(io_module.TEXT + MORE)
    return Choosy(dictionary, store=FileStore(folder / "no such folder" / "module.dcf", dictionary))


def cabin(_: Path) -> SimulatedDevice:
    return Measuring(lift.dictionary("cabin"))


def reversed_cabin(_: Path) -> SimulatedDevice:
    return Measuring(lift.dictionary("cabin", lift.REVERSED))


# What is sent to them


def read(index: int, sub: int = 0) -> bytes:
    return initiate(ClientCommand.UPLOAD << 5, (index, sub))


def write(index: int, sub: int, value: int, size: int = 4) -> bytes:
    command = ClientCommand.DOWNLOAD << 5 | 4 - size << 2 | EXPEDITED | SIZE_GIVEN
    return initiate(command, (index, sub), value.to_bytes(size, "little"))


def raw(data: str) -> bytes:
    """Return a frame from hexadecimal digits, filled up with zeros."""
    return bytes.fromhex(data).ljust(8, b"\0")


def off(index: int, cob_id: int) -> bytes:
    return write(index, 1, NOT_VALID | cob_id)


Made: TypeAlias = Callable[[Path], SimulatedDevice]

FIRMWARE, SAVE = "002200", int.from_bytes(b"save", "little")
"""The index and sub-index of a DOMAIN of the module, as in a frame; the signature of 0x1010."""

PROVOKED: Mapping[Reason, tuple[Made, Sequence[bytes | NmtCommand]]] = {
    Reason.TOGGLE_BIT: (module, [read(0x2200), raw("70")]),
    Reason.CLIENT_SILENT: (module, [read(0x2200)]),
    Reason.OUT_OF_STEP: (module, [raw("60")]),
    Reason.BLOCK_SIZE: (module, [raw("a4" + FIRMWARE + "80")]),
    Reason.SEGMENT_ZERO: (module, [raw("c6" + FIRMWARE + "08"), raw("00")]),
    Reason.NEVER_SENT: (module, [raw("a4" + FIRMWARE + "7f"), raw("a3"), raw("a27f7f")]),
    Reason.CRC: (module, [raw("c4" + FIRMWARE), raw("81"), raw("c1ffff")]),
    Reason.MORE_BYTES: (module, [raw("21" + FIRMWARE + "01"), raw("01")]),
    Reason.FEWER_BYTES: (module, [raw("21" + FIRMWARE + "09"), raw("01")]),
    Reason.NO_OBJECT: (module, [read(0x2999)]),
    Reason.NO_SUBINDEX: (module, [read(0x1000, 1)]),
    Reason.WRITE_ONLY: (module, [read(0x2300)]),
    Reason.READ_ONLY: (module, [write(0x2301, 0, 1, size=1)]),
    Reason.NO_ACCESS: (module, [read(0x2306)]),
    Reason.LONGER_THAN_TYPE: (module, [write(0x2302, 0, 6, size=4)]),
    Reason.SHORTER_THAN_TYPE: (module, [write(0x1017, 0, 6, size=1)]),
    Reason.OUT_OF_MEMORY: (module, [raw("21" + FIRMWARE + "01000001")]),
    Reason.ABOVE_LIMIT: (module, [write(0x2302, 0, 10, size=1)]),
    Reason.BELOW_LIMIT: (module, [write(0x2302, 0, 4, size=1)]),
    Reason.NO_VALUE: (module, [read(0x2304)]),
    Reason.NO_SUCH_ERROR: (module, [read(0x1003, 1)]),
    Reason.ERRORS_NOT_CLEARED: (module, [write(0x1003, 0, 1, size=1)]),
    Reason.SIGNATURE: (module, [write(0x1010, 1, SAVE + 1)]),
    Reason.NOT_STORED: (module, [write(0x1010, 1, SAVE)]),
    Reason.WATCHED_TWICE: (module, [write(0x1016, 1, 0x90064), write(0x1016, 2, 0x90064)]),
    Reason.SYNC_COB_ID: (module, [write(0x1005, 0, 1 << 29 | 0x080)]),
    Reason.SYNC_SENT: (module, [write(0x1005, 0, 1 << 30 | 0x080), write(0x1005, 0, 1 << 30 | 0x081)]),
    Reason.SYNC_COUNTER: (module, [write(0x1019, 0, 1, size=1)]),
    Reason.SYNC_PERIOD: (module, [write(0x1006, 0, 10_000), write(0x1019, 0, 2, size=1)]),
    Reason.PDO_VALID: (module, [write(ON_CHANGE, 1, 0x186)]),
    Reason.PDO_COB_ID: (module, [write(ON_CHANGE, 1, NOT_VALID | 1 << 29 | 0x185)]),
    Reason.COB_ID_TAKEN: (module, [off(ON_CHANGE, 0x185), write(ON_CHANGE, 1, 0x605)]),
    Reason.TRANSMISSION_TYPE: (module, [write(ON_CHANGE, 2, 241, size=2)]),
    Reason.RPDO_INHIBITED: (cabin, [write(0x1400, 3, 10, size=2)]),
    Reason.MAPPING_USED: (module, [off(ON_CHANGE, 0x185), write(0x1A00, 1, TEMPERATURE)]),
    Reason.MAPPED_MISSING: (module, [off(ON_CHANGE, 0x185), write(0x1A00, 0, 0, size=1), write(0x1A00, 1, 0x29990008)]),
    Reason.NOT_MAPPABLE: (module, [off(ON_CHANGE, 0x185), write(0x1A00, 0, 0, size=1), write(0x1A00, 1, 0x23050008)]),
    Reason.MAPPED_BITS: (module, [off(ON_CHANGE, 0x185), write(0x1A00, 0, 0, size=1), write(0x1A00, 1, 0x20000111)]),
    Reason.MAPPING_TOO_LONG: (
        module,
        [off(ON_CHANGE, 0x185), write(0x1A00, 0, 0, size=1), write(0x1A00, 1, LABEL), write(0x1A00, 0, 2, size=1)],
    ),
    Reason.PDO_CONFLICT: (module, [off(ON_CHANGE, 0x185), write(ON_CHANGE, 1, 0x285)]),
    Reason.TOO_FEW_BITS: (
        cabin,
        [
            off(0x1802, 0x205),
            write(0x1A02, 0, 0, size=1),
            write(0x1A02, 1, 0x20110108),  # 8 of the 12 bits of the height
            write(0x1A02, 0, 4, size=1),
            write(0x1802, 1, 0x205),
        ],
    ),
    Reason.WRONG_STATE: (cabin, [NmtCommand.ENTER_PRE_OPERATIONAL, write(0x2000, 4, 0, size=2)]),
    Reason.COMMAND_VALUES: (reversed_cabin, [write(0x3000, 1, 0xFF, size=1), write(0x3000, 8, 0, size=1)]),
    Reason.REFUSED_NOW: (module, [write(0x2303, 0, 0x41, size=1)]),
    Reason.REFUSED_VALUE: (module, [write(0x2100, 0, 1, size=2)]),
    Reason.NO_MESSAGE: (cabin, [read(0x2002, 1)]),
    Reason.MEASURED_VALUE: (cabin, [read(0x2011, 1)]),
}


@pytest.mark.parametrize("reason", Reason, ids=lambda each: each.name)
def test_a_device_sends_each_abort(reason: Reason, tmp_path: Path) -> None:
    made, requests = PROVOKED[reason]
    with SimulatedNetwork() as network:
        device = made(tmp_path)
        network.simulate(device)
        answers: list[bytes] = []
        network.master.listeners[device.device.sdo_service.answers] = answers.append
        for each in requests:
            if isinstance(each, NmtCommand):
                network.nmt.command(each)
            else:
                network.send(device.device.sdo_service.requests, each)
            network.sleep(0.01)
        network.sleep(TIMEOUT)
    assert [each[0] == ABORT for each in answers[-2:]] in ([True], [False, True]), answers
    assert Initiate.of(answers[-1]).number == reason.code
    aborted = device.device.sdo_service.aborted
    assert aborted is not None
    assert aborted.reason is reason
    assert (aborted.__traceback__, aborted.__context__) == (None, None), "holds a bus"


WRITERS = {
    "sdo/server.py",  # what the table has
    "sdo/client.py",  # as a client, for an answer that it cannot use
    "check/conformance/sdo.py",  # as a client, to see what a device does then
    "check/tester.py",  # as a client, for a transfer that a red step left open
    "device/faults.py",  # a faulty device, anything
}


def test_only_the_wire_module_writes_aborts() -> None:
    package = Path(__file__).parents[2] / "eurobot_od"
    found = (file for file in package.rglob("*.py") if re.search(r"(?<!def )\baborted\(", file.read_text("utf-8")))
    assert {file.relative_to(package).as_posix() for file in found} <= WRITERS


def test_an_abort_has_code_text_and_reason() -> None:
    assert str(Abort(Reason.NO_OBJECT)) == "0x06020000 Object does not exist: the EDS has no object with this index"
    assert str(Abort(Reason.TOO_FEW_BITS, "too few bits for x")).endswith(" reason: too few bits for x")


def test_every_abort_code_has_a_remedy() -> None:
    assert [*REMEDIES] == [*AbortCode]
