"""Messages of devices outside the catalogue: all data types at any offset, names, identifiers, PDOs left out."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.errors import FieldError, MappingError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import DATA_TYPES
from eurobot_od.pdo.kinds import OutOfRange
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import DEVICE_TYPE, pdo, variable

NODE_ID = 5


def dictionary(text: str, name: str = "arm", node_id: int = NODE_ID) -> Dictionary:
    return Dictionary.read((DEVICE_TYPE + text).encode(), Path(f"{name}.eds"), node_id)


def protocol(*dictionaries: Dictionary) -> tuple[Protocol, list[str]]:
    """The messages of devices, and what was said of PDOs left out."""
    said: list[str] = []

    def refused(error: MappingError) -> None:
        said.append(str(error))

    return Protocol([(each, each.read_pdos(each.default, refused)) for each in dictionaries], refused=refused), said


def of(text: str) -> Protocol:
    made, said = protocol(dictionary(text))
    assert said == []
    return made


# Type, mapped bits, offset in bits, data, the meaning.
MEANINGS: list[tuple[str, int, int, str, Any]] = [
    ("INTEGER8", 8, 0, "FF", -1),
    ("INTEGER16", 16, 0, "0080", -32768),
    ("INTEGER16", 16, 4, "00F80F", -128),
    ("INTEGER16", 12, 0, "FF0F", -1),  # the sign is the highest bit that is mapped
    ("INTEGER24", 24, 8, "00FEFFFF", -2),
    ("INTEGER32", 32, 0, "00000080", -(1 << 31)),
    ("INTEGER32", 32, 3, "F8FFFFFF07", -1),
    ("INTEGER40", 40, 0, "00000000FF", -(1 << 32)),
    ("INTEGER64", 64, 0, "FFFFFFFFFFFFFF7F", (1 << 63) - 1),
    ("INTEGER64", 64, 0, "FEFFFFFFFFFFFFFF", -2),
    ("INTEGER8", 3, 2, "10", -4),  # from a table of all values
    ("INTEGER8", 3, 2, "0C", 3),
    ("UNSIGNED64", 64, 0, "FFFFFFFFFFFFFFFF", (1 << 64) - 1),
    ("REAL32", 32, 0, "0000C0BF", -1.5),
    ("REAL32", 32, 7, "000000E01F", 1.5),
    ("REAL64", 64, 0, "9A9999999999B93F", 0.1),
    ("BOOLEAN", 1, 0, "01", True),
    ("BOOLEAN", 1, 6, "00", False),
    ("BOOLEAN", 8, 0, "01", True),
    ("VISIBLE_STRING", 32, 0, "4F4B0000", "OK"),
    ("VISIBLE_STRING", 16, 4, "100400", "A"),
    ("VISIBLE_STRING", 8, 0, "E4", "\xe4"),
    ("OCTET_STRING", 32, 0, "01020300", b"\1\2\3\0"),
    ("OCTET_STRING", 12, 0, "2301", 0x123),  # no whole bytes: a number
    ("REAL32", 16, 0, "C0BF", 0xBFC0),  # half of a number means nothing, its bits do
    ("TIME_OF_DAY", 48, 0, "010000000000", 1),
    ("DOMAIN", 16, 0, "3412", 0x1234),
]  # fmt: skip


def one_field(type_: str, bits: int, offset: int) -> Protocol:
    before = [f"0x000500{8:02X}"] * (offset // 8) + [f"0x200100{offset % 8:02X}"] * bool(offset % 8)
    objects = variable("2000", "Value", type_) + variable("2001", "Before", "UNSIGNED8")
    return of(objects + pdo(0x1800, *before, f"0x200000{bits:02X}"))


@pytest.mark.parametrize(("type_", "bits", "offset", "data", "meaning"), MEANINGS)
def test_a_value_of_any_type_at_any_offset(type_: str, bits: int, offset: int, data: str, meaning: Any) -> None:
    made = one_field(type_, bits, offset)
    message = made.decode(0x180 + NODE_ID, bytes.fromhex(data))
    assert (message._asdict()["value"], type(message._asdict()["value"])) == (meaning, type(meaning))
    assert made.encode(message).data == bytes.fromhex(data)


# Type, mapped bits, and what may not be sent.
REFUSED: list[tuple[str, int, Any, str]] = [
    ("INTEGER8", 8, 128, "-128..127"),
    ("INTEGER8", 8, -129, "-128..127"),
    ("INTEGER8", 8, 1.5, "whole numbers, -128..127"),
    ("INTEGER16", 12, 2048, "-2048..2047"),
    ("INTEGER8", 3, 4, "-4..3"),
    ("BOOLEAN", 1, 2, "false, true"),
    ("REAL32", 32, 1e300, "any REAL32"),
    ("REAL32", 32, "1", "any REAL32"),
    ("VISIBLE_STRING", 16, "abc", "up to 2 characters"),
    ("VISIBLE_STRING", 16, "\u20ac", "up to 2 characters"),
    ("OCTET_STRING", 16, b"abc", "2 bytes as hexadecimal digits"),
    ("OCTET_STRING", 16, "ab", "2 bytes as hexadecimal digits"),
]


@pytest.mark.parametrize(("type_", "bits", "value", "allowed"), REFUSED)
def test_values_outside_the_type_are_not_sent(type_: str, bits: int, value: Any, allowed: str) -> None:
    made = one_field(type_, bits, 0)
    with pytest.raises(FieldError) as error:
        made.encode(made.bindings[0].message(value=value))
    assert str(error.value).endswith(f"allowed: {allowed}")


def test_limits_of_a_signed_object_are_checked() -> None:
    made = of(variable("2000", "Heat", "INTEGER16", more="LowLimit=-40\nHighLimit=0x55\n") + pdo(0x1800, "0x20000010"))
    assert made.decode(0x185, b"\xd8\xff") == made.bindings[0].message(heat=-40)
    (flagged,) = made.decode(0x185, b"\xd7\xff")
    assert flagged == OutOfRange(-41)
    assert isinstance(flagged, OutOfRange)
    with pytest.raises(FieldError, match=r"heat = 86 is not allowed; allowed: -40\.\.85"):
        made.encode(made.bindings[0].message(heat=86))


def test_a_wide_boolean_is_out_of_range_unless_0_or_1() -> None:
    (value,) = one_field("BOOLEAN", 8, 0).decode(0x185, b"\2")
    assert isinstance(value, OutOfRange)


def test_pack_and_unpack_use_signed_integers() -> None:
    made = one_field("INTEGER16", 16, 0)
    assert made.pack("arm.TPDO1", value=-2) == b"\xfe\xff"
    assert made.unpack(0x185, b"\xfe\xff") == ("arm.TPDO1", {"value": -2})
    with pytest.raises(FieldError, match=r"-32768\.\.32767"):
        made.pack("arm.TPDO1", value=32768)


NOT_A_NUMBER = struct.pack("<f", math.nan)


def test_an_invalid_number_is_described() -> None:
    made = one_field("REAL32", 32, 0)
    kind = made.bindings[0].kinds["value"]
    (value,) = made.decode(0x185, NOT_A_NUMBER)
    assert (kind.plain(value), kind.text(value)) == ("nan", "nan")


# A person's words, and the value.
WORDS: list[tuple[str, int, str, Any, str]] = [
    ("INTEGER16", 16, "-5", -5, "-5"),
    ("BOOLEAN", 1, "true", True, "true"),
    ("BOOLEAN", 1, "0", False, "false"),
    ("REAL32", 32, "0.1", struct.unpack("<f", struct.pack("<f", 0.1))[0], "0.1"),
    ("REAL64", 64, "0.1", 0.1, "0.1"),
    ("VISIBLE_STRING", 64, "a\tb", "a\tb", r"'a\tb'"),
    ("OCTET_STRING", 16, "0aff", b"\x0a\xff", "0AFF"),
]


@pytest.mark.parametrize(("type_", "bits", "text", "value", "written"), WORDS)
def test_values_are_parsed_and_formatted(type_: str, bits: int, text: str, value: Any, written: str) -> None:
    kind = one_field(type_, bits, 0).bindings[0].kinds["value"]
    assert (kind.parse(text), kind.text(value)) == (value, written)


TYPES = [each for each in DATA_TYPES.values() if 0 < each.bits <= 64]


@given(st.sampled_from(TYPES), st.integers(0, 63), st.data())
def test_encoding_inverts_decoding_for_any_bits(type_: Any, offset: int, draws: st.DataObject) -> None:
    offset %= 65 - type_.bits
    made = one_field(type_.name, type_.bits, offset)
    data = draws.draw(st.integers(0, (1 << type_.bits) - 1)) << offset
    bytes_ = data.to_bytes((offset + type_.bits + 7) // 8, "little")
    message = made.decode(0x185, bytes_)
    if not any(each != each for each in message):  # of NaN, C knows several
        assert made.encode(message).data == bytes_


# Identifiers

DEFAULTS = [
    *((0x1800 + n, base) for n, base in enumerate((0x180, 0x280, 0x380, 0x480))),
    *((0x1400 + n, base) for n, base in enumerate((0x200, 0x300, 0x400, 0x500))),
]


@pytest.mark.parametrize(("index", "base"), DEFAULTS)
@pytest.mark.parametrize("said", [None, ""])
def test_the_first_four_pdos_have_default_identifiers(index: int, base: int, said: str | None) -> None:
    made = of(variable("2000", "Value", "UNSIGNED8") + pdo(index, "0x20000008", cob_id=said))
    assert [each.cob_id for each in made.bindings] == [base + NODE_ID]


def test_times_and_transmission_types_are_kept() -> None:
    text = variable("2000", "Value", "UNSIGNED8")
    (rpdo,) = dictionary(text + pdo(0x1400, "0x20000008", settings={2: "240", 3: "7", 5: "50"})).pdos
    assert (rpdo.transmission_type, rpdo.is_synchronous, rpdo.inhibit_time, rpdo.event_timer) == (240, True, 7, 50)


def test_a_pdo_without_transmission_type_and_times_is_event_driven() -> None:
    (tpdo,) = dictionary(variable("2000", "Value", "UNSIGNED8") + pdo(0x1800, "0x20000008")).pdos
    assert (tpdo.transmission_type, tpdo.is_synchronous, tpdo.inhibit_time, tpdo.event_timer) == (255, False, 0, 0)


# Names

VALUE = variable("2000", "Value", "UNSIGNED8")


def named(*names: str) -> list[str]:
    """The messages of a device's TPDOs with these names."""
    texts = (pdo(0x1800 + n, "0x20000008", cob_id=f"0x{0x181 + n:X}", name=each) for n, each in enumerate(names))
    return [each.name for each in of(VALUE + "".join(texts)).bindings]


