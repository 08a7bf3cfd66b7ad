"""The protocol: identifiers and bits from the EDS files, meanings from the message types, and what does not fit."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import pytest

import eurobot_od
from eurobot_od.errors import FieldError, FrameLengthError, MappingError, RemoteError, UnknownIdentifier, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import make_files, write_files
from eurobot_od.pdo.kinds import Message, OutOfRange, flagged_fields
from eurobot_od.pdo.protocol import ErrorWords, Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CATALOGUE,
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    ConfederatePositionResponse,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Barriers, Direction, GotoFault, Obstacle, Passage, Route, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from tests.eds_text import DEVICE_TYPE, pdo
from tests.robot.document import NAMES, TABLES_4_AND_5
from tests.rows import rows

ROOT = Path(__file__).parents[2]
PROTOCOL = EurobotProtocol.load("canopen")
FIRMWARE = EurobotProtocol.load("firmware2014")
GOLDEN = json.loads((ROOT / "tests" / "golden" / "firmware2014.json").read_text())

Spoil = Callable[..., Path]

GOTO = GotoXY(x=1234, y=567, angle=89, speed=75)
START = StartConfigurationSet(TeamColour.RED, 2, 1, 45, 33)

# The document's messages as they go over the wire in CiA 301's order, and back.
FRAMES: list[tuple[Message, str]] = [
    (EmergencyShutdown(), "001#"),
    (EmergencyStop(Obstacle.OBJECT), "002#00"),
    (EmergencyStop(Obstacle.ENEMY), "002#01"),
    (StopDrive(), "004#"),
    (GOTO, "008#D27423592C010000"),
    (GOTO._replace(barriers=Barriers(0xA5C3)), "008#D27423592C01C3A5"),
    (GOTO._replace(barriers=Barriers.of({1: Passage.FORCED, 8: Passage.NORMAL})), "008#D27423592C010240"),
    (GotoXY(0, 0, 0, 0), "008#0000000000000000"),
    (GotoXY(3000, 2000, 359, 100), "008#B80B7D6791010000"),
    (GotoConfirm(), "00C#"),
    (GotoStateRequest(), "010#"),
    (GotoStateResponse(0), "014#000000"),
    (GotoStateResponse(0x0FFFFE), "014#FEFF0F"),
    (GotoStateResponse(None), "014#FFFF0F"),
    (GotoStateResponse(GotoFault.BLOCKED), "014#FEFFFF"),
    (GotoStateResponse(GotoFault.NOT_POSSIBLE), "014#FFFFFF"),
    (NaviPositionRequest(), "040#"),
    (NaviPositionResponse(1234, 567, 89, Source.INTERNAL), "080#D274235900"),
    (NaviPositionResponse(None, None, None, Source.INTERNAL), "080#FFF00FFF03"),
    (NaviPositionResponse(255, 255, 0, Source.INTERNAL), "080#FFF00F0000"),  # 255 mm alone is a real place
    (NaviPositionResponse(254, 255, None, Source.INTERNAL), "080#FEF00FFF03"),  # a place without a heading
    (KalmanPositionRequest(), "0C0#"),
    (KalmanPositionResponse(3000, 2000, 359, Source.INTERNAL), "100#B80B7D6701"),
    (Enemy1PositionRequest(), "140#"),
    (Enemy1PositionResponse(0, 1, 2, Source.ENEMY_1), "180#0010000208"),
    (Enemy2PositionRequest(), "1C0#"),
    (Enemy2PositionResponse(None, None, None, Source.ENEMY_2), "200#FFF00FFF0F"),
    (ConfederatePositionRequest(), "240#"),
    (ConfederatePositionResponse(255, 255, 359, Source.CONFEDERATE), "280#FFF00F6705"),
    (START, "2C0#DD86"),
    (StartConfigurationSet(TeamColour.YELLOW, 0, 0, 0, 0), "2C0#0000"),
    (StartConfigurationSet(TeamColour.RED, 2, 1, 50, 50), "2C0#2DCB"),
    (StartConfigurationConfirm(), "300#"),
    (CheckNaviRequest(), "340#"),
    (CheckNaviResponse(), "380#"),
    (CheckDriveRequest(), "3C0#"),
    (CheckDriveResponse(), "400#"),
]

# What may not be sent: the message, the field that is named, and what is said to be allowed.
FORBIDDEN: list[tuple[Message, str, str]] = [
    (EmergencyStop(OutOfRange(2)), "obstacle", "object (0), enemy (1)"),
    (GOTO._replace(x=3001), "x", "0..3000 mm"),
    (GOTO._replace(x=-1), "x", "0..3000 mm"),
    (GOTO._replace(x=-3001), "x", "0..3000 mm"),  # the first from the end of a table of all places
    (GOTO._replace(x=-6002), "x", "0..3000 mm"),
    (GOTO._replace(x=-1 << 64), "x", "0..3000 mm"),
    (GOTO._replace(x=1 << 64), "x", "0..3000 mm"),
    (GOTO._replace(y=2001), "y", "0..2000 mm"),
    (GOTO._replace(speed=101), "speed", "0..100 %"),
    (GOTO._replace(barriers=Barriers(0x10000)), "barriers", "0..65535, or fire-1, fire-2, fire-3,"),
    (GOTO._replace(direction=Direction.BACKWARD), "direction", "forward, as the loaded EDS does not map it"),
    (GOTO._replace(route=Route.DIRECT), "route", "planned, as the loaded EDS does not map it"),
    (GotoStateResponse(0x0FFFFF), "time", "0..1048574 ms, None for unknown, blocked, not possible"),
    (GotoStateResponse(-1), "time", "0..1048574 ms, None for unknown, blocked, not possible"),
    (NaviPositionResponse(None, 5, 5, Source.INTERNAL), "x", "0..3000 mm, or x, y and angle None for unknown"),
    (NaviPositionResponse(5, None, None, Source.INTERNAL), "y", "0..2000 mm, or x, y and angle None for unknown"),
    (KalmanPositionResponse(None, None, 5, Source.INTERNAL), "x", "0..3000 mm, or x, y and angle None for unknown"),
    # a real place whose bits would say "unknown"
    (
        NaviPositionResponse(255, 255, None, Source.INTERNAL),
        "x",
        "another place: with an unknown angle it means unknown",
    ),
    (
        Enemy1PositionResponse(5, 5, 5, OutOfRange(4)),
        "source",
        "internal (0), confederate (1), enemy 1 (2), enemy 2 (3)",
    ),
    (START._replace(enemies=3), "enemies", "0..2"),
    (START._replace(confederates=2), "confederates", "0..1"),
    (START._replace(enemy_1_diameter=51), "enemy_1_diameter", "0..50 cm"),
    (START._replace(enemy_2_diameter=-1), "enemy_2_diameter", "0..50 cm"),
]

# What callers without types may give; each is refused in the field's own words.
NO_VALUES: list[Any] = [None, "5", 1.5, float("nan"), float("inf"), [], {}, object(), b"\x05", 1j]

# Received values outside their range stay what they are, flagged: frame, and the fields concerned.
OUT_OF_RANGE: list[tuple[str, dict[str, int]]] = [
    ("008#B90B7D6791010000", {"x": 3001}),
    ("008#B81B7D6791010000", {"y": 2001}),
    ("008#D27423FF2F010000", {"angle": 0x3FF}),  # a goto has no unknown angle
    ("008#0000000094010000", {"speed": 101}),
    ("014#000010", {"time": 0x100000}),
    ("014#FDFFFF", {"time": 0xFFFFFD}),
    ("080#FFFFFFFF03", {"x": 4095, "y": 4095}),
    ("100#0000006801", {"angle": 360}),
    ("180#0000000010", {"source": 4}),
    ("2C0#FFFF", {"enemies": 3, "enemy_1_diameter": 63, "enemy_2_diameter": 63}),
]


def frame(text: str) -> Frame:
    cob_id, _, data = text.partition("#")
    return Frame(int(cob_id, 16), bytes.fromhex(data))


# What there is


@pytest.mark.parametrize("dialect", dialects.names())
def test_messages_are_those_of_the_documents_tables(dialect: str) -> None:
    bindings = [each for each in EurobotProtocol.load(dialect).bindings if each.name in NAMES]
    rows = [(row.cob_id, row.name, row.senders, row.receivers) for row in TABLES_4_AND_5]
    assert [(each.cob_id, each.name, each.senders, each.receivers) for each in bindings] == rows


@rows("cob_id, name", [row[:2] for row in TABLES_4_AND_5])
def test_message_is_found_by_identifier_name_and_type(cob_id: int, name: str) -> None:
    binding = PROTOCOL.binding_of(cob_id)
    assert PROTOCOL.binding(name) is PROTOCOL.binding(name.lower()) is PROTOCOL.binding(binding.type) is binding
    assert PROTOCOL.cob_id(binding.type) == PROTOCOL.cob_id(name) == cob_id
    assert PROTOCOL.name(binding.type) == name


def test_names_are_most_urgent_first() -> None:
    assert PROTOCOL.names() == sorted(PROTOCOL.names(), key=PROTOCOL.cob_id)


def test_every_message_of_the_document_has_a_frame_in_the_table() -> None:
    assert {PROTOCOL.name(type(message)) for message, _ in FRAMES} == set(NAMES)


def test_a_node_knows_its_own_messages_only() -> None:
    core = EurobotProtocol.of(dialects.load("core"))
    assert "Goto XY" in core.names()
    with pytest.raises(UnknownName, match="unknown message 'NaviPositionResponse'"):
        core.cob_id(NaviPositionResponse)  # its PDO is not valid until somebody configures it
    with pytest.raises(UnknownName, match="unknown message 'NaviPositionResponse'"):
        core.encode(NaviPositionResponse(1, 1, 1, Source.INTERNAL))
    with pytest.raises(UnknownIdentifier):
        core.decode(0x080, bytes(5))


@pytest.mark.parametrize("name", ["Goto", "Go to XY!", ""])
def test_unknown_message_is_told(name: str) -> None:
    for ask in (PROTOCOL.binding, PROTOCOL.cob_id, PROTOCOL.pack):
        with pytest.raises(UnknownName, match=f"unknown message '{name}'"):
            ask(name)


@pytest.mark.parametrize("cob_id", [0x000, 0x003, 0x7FF, 0x800, -1])
def test_unknown_identifier_is_told(cob_id: int) -> None:
    for ask in (PROTOCOL.decode, PROTOCOL.unpack):
        with pytest.raises(UnknownIdentifier):
            ask(cob_id, b"")


def test_names_of_the_package_are_loaded_when_asked_for() -> None:
    assert issubclass(eurobot_od.Protocol, Protocol)  # with the deprecated `load`
    assert eurobot_od.Frame is Frame
    assert eurobot_od.messages.GotoXY is GotoXY
    assert all(hasattr(eurobot_od, name) for name in import_module("eurobot_od").__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Kern'"):
        _ = eurobot_od.Kern  # type: ignore[attr-defined]


# Encoding and decoding


@rows("message, text", FRAMES)
def test_encodes(message: Message, text: str) -> None:
    assert str(PROTOCOL.encode(message)) == text


@rows("message, text", FRAMES)
def test_decodes(message: Message, text: str) -> None:
    cob_id, data = frame(text)
    for kind in (bytes, bytearray, memoryview, list):
        decoded = PROTOCOL.decode(cob_id, kind(data))  # type: ignore[arg-type]  # callers without types
        assert decoded == message
        assert [type(value) for value in decoded] == [type(value) for value in message]


def test_messages_are_encoded_and_decoded_alike_the_first_and_any_other_time() -> None:
    protocol = EurobotProtocol.load("canopen")  # that has seen none of them
    for message, text in FRAMES:
        assert [protocol.encode(message) for _ in range(3)] == [frame(text)] * 3
        assert [protocol.decode(*frame(text)) for _ in range(3)] == [message] * 3


@pytest.mark.parametrize(("angle", "sent"), [(360, 0), (-1, 359), (450, 90), (-720, 0), (1023, 303), (90.0, 90)])
def test_any_whole_angle_is_brought_to_the_circle(angle: Any, sent: int) -> None:
    assert PROTOCOL.encode(GOTO._replace(angle=angle)) == PROTOCOL.encode(GOTO._replace(angle=sent))
    place = NaviPositionResponse(1, 2, angle, Source.INTERNAL)
    assert PROTOCOL.encode(place) == PROTOCOL.encode(place._replace(angle=sent))


@rows("message, field, allowed", FORBIDDEN)
def test_refuses_to_send_a_value_out_of_range(message: Message, field: str, allowed: str) -> None:
    with pytest.raises(FieldError) as error:
        PROTOCOL.encode(message)
    name = PROTOCOL.name(type(message))
    assert (error.value.message, error.value.field) == (name, field)
    assert error.value.value == getattr(message, field)
    assert error.value.allowed.startswith(allowed)
    assert str(error.value).startswith(f"{name}: {field} = ")


@pytest.mark.parametrize("protocol", [PROTOCOL, FIRMWARE])
@pytest.mark.parametrize("message", [GOTO, EmergencyStop(Obstacle.ENEMY), START])
def test_refuses_to_send_what_is_no_value(message: Message, protocol: Protocol) -> None:
    for field, value in product(message._fields, NO_VALUES):
        with pytest.raises(FieldError, match=f": {field} = "):
            protocol.encode(message._replace(**{field: value}))


def test_refuses_to_send_what_is_no_message() -> None:
    nothing: Any = ("Goto XY", 1)
    with pytest.raises(UnknownName, match="unknown message 'tuple'"):
        PROTOCOL.encode(nothing)


@rows("text, fields", OUT_OF_RANGE)
def test_flags_received_values_out_of_range_and_keeps_them(text: str, fields: dict[str, int]) -> None:
    message = PROTOCOL.decode(*frame(text))
    assert flagged_fields(message) == list(fields)
    assert {field: int(getattr(message, field)) for field in fields} == fields
    with pytest.raises(FieldError):
        PROTOCOL.encode(message)  # what was flagged does not go on


# Lengths


@rows("protocol", [PROTOCOL, FIRMWARE])
@rows("name", [row[1] for row in TABLES_4_AND_5])
def test_2014_length_never_looked_at_so_short_frames_read_left_over_bytes(protocol: Protocol, name: str) -> None:
    binding = protocol.binding(name)
    assert binding.lengths == ((6, 8) if name == "Goto XY" else (binding.layout.length,))
    expected = " or ".join(map(str, binding.lengths))
    for length in set(range(binding.layout.length)) - set(binding.lengths):
        for read in (protocol.decode, protocol.unpack):
            with pytest.raises(FrameLengthError) as error:
                read(binding.cob_id, bytes(length))
            told = f"{name} (0x{binding.cob_id:03X}): {length} bytes of data, expected {expected}"
            assert str(error.value) == told


@pytest.mark.parametrize("protocol", [PROTOCOL, FIRMWARE])
def test_goto_may_leave_out_its_barriers(protocol: Protocol) -> None:
    full = protocol.encode(GOTO._replace(barriers=Barriers(0xFFFF)))
    assert protocol.decode(full.cob_id, full.data[:6]) == GOTO
    values = protocol.unpack(full.cob_id, full.data[:6])[1]
    assert values["barriers"] == 0
    assert values.get("route", Route.PLANNED) == Route.PLANNED


@rows("reserved", range(1, 1 << 6))
def test_reserved_bits_are_not_looked_at_and_sent_as_0(reserved: int) -> None:
    goto = GOTO._replace(barriers=Barriers(0xA5C3))
    sent = PROTOCOL.encode(goto)
    received = (int.from_bytes(sent.data, "little") | reserved << 42).to_bytes(8, "little")
    assert PROTOCOL.decode(sent.cob_id, received) == goto
    assert PROTOCOL.decode(sent.cob_id, received[:6]) == GOTO
    name, values = PROTOCOL.unpack(sent.cob_id, received)
    assert PROTOCOL.pack(name, **values) == sent.data


# Raw integers


def test_pack_and_unpack_speak_raw_integers() -> None:
    data = PROTOCOL.pack("Goto XY", x=1234, y=567, angle=89, speed=75, barriers=0xA5C3)
    assert data.hex().upper() == "D27423592C01C3A5"
    values = {"x": 1234, "y": 567, "angle": 89, "speed": 75, "barriers": 0xA5C3}
    assert PROTOCOL.unpack(0x008, data) == ("Goto XY", values)


def test_pack_looks_at_widths_only() -> None:
    assert PROTOCOL.pack("Goto XY", x=4095, y=4095, angle=1023, speed=255, barriers=0xFFFF).hex() == "ffffffffff03ffff"
    assert PROTOCOL.pack("Goto State Response", time=0xABCDEF) == bytes.fromhex("EFCDAB")


def test_pack_may_leave_out_optional_fields() -> None:
    short = {"x": 1, "y": 2, "angle": 3, "speed": 4}
    assert PROTOCOL.pack("Goto XY", **short) == PROTOCOL.pack("Goto XY", **short, barriers=0)
    assert FIRMWARE.pack("Goto XY", **short) == FIRMWARE.pack("Goto XY", **short, barriers=0, direction=0, route=1)


NOT_PACKED: list[tuple[str, dict[str, Any], str]] = [
    ("Emergency Stop", {"obstacle": 2}, "Emergency Stop: obstacle = 2 is not allowed; allowed: 0..1"),
    ("Emergency Stop", {"obstacle": -1}, "Emergency Stop: obstacle = -1 is not allowed; allowed: 0..1"),
    ("Emergency Stop", {"obstacle": 1.0}, "Emergency Stop: obstacle = 1.0 is not allowed; allowed: 0..1"),
    ("Emergency Stop", {}, "Emergency Stop: obstacle = None is not allowed; allowed: 0..1"),
    ("Goto State Response", {"time": 1 << 24}, "Goto State Response: time = 16777216 is not allowed"),
]


@pytest.mark.parametrize(("name", "values", "told"), NOT_PACKED)
def test_pack_refuses_what_has_no_bits(name: str, values: dict[str, Any], told: str) -> None:
    with pytest.raises(FieldError) as error:
        PROTOCOL.pack(name, **values)
    assert str(error.value).startswith(told)


KNOWN = "known: x, y, angle, speed, barriers"


@pytest.mark.parametrize(
    ("field", "hint"),
    [("z", KNOWN), ("direction", KNOWN), ("X", r"did you mean x\?")],  # direction: only where the EDS maps it
)
def test_pack_refuses_an_unknown_field(field: str, hint: str) -> None:
    with pytest.raises(UnknownName, match=f"unknown field of Goto XY '{field}'; {hint}"):
        PROTOCOL.pack("Goto XY", x=1, y=1, angle=1, speed=1, **{field: 0})


# The 2014 robot


def raw_values(protocol: Protocol, message: Message) -> dict[str, int]:
    """Give the raw values that a message came from, those that are flagged too."""
    binding = protocol.binding(type(message))
    if binding.layout.fields[:2] == ("x", "y") and message[:3] == (None, None, None):
        message = message._replace(x=0xFF, y=0xFF)
    mapped = {field: value for field, value in message._asdict().items() if field in binding.limits}
    return {f: int(v) if isinstance(v, OutOfRange) else binding.raw(f, v) for f, v in mapped.items()}


def test_recordings_have_every_message_of_the_document() -> None:
    assert {each["message"] for each in GOLDEN["encode"]} == set(NAMES)


@rows("each", GOLDEN["encode"])
def test_sends_the_2014_robots_frames_unless_a_value_is_out_of_range(each: dict[str, Any]) -> None:
    sent = Frame(FIRMWARE.cob_id(each["message"]), FIRMWARE.pack(each["message"], **each["fields"]))
    assert sent == Frame(each["id"], bytes.fromhex(each["data"]))
    message = FIRMWARE.decode(*sent)
    if flagged_fields(message):
        with pytest.raises(FieldError, match=f"^{each['message']}: "):
            FIRMWARE.encode(message)
    else:
        assert FIRMWARE.encode(message) == sent


@rows("each", GOLDEN["encode"] + GOLDEN["decode"])
def test_reads_the_2014_robots_frames_with_every_raw_value(each: dict[str, Any]) -> None:
    data = bytes.fromhex(each["data"])
    assert FIRMWARE.unpack(each["id"], data) == (each["message"], each["fields"])
    message = FIRMWARE.decode(each["id"], data)
    assert FIRMWARE.name(type(message)) == each["message"]
    assert raw_values(FIRMWARE, message) == each["fields"]


def test_goto_has_two_further_bits_in_the_2014_robot() -> None:
    for direction, route in product(Direction, Route):
        goto = GOTO._replace(direction=direction, route=route)
        word = 1234 << 52 | 567 << 40 | 89 << 30 | 75 << 22 | direction << 5 | route << 4
        assert FIRMWARE.encode(goto) == Frame(0x008, word.to_bytes(8, "big"))
        assert FIRMWARE.decode(0x008, word.to_bytes(8, "big")) == goto


def test_2014_unmasked_obstacle_byte() -> None:
    # One bit is mapped by CiA 301's order: the other seven of the byte never reach the application.
    assert [PROTOCOL.decode(0x002, bytes([byte])) for byte in (0x00, 0x01, 0xFE, 0xFF)] == [
        EmergencyStop(Obstacle.OBJECT),
        EmergencyStop(Obstacle.ENEMY),
        EmergencyStop(Obstacle.OBJECT),
        EmergencyStop(Obstacle.ENEMY),
    ]
    # The robot's own frames have the whole byte: what is not an obstacle is flagged, not taken for one.
    for byte in range(2, 256):
        message = FIRMWARE.decode(0x002, bytes([byte]))
        assert message == EmergencyStop(OutOfRange(byte))
        assert flagged_fields(message) == ["obstacle"]


# Dictionaries that do not fit: changes in the EDS files, the file and index told, and what is said.
MISFITS: list[tuple[list[tuple[str, str, str, str | None]], str, int, str]] = [
    (
        [("drive", f"1603sub{n}", "DefaultValue", f"0x20000{n}10") for n in (1, 2, 3)],
        "drive",
        0x1603,
        "Goto XY: 78 bits are mapped, a PDO has at most 64",
    ),
    (
        [("core", "1804sub1", "DefaultValue", "0x00000008")],
        "core",
        0x1804,
        "Goto State Request: COB-ID 0x008 is already that of Goto XY (core.eds 0x1803)",
    ),
    (
        [("navigation", "1800sub1", "DefaultValue", "0x00000014")],
        "navigation",
        0x1800,
        "Navi Position Response: COB-ID 0x014 is already that of Goto State Response (drive.eds 0x1801)",
    ),
    (
        [("drive", "1403sub1", "DefaultValue", "0x00000009")],
        "drive",
        0x1403,
        "Goto XY: COB-ID 0x009, but 0x008 in core.eds",
    ),
    (
        [("drive", "1603sub1", "DefaultValue", "0x2000010B")],
        "drive",
        0x1603,
        "Goto XY: mapping differs from that in core.eds 0x1A03",
    ),
    (
        [("drive", "1603sub1", "DefaultValue", "0x2000020C"), ("drive", "1603sub2", "DefaultValue", "0x2000010C")],
        "drive",
        0x1603,
        "Goto XY: mapping differs from that in core.eds 0x1A03",
    ),
    (
        [("core", "1A03sub4", "DefaultValue", "0x20010101")],
        "core",
        0x1A03,
        "Goto XY maps x, y, angle, obstacle, barriers; its fields are x, y, angle, speed, barriers, direction, route",
    ),
    (
        [("core", "1A03sub0", "DefaultValue", "3")],
        "core",
        0x1A03,
        "Goto XY maps x, y, angle; its fields are x, y, angle, speed, barriers, direction, route",
    ),
    (
        [("core", "1A01sub0", "DefaultValue", "0")],
        "core",
        0x1A01,
        "Emergency Stop maps nothing; its fields are obstacle",
    ),
    (
        [("core", "1A02sub0", "DefaultValue", "1"), ("core", "1A02sub1", "DefaultValue", "0x20010101")],
        "core",
        0x1A02,
        "Stop Drive maps obstacle; its fields are nothing",
    ),
    (
        [("core", "1A03sub2", "DefaultValue", "0x2000010C")],
        "core",
        0x1A03,
        "Goto XY maps x, x_2, angle, speed, barriers; its fields are x, y, angle, speed, barriers, direction, route",
    ),
    (
        [("core", "1803", "ParameterName", "Goto XYZ")],
        "drive",
        0x1403,
        "Goto XY: COB-ID 0x008 is already that of Goto XYZ (core.eds 0x1803)",
    ),
    (
        [("core", "1A03sub1", "DefaultValue", "0x2FFF010C")],
        "core",
        0x1A03,
        "maps 0x2FFF sub 1, which is missing",
    ),
]

# The same for slices: entry of the mapping or name of the slice, in core.eds of the 2014 robot.
BAD_SLICES = [
    ("1A03sub1", "DefaultValue", "0x30000107", "X position (11:4) is mapped with 7 bits"),
    ("3000sub3", "ParameterName", "X position [4:1]", "x: bit 0 is mapped nowhere"),
    ("3000sub1", "ParameterName", "X position [10:3]", "x: bits are mapped twice"),
    ("3000sub1", "ParameterName", "X position [12:5]", "x: bit 4 is mapped nowhere"),
    ("3000sub3", "ParameterName", "Depth [3:0]", "x: bit 0 is mapped nowhere"),
]


def told_by(folder: Path) -> MappingError:
    with pytest.raises(MappingError) as error:
        EurobotProtocol.load(folder)
    return error.value


@rows("changes, node, index, what", MISFITS)
def test_what_does_not_fit_stops_the_load_with_file_and_index(
    changes: list[tuple[str, str, str, str | None]], node: str, index: int, what: str, spoil_eds: Spoil
) -> None:
    folder = spoil_eds(*changes)
    error = told_by(folder)
    assert (error.file, error.index) == (str(folder / f"{node}.eds"), index)
    assert str(error) == f"{folder / node}.eds: 0x{index:04X}: {what}"


@pytest.mark.parametrize(("section", "key", "value", "what"), BAD_SLICES)
def test_slices_that_make_no_whole_stop_the_load(
    section: str, key: str, value: str, what: str, spoil_eds: Spoil
) -> None:
    error = told_by(spoil_eds(("core", section, key, value), dialect="firmware2014"))
    assert error.index == 0x1A03
    assert str(error).endswith(f"core.eds: 0x1A03: Goto XY: {what}")


def test_a_goto_may_be_mapped_without_barriers(spoil_eds: Spoil) -> None:
    protocol = EurobotProtocol.load(
        spoil_eds(("core", "1A03sub0", "DefaultValue", "4"), ("drive", "1603sub0", "DefaultValue", "4"))
    )
    assert protocol.encode(GOTO).data.hex() == "d27423592c01"
    assert protocol.decode(*protocol.encode(GOTO)) == GOTO
    with pytest.raises(FieldError, match=r"barriers = .* allowed: none, as the loaded EDS does not map it"):
        protocol.encode(GOTO._replace(barriers=Barriers(1)))


# A field narrower than its meanings: what does not fit is refused, not cut.
NARROW = [
    (
        "time",
        [("drive", "1A01sub1", "0x20020114"), ("core", "1601sub1", "0x20020114")],
        GotoStateResponse(5),
        GotoFault.BLOCKED,
    ),
    (
        "time",
        [("drive", "1A01sub1", "0x20020112"), ("core", "1601sub1", "0x20020112")],
        GotoStateResponse(0x3FFFF),
        0x40000,
    ),
    ("angle", [("core", "1A03sub3", "0x20000308"), ("drive", "1603sub3", "0x20000308")], GOTO, 359),
]


@pytest.mark.parametrize(("field", "entries", "message", "value"), NARROW)
def test_a_value_that_its_bits_cannot_hold_is_not_sent(
    field: str, entries: list[tuple[str, str, str]], message: Message, value: Any, spoil_eds: Spoil
) -> None:
    protocol = EurobotProtocol.load(
        spoil_eds(*((node, section, "DefaultValue", entry) for node, section, entry in entries))
    )
    assert protocol.decode(*protocol.encode(message)) == message
    with pytest.raises(FieldError, match=f"{field} = .* bits that the loaded EDS maps"):
        protocol.encode(message._replace(**{field: value}))


@rows("time", [0, 1, 0x0FFFFE, None, GotoFault.BLOCKED, True, 0x0FFFFF, -1, 1.0])
def test_a_wide_field_is_written_as_its_kind_says_it(time: Any) -> None:
    """Numbers go past the kind, so there must be no difference."""
    binding, message = PROTOCOL.binding(GotoStateResponse), GotoStateResponse(time)
    try:
        raw = binding.raw("time", time)
    except FieldError:
        with pytest.raises(FieldError):
            PROTOCOL.encode(message)
    else:
        assert PROTOCOL.encode(message).data == raw.to_bytes(3, "little")
        read = binding.kinds["time"].read(raw, binding.limits["time"])
        assert PROTOCOL.decode(*PROTOCOL.encode(message)) == GotoStateResponse(read)


@pytest.mark.parametrize("type_", ["int64", "int32", "uint16", "float64", "float32"])
def test_numbers_of_numpy_are_numbers(type_: str) -> None:
    make = getattr(pytest.importorskip("numpy"), type_)
    message = GotoXY(make(1234), make(567), make(89), make(75), Barriers(0xA5C3))
    assert PROTOCOL.encode(message).data.hex() == "d27423592c01c3a5"
    for wrong in (make(3001), make(40000)):
        with pytest.raises(FieldError, match=r"allowed: 0\.\.3000 mm"):
            PROTOCOL.encode(message._replace(x=wrong))
    if type_.startswith("float"):
        with pytest.raises(FieldError, match=r"whole millimetres, 0\.\.3000 mm"):
            PROTOCOL.encode(message._replace(x=make(1.5)))
    else:
        raws = {field: make(value) for field, value in (("x", 1234), ("y", 567), ("angle", 89), ("speed", 75))}
        assert PROTOCOL.pack("Goto XY", **raws, barriers=0xA5C3).hex() == "d27423592c01c3a5"


def test_the_codec_follows_the_table(tmp_path: Path) -> None:
    table = (ROOT / "eds" / "protocol.yaml").read_text().replace("{Barriers: 6}", "{Barriers: 4}")
    wider, count = re.subn(r"(Goto XY:.*\n.*\n.*\n *X position: \{bits: )12", r"\g<1>14", table)
    assert count == 1
    write_files(make_files(read_table(wider, "protocol.yaml")), tmp_path)
    protocol = EurobotProtocol.load(tmp_path / "canopen")
    word = 1234 | 567 << 14 | 89 << 26 | 75 << 36 | 0xA5C3 << 48
    assert protocol.encode(GOTO._replace(barriers=Barriers(0xA5C3))) == Frame(0x008, word.to_bytes(8, "little"))


def test_errors_of_the_wire_are_the_peers() -> None:
    for cob_id, data in ((0x003, b""), (0x008, b"\x01")):
        with pytest.raises(RemoteError):
            PROTOCOL.decode(cob_id, data)


@pytest.mark.parametrize(
    ("node_id", "text"),
    [
        (5, "drive blocked"),  # a device of the robot, by the name of its PDO
        (6, "device specific"),  # a drive of CiA 402, of another maker
        (7, "fan blocked"),  # its maker's table, whatever the profile
        (8, "device specific"),  # of another maker, without a profile
        (9, "device specific"),  # of which there is no file
    ],
)
def test_the_robots_words_are_for_its_own_devices(node_id: int, text: str) -> None:
    goto = pdo(0x1800, "0x20000010", cob_id="0x185", name="Goto XY")
    devices = [
        Dictionary.read(text.encode(), Path("any.eds"), node_id)
        for node_id, text in {
            5: DEVICE_TYPE + goto,
            6: DEVICE_TYPE.replace("Value=0", "Value=402"),
            7: DEVICE_TYPE.replace("Value=0", "Value=402"),
            8: DEVICE_TYPE + pdo(0x1800, "0x20000010", cob_id="0x185"),
        }.items()
    ]
    words = ErrorWords.of_devices(devices, CATALOGUE, {7: {0xFF02: "fan blocked"}})
    assert words.of(node_id)(0xFF02) == text
