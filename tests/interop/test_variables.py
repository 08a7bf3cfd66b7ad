"""What the question to canopen's PDO variables finds out: one type in one file that does not cover its bytes."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from canopen.objectdictionary import ObjectDictionaryError
from interop_rows import variables
from interop_rows.row import Differs

from eurobot_od.pdo.kinds import Real
from tests.kit import plant

FRAMES = 20
UNSIGNED8, UNSIGNED24 = "0x0005", "0x0016"
WRONG = [
    # (file, its section, type, the message that canopen then reads or writes otherwise)
    ("panel", "2000sub4", UNSIGNED8, "Move To"),  # 8 bits at bit 34
    ("lift", "2000sub4", UNSIGNED8, "Move To"),
    ("lift", "2000sub5", UNSIGNED24, "Move To"),  # whole bytes, and one more
    ("scale", "2020sub2", UNSIGNED24, "Order Set"),  # 6 bits at bit 1
    ("panel", "2010sub3", UNSIGNED24, "Place Response"),  # goes past the end
]


@pytest.mark.parametrize(("node", "section", "type_", "message"), WRONG)
def test_a_type_of_other_bytes_than_its_field_touches_differs(
    node: str, section: str, type_: str, message: str, tmp_path: Path
) -> None:
    assert list(differing(plant.spoiled(tmp_path, (node, section, "DataType", type_)))) == [message]


def test_the_files_as_they_are_do_not_differ() -> None:
    assert list(differing(plant.FILES.folder())) == []


def differing(folder: Path) -> Iterator[str]:
    """Yield the messages of all nodes' files that canopen does not read and write as we do."""
    for binding, pdo in variables.stock_pdos(folder):
        if any(isinstance(kind, Real) for kind in binding.kinds.values()):
            continue  # its raw value is a number there, and its bits here
        try:
            variables.compare(binding, pdo, FRAMES)
        except (Differs, struct.error, ObjectDictionaryError):
            yield binding.name
