"""The protocol: identifiers and bits from the EDS files, meanings from the message types, and what does not fit."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.errors import FieldError, FrameLengthError, MappingError, RemoteError, UnknownIdentifier, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, OutOfRange, flagged_fields
from eurobot_od.pdo.protocol import ErrorWords, Protocol
from tests.eds_text import DEVICE_TYPE, pdo, with_entry
from tests.kit import lift
from tests.kit.lift import (
    OFFICE,
    Brake,
    Building,
    CheckCabinRequest,
    Configure,
    Doors,
    FloorResponse,
    Halt,
    LiftProtocol,
    MoveConfirm,
    MoveTo,
    NoTime,
    PlaceResponse,
    Ride,
    Sensor,
    StateResponse,
    Trouble,
)

PROTOCOL, REVERSED = lift.protocol(), lift.protocol(lift.REVERSED)
MOVE = MoveTo(1234, Ride.SERVICE, 75)

# Messages as they go over the wire in CiA 301's order, and back.
FRAMES: list[tuple[Message, str]] = [
    (Halt(), "104#"),
    (Brake(Trouble.OVERLOAD), "102#00"),
    (Brake(Trouble.OBSTACLE), "102#01"),
    (MOVE, "108#D2D4120000"),
    (MOVE._replace(pause=600), "108#D2D4125802"),
    (MoveTo(0, Ride.NORMAL, 0), "108#0000000000"),
    (MoveTo(3000, Ride.FIRE, 100, 600), "108#B82B195802"),
    (MoveConfirm(), "10C#"),
    (StateResponse(0), "114#000000"),
    (StateResponse(60000), "114#60EA00"),
    (StateResponse(NoTime.UNKNOWN), "114#FFFF0F"),
    (StateResponse(NoTime.JAMMED), "114#FFFFFF"),
    (PlaceResponse(1234, 567, 89, Sensor.BELT), "205#D27423590C"),
    (FloorResponse(None, None, None, Sensor.NONE), "195#FFF00FFF03"),
    (FloorResponse(255, 255, 0, Sensor.NONE), "195#FFF00F0000"),  # 255 mm alone is a real place
    (FloorResponse(254, 255, None, Sensor.BELT), "195#FEF00FFF0F"),  # a place without a turn
    (Configure(Building.HOSPITAL, 2, 1, 45), "2C5#DD02"),
    (Configure(Building.OFFICE, 0, 0, 0), "2C5#0000"),
    (CheckCabinRequest(), "3C5#"),
]

# What may not be sent: the message, the field that is named, and what is said to be allowed.
FORBIDDEN: list[tuple[Message, str, str]] = [
    (Brake(OutOfRange(2)), "trouble", "overload (0), obstacle (1)"),
    (MOVE._replace(height=3001), "height", "0..3000 mm"),
    (MOVE._replace(height=-1), "height", "0..3000 mm"),
    (MOVE._replace(height=-3001), "height", "0..3000 mm"),  # the first from the end of a table of all heights
    (MOVE._replace(height=-1 << 64), "height", "0..3000 mm"),
    (MOVE._replace(height=1 << 64), "height", "0..3000 mm"),
    (MOVE._replace(speed=101), "speed", "0..100 %"),
    (MOVE._replace(pause=601), "pause", "0..600 s"),
    (MOVE._replace(doors=Doors.OPEN), "doors", "closed, as the loaded EDS does not map it"),
    (StateResponse(60001), "time", "0..60000 ms, unknown (1048575), jammed (16777215)"),
    (StateResponse(-1), "time", "0..60000 ms, unknown (1048575), jammed (16777215)"),
    (FloorResponse(None, 5, 5, Sensor.NONE), "height", "0..3000 mm"),
    (FloorResponse(5, None, None, Sensor.NONE), "sway", "0..2000 mm"),
    # a real place whose bits would say "unknown"
    (FloorResponse(255, 255, None, Sensor.NONE), "height", "another value: with turn unknown all would be unknown"),
    (PlaceResponse(5, 5, 5, OutOfRange(4)), "sensor", "none (0), magnet (1), camera (2), belt (3)"),
    (OFFICE._replace(doors=3), "doors", "0..2"),
    (OFFICE._replace(load=51), "load", "0..50 kg"),
]

# What callers without types may give; each is refused in the field's own words.
NO_VALUES: list[Any] = [None, "5", 1.5, float("nan"), float("inf"), [], {}, object(), b"\x05", 1j]

# Received values outside their range stay what they are, flagged: frame, and the fields concerned.
OUT_OF_RANGE: list[tuple[str, dict[str, int]]] = [
    ("108#B9CB120000", {"height": 3001}),
    ("108#D2F4120000", {"ride": 3}),
    ("108#D254190000", {"speed": 101}),
    ("108#D2D4125902", {"pause": 601}),
    ("114#61EA00", {"time": 60001}),
    ("114#FDFFFF", {"time": 0xFFFFFD}),
    ("195#FFFFFFFF03", {"height": 4095, "sway": 4095}),
    ("205#0000006801", {"turn": 360}),
    ("2C5#FFFF", {"doors": 3, "load": 63}),
]


def frame(text: str) -> Frame:
    cob_id, _, data = text.partition("#")
    return Frame(int(cob_id, 16), bytes.fromhex(data))


# What there is


@pytest.mark.parametrize(("cob_id", "name"), [(each.cob_id, each.name) for each in PROTOCOL.bindings])
def test_a_message_is_found_by_identifier_name_and_type(cob_id: int, name: str) -> None:
    binding = PROTOCOL.binding_of(cob_id)
    assert PROTOCOL.binding(name) is PROTOCOL.binding(name.lower()) is PROTOCOL.binding(binding.type) is binding
    assert PROTOCOL.cob_id(binding.type) == PROTOCOL.cob_id(name) == cob_id
    assert PROTOCOL.name(binding.type) == name


def test_names_are_in_order_of_priority() -> None:
    assert PROTOCOL.names() == sorted(PROTOCOL.names(), key=PROTOCOL.cob_id)


def test_a_nodes_protocol_has_only_its_messages() -> None:
    panel = LiftProtocol.of(lift.dictionary("panel"))
    assert "Move To" in panel.names()
    with pytest.raises(UnknownName, match="unknown message 'FloorResponse'"):
        panel.cob_id(FloorResponse)  # its PDO is not valid until somebody configures it
    with pytest.raises(UnknownName, match="unknown message 'FloorResponse'"):
        panel.encode(FloorResponse(1, 1, 1, Sensor.BELT))
    with pytest.raises(UnknownIdentifier):
        panel.decode(0x195, bytes(5))


@pytest.mark.parametrize("name", ["Move", "Move to it!", ""])
def test_an_unknown_message_raises(name: str) -> None:
    for ask in (PROTOCOL.binding, PROTOCOL.cob_id, PROTOCOL.pack):
        with pytest.raises(UnknownName, match=f"unknown message '{name}'"):
            ask(name)


@pytest.mark.parametrize("cob_id", [0x000, 0x003, 0x7FF, 0x800, -1])
def test_an_unknown_identifier_raises(cob_id: int) -> None:
    for ask in (PROTOCOL.decode, PROTOCOL.unpack):
        with pytest.raises(UnknownIdentifier):
            ask(cob_id, b"")


# Encoding and decoding


@pytest.mark.parametrize(("message", "text"), FRAMES)
def test_messages_are_encoded(message: Message, text: str) -> None:
    assert str(PROTOCOL.encode(message)) == text


@pytest.mark.parametrize(("message", "text"), FRAMES)
def test_messages_are_decoded(message: Message, text: str) -> None:
    cob_id, data = frame(text)
    for kind in (bytes, bytearray, memoryview, list):
        decoded = PROTOCOL.decode(cob_id, kind(data))  # type: ignore[arg-type]  # callers without types
        assert decoded == message
        assert [type(value) for value in decoded] == [type(value) for value in message]


def test_the_first_and_later_calls_encode_and_decode_the_same() -> None:
    protocol = LiftProtocol.of_devices(lift.dictionaries(), lift.CATALOGUE)  # that has seen none of them
    for message, text in FRAMES:
        assert [protocol.encode(message) for _ in range(3)] == [frame(text)] * 3
        assert [protocol.decode(*frame(text)) for _ in range(3)] == [message] * 3


@pytest.mark.parametrize(("message", "field", "allowed"), FORBIDDEN)
def test_a_value_out_of_range_is_not_encoded(message: Message, field: str, allowed: str) -> None:
    with pytest.raises(FieldError) as error:
        PROTOCOL.encode(message)
    name = PROTOCOL.name(type(message))
    assert (error.value.message, error.value.field) == (name, field)
    assert error.value.value == getattr(message, field)
    assert error.value.allowed.startswith(allowed)
    assert str(error.value).startswith(f"{name}: {field} = ")


@pytest.mark.parametrize("protocol", [PROTOCOL, REVERSED])
@pytest.mark.parametrize("message", [MOVE, Brake(Trouble.OBSTACLE), OFFICE])
def test_a_value_of_a_wrong_type_is_not_encoded(message: Message, protocol: Protocol) -> None:
    for field, value in product(message._fields, NO_VALUES):
        with pytest.raises(FieldError, match=f": {field} = "):
            protocol.encode(message._replace(**{field: value}))


def test_an_object_that_is_no_message_is_not_encoded() -> None:
    nothing: Any = ("Move To", 1)
    with pytest.raises(UnknownName, match="unknown message 'tuple'"):
        PROTOCOL.encode(nothing)


@pytest.mark.parametrize(("text", "fields"), OUT_OF_RANGE)
def test_received_values_out_of_range_are_kept_and_marked(text: str, fields: dict[str, int]) -> None:
    message = PROTOCOL.decode(*frame(text))
    assert flagged_fields(message) == list(fields)
    assert {field: int(getattr(message, field)) for field in fields} == fields
    with pytest.raises(FieldError):
        PROTOCOL.encode(message)  # what was flagged does not go on


def test_bits_after_the_mapping_are_ignored() -> None:
    troubles = [PROTOCOL.decode(0x102, bytes([byte])) for byte in (0x00, 0x01, 0xFE, 0xFF)]
    assert troubles == [Brake(Trouble.OVERLOAD), Brake(Trouble.OBSTACLE)] * 2
    # Where the whole byte is mapped, what is no trouble is flagged, not taken for one.
    for byte in range(2, 256):
        message = REVERSED.decode(0x102, bytes([byte]))
        assert message == Brake(OutOfRange(byte))
        assert flagged_fields(message) == ["trouble"]


def test_a_field_that_one_dialect_has_goes_over_its_bits() -> None:
    for ride, doors in product(Ride, Doors):
        move = MoveTo(1234, ride, 75, 600, doors)
        word = 1234 << 28 | ride << 26 | 75 << 19 | 600 << 3 | doors << 2
        assert REVERSED.encode(move) == Frame(0x108, word.to_bytes(5, "big"))
        assert REVERSED.decode(0x108, word.to_bytes(5, "big")) == move


# Lengths


@pytest.mark.parametrize("protocol", [PROTOCOL, REVERSED])
@pytest.mark.parametrize("name", PROTOCOL.names())
def test_a_frame_is_as_long_as_its_mapping_or_ends_before_its_optional_fields(protocol: Protocol, name: str) -> None:
    binding = protocol.binding(name)
    assert binding.lengths == ((3, 5) if name == "Move To" else (binding.layout.length,))
    expected = " or ".join(map(str, binding.lengths))
    for length in set(range(binding.layout.length)) - set(binding.lengths):
        for read in (protocol.decode, protocol.unpack):
            with pytest.raises(FrameLengthError) as error:
                read(binding.cob_id, bytes(length))
            told = f"{name} (0x{binding.cob_id:03X}): {length} bytes of data, expected {expected}"
            assert str(error.value) == told


@pytest.mark.parametrize("protocol", [PROTOCOL, REVERSED])
def test_a_frame_may_omit_its_optional_fields(protocol: Protocol) -> None:
    full = protocol.encode(MOVE._replace(pause=600))
    assert protocol.decode(full.cob_id, full.data[:3]) == MOVE
    assert protocol.unpack(full.cob_id, full.data[:3])[1]["pause"] == 0


@pytest.mark.parametrize("reserved", range(1, 1 << 3))
def test_reserved_bits_are_ignored_and_sent_as_0(reserved: int) -> None:
    move = MOVE._replace(pause=600)
    sent = PROTOCOL.encode(move)
    received = (int.from_bytes(sent.data, "little") | reserved << 21).to_bytes(5, "little")
    assert PROTOCOL.decode(sent.cob_id, received) == move
    assert PROTOCOL.decode(sent.cob_id, received[:3]) == MOVE
    name, values = PROTOCOL.unpack(sent.cob_id, received)
    assert PROTOCOL.pack(name, **values) == sent.data


# Raw integers


def test_pack_and_unpack_use_raw_integers() -> None:
    values = {"height": 1234, "ride": 1, "speed": 75, "pause": 600}
    data = PROTOCOL.pack("Move To", **values)
    assert data.hex().upper() == "D2D4125802"
    assert PROTOCOL.unpack(0x108, data) == ("Move To", values)


def test_pack_checks_only_widths() -> None:
    assert PROTOCOL.pack("Move To", height=4095, ride=3, speed=127, pause=0xFFFF).hex() == "ffff1fffff"
    assert PROTOCOL.pack("State Response", time=0xABCDEF) == bytes.fromhex("EFCDAB")


def test_pack_may_omit_optional_fields() -> None:
    short = {"height": 1, "ride": 2, "speed": 4}
    assert PROTOCOL.pack("Move To", **short) == PROTOCOL.pack("Move To", **short, pause=0)
    assert REVERSED.pack("Move To", **short) == REVERSED.pack("Move To", **short, pause=0, doors=0)


NOT_PACKED: list[tuple[str, dict[str, Any], str]] = [
    ("Brake", {"trouble": 2}, "Brake: trouble = 2 is not allowed; allowed: 0..1"),
    ("Brake", {"trouble": -1}, "Brake: trouble = -1 is not allowed; allowed: 0..1"),
    ("Brake", {"trouble": 1.0}, "Brake: trouble = 1.0 is not allowed; allowed: 0..1"),
    ("Brake", {}, "Brake: trouble = None is not allowed; allowed: 0..1"),
    ("State Response", {"time": 1 << 24}, "State Response: time = 16777216 is not allowed"),
]


@pytest.mark.parametrize(("name", "values", "told"), NOT_PACKED)
def test_pack_refuses_values_that_do_not_fit(name: str, values: dict[str, Any], told: str) -> None:
    with pytest.raises(FieldError) as error:
        PROTOCOL.pack(name, **values)
    assert str(error.value).startswith(told)


KNOWN = "known: height, ride, speed, pause"


@pytest.mark.parametrize(
    ("field", "hint"),
    [("z", KNOWN), ("doors", KNOWN), ("Height", r"did you mean height\?")],  # doors: only where the EDS maps it
)
def test_pack_refuses_an_unknown_field(field: str, hint: str) -> None:
    with pytest.raises(UnknownName, match=f"unknown field of Move To '{field}'; {hint}"):
        PROTOCOL.pack("Move To", height=1, ride=1, speed=1, **{field: 0})


# Dictionaries that do not fit: changes in the EDS files, the file and index told, and what is said.

Change = tuple[str, str, str, str]
"""A node, a section, a key and its new value."""

FIELDS = "height, ride, speed, pause, doors"
MISFITS: list[tuple[list[Change], str, int, str]] = [
    (
        [("cabin", f"1603sub{n}", "DefaultValue", "0x20000110") for n in (1, 2, 3, 4)],
        "cabin",
        0x1603,
        "Move To: 80 bits are mapped, a PDO has at most 64",
    ),
    (
        [("panel", "1804sub1", "DefaultValue", "0x00000108")],
        "panel",
        0x1804,
        "State Request: COB-ID 0x108 is already that of Move To (panel.eds 0x1803)",
    ),
    (
        [("door", "1800sub1", "DefaultValue", "0x00000114")],
        "door",
        0x1800,
        "Floor Response: COB-ID 0x114 is already that of State Response (cabin.eds 0x1801)",
    ),
    (
        [("cabin", "1403sub1", "DefaultValue", "0x00000109")],
        "cabin",
        0x1403,
        "Move To: COB-ID 0x109, but 0x108 in panel.eds",
    ),
    (
        [("cabin", "1603sub1", "DefaultValue", "0x2000010B")],
        "cabin",
        0x1603,
        "Move To: mapping differs from that in panel.eds 0x1A03",
    ),
    (
        [("cabin", "1603sub2", "DefaultValue", "0x20000307"), ("cabin", "1603sub3", "DefaultValue", "0x20000202")],
        "cabin",
        0x1603,
        "Move To: mapping differs from that in panel.eds 0x1A03",
    ),
    (
        [("panel", "1A03sub3", "DefaultValue", "0x20010101")],
        "panel",
        0x1A03,
        f"Move To maps height, ride, trouble, pause; the fields of class MoveTo are {FIELDS}",
    ),
    (
        [("panel", "1A03sub0", "DefaultValue", "2")],
        "panel",
        0x1A03,
        f"Move To maps height, ride; the fields of class MoveTo are {FIELDS}",
    ),
    (
        [("panel", "1A01sub0", "DefaultValue", "0")],
        "panel",
        0x1A01,
        "Brake maps nothing; the fields of class Brake are trouble",
    ),
    (
        [("panel", "1A02sub0", "DefaultValue", "1"), ("panel", "1A02sub1", "DefaultValue", "0x20010101")],
        "panel",
        0x1A02,
        "Halt maps trouble; the fields of class Halt are nothing",
    ),
    (
        [("panel", "1A03sub2", "DefaultValue", "0x2000010C")],
        "panel",
        0x1A03,
        f"Move To maps height, height_2, speed, pause; the fields of class MoveTo are {FIELDS}",
    ),
    (
        [("panel", "1803", "ParameterName", "Move Too")],
        "cabin",
        0x1403,
        "Move To: COB-ID 0x108 is already that of Move Too (panel.eds 0x1803)",
    ),
    (
        [("panel", "1A03sub1", "DefaultValue", "0x2FFF010C")],
        "panel",
        0x1A03,
        "maps 0x2FFF sub 1, which is missing",
    ),
]

# The same for slices: entry of the mapping or name of the slice, in panel.eds with the most significant bit first.
BAD_SLICES = [
    ("1A03sub1", "DefaultValue", "0x30000107", "Height (11:4) is mapped with 7 bits"),
    ("3000sub3", "ParameterName", "Height [4:1]", "height: bit 0 is mapped nowhere"),
    ("3000sub1", "ParameterName", "Height [10:3]", "height: bits are mapped twice"),
    ("3000sub1", "ParameterName", "Height [12:5]", "height: bit 4 is mapped nowhere"),
    ("3000sub3", "ParameterName", "Depth [3:0]", "height: bit 0 is mapped nowhere"),
]


def changed(changes: Iterable[Change], dialect: str = lift.DIALECT) -> LiftProtocol:
    """Return the protocol of the lift's files with some changes."""
    texts = {name: lift.dictionary(name, dialect).content.decode() for name in lift.NAMES}
    for node, *change in changes:
        texts[node] = with_entry(texts[node], *change)
    read = (Dictionary.read(text.encode(), Path(f"{name}.eds")) for name, text in texts.items())
    return LiftProtocol.of_devices(read, lift.CATALOGUE)


