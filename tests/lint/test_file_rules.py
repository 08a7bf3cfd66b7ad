"""The forms of a file's values, up to their ends."""

from __future__ import annotations

import pytest

from eurobot_od.lint.file_rules import is_date, is_time, is_version


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
def test_a_time(text: str, is_one: bool) -> None:
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
def test_a_date(text: str, is_one: bool) -> None:
    assert is_date(text) is is_one


@pytest.mark.parametrize(
    ("text", "is_one"), [("4.0", True), ("4", True), ("4.", False), (".0", False), ("4.0a", False), ("", False)]
)
def test_a_version(text: str, is_one: bool) -> None:
    assert is_version(text) is is_one
