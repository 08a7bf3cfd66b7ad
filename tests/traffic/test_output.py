"""JSON lines and CSV of single entries: what is unknown, what is wrong, and names that need quotes."""

from __future__ import annotations

import csv
import json
from typing import Any

import pytest

from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import decoder as robot_decoder
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.output import CsvOutput, JsonOutput, Output

DECODER = robot_decoder(dialects.DEFAULT)
PLACE = {"log": 'a "log", 1', "line": 7, "channel": "can,0"}
ENTRIES: list[tuple[Raw, dict[str, Any]]] = [
    (Frame(0x014, b"\xff\xff\x0f"), {"id": "0x014", "data": "FFFF0F", "fields": {"time": None}}),
    (Frame(0x014, b"\xfe\xff\xff"), {"message": "Goto State Response", "fields": {"time": "blocked"}}),
    (Frame(0x702, b"\0"), {"message": "Heartbeat", "protocol": "CANopen", "text": "drive, boot-up"}),
    (Frame(0x7FE), {"id": "0x7FE", "text": "7FE#", "damage": [{"kind": "unknown identifier", "text": "7FE#"}]}),
    (Foreign(Damage.FD, "008##1AA"), {"message": "CAN FD, 1 byte", "text": "008##1AA"}),
]


def line(output: Output, raw: Raw) -> str:
    return output.writer('a "log", 1')(7, 1.5, "can,0", output.row(DECODER(raw)))


@pytest.mark.parametrize(("raw", "expected"), ENTRIES)
def test_json(raw: Raw, expected: dict[str, Any]) -> None:
    found = json.loads(line(JsonOutput(), raw))
    assert found | PLACE | {"time": 1.5} | expected == found


@pytest.mark.parametrize(
    ("name", "written"), [("für.log", '"für.log"'), ("a\x9bb", '"a\\u009bb"'), ("a\nb", '"a\\nb"')]
)
def test_json_is_for_people_unless_a_terminal_might_act_on_it(name: str, written: str) -> None:
    output = JsonOutput()
    assert written in output.writer(name)(7, 1.5, "can0", output.row(DECODER(Frame(0x00C))))


@pytest.mark.parametrize(("raw", "expected"), ENTRIES)
def test_csv(raw: Raw, expected: dict[str, Any]) -> None:
    output = CsvOutput(["x", "time"])
    (found,) = csv.DictReader([output.header, line(output, raw)])
    assert (found["log"], found["line"], found["timestamp"], found["channel"]) == (
        'a "log", 1',
        "7",
        "1.500000",
        "can,0",
    )
    assert found["damage"] == "; ".join(f"{each['kind']}: {each['text']}" for each in expected.get("damage", []))
    assert found["time"] == (expected.get("fields", {}).get("time") or "")
    assert found["x"] == ""