@pytest.mark.parametrize(("changes", "node", "index", "what"), MISFITS)
def test_a_mapping_that_does_not_fit_is_an_error_with_file_and_index(
    changes: list[Change], node: str, index: int, what: str
) -> None:
    with pytest.raises(MappingError) as error:
        changed(changes)
    assert (error.value.file, error.value.index) == (f"{node}.eds", index)
    assert str(error.value) == f"{node}.eds: 0x{index:04X}: {what}"


@pytest.mark.parametrize(("section", "key", "value", "what"), BAD_SLICES)
def test_incomplete_slices_are_an_error(section: str, key: str, value: str, what: str) -> None:
    with pytest.raises(MappingError) as error:
        changed([("panel", section, key, value)], lift.REVERSED)
    assert error.value.index == 0x1A03
    assert str(error.value).endswith(f"panel.eds: 0x1A03: Move To: {what}")


def test_an_optional_field_need_not_be_mapped() -> None:
    protocol = changed([("panel", "1A03sub0", "DefaultValue", "4"), ("cabin", "1603sub0", "DefaultValue", "4")])
    assert protocol.encode(MOVE).data.hex() == "d2d412"
    assert protocol.decode(*protocol.encode(MOVE)) == MOVE
    with pytest.raises(FieldError, match=r"pause = 1 .* allowed: 0 s, as the loaded EDS does not map it"):
        protocol.encode(MOVE._replace(pause=1))


