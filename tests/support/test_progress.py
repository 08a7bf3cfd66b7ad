"""The bar of a long transfer; what is said while many things are made."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from eurobot_od.cli import main
from eurobot_od.support import progress
from eurobot_od.support import progress as module
from eurobot_od.support.progress import ENDLESS, LONG, PERCENT, REDRAWN, bar, columns, counted, folded, line, unwatched
from tests.cli.console import Terminal
from tests.kit.devices import MOTOR


@pytest.mark.parametrize(
    ("done", "size", "seconds", "text"),
    [
        (0, 100, 0.0, "x  ░░░░░░░░░░░░░░░░░░░░░░░░░░░░░░   0%  0 of 100 bytes"),
        (50, 100, 0.01, "x  ███████████████░░░░░░░░░░░░░░░  50%  50 of 100 bytes  5.0 kB/s"),
        (100, 100, 1.0, "x  ██████████████████████████████ 100%  100 of 100 bytes  0.1 kB/s"),
        (25, 100, 2.0, "x  ███████░░░░░░░░░░░░░░░░░░░░░░░  25%  25 of 100 bytes  0.0 kB/s, about 6 s left"),
        (500, None, 1.0, "x  500 bytes  0.5 kB/s"),  # a server need not say how many there are
    ],
)
def test_a_bar_shows_share_number_rate_and_time_left(done: int, size: int | None, seconds: float, text: str) -> None:
    assert line("x", done, size, seconds) == text


def test_a_bar_of_percent_shows_its_rate() -> None:
    filled = "███████░░░░░░░░░░░░░░░░░░░░░░░"
    assert line("x", 25, 100, 5.0, PERCENT) == f"x  {filled}  25%  25 of 100 %  5.0 %/s, about 15 s left"


def test_no_bar_is_drawn_before_the_delay() -> None:
    terminal, now = Terminal(), [0.0]
    with bar("x", terminal, lambda: now[0], late=True) as progress:
        now[0] = 1.9
        progress(50, 100)
        before = terminal.getvalue()
        now[0] = 2.0
        progress(75, 100)
        after = terminal.getvalue()
    assert (before, "75 of 100 bytes" in after) == ("", True)


def test_the_bar_is_redrawn_at_intervals_and_erased_at_the_end() -> None:
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


@pytest.mark.parametrize(
    ("words", "seen"),
    [
        ("compare LOG LOG", "of 18500 bytes"),
        ("replay LOG --speed 100000 -i virtual", "of 18500 bytes"),
        ("export mcap LOG -o OUT.mcap", "of 18500 bytes"),
        ("decode LOG", "of 18500 bytes"),
        ("field LOG -o OUT.svg", "of 18500 bytes"),
        ("lint EDS EDS", "1 of 2 files"),
    ],
)
def test_reading_a_large_log_shows_a_bar_on_a_terminal(
    words: str, seen: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "mcap" in words:
        pytest.importorskip("mcap", reason="the extra `mcap` is not installed")
    names = {"LOG": tmp_path / "some.log", "OUT": tmp_path / "out", "EDS": MOTOR}
    names["LOG"].write_text("(1.000000) can0 185#D27423592C01C3A5\n" * 500)
    terminal = Terminal()
    monkeypatch.setattr(module, "SHORT", 0.0)
    monkeypatch.setattr("sys.stderr", terminal)
    main([re.sub("LOG|OUT|EDS", lambda found: str(names[found[0]]), word) for word in words.split()])
    assert seen in terminal.getvalue()


# Many things


def told(stream: io.StringIO, number: int, seconds: float, at_once: int = 1) -> list[str]:
    """Count things, each of which takes so long, and return what was written before each and at the end."""
    now = [0.0]

    def made() -> Iterator[int]:
        for each in range(number):
            now[0] += seconds / at_once
            yield each

    written, counting = [], counted(made(), number, "matches", at_once, stream, lambda: now[0])
    for expected in range(number):
        assert next(counting) == expected
        written.append(stream.getvalue())
    assert next(counting, None) is None
    return [after.removeprefix(before) for before, after in pairwise(["", *written, stream.getvalue()])]


def test_a_short_job_prints_no_progress() -> None:
    assert set(told(io.StringIO(), 9, LONG / 9.5)) == {""}


def test_a_long_job_prints_its_expected_time_then_its_progress() -> None:
    said = told(io.StringIO(), 100, 1.0, at_once=2)
    assert [(number, text) for number, text in enumerate(said, 1) if text] == [
        (3, "100 matches, about 48 s on 2 processes\n"),
        (21, "21 of 100 matches, about 40 s left\n"),
        (41, "41 of 100 matches, about 30 s left\n"),
        (61, "61 of 100 matches, about 20 s left\n"),
        (81, "81 of 100 matches, about 10 s left\n"),
    ]


def test_long_times_are_in_minutes() -> None:
    assert told(io.StringIO(), 300, 0.9)[1] == "300 matches, about 4 min\n"


def test_a_counted_job_erases_its_bar_at_the_end() -> None:
    first, *_, last, end = told(Terminal(), 3, 1.0)
    assert first == f"\r{'█' * 10}{'░' * 20}  33%  1 of 3 matches  1.0 matches/s"
    assert last == f"\r{'█' * 30} 100%  3 of 3 matches  1.0 matches/s, about 0 s left"
    assert end == "\r" + " " * len(last[1:]) + "\r"


@pytest.mark.parametrize("most", [120, 79, 59, 30, 10])
def test_a_bar_fits_its_terminal(most: int) -> None:
    for done in (0, 1, 5, 12):
        text = line("", done, 12, 20.0, module.Unit("matches", "matches/s"), most)
        assert len(text) <= most
        assert ("12 matches" in text) is (most >= 30)  # the count is cut off last
        assert text[0] in "█░"


@pytest.mark.posix
def test_a_bar_on_a_narrow_terminal_stays_in_its_line() -> None:
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 60, 0, 0))
    times = iter(range(100))
    with open(theirs, "w", encoding="utf-8") as terminal:  # noqa: PTH123  # a descriptor
        list(counted(range(12), 12, "matches", 1, terminal, lambda: next(times) * 5.0))
        written = os.read(ours, 100_000).decode()
    os.close(ours)
    assert "about" in written
    assert max(len(each) for each in written.split("\r")) == 59


LINE = "    2.756 s  stop       emergency stop: object ahead of the robot"
FOLDED = [
    # (columns, lines)
    (80, [LINE]),
    (len(LINE), [LINE]),
    (50, ["    2.756 s  stop       emergency stop: object", "                        ahead of the robot"]),
    (40, [LINE]),  # so narrow that no lines would be better
]


@pytest.mark.parametrize(("width", "lines"), FOLDED)
def test_a_line_is_wrapped_between_words(width: int, lines: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "columns", lambda _: width)
    assert folded(LINE, io.StringIO(), 24) == "\n".join(lines)


def test_lines_for_a_file_are_not_wrapped() -> None:
    assert columns(io.StringIO()) == ENDLESS
    assert folded(LINE * 10, io.StringIO(), 24) == LINE * 10
