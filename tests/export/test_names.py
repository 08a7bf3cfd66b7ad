"""Identifiers and texts, whatever a file says."""

from __future__ import annotations

import re

import pytest

from eurobot_od.export.description import LONGEST_IDENTIFIER, Identifiers, printable
from tests.export.made_up import BAD_NAMES

IDENTIFIERS = [
    ("Move To", "Move_To"),
    ("Status (raw)", "Status_raw"),
    ("1st axis", "n1st_axis"),
    ("", "unnamed"),
    ("\x01\x02", "unnamed"),
    ("__a__", "a"),
    ("for", "for_2"),
    ("FOR", "FOR_2"),
    ("a" * 1000, "a" * LONGEST_IDENTIFIER),
]


@pytest.mark.parametrize(("name", "identifier"), IDENTIFIERS)
def test_an_identifier_of_a_name(name: str, identifier: str) -> None:
    assert Identifiers("for while").new(name) == identifier


def test_equal_names_are_told_apart() -> None:
    names = Identifiers()
    assert [names.new(each) for each in ("same", "Same", "same 2", "same")] == ["same", "Same_2", "same_2_2", "same_3"]


def test_identifiers_are_valid_distinct_and_short() -> None:
    names = Identifiers()
    made = [names.new(each) for each in BAD_NAMES * 20]
    assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]{0,30}", each) for each in made)
    assert len({each.lower() for each in made}) == len(made)


TEXTS = [
    ("plain text", "plain text"),
    ("two\nlines\tand more", "two lines and more"),
    ("Über\x1b[31m", ".ber.[31m"),
    ("x" * 1000, "x" * 397 + "..."),
]


@pytest.mark.parametrize(("text", "shown"), TEXTS)
def test_a_printable_text(text: str, shown: str) -> None:
    assert printable(text) == shown
