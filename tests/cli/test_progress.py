"""The bar of a long transfer."""

from __future__ import annotations

import io

import pytest

from eurobot_od.cli.progress import REDRAWN, bar, line
from eurobot_od.sdo.client import unwatched


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("done", "size", "seconds", "text"),
    [
        (0, 100, 0.0, "x  ░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░   0%  0 of 100 bytes"),
        (50, 100, 0.01, "x  ███████████████░░░░░░░░░░░░░░░  50%  50 of 100 bytes  5.0 kB/s"),
        (100, 100, 1.0, "x  ██████████████████████████████ 100%  100 of 100 bytes  0.1 kB/s"),
        (500, None, 1.0, "x  500 bytes  0.5 kB/s"),  # a server need not say how many there are
    ],
)
def test_a_line(done: int, size: int | None, seconds: float, text: str) -> None:
    assert line("x", done, size, seconds) == text


def test_a_terminal_sees_the_bar_now_and_then_and_nothing_of_it_at_the_end() -> None:
    terminal, now = Terminal(), [0.0]
    with bar("x", terminal, lambda: now[0]) as progress:
        for done in (10, 20, 30, 100):
            now[0] += REDRAWN / 2.5
            progress(done, 100)
    drawn = terminal.getvalue().split("\r")
    assert [text.split("  ")[-2].strip() for text in drawn[1:-2]] == ["10 of 100 bytes", "100 of 100 bytes"]
    assert drawn[-2:] == [" " * len(drawn[2]), ""]


def test_without_a_terminal_nothing_is_drawn() -> None:
    stream = io.StringIO()
    with bar("x", stream) as progress:
        assert progress is unwatched
    assert stream.getvalue() == ""
