"""The live table on a terminal, and the keys."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from eurobot_od.frame import Frame
from eurobot_od.traffic.monitor import COLOURS, SERVICE_COLOUR, SORTS, Controls, Size, Traffic, screen
from tests.kit import plant
from tests.kit.plant import messages as m

WIDE = Size(120, 24)
DECODER = plant.decoder()


@pytest.fixture
def traffic() -> Traffic:
    traffic = Traffic(DECODER, 500_000)
    traffic.take(1.0, DECODER.protocol.encode(m.MoveTo(1, 2, 3, 4)))
    traffic.take(2.0, DECODER.protocol.encode(m.PlaceRequest()))
    traffic.take(2.1, Frame(0x702, b"\5"))
    return traffic


def shown(
    traffic: Traffic,
    controls: Controls | None = None,
    now: float = 2.5,
    load: float = 0.25,
    size: Size = WIDE,
) -> str:
    console = Console(
        file=io.StringIO(), width=size.width, height=size.height, force_terminal=True, color_system="standard"
    )
    console.print(screen(traffic, controls or Controls(), now, (load, 1000.0), size))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def style_before(text: str, words: str) -> str:
    """Return the terminal's colour codes in force at some words."""
    return text[: text.index(words)].rpartition("\x1b[")[2].partition("m")[0]


def test_table(traffic: Traffic) -> None:
    text = shown(traffic)
    for expected in ("3 frames", "1000/s", "25.0%", "of 500 kbit/s", "lift operational", "panel not heard", "x=1 mm"):
        assert expected in text


def test_protocols_have_colours_of_their_own(traffic: Traffic) -> None:
    text = shown(traffic)
    assert style_before(text, "Move To") == "96"
    assert style_before(text, "Place Request") == "32"
    assert style_before(text, "Heartbeat lift") == "35"
    assert len({*COLOURS, SERVICE_COLOUR}) == len(COLOURS) + 1


def test_defects_are_red(traffic: Traffic) -> None:
    traffic.take(3.0, Frame(0x123))
    text = shown(traffic, load=0.9, now=9.0)
    for words in ("unknown identifier: 123#", "1 x unknown identifier", "90.0%", "● lift LOST"):
        assert style_before(text, words) == "1;31"


def test_rows_that_do_not_fit_are_counted(traffic: Traffic) -> None:
    assert "2 rows more" in shown(traffic, size=Size(120, 9))
    assert " more" not in shown(traffic)


COLUMNS = [
    (120, "ID Message Count Period ms Age s Last values"),
    (66, "ID Message Count Period ms Last values"),
    (60, "ID Message Period ms Last values"),
    (50, "ID Message Last values"),
]


@pytest.mark.parametrize(("width", "headings"), COLUMNS, ids=[str(width) for width, _ in COLUMNS])
def test_a_narrow_terminal_does_without_columns_and_shows_the_values(
    traffic: Traffic, width: int, headings: str
) -> None:
    lines = plain(shown(traffic, size=Size(width, 24))).splitlines()
    assert all(len(line) <= width for line in lines)
    (heading,) = [line for line in lines if line.startswith("ID ")]
    assert " ".join(heading.split()) == headings


def plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def test_rows_scroll_and_the_last_one_stays_in_sight(traffic: Traffic) -> None:
    controls = Controls()
    for keys, message in (("", "Move To"), ("j", "Place Request"), ("jjjj", "Heartbeat"), ("k", "Place Request")):
        for key in keys:
            controls.key(key)
        assert message in shown(traffic, controls, size=Size(120, 9))


def test_filter_and_pause_are_shown(traffic: Traffic) -> None:
    text = shown(traffic, Controls(part="move", typing=True, paused=True))
    assert "Place" not in text
    assert "filter: move_" in text
    assert "PAUSED" in text


KEYS: list[tuple[str, Controls]] = [
    ("", Controls()),
    ("p", Controls(paused=True)),
    (" ", Controls(paused=True)),
    ("pp", Controls()),
    ("s", Controls(sort="name")),
    ("s" * len(SORTS), Controls()),
    ("c", Controls(clear=True)),
    ("q", Controls(running=False)),
    ("x", Controls()),
    ("jj", Controls(top=2)),
    ("jjk", Controls(top=1)),
    ("\x0e\x0e\x10", Controls(top=1)),
    ("/a\x0e", Controls(part="a", typing=True)),
    ("k", Controls()),
    ("/", Controls(typing=True)),
    ("/goto\r", Controls(part="goto")),
    ("/Move To\n", Controls(part="Move To")),
    ("/gotp\x7fo\r", Controls(part="goto")),
    ("/q", Controls(part="q", typing=True)),
    ("/goto\x1b", Controls()),
    ("/goto\r/", Controls(typing=True)),
    ("/\x07\r", Controls()),
]


@pytest.mark.parametrize(("keys", "expected"), KEYS)
def test_keys(keys: str, expected: Controls) -> None:
    controls = Controls()
    for key in keys:
        controls.key(key)
    assert controls == expected


def test_a_name_that_looks_like_markup_or_an_escape_is_shown_as_it_is(traffic: Traffic) -> None:
    row = next(iter(traffic.rows.values()))
    row.meaning = row.meaning._replace(text="[red]x[/nonsense]\x1b[2J")
    assert "[red]x[/nonsense]\\x1b[2J" in shown(traffic)