# A field narrower than its meanings: what does not fit is refused, not cut.
NARROW = [
    ("time", [("cabin", "1A01sub1", "0x20020110"), ("panel", "1601sub1", "0x20020110")], StateResponse(5), 0xFFFFFF),
    ("time", [("cabin", "1A01sub1", "0x2002010F"), ("panel", "1601sub1", "0x2002010F")], StateResponse(32767), 32768),
    (
        "turn",
        [("cabin", "1A02sub3", "0x20110308"), ("panel", "1603sub3", "0x20110308")],
        PlaceResponse(1, 2, 255, Sensor.BELT),
        256,
    ),
]


@pytest.mark.parametrize(("field", "entries", "message", "value"), NARROW)
def test_a_value_wider_than_its_bits_is_not_encoded(
    field: str, entries: list[tuple[str, str, str]], message: Message, value: int
) -> None:
    protocol = changed((node, section, "DefaultValue", entry) for node, section, entry in entries)
    assert protocol.decode(*protocol.encode(message)) == message
    with pytest.raises(FieldError, match=f"{field} = .* bits that the loaded EDS maps"):
        protocol.encode(message._replace(**{field: NoTime(value) if value in set(NoTime) else value}))


@pytest.mark.parametrize("time", [0, 1, 60000, *NoTime, None, True, 60001, 0x0FFFFF, -1, 1.0])
def test_a_wide_field_is_written_by_its_kind(time: Any) -> None:
    """Numbers go past the kind, so there must be no difference."""
    binding, message = PROTOCOL.binding(StateResponse), StateResponse(time)
    try:
        raw = binding.raw("time", time)
    except FieldError:
        with pytest.raises(FieldError):
            PROTOCOL.encode(message)
    else:
        assert PROTOCOL.encode(message).data == raw.to_bytes(3, "little")
        read = binding.kinds["time"].read(raw, binding.limits["time"])
        assert PROTOCOL.decode(*PROTOCOL.encode(message)) == StateResponse(read)


