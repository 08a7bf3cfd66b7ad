"""What the question to canopen's PDO variables finds out: one type in one file that does not cover its bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from canopen.objectdictionary import ObjectDictionaryError
from interop_rows import variables
from interop_rows.row import Differs

from eurobot_od.robot import dialects

FRAMES = 20
UNSIGNED8, UNSIGNED24 = "0x0005", "0x0016"
WRONG = [
    # (file, its section, type, the message that canopen then reads or writes otherwise)
    ("core", "2000sub4", UNSIGNED8, "Goto XY"),  # 8 bits at bit 34
    ("drive", "2000sub4", UNSIGNED8, "Goto XY"),
    ("drive", "2000sub5", UNSIGNED24, "Goto XY"),  # whole bytes, and one more
    ("navigation", "2020sub4", UNSIGNED8, "Start Configuration Set"),  # 6 bits at bit 4
    ("core", "2011sub3", UNSIGNED24, "Kalman Position Response"),  # goes past the end
]


@pytest.mark.parametrize(("node", "section", "type_", "message"), WRONG)
def test_a_type_of_other_bytes_than_its_field_touches_differs(
    node: str, section: str, type_: str, message: str, spoil_eds: Callable[..., Path]
) -> None:
    assert list(differing(spoil_eds((node, section, "DataType", type_)))) == [message]


def test_the_files_as_they_are_do_not_differ() -> None:
    assert list(differing(dialects.folder(dialects.DEFAULT))) == []


def differing(folder: Path) -> Iterator[str]:
    """Give the messages of all nodes' files that canopen does not read and write as we do."""
    for binding, pdo in variables.stock_pdos(folder):
        try:
            variables.compare(binding, pdo, FRAMES)
        except (Differs, struct.error, ObjectDictionaryError):
            yield binding.name
