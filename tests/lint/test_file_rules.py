"""The forms of a file's values, up to their ends."""

from __future__ import annotations

import pytest

from eurobot_od.lint.file_rules import is_date, is_time, is_version, looks_like_object
from eurobot_od.lint.rules import lint
from tests.eds_text import with_entry
from tests.lint.mutations import CLEAN


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("09:30AM", True),
        ("12:59pm", True),
        ("00:00AM", True),
        ("13:00PM", False),
        ("09:60AM", False),
        ("09:30", False),
        ("09.30AM", False),
        ("9:30AM", False),
        ("09:3xAM", False),
        ("", False),
    ],
)
def test_times_are_recognised(text: str, is_one: bool) -> None:
    assert is_time(text) is is_one


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("05-28-2014", True),
        ("01-01-2014", True),
        ("12-31-2014", True),
        ("00-01-2014", False),
        ("13-01-2014", False),
        ("01-00-2014", False),
        ("01-32-2014", False),
        ("5-28-2014", False),
        ("05-28-14", False),
        ("05.28.2014", False),
        ("xx-28-2014", False),
    ],
)
def test_dates_are_recognised(text: str, is_one: bool) -> None:
    assert is_date(text) is is_one


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("0x1000", True),
        ("01000", True),
        ("100", True),  # too short, and nothing else
        ("10", False),
        ("018", False),
        ("12345", False),
        ("1000sub01", True),
        ("1000sub", False),
        ("1000 sub 0", True),
        ("1000subx", False),
        ("feed", False),
        ("fee1", True),
    ],
)
def test_malformed_object_sections_are_recognised(text: str, is_one: bool) -> None:
    assert looks_like_object(text) is is_one


@pytest.mark.parametrize(
    ("text", "is_one"), [("4.0", True), ("4", True), ("4.", False), (".0", False), ("4.0a", False), ("", False)]
)
def test_versions_are_recognised(text: str, is_one: bool) -> None:
    assert is_version(text) is is_one


@pytest.mark.parametrize(
    ("section", "key", "most", "code"),
    [
        ("FileInfo", "FileVersion", 255, "E204"),
        ("FileInfo", "FileRevision", 255, "E205"),
        ("DeviceInfo", "NrOfRXPDO", 512, "E223"),
        ("DeviceInfo", "Granularity", 64, "E224"),
        ("DeviceInfo", "LSS_Supported", 1, "E216"),
        ("DummyUsage", "Dummy0005", 1, "E231"),
    ],
)
def test_numbers_are_checked_up_to_the_maximum(section: str, key: str, most: int, code: str) -> None:
    def codes(value: int) -> set[str]:
        return {each.code for each in lint(with_entry(CLEAN, section, key, str(value)).encode(), "clean.eds")}

    assert [code in codes(value) for value in (-1, 0, most, most + 1)] == [True, False, False, True]