@pytest.mark.parametrize("type_", ["int64", "int32", "uint16", "float64", "float32"])
def test_numpy_numbers_are_accepted(type_: str) -> None:
    make = getattr(pytest.importorskip("numpy"), type_)
    message = MoveTo(make(1234), Ride.SERVICE, make(75), make(600))
    assert PROTOCOL.encode(message).data.hex() == "d2d4125802"
    for wrong in (make(3001), make(40000)):
        with pytest.raises(FieldError, match=r"allowed: 0\.\.3000 mm"):
            PROTOCOL.encode(message._replace(height=wrong))
    if type_.startswith("float"):
        with pytest.raises(FieldError, match=r"whole millimetres, 0\.\.3000 mm"):
            PROTOCOL.encode(message._replace(height=make(1.5)))
    else:
        raws = {field: make(value) for field, value in (("height", 1234), ("ride", 1), ("speed", 75))}
        assert PROTOCOL.pack("Move To", **raws, pause=600).hex() == "d2d4125802"


def test_errors_of_received_frames_are_remote_errors() -> None:
    for cob_id, data in ((0x003, b""), (0x108, b"\x01")):
        with pytest.raises(RemoteError):
            PROTOCOL.decode(cob_id, data)


@pytest.mark.parametrize(
    ("node_id", "text"),
    [
        (5, "configuration refused"),  # a device of the catalogue, by the name of its PDO
        (6, "device specific"),  # a drive of CiA 402, of another maker
        (7, "fan blocked"),  # its maker's table, whatever the profile
        (8, "device specific"),  # of another maker, without a profile
        (9, "device specific"),  # of which there is no file
    ],
)
def test_a_catalogues_error_texts_apply_to_its_own_devices(node_id: int, text: str) -> None:
    move = pdo(0x1800, "0x20000010", cob_id="0x185", name="Move To")
    devices = [
        Dictionary.read(text.encode(), Path("any.eds"), node_id)
        for node_id, text in {
            5: DEVICE_TYPE + move,
            6: DEVICE_TYPE.replace("Value=0", "Value=402"),
            7: DEVICE_TYPE.replace("Value=0", "Value=402"),
            8: DEVICE_TYPE + pdo(0x1800, "0x20000010", cob_id="0x185"),
        }.items()
    ]
    words = ErrorWords.of_devices(devices, lift.CATALOGUE, {7: {0xFF02: "fan blocked"}})
    assert words.of(node_id)(0xFF02) == text
