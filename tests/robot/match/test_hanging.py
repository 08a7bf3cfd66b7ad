"""A strategy that hangs is ended, with its line, and the robot stands; it cannot take anything else with it."""

from __future__ import annotations

import gc
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from textwrap import dedent
from types import FrameType

import pytest

from eurobot_od.bus.live import event_loop, open_bus
from eurobot_od.robot.match import stage
from eurobot_od.robot.match.referee import StrategyFiles, load_strategy
from eurobot_od.robot.match.seeds import play_many
from eurobot_od.robot.match.summary import Summary
from eurobot_od.robot.model.messages import StopDrive
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.world.world import EventKind, MatchEvent
from tests.client.peers import new_channel

ALONE = MatchOptions(enemies=0, confederates=0, duration=30.0)
STOP = EurobotProtocol.load().cob_id(StopDrive)

SOON = 2.0
"""The computer's time in which a hanging strategy is ended, in s; it has 0.3 s of it."""

LONG = 60.0
"""Longest wait for what has to come, s."""

BUSY = 3.0
"""Seconds more for a computer that does something else as well."""

HANGING = {
    # what students write: (the strategy, the line where it hangs)
    "waits for the end": ("while core.time_left > 0: pass", "while core.time_left > 0: pass"),
    "gives way and no time passes": ("while True: await asyncio.sleep(0)", "while True: await asyncio.sleep(0)"),
    "hardly any time passes": ("while True: await asyncio.sleep(1e-7)", "while True: await asyncio.sleep(1e-7)"),
    "catches everything": ("while True:\n    try:\n        core.time_left\n    except:\n        pass", ""),
    "catches what a shutdown raises": (
        "await core.emergency_shutdown()\nwhile True:\n    try:\n        await core.goto(600, 1700, 90, 60)\n"
        "    except Exception:\n        pass",
        "",
    ),
    "sleeps": ("going = core.goto(1500, 1000, 90, 60)\ntime.sleep(30)", "time.sleep(30)"),
    "waits for a lock": ("threading.Event().wait()", "threading.Event().wait()"),
    "never awaits": ("while True: core.goto(600, 1700, 90, 60)", "while True: core.goto(600, 1700, 90, 60)"),
    "makes named tuples, by code that has no file": (
        "from collections import namedtuple\nPair = namedtuple('Pair', 'x y')\nwhile True: Pair(1, 2)",
        "while True: Pair(1, 2)",
    ),
    "cleans up for ever": (
        "try:\n    await core.goto(600, 1700, 90, 60)\nfinally:\n    while core: hash(core)",
        "while core: hash(core)",
    ),
}


def write(folder: Path, body: str) -> Path:
    file = folder / "mine.py"
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    file.write_text(f"import asyncio, pathlib, sys, threading, time\nasync def play(core):\n{lines}", encoding="utf-8")
    return file


@pytest.fixture
def _impatient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """End a strategy that hangs soon, and not in what hypothesis does at each garbage collection."""
    monkeypatch.setattr(event_loop, "PATIENCE", 0.3)
    gc.disable()
    yield
    gc.enable()


def play(file: Path) -> tuple[Summary, list[MatchEvent], list[int], list[str]]:
    """Play a match in simulated time; also return the identifiers on the bus, and what the watchdog told."""
    events: list[MatchEvent] = []
    sent: list[int] = []
    told: list[str] = []
    summary, _ = stage.play_simulated(
        ALONE, events.append, lambda _, frame: sent.append(frame.cob_id), None, load_strategy(file), tell=told.append
    )
    return summary, events, sent, told


@pytest.mark.usefixtures("_impatient")
@pytest.mark.parametrize(("body", "line"), HANGING.values(), ids=HANGING)
def test_a_hanging_strategy_is_ended_with_its_line_and_the_robot_stands(tmp_path: Path, body: str, line: str) -> None:
    file = write(tmp_path, body)
    begin = time.process_time()
    summary, events, sent, _ = play(file)
    assert time.process_time() - begin < SOON + BUSY
    assert summary.failure is not None
    assert summary.failure.startswith(f"the strategy hangs: {file}:")
    assert f"`{line}" in summary.failure
    assert [event.kind for event in events if event.kind is EventKind.FAILED]
    assert STOP in sent
    assert events[-1].kind is EventKind.END
    assert events[-1].data["moved"] == 0


