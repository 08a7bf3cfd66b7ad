"""The robot's protocol: the document's messages in its EDS files, and the frames of the robot that ran in 2014."""

from __future__ import annotations

import json
import shutil
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import pytest

import eurobot_od
from eurobot_od.errors import FieldError, FrameLengthError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import NOTHING, Message, OutOfRange, flagged_fields, plain, units
from eurobot_od.pdo.protocol import Protocol, frame_to_send
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import (
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
from eurobot_od.robot.protocol import EurobotProtocol, decoder
from tests.robot.document import NAMES, TABLES_4_AND_5
from tests.rows import rows

ROOT = Path(__file__).parents[2]
PROTOCOL = EurobotProtocol.load("canopen")
FIRMWARE = EurobotProtocol.load("firmware2014")
GOLDEN = json.loads((ROOT / "tests" / "golden" / "firmware2014.json").read_text())


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


def frame(text: str) -> Frame:
    cob_id, _, data = text.partition("#")
    return Frame(int(cob_id, 16), bytes.fromhex(data))


# What there is


@pytest.mark.parametrize("dialect", dialects.names())
def test_messages_are_those_of_the_documents_tables(dialect: str) -> None:
    bindings = [each for each in EurobotProtocol.load(dialect).bindings if each.name in NAMES]
    rows = [(row.cob_id, row.name, row.senders, row.receivers) for row in TABLES_4_AND_5]
    assert [(each.cob_id, each.name, each.senders, each.receivers) for each in bindings] == rows


def test_the_table_says_every_unit_that_a_class_names() -> None:
    told = Protocol.of_devices(dialects.load_all(), NOTHING)
    named = [(each.name, units(each.type), told.binding(each.name).kinds) for each in PROTOCOL.bindings]
    lost = [(name, field) for name, own, kinds in named for field in own if field in kinds and not kinds[field].unit]
    assert lost == []


def test_every_message_of_the_document_has_a_frame_in_the_table() -> None:
    assert {PROTOCOL.name(type(message)) for message, _ in FRAMES} == set(NAMES)


def test_names_of_the_package_are_loaded_when_asked_for() -> None:
    assert issubclass(eurobot_od.Protocol, Protocol)  # with the deprecated `load`
    assert eurobot_od.Frame is Frame
    assert eurobot_od.messages.GotoXY is GotoXY
    assert all(hasattr(eurobot_od, name) for name in import_module("eurobot_od").__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Kern'"):
        _ = eurobot_od.Kern  # type: ignore[attr-defined]


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


@pytest.mark.parametrize(("angle", "sent"), [(360, 0), (-1, 359), (450, 90), (-720, 0), (1023, 303), (90.0, 90)])
def test_any_whole_angle_is_brought_to_the_circle(angle: Any, sent: int) -> None:
    assert PROTOCOL.encode(GOTO._replace(angle=angle)) == PROTOCOL.encode(GOTO._replace(angle=sent))
    place = NaviPositionResponse(1, 2, angle, Source.INTERNAL)
    assert PROTOCOL.encode(place) == PROTOCOL.encode(place._replace(angle=sent))


# Lengths


@pytest.mark.parametrize("protocol", [PROTOCOL, FIRMWARE], ids=["canopen", "firmware2014"])
@pytest.mark.parametrize("name", [row[1] for row in TABLES_4_AND_5])
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
    assert values.get("route", 1) == 1


# The 2014 robot


def raw_values(protocol: Protocol, message: Message) -> dict[str, int]:
    """Return the raw values of a message, flagged ones included."""
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
    for (forward, direction), (direct, route) in product(enumerate(Direction), enumerate(Route)):
        goto = GOTO._replace(direction=direction, route=route)
        word = 1234 << 52 | 567 << 40 | 89 << 30 | 75 << 22 | forward << 5 | direct << 4
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


def test_barriers_have_the_names_of_the_file_beside_the_eds_files(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(dialects.folder("canopen"), tmp_path / "eds"))
    facts = (dialects.eds_folder() / robot_file.NAME).read_text(encoding="utf-8")
    (folder / robot_file.NAME).write_text(facts.replace("    fire 6:", "    rock 1:", 1), encoding="utf-8")
    decode = decoder(folder)
    frame = decode.protocol.encode(GOTO._replace(barriers=Barriers.of({6: Passage.FORCED})))
    meaning = decode(frame)
    assert meaning.text.endswith("barriers=rock 1:forced")
    assert meaning.message is not None
    assert plain(meaning.message, meaning.kinds)["barriers"] == "rock 1:forced"
    fields = ["x=1234", "y=567", "angle=89", "speed=75", "barriers=rock-1:forced"]
    assert frame_to_send(decode.protocol, "Goto XY", fields).frame == frame
    with pytest.raises(UnknownName, match="rock 1"):
        frame_to_send(decode.protocol, "Goto XY", [*fields[:4], "barriers=fire-6:forced"])
