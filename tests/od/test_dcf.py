"""The DCF writer: the lines of the EDS stay, another reader finds the values, and a file that was cut off is told."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.robot import dialects

FILES = sorted(dialects.eds_folder().glob("*/*.eds"))
DRIVE = (dialects.eds_folder() / "canopen" / "drive.eds").read_text()
VALUES: dict[Address, Value] = {(0x1017, 0): 500, (0x1403, 1): 0x18, (0x1014, 0): 0x99, (0x2101, 1): 900}


def drive_dcf(values: dict[Address, Value], text: str = DRIVE) -> str:
    return dcf.with_values(text, values, 2, "drive", 500)


@pytest.mark.parametrize(
    ("address", "value", "line"),
    [
        ((0x1017, 0), 500, "ParameterValue=500"),  # decimal, as its default
        ((0x1403, 1), 0x18, "ParameterValue=0x00000018"),  # hexadecimal with 8 digits, as its default
        ((0x1014, 0), 0x99, "ParameterValue=0x00000099"),  # a number where the default counts from the node-ID
        ((0x1008, 0), "Fast drive", "ParameterValue=Fast drive"),  # text
        ((0x1021, 0), b"\x01\xab", "ParameterValue=01AB"),  # bytes
        ((0x1018, 3), -1, "ParameterValue=-1"),  # a negative number has no hexadecimal form
        ((0x1017, 0), True, "ParameterValue=1"),  # a bool is a number in a DCF
    ],
)
def test_a_value_is_written_in_the_form_of_its_default(address: Address, value: Value, line: str) -> None:
    added = set(drive_dcf({address: value}).split("\n")) - set(drive_dcf({}).split("\n"))
    assert added == {line}


def test_every_line_of_the_eds_stays_but_its_own_name() -> None:
    lines = drive_dcf(VALUES).split("\n")
    assert [line for line in DRIVE.split("\n") if line not in lines] == ["FileName=drive.eds"]


def test_the_dcf_names_the_eds_it_was_made_from() -> None:
    text = drive_dcf({})
    assert "FileName=drive.dcf\n" in text
    assert "LastEDS=drive.eds\n" in text


def test_a_dcf_of_a_dcf_replaces_values_and_doubles_nothing() -> None:
    once = drive_dcf(VALUES)
    assert drive_dcf(VALUES, once) == once
    assert drive_dcf({(0x1017, 0): 501}, once) == once.replace("ParameterValue=500", "ParameterValue=501")


def test_none_leaves_an_object_without_a_value() -> None:
    assert drive_dcf({(0x1017, 0): None}) == drive_dcf({})


def test_line_ends_of_windows_are_read() -> None:
    assert drive_dcf(VALUES, DRIVE.replace("\n", "\r\n")) == drive_dcf(VALUES)


@pytest.mark.parametrize("address", [(0x5000, 0), (0x1017, 1), (0x1018, 0x99), (0x1018, -1)])
def test_an_object_that_the_eds_lacks_is_refused(address: Address) -> None:
    with pytest.raises(UnknownName, match=f"0x{address[0]:04X}"):
        drive_dcf({address: 1})


@pytest.mark.parametrize("file", FILES, ids=str)
def test_another_reader_finds_values_and_commissioning(file: Path, tmp_path: Path) -> None:
    written = tmp_path / "node.dcf"
    written.write_text(dcf.with_values(file.read_text(), {(0x1017, 0): 500, (0x1014, 0): 0x99}, 5, "somebody", 250))
    read = Dictionary.load(written)
    assert (read.node_id, read.objects.bitrate) == (5, 250_000)
    assert [read.default((0x1017, 0)), read.default((0x1014, 0))] == [500, 0x99]
    assert read.default((0x1200, 1)) == 0x605  # $NODEID+0x600


@pytest.mark.parametrize("file", FILES, ids=str)
def test_dcfchk_accepts(file: Path, tmp_path: Path) -> None:
    written = tmp_path / "node.dcf"
    written.write_text(dcf.with_values(file.read_text(), {(0x1017, 0): 500, (0x2100, 1): 5}, 5, "somebody", 500))
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", str(written)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# What is missing


@pytest.mark.parametrize("file", FILES, ids=str)
def test_a_whole_file_misses_nothing(file: Path) -> None:
    assert dcf.missing(file.read_text()) == []


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        (DRIVE.replace("[1017]", "[9999]"), ["1017"]),  # a listed object
        (DRIVE.replace("[1018sub4]", "[9999]"), ["1018sub"]),  # a counted member
        (DRIVE.replace("[OptionalObjects]", "[9999]"), ["OptionalObjects"]),  # a list
        ("", ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"]),  # everything
    ],
)
def test_what_is_announced_and_not_there_is_named(text: str, missing: list[str]) -> None:
    assert dcf.missing(text) == missing


def test_a_number_of_members_that_is_none_counts_as_none() -> None:
    assert dcf.missing(DRIVE.replace("SubNumber=6", "SubNumber=six")) == []


@pytest.mark.parametrize("line", range(0, drive_dcf(VALUES).count("\n"), 97))
def test_a_dcf_cut_off_anywhere_misses_something(line: int) -> None:
    cut = "\n".join(drive_dcf(VALUES).split("\n")[:line])
    assert dcf.missing(cut) or f"[{dcf.COMMISSIONING}]" not in cut
