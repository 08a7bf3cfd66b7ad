"""Results to rows of Parquet and back: equal, whatever they hold."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import pytest

pytest.importorskip("pyarrow", reason="the extra `cluster` is not installed")

import pyarrow as pa

from eurobot_od.season import results


class Colour(Enum):
    RED = "r"


class Inner(NamedTuple):
    number: int | None
    text: str = "a"


@dataclass(frozen=True)
class Outer:
    inner: Inner
    rows: list[Inner]
    words: tuple[str, ...]
    counts: dict[str, int]
    colour: Colour
    file: Path
    share: float
    data: bytes
    sure: bool
    maybe: Inner | None = None
    texts: list[str] = field(default_factory=list)


CASES = (
    Outer(
        Inner(1),
        [Inner(2), Inner(None, "")],
        ("x", "y"),
        {"a": 1},
        Colour.RED,
        Path("a/b"),
        0.1,
        b"\0\xff",
        True,
        Inner(3),
    ),
    Outer(Inner(None), [], (), {}, Colour.RED, Path(), float("inf"), b"", False),
    Inner(1 << 62, "\u00e4\n"),
)


def there_and_back(record: Any) -> Any:
    kind = type(record)
    (row,) = pa.Table.from_pylist([results.row(record)], results.schema(kind)).to_pylist()
    return results.record_of(kind, row)


@pytest.mark.parametrize("record", CASES)
def test_a_record_comes_back_equal(record: Any) -> None:
    assert there_and_back(record) == record


def test_a_name_that_is_not_text_comes_back_with_its_bytes_escaped() -> None:
    record = replace(CASES[0], file=Path("a\udcff"), inner=Inner(1, "\ud800"))
    assert there_and_back(record) == replace(record, file=Path("a\\udcff"), inner=Inner(1, "\\ud800"))
