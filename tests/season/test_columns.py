"""Columns beside `Protocol`: every field of every row is the same, whatever the bits and whoever made the EDS."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("pyarrow", reason="the extra `season` is not installed")


import pyarrow.parquet as pq

from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Quantity
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.season.archive import DecodedNetwork
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder
from tests.eds_text import DEVICE_TYPE, pdo, variable
from tests.kit import plant
from tests.season.seasons import Timed, archived, assert_equal_to_protocol, protocol_of, random_frames, table, write_log

ROOT = Path(__file__).parents[2]

RANDOM = 20_000

TYPES = (
    ("INTEGER8", 3, 2),
    ("INTEGER16", 12, 0),
    ("INTEGER16", 16, 4),
    ("INTEGER24", 24, 8),
    ("INTEGER32", 32, 3),
    ("INTEGER64", 64, 0),
    ("UNSIGNED64", 64, 0),
    ("UNSIGNED8", 8, 0),
    ("UNSIGNED32", 31, 7),
    ("BOOLEAN", 1, 5),
    ("BOOLEAN", 8, 0),
    ("REAL32", 32, 5),
    ("REAL64", 64, 0),
    ("VISIBLE_STRING", 24, 4),
    ("OCTET_STRING", 16, 8),
)
"""Types, mapped bits, and how many bits stand before them."""


def all_types(file: Path) -> DecodedNetwork:
    """An EDS with a PDO for each type, the field at an offset and, where there is room, another one after it."""
    text = DEVICE_TYPE
    for number, (type_, bits, offset) in enumerate(TYPES):
        text += variable(
            f"{0x2000 + number:X}", "value", type_, more="LowLimit=-3\nHighLimit=0x60\n" if number < 4 else ""
        )
        entries = [f"0x{0x00050000 | offset:08X}"] if offset else []
        entries.append(f"0x{0x2000 + number:04X}00{bits:02X}")
        text += pdo(0x1800 + number, *entries, cob_id=f"0x{0x181 + 16 * number:X}", name=f"Of {type_} {bits} {offset}")
    file.write_text(text)
    return DecodedNetwork((Dictionary.load(file, 5),), NOTHING)


def network_of(dialect: str) -> DecodedNetwork:
    return DecodedNetwork(plant.load_all(dialect), plant.CATALOGUE)


@pytest.mark.long
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_every_row_of_a_match_has_the_protocol_s_values(dialect: str, tmp_path: Path) -> None:
    frames = [(round(time, 6), frame) for time, frame in plant.shift(dialect) if isinstance(frame, Frame)]
    season = archived(write_log(tmp_path / "shift.log", frames), network_of(dialect))
    assert len(table(season, "frames")) == len(frames)
    assert_equal_to_protocol(season, frames, network_of(dialect))


@pytest.mark.long
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_every_row_of_random_frames_has_the_protocol_s_values(dialect: str, tmp_path: Path) -> None:
    network = network_of(dialect)
    protocol = protocol_of(network)
    frames = [each for each in random_frames(RANDOM, protocol) if not _is_nan(protocol, each)]
    season = archived(write_log(tmp_path / "random.log", frames), network)
    assert_equal_to_protocol(season, frames, network)


def test_each_type_at_any_offset_has_the_protocol_s_values(tmp_path: Path) -> None:
    network = all_types(tmp_path / "types.eds")
    protocol = protocol_of(network)
    assert len(protocol.bindings) == len(TYPES)
    frames = [each for each in random_frames(5000, protocol) if not _is_nan(protocol, each)]
    season = archived(write_log(tmp_path / "random.log", frames), network)
    assert_equal_to_protocol(season, frames, network)


class Reading(IntEnum):
    """What a sensor sends instead of a number."""

    NOTHING = 60
    TOO_NEAR = -30


def test_scaled_values_and_codes_are_the_protocol_s(tmp_path: Path) -> None:
    catalogue = Catalogue()

    @catalogue.message()
    class Tenths(NamedTuple):
        """Steps of 0.1 mm, and two codes."""

        value: Annotated[float | Reading, Quantity("mm", step=0.1, within=(-2.5, 5), codes=Reading)]

    @catalogue.message()
    class Whole(NamedTuple):
        """Whole millimetres, and a code below them."""

        value: Annotated[int | Reading, Quantity("mm", within=(0, 50), codes=Reading)]

    text = DEVICE_TYPE
    file = tmp_path / "sensor.eds"
    for number, name in enumerate(("Tenths", "Whole")):
        text += variable(f"{0x2000 + number:X}", "value", "INTEGER8", more="LowLimit=-30\nHighLimit=60\n")
        text += pdo(0x1800 + number, f"0x{0x2000 + number:04X}0008", cob_id=f"0x{0x181 + number:X}", name=name)
    file.write_text(text)
    network = DecodedNetwork((Dictionary.load(file, 5),), catalogue)
    frames = [(raw / 100, Frame(0x181 + number, bytes([raw]))) for raw in range(256) for number in (0, 1)]
    season = archived(write_log(tmp_path / "all.log", frames), network)
    assert_equal_to_protocol(season, frames, network)
    tenths = table(season, "tenths")
    assert tenths.row(3, named=True)["value"] == 0.3
    assert tenths["value_flag"].drop_nulls().value_counts().height > 100, "what is out of range is flagged"


def _is_nan(protocol: Protocol, timed: Timed) -> bool:
    """Return whether a frame has a number that is not equal to itself."""
    try:
        return any(value != value for value in protocol.decode(*timed[1]))
    except EurobotError:
        return False


@pytest.mark.long
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_defects_are_the_same_as_the_decoder_s(dialect: str, tmp_path: Path) -> None:
    network = network_of(dialect)
    decode = Decoder(network.dictionaries, plant.CATALOGUE)
    frames = random_frames(5000, protocol_of(network), seed=2)
    season = archived(write_log(tmp_path / "random.log", frames), network)
    wanted = [
        (number, damage.value, text)
        for number, (_, frame) in enumerate(frames, 1)
        for damage, text, _ in decode(frame).defects
    ]
    assert {Damage(kind) for _, kind, _ in wanted} == {
        Damage.UNKNOWN_IDENTIFIER,
        Damage.WRONG_LENGTH,
        Damage.OUT_OF_RANGE,
    }
    assert sorted(table(season, "damage").select("line", "kind", "text").rows()) == sorted(wanted)


def test_columns_have_unit_and_the_meaning_of_null(tmp_path: Path) -> None:
    season = archived(write_log(tmp_path / "one.log", [(0.0, Frame(0x202, bytes(8)))]), network_of("plain"))
    (file,) = (season / "move_to").iterdir()
    schema = pq.read_schema(file)
    assert schema.metadata[b"message"] == b"Move To"
    assert schema.field("x").metadata == {b"unit": b"mm", b"allowed": b"0..3000 mm", b"null": b"see x_flag"}
    assert schema.field("gates").metadata[b"null"] == b"never"
    assert schema.field("t").metadata[b"unit"] == b"s"
