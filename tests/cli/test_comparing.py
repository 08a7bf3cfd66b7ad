"""`compare` and `replay`: what they print, their exit status, what they refuse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.frame import Frame
from tests.cli.console import run
from tests.client.wired import WiredBus
from tests.rows import rows

LINES = ["(1.000000) can0 008#D27423592C01C3A5", "(1.250000) can0 00C#", "(2.000000) can0 014#F40100"]
LATER = ["(1.000000) can0 008#D27423592C01C3A5", "(1.260000) can0 00C#", "(2.000000) can0 014#F50100"]


@pytest.fixture
def logs(tmp_path: Path) -> tuple[str, str]:
    names = []
    for name, lines in (("one", LINES), ("other", LATER)):
        file = tmp_path / f"{name}.log"
        file.write_text("".join(f"{line}\n" for line in lines))
        names.append(str(file))
    return names[0], names[1]


def test_equal_logs_are_fine(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "compare", logs[0], logs[0]) == (0, "3 and 3 frames: no difference\n", "")


def test_differences_are_listed_and_counted(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "compare", *logs)
    assert (said.status, said.err) == (1, "")
    assert said.out.splitlines() == [
        "     0.250000  late     Goto Confirm                  by 10.000 ms",
        "     1.000000  changed  Goto State Response           time = 500 ms -> 501 ms",
        "3 and 3 frames: 1 late, 1 changed",
    ]


def test_differences_as_json(logs: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys, "compare", *logs, "--json").out.splitlines()
    assert json.loads(lines[0]) == {
        "time": 0.25,
        "kind": "late",
        "name": "Goto Confirm",
        "text": "by 10.000 ms",
    }


@rows(
    "words, status",
    [
        (["--time", "10 ms", "--tolerance", "time=1"], 0),
        (["--time", "10 ms", "--tolerance", "Goto State Response.time=1"], 0),
        (["--time", "10 ms"], 1),
        (["--tolerance", "time=1"], 1),
        (["--message", "Goto XY"], 0),
    ],
)
def test_tolerances_and_filters(
    words: list[str], status: int, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "compare", *logs, *words).status == status


@rows(
    "words, complaint",
    [
        (["--tolerance", "x"], "argument --tolerance: x: write [MESSAGE.]FIELD=NUMBER"),
        (["--tolerance", "x=-1"], "--tolerance x=-1: not a number, 0 or more"),
        (["--tolerance", "nothing=1"], "unknown field 'nothing'"),
        (["--tolerance", "Goto.x=1"], "unknown message 'Goto'"),
        (["--time", "5"], "'5' is not a duration"),
    ],
)
def test_wrong_tolerances_are_one_line(
    words: list[str], complaint: str, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "compare", *logs, *words)
    assert (said.status, said.out) == (2, "")
    assert complaint in said.complaint


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> WiredBus:
    """A bus in simulated time."""
    bus = WiredBus()
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: bus)
    monkeypatch.setattr("eurobot_od.client.master.Master.__init__.__defaults__", (0.5, lambda: bus.now, 1 << 20))
    return bus


def test_replay_sends_the_frames_and_says_how_many(
    logs: tuple[str, str], bus: WiredBus, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "replay", logs[0], "--speed", "2")
    assert said == (0, "3 frames sent, 0 of them later than 1 ms, 0.0 ms at most\n", "")
    assert [str(frame) for frame in bus.sent] == [line.split()[2] for line in LINES]
    assert bus.now == pytest.approx(0.5)


@rows(
    "words, sent",
    [(["--only", "drive"], LINES[1:]), (["--except", "drive"], LINES[:1]), (["--only", "core"], LINES[:1])],
)
def test_replay_of_some_nodes(
    words: list[str], sent: list[str], logs: tuple[str, str], bus: WiredBus, capsys: pytest.CaptureFixture[str]
) -> None:
    bus.sent.clear()
    assert run(capsys, "replay", logs[0], *words).status == 0
    assert bus.sent == [Frame.parse(line.split()[2]) for line in sent]


@rows(
    "words, complaint",
    [
        (["--speed", "0"], "0 is not a positive number"),
        (["--speed", "inf"], "inf is not a positive number"),
        (["--only", "motor"], "unknown node 'motor'"),
        (["--only", "core", "--except", "drive"], "not allowed with argument --only"),
    ],
)
@pytest.mark.usefixtures("bus")
def test_replay_refuses_what_cannot_be(
    words: list[str], complaint: str, logs: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "replay", logs[0], *words)
    assert (said.status, said.out) == (2, "")
    assert complaint in said.complaint
