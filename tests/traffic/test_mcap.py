"""MCAP as its own reader sees it: channels, schemas, times, values, poses, damage."""

from __future__ import annotations

import json
from io import BytesIO
from math import sqrt
from typing import Any

import jsonschema
import pytest

pytest.importorskip("mcap", reason="the extra `mcap` is not installed")

from mcap.reader import make_reader

from eurobot_od.frame import Frame
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import GotoFault, Source
from eurobot_od.robot.protocol import decoder
from eurobot_od.robot.scene.files import drawings
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry
from eurobot_od.traffic.mcap import Written, write

DECODER = decoder()
ENCODE = DECODER.protocol.encode
ENTRIES: list[LogEntry] = [
    (1, 1.5, "can0", ENCODE(messages.GotoXY(x=1500, y=500, angle=90, speed=75))),
    (2, 1.6, "can0", ENCODE(messages.KalmanPositionResponse(1000, 2000, None, Source.INTERNAL))),
    (3, 1.7, "can0", ENCODE(messages.NaviPositionResponse(None, None, None, Source.INTERNAL))),
    (4, 1.8, "can0", ENCODE(messages.GotoStateResponse(GotoFault.BLOCKED))),
    (5, 1.9, "can0", Frame(0x702, b"\5")),
    (6, 2.0, "can0", Frame(0x7E6, b"12")),
    (7, 2.1, "", Foreign(Damage.UNREADABLE, "x")),
]


@pytest.fixture(scope="module")
def found() -> dict[str, list[tuple[float, dict[str, Any]]]]:
    """The content of all channels, each valid by its schema."""
    file = BytesIO()
    assert write(file, ENTRIES, DECODER, drawings(DECODER.protocol)) == Written(4, 2, 2)
    made: dict[str, list[tuple[float, dict[str, Any]]]] = {}
    for schema, channel, message in make_reader(BytesIO(file.getvalue())).iter_messages():
        content = json.loads(message.data)
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        jsonschema.validate(content, json.loads(schema.data))
        made.setdefault(channel.topic, []).append((message.log_time / 1e9, content))
    return made


def test_each_message_has_its_channel(found: dict[str, list[tuple[float, dict[str, Any]]]]) -> None:
    assert found["/Goto XY"] == [
        (1.5, {"x": 1500, "y": 500, "angle": 90, "speed": 75, "barriers": "none", "direction": "forward",
               "route": "planned", "_": {"line": 1, "channel": "can0"}})
    ]  # fmt: skip
    assert found["/Goto State Response"][0][1]["time"] == "blocked"
    assert found["/Navi Position Response"][0][1]["x"] is None
    assert found["/Heartbeat"][0][1]["text"] == "drive, operational"


def test_places_are_poses_in_metres(found: dict[str, list[tuple[float, dict[str, Any]]]]) -> None:
    ((time, goto),) = found["/Goto XY/drawing"]
    assert time == 1.5
    assert goto["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    assert goto["pose"]["position"] == {"x": 1.5, "y": 0.5, "z": 0.0}
    assert goto["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": sqrt(0.5), "w": sqrt(0.5)})
    assert found["/Kalman Position Response/drawing"][0][1]["pose"]["orientation"]["w"] == 1.0
    assert "/Navi Position Response/drawing" not in found


def test_damage_is_kept(found: dict[str, list[tuple[float, dict[str, Any]]]]) -> None:
    assert [content["text"] for _, content in found["/damage"]] == [
        "! unknown identifier: 7E6#3132",
        "! unreadable: x",
    ]


@pytest.mark.parametrize("time", [1e11, -1.0, float("inf"), float("nan")])
def test_a_time_that_mcap_cannot_have_is_damage(time: float) -> None:
    file = BytesIO()
    entries = [ENTRIES[0], (2, time, *ENTRIES[1][2:]), ENTRIES[2]]
    assert write(file, entries, DECODER, drawings(DECODER.protocol)) == Written(2, 1, 1)
    damage = [
        (message.log_time / 1e9, json.loads(message.data))
        for _, channel, message in make_reader(BytesIO(file.getvalue())).iter_messages()
        if channel.topic == "/damage"
    ]
    assert damage == [
        (1.5, {"text": f"the time {time:g} s is not in 0..1.84467e+10", "_": {"line": 2, "channel": "can0"}})
    ]
