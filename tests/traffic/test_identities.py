"""Devices that say in a log, or on a bus, what they are: read ahead, and while decoding."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from eurobot_od.library.library import Library, LibraryDevices
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.traffic import formats
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.identities import shown_in
from eurobot_od.traffic.meaning import Decoder
from tests.kit.library import OTHER_PRODUCT, PRODUCT, REVISION, VENDOR, device_text, library_of


def answers(*numbers: int, node_id: int = 5, index: int = 0x1018, first: int = 1) -> str:
    """Requests and answers about an object of a node, from a sub-index on."""
    lines = []
    for sub, number in enumerate(numbers, start=first):
        address = f"{index & 0xFF:02X}{index >> 8:02X}{sub:02X}"
        lines.append(f"{0x600 + node_id:03X}#40{address}00000000")
        lines.append(f"{0x580 + node_id:03X}#43{address}{number.to_bytes(4, 'little').hex()}")
    return " ".join(lines)


def log(frames: str) -> io.BytesIO:
    lines = (f"({number}.0) can0 {each}\n" for number, each in enumerate(frames.split(), start=1))
    return io.BytesIO("".join(lines).encode())


# What is read ahead: frames, and what nodes have shown.
SHOWN: list[tuple[str, dict[int, dict[Address, int]]]] = [
    ("181#00", {}),
    (answers(1, 2, 3), {5: {(0x1018, 1): 1, (0x1018, 2): 2, (0x1018, 3): 3}}),
    (answers(9, index=0x1000, first=0, node_id=127), {127: {(0x1000, 0): 9}}),
    ("585#4F18100107000000", {5: {(0x1018, 1): 7}}),  # one byte: what the others hold is not its value
    ("585#4218100107000000", {5: {(0x1018, 1): 7}}),  # no size: all four
    ("585#8018100100000206", {}),  # refused
    ("585#4118100104000000", {}),  # by segments
    ("585#6018100100000000", {}),  # a write is confirmed
    ("585#431810", {}),  # cut off
    ("585#4300200107000000", {}),  # another object
    ("605#4318100107000000", {}),  # to the node
    (f"{answers(1)} {answers(2)}", {5: {(0x1018, 1): 1}}),  # exchanged later: that is seen while decoding
]


@pytest.mark.parametrize(("frames", "shown"), SHOWN)
def test_identities_are_read_ahead(frames: str, shown: dict[int, dict[Address, int]]) -> None:
    assert shown_in(log(frames), "log") == shown


def test_only_the_beginning_is_read_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.traffic.identities.BEGINNING", 1)
    file = log(answers(1) + " 181#00" * 100_000 + " " + answers(2, node_id=6))
    assert list(shown_in(file, "log")) == [5]


# While decoding

MAPPED = "605#2300180185010080 585#6000180100000000 605#2F001A0000000000 585#60001A0000000000 " \
         "605#23001A0110000120 585#60001A0100000000 605#2F001A0001000000 585#60001A0000000000 " \
         "605#2300180185010000 585#6000180100000000"  # fmt: skip
"""A master maps 0x2001 into TPDO1."""


def texts(frames: str, folder: Path, *named: Dictionary) -> tuple[list[str], list[str]]:
    """Decode frames by a library; return the names and fields of TPDO1, and what was told."""
    told: list[str] = []
    describe = LibraryDevices(Library([folder]), told.append)
    following = TrackingDecoder(Decoder(named, refused=lambda _: None, describe=describe))
    meanings = [following(time, channel, raw) for _, time, channel, raw in formats.read(log(frames), "log")]
    return [f"{each.name} {each.text}" for each in meanings if each.raw[0] == 0x185], told


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return library_of(tmp_path / "lib", axis=device_text(), level=device_text(product=OTHER_PRODUCT, name="Level"))


AXIS, LEVEL = answers(VENDOR, PRODUCT, REVISION), answers(VENDOR, OTHER_PRODUCT, REVISION)


def test_a_device_is_known_from_its_answers_on(folder: Path) -> None:
    found, told = texts(f"185#0100 {AXIS} 185#0200", folder)
    assert (found, told) == (["PDO 0x185, 2 bytes 01 00", "axis_5.TPDO1 speed=2"], [])


def test_a_device_that_is_exchanged_is_known_by_its_new_answers(folder: Path) -> None:
    found, told = texts(f"{AXIS} 185#0100 705#00 {LEVEL} 185#0200", folder)
    assert (found, told) == (["axis_5.TPDO1 speed=1", "level_5.TPDO1 level=2"], [])


def test_earlier_mappings_take_precedence_over_the_file(folder: Path) -> None:
    found, told = texts(f"{MAPPED} {AXIS} 185#0100", folder)
    assert (found, told) == (["axis_5.TPDO1 speed_limit=1"], [])


def test_a_device_without_a_file_stays_a_number(folder: Path) -> None:
    found, told = texts(f"{answers(VENDOR, 0x9999, REVISION)} 185#0100", folder)
    assert (found, told) == (["PDO 0x185, 2 bytes 01 00"], [])


def test_a_named_file_is_kept_and_its_difference_told_once(folder: Path) -> None:
    named = Dictionary.load(folder / "level.eds", 5)
    found, told = texts(f"{AXIS} {AXIS} 185#0100", folder, named)
    assert found == ["level.TPDO1 level=1"]
    assert told == [f"{folder / 'level.eds'} is for another device: node 5 has product code 0x1001, not 0x1002"]
