"""Many matches: in the order of their seeds, the same on any number of processes, and no process is left over."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.played import play
from eurobot_od.robot.match.referee import StrategyFiles
from eurobot_od.robot.match.seeds import play_many
from eurobot_od.robot.match.stage import EdsFiles
from eurobot_od.season.campaign import HERE

SHORT = MatchOptions(duration=3.0)

PROGRAM = """
import os, signal
from contextlib import ExitStack
from multiprocessing import active_children
from eurobot_od.season.campaign import local
from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.seeds import play_many
opened = ExitStack()
workers = opened.enter_context(local(2))
matches = play_many(MatchOptions(duration=3.0), range(1, {last}), workers)
"""


def run(program: str, last: int) -> list[str]:
    """Run a program of its own, which has no threads while it forks, and return its lines."""
    words = [sys.executable, "-c", PROGRAM.format(last=last) + program + "\nopened.close()"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.mark.long
def test_each_seed_is_played_once_and_in_order() -> None:
    matches = list(play_many(SHORT, range(3, 6)))
    assert matches == [play(MatchOptions(seed=seed, duration=3.0), EdsFiles.read(MatchOptions())) for seed in (3, 4, 5)]


@pytest.mark.long
def test_several_processes_come_to_the_same() -> None:
    assert run("for match in matches: print(match)", 6) == [str(each) for each in play_many(SHORT, range(1, 6))]


@pytest.mark.long
def test_closing_ends_the_processes() -> None:
    lines = run("next(matches); print(len(active_children())); opened.close(); print(len(active_children()))", 1000)
    assert lines == ["2", "0"]


@pytest.mark.long
@pytest.mark.posix
def test_a_process_that_dies_is_an_error_and_the_others_end() -> None:
    program = """
next(matches)
os.kill(active_children()[0].pid, signal.SIGKILL)
try:
    list(matches)
except ChildProcessError as error:
    opened.close()
    print(error, len(active_children()))
"""
    assert run(program, 1000) == ["a process that did a part of the work has died 0"]


@pytest.mark.long
def test_processes_end_when_their_parent_is_killed() -> None:
    program = PROGRAM.format(last=1000) + "next(matches); print(flush=True); list(matches)"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as parent:
        assert parent.stdout
        parent.stdout.readline()
        parent.kill()
        assert parent.stdout.read() == b""  # the end of the pipe comes when nobody has it open any more


@pytest.mark.parametrize(
    ("options", "error"),
    [(MatchOptions(emergency_at=95.0), LocalError), (MatchOptions(dialect="nonsense"), UnknownName)],
)
def test_what_cannot_be_played_is_an_error_before_anything_begins(
    options: MatchOptions, error: type[Exception]
) -> None:
    with pytest.raises(error):
        play_many(options, range(1, 4))


LOOK = """
async def play(core):
    await core.goto(600, 1800, 0, 50)
    raise ValueError("no plan")
"""


@pytest.mark.long
@pytest.mark.parametrize("workers", ["workers", "HERE"])
def test_each_process_loads_the_strategies(tmp_path: Path, workers: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(LOOK)
    program = f"""
from pathlib import Path
from eurobot_od.season.campaign import HERE
from eurobot_od.robot.match.referee import StrategyFiles
for match in play_many(MatchOptions(duration=3.0), range(1, 4), {workers}, StrategyFiles(Path({str(file)!r}))):
    print(match.wrong)
"""
    assert run(program, 2) == ["['the strategy raised ValueError: no plan']"] * 3


def test_a_strategy_that_cannot_be_loaded_is_an_error_before_a_process_begins(tmp_path: Path) -> None:
    with pytest.raises(LocalError, match="No such file"):
        play_many(SHORT, range(1, 4), HERE, StrategyFiles(tmp_path / "none.py"))
