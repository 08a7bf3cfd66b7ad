"""Many matches: in the order of their seeds, the same on any number of processes, and no process is left over."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.referee import StrategyFiles
from eurobot_od.robot.match.seeds import (
    FIGURES,
    FORCED,
    MOST_LISTED,
    NO_TASKS,
    Figure,
    PlayedGoto,
    PlayedMatch,
    PlayedTask,
    Spread,
    endings,
    play,
    play_many,
    report,
    spread,
    touch_counts,
)
from eurobot_od.robot.match.stage import EdsFiles, Prefixed
from eurobot_od.robot.match.summary import RobotTouch, Summary
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
def test_several_processes_give_the_same_results() -> None:
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
def test_seeds_that_cannot_be_played_are_an_error_before_any_match(
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
    assert run(program, 2) == [str([f"the strategy raised ValueError: no plan ({file}:4)"])] * 3


def test_a_strategy_that_cannot_be_loaded_is_an_error_before_a_process_begins(tmp_path: Path) -> None:
    with pytest.raises(LocalError, match="No such file"):
        play_many(SHORT, range(1, 4), HERE, StrategyFiles(tmp_path / "none.py"))


def goto(end: str, *figures: float) -> PlayedGoto:
    return PlayedGoto(700, 1150, 225, end, 2.0, *figures)


ENDED = goto("stopped: the match is over")


def arrived(distance: float) -> PlayedGoto:
    return goto("arrived", distance, distance / 2)


def match(seed: int, *gotos: PlayedGoto, points: int = 10, touches: tuple[RobotTouch, ...] = ()) -> PlayedMatch:
    summary = Summary(93.3, 500_000, {"Goto XY": 1}, {}, 0.005, points={"ours": points})
    return PlayedMatch(seed, list(gotos), touches=list(touches), summary=summary)


POOL, FIRE = RobotTouch(1.0, "pool 1", True, False), RobotTouch(1.0, "fire 1", True, False)
FINE = match(1, arrived(4.0), arrived(6.0), ENDED, points=20)
STOPPED = match(2, goto("stopped: enemy ahead"), arrived(1.0), ENDED, touches=(FIRE,))
LOST = match(3, arrived(9.0), goto("lost"), points=4, touches=(POOL, FIRE))
FAILED = PlayedMatch(4, failure="no answer")
DISTANCE = next(figure for figure in FIGURES if figure.name.startswith("distance"))
POINTS = FIGURES[0]


def test_a_line_of_a_strategy_is_written_whole() -> None:
    """The parts of two processes would mix otherwise."""
    written: list[str] = []
    printed = Prefixed(SimpleNamespace(write=written.append, flush=bool), "seed 1: ")  # type: ignore[arg-type]
    for part in ("600", " ", "ARRIVED", "\n", "last"):
        printed.write(part)
    printed.end()
    assert [each for each in written if each] == ["seed 1: 600 ARRIVED\n", "seed 1: last\n"]


@pytest.mark.parametrize(
    ("matches", "rows"),
    [
        ([FINE], {"arrived": (1, 2), "stopped: the match is over": (1, 1)}),
        ([FINE, STOPPED], {"arrived": (2, 3), "stopped: enemy ahead": (1, 1)}),
        ([LOST], {"arrived": (1, 1), "lost": (1, 1), "not possible": (0, 0)}),
        ([FAILED], {"arrived": (0, 0)}),
    ],
)
def test_endings_of_gotos_are_counted(matches: list[PlayedMatch], rows: dict[str, tuple[int, int]]) -> None:
    counted = {name: (in_matches, gotos) for name, in_matches, gotos in endings(matches)}
    assert counted.items() >= rows.items()


def test_problems_have_a_row_even_when_their_number_is_0() -> None:
    names = ["not possible", "replaced", "lost"]
    assert endings([FINE])[1:4] == [(name, 0, 0) for name in names]


def test_touches_are_counted_by_what_and_by_whose_fault() -> None:
    forced, rammed = POOL._replace(forced=True), RobotTouch(3.0, "enemy 1", False, True)
    counted = touch_counts([FINE, match(5, touches=(POOL, forced)), match(6, touches=(POOL, POOL, rammed))])
    assert [each for each in counted if each[2]] == [
        (FORCED, 1, 1, 1, 0),
        ("pool", 2, 3, 3, 0),
        ("robot", 1, 1, 0, 1),
    ]


@pytest.mark.parametrize(
    ("figure", "matches", "expected"),
    [
        (DISTANCE, [FINE, STOPPED, LOST], Spread(5.0, (1.0, 2), [3.25, 5.0, 6.75], (9.0, 3))),
        (POINTS, [FINE, STOPPED, LOST], Spread(34 / 3, (4, 3), [7, 10, 15], (20, 1))),
        (
            DISTANCE,
            [match(8, arrived(5.0)), match(9, arrived(5.0))],
            Spread(5, (5, 8), [5, 5, 5], (5, 8)),
        ),  # the first seed
        (POINTS, [LOST], Spread(4, (4, 3), [4, 4, 4], (4, 3))),
        (DISTANCE, [FAILED], None),
        (DISTANCE, [FAILED, FINE], Spread(5.0, (4.0, 1), [4.5, 5.0, 5.5], (6.0, 1))),
    ],
)
def test_the_spread_of_a_figure_over_matches(
    figure: Figure, matches: list[PlayedMatch], expected: Spread | None
) -> None:
    assert spread(figure, matches) == expected


@pytest.mark.parametrize("figure", FIGURES)
def test_a_match_that_failed_has_no_figures(figure: Figure) -> None:
    assert spread(figure, [FAILED]) is None
    assert spread(figure, [FINE]) is not None


def test_the_load_of_the_bus_is_in_percent() -> None:
    (load,) = (figure for figure in FIGURES if figure.name == "bus load, %")
    assert [*load.of(FINE)] == [0.5]


def test_a_task_without_points_is_not_done() -> None:
    (tasks_done,) = (figure for figure in FIGURES if figure.name == "tasks done")
    played = replace(
        FINE, tasks=[PlayedTask(2.0, "fire 1", 0), PlayedTask(4.0, "fire 2", 1), PlayedTask(9.0, "net", 6)]
    )
    assert list(tasks_done.of(played)) == [2]


def test_the_position_error_is_that_of_all_arrivals() -> None:
    errors = [2.0, 3.0, 0.5, 4.5]
    assert sum(errors) / 4 == 2.5
    rms = (sum(error**2 for error in errors) / 4) ** 0.5
    line = f"position error at 4 arrivals: mean 2.5 mm, RMS {rms:.1f} mm, 95 % up to 4.5 mm"
    assert line in list(report([FINE, STOPPED, LOST]))


def test_the_histogram_has_a_line_for_each_step_of_points() -> None:
    lines = list(report([FINE, STOPPED, match(7)]))
    begin = lines.index("matches by points")
    assert [lines[begin + 1].split()[0], lines[begin + 1].split()[-1], lines[begin + 11].split()[-1]] == [
        "10",
        "2",
        "1",
    ]


def test_the_report_ends_with_the_seeds_to_look_at() -> None:
    assert list(report([FINE, STOPPED, LOST, FAILED]))[-4:] == [
        "seed 3: goto (700, 1150): lost, and 1 more",
        "seed 4: no answer",
        "fewest points: seed 3 with 4, seed 2 with 10, seed 1 with 20",
        "4 matches, seeds 1 to 4: something went wrong in 2",
    ]
    assert NO_TASKS in report([FINE, STOPPED])
    assert NO_TASKS not in report([FINE, replace(STOPPED, tasks=[PlayedTask(1.0, "fire 1", 0)])])
    assert list(report([FINE, STOPPED]))[-1] == "2 matches, seeds 1 to 2: nothing went wrong"
    assert list(report([FAILED]))[-2:] == ["seed 4: no answer", "1 match, seeds 4 to 4: something went wrong in 1"]


def test_the_report_counts_touches_by_what_was_touched() -> None:
    lines = [line.split() for line in report([STOPPED, LOST])]
    heading = lines.index(["touched", "matches", "touches", "our", "fault", "driven", "into"])
    assert lines[heading + 1 : lines.index([], heading)] == [
        [*name.split(), *map(str, numbers)] for name, *numbers in touch_counts([STOPPED, LOST])
    ]


def test_of_very_many_seeds_the_first_are_listed() -> None:
    lines = list(report([match(seed, goto("lost")) for seed in range(1, MOST_LISTED + 8)]))
    assert sum(line.startswith("seed ") for line in lines) == MOST_LISTED
    assert "and 7 more seeds" in lines


def test_columns_stand_below_each_other() -> None:
    lines = list(report([FINE, STOPPED]))
    first = lines.index("")
    second = lines.index("", first + 1)
    tables = lines[:first], lines[first + 1 : second], lines[second + 1 : second + 2 + len(FIGURES)]
    assert [{len(line) for line in table} for table in tables] == [{48}, {63}, {90}]


WITHOUT_EXTRAS = """
import sys
sys.modules.update(dict.fromkeys(["duckdb", "polars", "pyarrow"]))
from eurobot_od.cli import main
sys.exit(main(["match", "--seeds", "7-7", "--jobs", "1", "--for", "1"]))
"""


def test_matches_whose_results_nobody_keeps_need_no_extra() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_EXTRAS], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 match" in done.stdout