NAMES = [
    (["Encoder", "Encoder", "encoder"], ["Encoder", "arm.TPDO2", "arm.TPDO3"]),  # one name for all
    (["Transmit PDO 1", "class", '"'], ["arm.TPDO1", "class", "arm.TPDO3"]),
    (["a\x01\x1b[31mb  c"], ["a [31mb c"]),  # nothing that a terminal would obey
    (["n" * 200], ["n" * 60]),
    (['");import os'], ['");import os']),
]


@pytest.mark.parametrize(("records", "messages"), NAMES)
def test_every_pdo_has_a_name_of_its_own(records: list[str], messages: list[str]) -> None:
    assert named(*records) == messages


FIELDS = [
    (["class", "class", "self"], ["class_", "class__2", "self"]),
    (["", "", "\x01"], ["field", "field_2", "field_3"]),
    (["x" * 1000, "x" * 1001], ["x" * 60, "x" * 60 + "_2"]),
    (['"' * 5, "a\nb=1"[:1], "__import__('os')"], ["field", "a", "import___os"]),
    (["Cell 2", "Cell", "Cell"], ["cell_2", "cell", "cell_3"]),
]


@pytest.mark.parametrize(("objects", "fields"), FIELDS)
def test_every_field_has_a_name_that_is_an_identifier(objects: list[str], fields: list[str]) -> None:
    texts = [variable(f"{0x2000 + n:04X}", name or '"', "UNSIGNED8") for n, name in enumerate(objects)]
    made = of("".join(texts) + pdo(0x1800, *(f"0x{0x2000 + n:04X}0008" for n in range(len(objects)))))
    message = made.decode(0x185, bytes(range(len(objects))))
    assert message._asdict() == {field: n for n, field in enumerate(fields)}
    assert made.encode(made.bindings[0].message(**message._asdict())).data == bytes(range(len(objects)))
    assert all(field.isidentifier() and field.isascii() for field in message._fields)


