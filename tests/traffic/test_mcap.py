"""MCAP as its own reader sees it: channels, schemas, times, values, drawings, damage."""

from __future__ import annotations

import json
from io import BytesIO
from typing import Any

import jsonschema
import pytest

pytest.importorskip("mcap", reason="the extra `mcap` is not installed")

from mcap.reader import make_reader

from eurobot_od.export.description import Drawing
from eurobot_od.frame import Frame
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry
from eurobot_od.traffic.mcap import Written, write
from tests.kit import plant
from tests.kit.plant import messages as m

DECODER = plant.decoder()
ENCODE = DECODER.protocol.encode


def spot(message: Any, time: dict[str, int]) -> dict[str, Any] | None:
    """Draw a place in metres; none that is unknown."""
    return None if message.x is None else {"timestamp": time, "x": message.x / 1000}


SPOT = Drawing("line.Spot", {"timestamp": {"type": "object"}, "x": {"type": "number"}}, spot)
DRAWINGS = {"Move To": SPOT, "Place Response": SPOT}
ENTRIES: list[LogEntry] = [
    (1, 1.5, "can0", ENCODE(m.MoveTo(x=1500, y=500, angle=90, speed=75))),
    (2, 1.6, "can0", ENCODE(m.PlaceResponse(1000, 2000, None, m.Source.ENCODER))),
    (3, 1.7, "can0", ENCODE(m.PlaceResponse(None, None, None, m.Source.ENCODER))),
    (4, 1.8, "can0", ENCODE(m.MoveStateResponse(m.Fault.BLOCKED))),
    (5, 1.9, "can0", Frame(0x702, b"\5")),
    (6, 2.0, "can0", Frame(0x7E6, b"12")),
    (7, 2.1, "", Foreign(Damage.UNREADABLE, "x")),
]


@pytest.fixture(scope="module")
def found() -> dict[str, list[tuple[float, dict[str, Any]]]]:
    """The content of all channels, each valid by its schema."""
    file = BytesIO()
    assert write(file, ENTRIES, DECODER, DRAWINGS) == Written(4, 2, 2)
    made: dict[str, list[tuple[float, dict[str, Any]]]] = {}
    for schema, channel, message in make_reader(BytesIO(file.getvalue())).iter_messages():
        content = json.loads(message.data)
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        jsonschema.validate(content, json.loads(schema.data))
        made.setdefault(channel.topic, []).append((message.log_time / 1e9, content))
    return made


def test_each_message_has_its_channel(found: dict[str, list[tuple[float, dict[str, Any]]]]) -> None:
    assert found["/Move To"] == [
        (1.5, {"x": 1500, "y": 500, "angle": 90, "speed": 75, "gates": "none", "direction": "forward",
               "route": "planned", "_": {"line": 1, "channel": "can0"}})
    ]  # fmt: skip
    assert found["/Move State Response"][0][1]["time"] == "blocked"
    assert found["/Place Response"][1][1]["x"] is None
    assert found["/Heartbeat"][0][1]["text"] == "lift, operational"


def test_a_message_with_a_drawing_has_it_in_a_channel_of_its_own(
    found: dict[str, list[tuple[float, dict[str, Any]]]],
) -> None:
    assert found["/Move To/drawing"] == [(1.5, {"timestamp": {"sec": 1, "nsec": 500_000_000}, "x": 1.5})]
    assert found["/Place Response/drawing"] == [(1.6, {"timestamp": {"sec": 1, "nsec": 600_000_000}, "x": 1.0})]
    assert len(found["/Place Response"]) == 2, "of the second there is nothing to draw"


def test_damage_is_kept(found: dict[str, list[tuple[float, dict[str, Any]]]]) -> None:
    assert [content["text"] for _, content in found["/damage"]] == [
        "! unknown identifier: 7E6#3132",
        "! unreadable: x",
    ]


@pytest.mark.parametrize("time", [1e11, -1.0, float("inf"), float("nan")])
def test_a_time_that_mcap_cannot_have_is_damage(time: float) -> None:
    file = BytesIO()
    entries = [ENTRIES[0], (2, time, *ENTRIES[1][2:]), ENTRIES[2]]
    assert write(file, entries, DECODER, DRAWINGS) == Written(2, 1, 1)
    damage = [
        (message.log_time / 1e9, json.loads(message.data))
        for _, channel, message in make_reader(BytesIO(file.getvalue())).iter_messages()
        if channel.topic == "/damage"
    ]
    assert damage == [
        (1.5, {"text": f"the time {time:g} s is not in 0..1.84467e+10", "_": {"line": 2, "channel": "can0"}})
    ]