def test_a_blocking_sleep_is_told_by_name_with_what_to_write_instead(tmp_path: Path) -> None:
    summary, _, _, told = play(write(tmp_path, "time.sleep(0.4)"))
    assert summary.failure is None
    text = "`time.sleep(0.4)` blocks: time.sleep stops everything, write `await asyncio.sleep(0.4)`"
    assert told == [f"{tmp_path / 'mine.py'}:3: {text}"]


@contextmanager
def answered_late(pipe: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make a file on a disk that stalls: its reader gets the word only after the watchdog has looked 20 times."""
    looks, innermost, enough = 0, event_loop.innermost, threading.Event()

    def counted(frame: FrameType | None) -> FrameType | None:
        nonlocal looks
        looks += 1
        if looks == 20:
            enough.set()
        return innermost(frame)

    def answer() -> None:
        enough.wait(LONG)
        pipe.write_text("go on", encoding="utf-8")

    monkeypatch.setattr(event_loop, "innermost", counted)
    os.mkfifo(pipe)
    thread = threading.Thread(target=answer)
    thread.start()
    yield
    thread.join(LONG)


READS = "core.say(pathlib.Path(__file__).with_name('slow').read_text())\nawait core.goto(600, 1700, 90, 60)"


@pytest.mark.posix
@pytest.mark.usefixtures("_impatient")
def test_a_strategy_that_waits_for_a_slow_file_is_not_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with answered_late(tmp_path / "slow", monkeypatch):
        summary, events, *_ = play(write(tmp_path, READS))
    assert summary.failure is None
    assert [event.text for event in events if event.kind is EventKind.SAID] == ["go on"]


@pytest.mark.posix
@pytest.mark.usefixtures("_impatient")
def test_a_strategy_that_waits_for_a_file_for_ever_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_loop, "STALLED", 0.5)
    os.mkfifo(tmp_path / "slow")
    summary, *_ = play(write(tmp_path, READS))
    assert summary.failure is not None
    assert "read_text()" in summary.failure


@pytest.mark.usefixtures("_impatient")
def test_a_hanging_strategy_is_ended_in_a_live_match(tmp_path: Path) -> None:
    events: list[MatchEvent] = []
    opener = partial(open_bus, "virtual", new_channel())
    begin = time.process_time()
    options = replace(ALONE, settings=(("core.Position polling.Start delay", "0"),))
    summary, _ = stage.play_live(
        options, events.append, lambda *_: None, opener, load_strategy(write(tmp_path, HANGING["waits for the end"][0]))
    )
    assert time.process_time() - begin < SOON + BUSY
    assert summary.failure is not None
    assert "`while core.time_left > 0: pass`" in summary.failure
    assert summary.frames["Stop Drive"]


def test_a_hanging_strategy_does_not_end_the_other_seeds(tmp_path: Path) -> None:
    once = "flag = pathlib.Path(__file__).with_suffix('.flag')\nif not flag.exists():\n    flag.touch()\n"
    file = write(tmp_path, once + "    while True: pass\nawait core.goto(600, 1700, 90, 60)")
    first, *others = play_many(ALONE, range(1, 4), strategies=StrategyFiles(file))
    assert [text.partition(": ")[0] for text in first.wrong] == ["the strategy hangs"]
    assert [(len(each.gotos), each.summary and each.summary.failure) for each in others] == [(1, None)] * 2


def test_sys_exit_is_a_failed_match(tmp_path: Path) -> None:
    summary, events, *_ = play(write(tmp_path, "sys.exit(0)"))
    assert summary.failure is not None
    assert summary.failure.endswith("sys.exit(0) ends the whole program: write `return`")
    assert events[-1].kind is EventKind.END


def test_a_strategy_that_drives_on_when_the_match_is_over_ends_cleanly(tmp_path: Path) -> None:
    body = """
        while True:
            try:
                await core.goto(600, 1700, 90, 60)
                await core.goto(900, 1700, 90, 60)
            except Exception:
                pass
    """
    summary, events, *_ = play(write(tmp_path, dedent(body).strip()))
    assert summary.failure is None
    assert EventKind.FAILED not in {event.kind for event in events}


def test_a_strategy_that_swallows_its_end_is_told(tmp_path: Path) -> None:
    body = "while True:\n    try:\n        await asyncio.sleep(1)\n    except BaseException:\n        pass"
    summary, *_ = play(write(tmp_path, body))
    assert summary.failure == "the strategy goes on after the match: it swallows asyncio.CancelledError"


def test_no_watchdog_thread_is_left_after_a_match() -> None:
    assert [each.name for each in threading.enumerate() if each.name == "watchdog"] == []
