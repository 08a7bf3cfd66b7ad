"""The mappings in the EDS files put every bit where the document, CiA 301 and the 2014 robot have it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import canopen
import pytest

from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import make_files, write_files
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.pdo.protocol import Protocol
from tests.od.make.tables import TABLE

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
    ("Goto XY", {"x": 1234, "y": 567, "angle": 89, "speed": 75, "barriers": 0xA5C3}, "d27423592c01c3a5"),
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
    name = od[entry >> 16][entry >> 8 & 0xFF].name
    bits = entry & 0xFF
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
    word = int.from_bytes(bytes.fromhex(data), "little")
    fields = dict.fromkeys((each.field for each in runs), 0)
    for field, low, bits in runs:
        fields[field] |= (word & (1 << bits) - 1) << low
        word >>= bits
    return {field: value for field, value in fields.items() if field not in ("padding", "reserved")}


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


@pytest.mark.parametrize("node", NODES)
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_type_has_the_bytes_that_its_field_touches(dialect: str, node: str) -> None:
    od: Any = canopen.import_od(str(EDS / dialect / f"{node}.eds"), node_id=1)
    assert list(touched_and_typed(od)) == []


# 32 bits behind 20 others touch five bytes; reserved bits are the last sub-indices, wherever they lie.
def test_fields_and_reserved_bits_may_lie_anywhere(tmp_path: Path) -> None:
    rows = "{Target: {X position: 4, Speed: 3, Far: 1}}"
    table = (
        TABLE.replace(
            "Speed: {bits: 8, range: [0, 100], default: 0}",
            "Speed: {bits: 8, range: [0, 100], default: 0}\n      Far: {bits: 32, range: [0, 9], default: 0}",
        )
        .replace("other: {", f"other: {{reserved: {rows}, ")
        .replace("plain: {", f"plain: {{reserved: {rows}, ")
    )
    write_files(make_files(read_table(table, "")), tmp_path)
    od: Any = canopen.import_od(str(tmp_path / "plain" / "drive.eds"), node_id=2)
    assert list(touched_and_typed(od)) == []
    assert [(each.name, od[0x2000][sub].data_type) for sub, each in od[0x2000].items()][1:] == [
        ("X position", values.UNSIGNED16.code),
        ("Speed", values.UNSIGNED16.code),
        ("Far", 0x18),  # UNSIGNED40
        ("Reserved", values.UNSIGNED8.code),
        ("Reserved 2", values.UNSIGNED8.code),
        ("Reserved 3", values.UNSIGNED8.code),
    ]
    for dialect, word in (
        ("plain", 0xABC << 4 | 99 << 19 | 9 << 28),
        ("other", int.from_bytes((0xABC << 48 | 99 << 38 | 9 << 5).to_bytes(8, "big"), "little")),
    ):
        runs = mappings(tmp_path / dialect / "drive.eds")["Goto"]
        assert pack(runs, {"x": 0xABC, "speed": 99, "far": 9}) == word.to_bytes(8, "little").hex()


def touched_and_typed(od: Any) -> Iterator[tuple[str, int, int]]:
    """Yield what is mapped with a type of other bytes than it touches, with both numbers."""
    for record in (each for index, each in od.items() if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00):
        offset = 0
        for n in range(1, record[0].default + 1):
            entry = record[n].default
            variable = od[entry >> 16][entry >> 8 & 0xFF]
            bits = entry & 0xFF
            touched = (offset + bits - 1) // 8 - offset // 8 + 1
            if len(variable) != touched * 8:
                yield variable.qualname, touched, len(variable) // 8
            offset += bits


@pytest.mark.parametrize("dialect", ["plain", "other"])  # whole fields; slices, the most significant bit first
def test_values_below_zero_and_real_ones(dialect: str, tmp_path: Path) -> None:
    speed = "{bits: 12, range: [-200, 1500], codes: {nothing: -2047}, default: nothing, unit: mm}"
    table = TABLE.replace(
        "Speed: {bits: 8, range: [0, 100], default: 0}",
        f"Speed: {speed}\n      Force: {{bits: 32, type: REAL32, default: 2}}",
    ).replace("widths: {Target: {Speed: 7}}, ", "")
    write_files(make_files(read_table(table, "")), tmp_path)
    drive = Dictionary.load(tmp_path / dialect / "drive.eds")
    protocol = Protocol.of_devices([drive], NOTHING)
    binding = protocol.binding("Goto")
    assert [drive.default(drive.address(f"Target.{name}")) for name in ("Speed", "Force")] == [-2047, 2.0]
    assert binding.limits["speed"] == Limits(-2047, 1500)
    sent = {"x": 3000, "speed": -200, "force": 0x3F000000}
    data = protocol.pack("Goto", **sent)
    bits = f"{3000:012b}{-200 & 0xFFF:012b}{0x3F000000:032b}"
    little = int(f"{0x3F000000:032b}{-200 & 0xFFF:012b}{3000:012b}", 2).to_bytes(7, "little")
    assert data == (little if dialect == "plain" else int(bits, 2).to_bytes(7, "big"))
    assert protocol.unpack(binding.cob_id, data) == ("Goto", sent)


def test_has_every_recorded_message() -> None:
    assert {message for message, *_ in ENCODED} <= set().union(*(mappings(file) for file in EDS.glob("firmware2014/*")))