# Several devices


def test_a_frame_is_one_message_with_its_sender_and_its_receivers() -> None:
    sender = dictionary(variable("2000", "Speed", "INTEGER16") + pdo(0x1800, "0x20000010", cob_id="0x190"), "motor", 3)
    receiver = variable("2000", "Remote speed", "INTEGER16") + pdo(0x1400, "0x20000010", cob_id="0x190")
    made, said = protocol(dictionary(receiver, "panel", 1), sender, dictionary(receiver, "logger", 2))
    (binding,) = made.bindings
    assert said == []
    assert (binding.name, binding.senders, binding.receivers) == ("motor.TPDO1", ["motor"], ["panel", "logger"])
    assert binding.layout.fields == ("speed",)  # in the sender's words


def test_a_receiver_with_another_mapping_is_left_out() -> None:
    sender = dictionary(variable("2000", "Speed", "INTEGER16") + pdo(0x1800, "0x20000010", cob_id="0x190"), "motor", 3)
    receiver = dictionary(VALUE + pdo(0x1400, "0x20000008", cob_id="0x190"), "panel", 1)
    made, said = protocol(receiver, sender)
    assert [(each.name, each.receivers) for each in made.bindings] == [("motor.TPDO1", [])]
    assert said == ["panel.eds: 0x1600: motor.TPDO1: mapping differs from that in motor.eds 0x1A00"]


