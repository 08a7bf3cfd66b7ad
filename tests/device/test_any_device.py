"""A device from anybody's EDS boots and answers for every object, also where the file is not all it should be."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.device.device import Device
from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import AbortCode

NODE_ID = 5
SAMPLES = Path(__file__).parents[1] / "lint" / "samples"
FILES = sorted(SAMPLES.iterdir())


def started(file: Path) -> Device:
    device = Device(Dictionary.load(file, NODE_ID))
    assert device.start(0.0) == [Frame(0x705, b"\0")]
    return device


def read(device: Device, address: Address) -> Frame:
    """Ask the device for an object; it answers at once, with a value or an abort."""
    assert device.sdo_service.requests is not None
    request = bytes([0x40, *address[0].to_bytes(2, "little"), address[1], 0, 0, 0, 0])
    (answer,) = device.receive(Frame(device.sdo_service.requests, request), 0.0).frames
    return answer


@pytest.mark.parametrize("file", FILES)
def test_boots_and_answers_for_every_object(file: Path) -> None:
    device = started(file)
    for address in device.dictionary.addresses():
        answer = read(device, address)
        assert answer.cob_id == device.sdo_service.answers
        assert answer.data[0] == 0x80 or answer.data[1:4] == bytes([*address[0].to_bytes(2, "little"), address[1]])


MINIMAL = """\
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018
[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
DefaultValue=0x12
[1018]
ParameterName=Identity
ObjectType=9
SubNumber=2
[1018sub0]
ParameterName=Highest sub-index
DataType=0x0005
AccessType=const
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
DataType=0x0007
AccessType=ro
DefaultValue=1
"""


def described(tmp_path: Path, more: str) -> Path:
    file = tmp_path / "any.eds"
    file.write_text(MINIMAL + more, encoding="latin-1")
    return file


def test_without_1200_it_has_the_default_sdo_server(tmp_path: Path) -> None:
    device = started(described(tmp_path, ""))
    assert (device.sdo_service.requests, device.sdo_service.answers) == (0x605, 0x585)
    assert read(device, (0x1000, 0)).data == bytes.fromhex("4300100012000000")


def test_without_1f80_it_waits_for_a_master(tmp_path: Path) -> None:
    device = started(described(tmp_path, ""))
    assert device.state is NmtState.PRE_OPERATIONAL
    device.receive(Frame(0x000, b"\x01\x05"), 0.0)
    assert device.operational


def variable(data_type: int, default: str) -> str:
    return f"[2000]\nParameterName=Odd\nDataType=0x{data_type:04X}\nAccessType=ro\nDefaultValue={default}\n"


# A default that the file's own type cannot hold: there is nothing to read.
NO_VALUES = [
    (variable(0x0005, "300"), "too large for UNSIGNED8"),
    (variable(0x0003, "-40000"), "too small for INTEGER16"),
]


@pytest.mark.parametrize(("text", "reason"), NO_VALUES, ids=lambda value: value[:20])
def test_a_default_outside_its_type_is_an_abort(tmp_path: Path, text: str, reason: str) -> None:
    answer = read(started(described(tmp_path, text)), (0x2000, 0))
    assert answer.data[0] == 0x80, reason
    assert int.from_bytes(answer.data[4:], "little") == AbortCode.NO_DATA


def test_a_text_is_served_as_the_bytes_of_its_file(tmp_path: Path) -> None:
    answer = read(started(described(tmp_path, variable(0x0009, "\xf6"))), (0x2000, 0))
    assert answer.data[4:5] == b"\xf6"  # the file is Latin-1


def pdo(index: int, cob_id: str, *entries: str) -> str:
    """A TPDO's two records."""
    mapped = "".join(_member(index + 0x200, sub, 7, entry) for sub, entry in enumerate(entries, 1))
    return (
        _record(index, 3)
        + _member(index, 0, 5, "2")
        + _member(index, 1, 7, cob_id)
        + _member(index, 2, 5, "254")
        + _record(index + 0x200, len(entries) + 1)
        + _member(index + 0x200, 0, 5, str(len(entries)))
        + mapped
    )


def _record(index: int, subs: int) -> str:
    return f"[{index:04X}]\nParameterName=TPDO parameter\nObjectType=9\nSubNumber={subs}\n"


def _member(index: int, sub: int, data_type: int, default: str) -> str:
    head = f"[{index:04X}sub{sub:X}]\nParameterName=Entry {sub}\nDataType=0x{data_type:04X}\nAccessType=rw\n"
    return f"{head}DefaultValue={default}\n"


BAD_PDOS = [
    (pdo(0x1800, "0x181", "0x30000008"), "maps an object that is missing"),
    (pdo(0x1800, "0x181", *["0x10000020"] * 3), "over 64 bits"),
    (pdo(0x1800, "0x20000181", "0x10000020"), "29 bits"),
    (pdo(0x1804, "", "0x10000020"), "no COB-ID, nor one by default, as the first four have"),
]


@pytest.mark.parametrize(("text", "reason"), BAD_PDOS, ids=lambda value: value[:20])
def test_a_pdo_that_does_not_hold_is_left_out_and_the_others_work(tmp_path: Path, text: str, reason: str) -> None:
    device = started(described(tmp_path, text + pdo(0x1801, "$NODEID+0x280", "0x10000020")))
    assert [each.cob_id for each in device.protocol.bindings] == [0x285], reason
