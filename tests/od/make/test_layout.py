"""The mappings in the EDS files put every bit where the document, CiA 301 and the 2014 robot have it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import canopen
import pytest

Frame = tuple[str, dict[str, int], str]

ROOT = Path(__file__).resolve().parents[3]
EDS = ROOT / "eds"
NODES = ("core", "drive", "navigation")
DIALECTS = ("canopen", "firmware2014")
GOLDEN = json.loads((ROOT / "tests" / "golden" / "firmware2014.json").read_text())
ENCODED: list[Frame] = [(each["message"], each["fields"], each["data"]) for each in GOLDEN["encode"]]
DECODED: list[Frame] = [(each["message"], each["fields"], each["data"]) for each in GOLDEN["decode"]]

# Bytes on which three CANopen stacks agree: CiA 301 fills a frame from its least significant bit on.
STANDARD: list[Frame] = [
    ("Goto XY", {"x": 1234, "y": 567, "angle": 89, "speed": 75, "barriers": 0xA5C3}, "d27423592c0d9702"),
    (
        "Start Configuration Set",
        {"team_colour": 1, "enemies": 2, "confederates": 1, "enemy_1_diameter": 45, "enemy_2_diameter": 33},
        "dd86",
    ),
    ("Goto State Response", {"time": 0x123456}, "563412"),
    ("Emergency Stop", {"obstacle": 1}, "01"),
    ("Navi Position Response", {"x": 0x0FF, "y": 0x0FF, "angle": 0x3FF, "source": 3}, "fff00fff0f"),
    ("Check Navi Request", {}, ""),
]


class Run(NamedTuple):
    """Bits of a field as one mapping entry has them."""

    field: str
    low: int
    bits: int


def field_name(parameter_name: str) -> str:
    return parameter_name.removesuffix(" position").lower().replace(" ", "_")


def run(od: Any, entry: int) -> Run:
    name, bits = od[entry >> 16][entry >> 8 & 0xFF].name, entry & 0xFF
    part = re.fullmatch(r"(.+) \(\d+:(\d+)\)", name)
    return Run(field_name(part[1]), int(part[2]), bits) if part else Run(field_name(name), 0, bits)


def mappings(file: Path) -> dict[str, list[Run]]:
    od: Any = canopen.import_od(str(file), node_id=1)
    records = [each for index, each in od.items() if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00]
    return {
        each.name.removesuffix(" mapping"): [run(od, each[n].default) for n in range(1, each[0].default + 1)]
        for each in records
    }


def pack(runs: list[Run], fields: dict[str, int]) -> str:
    word = position = 0
    for field, low, bits in runs:
        word |= (fields.get(field, 0) >> low & (1 << bits) - 1) << position
        position += bits
    return word.to_bytes(-(-position // 8), "little").hex()


def unpack(runs: list[Run], data: str) -> dict[str, int]:
    word, fields = int.from_bytes(bytes.fromhex(data), "little"), dict.fromkeys((each.field for each in runs), 0)
    for field, low, bits in runs:
        fields[field] |= (word & (1 << bits) - 1) << low
        word >>= bits
    return {field: value for field, value in fields.items() if field != "padding"}


def frames_of(file: Path, frames: Iterable[Frame]) -> list[tuple[list[Run], dict[str, int], str]]:
    runs = mappings(file)
    return [(runs[message], fields, data) for message, fields, data in frames if message in runs]


@pytest.mark.parametrize("node", NODES)
@pytest.mark.parametrize(("dialect", "frames"), [("canopen", STANDARD), ("firmware2014", ENCODED)], ids=DIALECTS)
def test_packs(dialect: str, frames: list[Frame], node: str) -> None:
    for runs, fields, data in frames_of(EDS / dialect / f"{node}.eds", frames):
        assert pack(runs, fields) == data


@pytest.mark.parametrize("node", NODES)
@pytest.mark.parametrize(
    ("dialect", "frames"), [("canopen", STANDARD), ("firmware2014", ENCODED + DECODED)], ids=DIALECTS
)
def test_unpacks(dialect: str, frames: list[Frame], node: str) -> None:
    for runs, fields, data in frames_of(EDS / dialect / f"{node}.eds", frames):
        assert unpack(runs, data) == fields


def test_has_every_recorded_message() -> None:
    assert {message for message, *_ in ENCODED} <= set().union(*(mappings(file) for file in EDS.glob("firmware2014/*")))