# PDOs that cannot be used, and what is said; the one beside them works.
LEFT_OUT = [
    (
        pdo(0x1801, "0x20000008", cob_id="$NODEID+0x20000280"),
        ["0x1801: COB-ID 0x20000285 asks for a 29-bit identifier"],
    ),
    (pdo(0x1804, "0x20000008"), ["0x1804: sub 1 is missing or has no number as its value"]),
    (pdo(0x1801, "0x30000008"), ["0x1A01: maps 0x3000 sub 0, which is missing"]),
    (pdo(0x1801, *["0x20000008"] * 9), ["0x1A01: arm.TPDO2: 72 bits are mapped, a PDO has at most 64"]),
    (pdo(0x1801, "0x20000008").replace("[1A01", "[3A01"), ["0x1A01: sub 0 is missing or has no number as its value"]),
    (pdo(0x1801, "0x20000008", cob_id="0x185"), []),  # the very same frame
    (pdo(0x1801, cob_id="0x80000285"), []),  # unused
]


@pytest.mark.parametrize(("text", "told"), LEFT_OUT)
def test_an_unusable_pdo_is_reported_once_and_others_work(text: str, told: list[str]) -> None:
    made, said = protocol(dictionary(VALUE + pdo(0x1800, "0x20000008") + text))
    assert said == [f"arm.eds: {each}" for each in told]
    assert [each.cob_id for each in made.bindings] == [0x185]


def test_a_device_without_pdos_has_no_messages() -> None:
    assert protocol(dictionary(""))[0].bindings == ()


def test_512_pdos_of_each_direction_are_read() -> None:
    records = (
        pdo(index, "0x20000008", cob_id="0x80000000") for base in (0x1400, 0x1800) for index in range(base, base + 512)
    )
    pdos: tuple[Pdo, ...] = dictionary(VALUE + "".join(records)).pdos
    assert [each.number for each in pdos] == [*range(1, 513)] * 2
