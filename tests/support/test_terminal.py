"""What may be written to a stream: lines that fit a terminal."""

from __future__ import annotations

import io

import pytest

from eurobot_od.support import terminal
from eurobot_od.support.terminal import ENDLESS, columns, folded

LINE = "    2.756 s  stop       emergency stop: object ahead of the robot"
FOLDED = [
    # (columns, lines)
    (80, [LINE]),
    (len(LINE), [LINE]),
    (50, ["    2.756 s  stop       emergency stop: object", "                        ahead of the robot"]),
    (40, [LINE]),  # so narrow that no lines would be better
]


@pytest.mark.parametrize(("width", "lines"), FOLDED)
def test_a_line_is_folded_between_words(width: int, lines: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal, "columns", lambda _: width)
    assert folded(LINE, io.StringIO(), 24) == "\n".join(lines)


def test_a_file_has_lines_of_any_length() -> None:
    assert columns(io.StringIO()) == ENDLESS
    assert folded(LINE * 10, io.StringIO(), 24) == LINE * 10
