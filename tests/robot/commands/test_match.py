"""`match`: its timeline and summary, JSON, logs in every format, and wrong command lines."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest

from eurobot_od.robot.match import strategy
from eurobot_od.robot.model.options import UNITS, Errors
from eurobot_od.robot.protocol import EurobotProtocol
from tests.cli.console import run
from tests.robot.document import NAMES

SHORT = ["match", "--for", "2"]
SCRIPT = [sys.executable, "-m", "eurobot_od"]


def total(out: str) -> int:
    """Return the number of frames that the summary tells."""
    return next(int(line.split()[1]) for line in out.splitlines() if line.startswith("total "))


# What it prints


def test_a_person_reads_timeline_and_summary(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, *SHORT)
    lines = said.out.splitlines()
    assert (said.status, said.err) == (0, "")
    assert lines[0] == ("    0.000 s  start      core, drive, navigation at 500 kbit/s, simulated; EDS files: canopen")
    kinds = [line[13:23].strip() for line in lines[: lines.index("")]]
    assert kinds[:5] == ["start", "check", "configure", "position", "match"]
    assert kinds[-1] == "end"
    assert lines[lines.index("") + 1].split() == ["message", "frames"]
    assert "\x1b" not in said.out


@pytest.mark.long
def test_a_reader_that_leaves_ends_neither_the_match_nor_its_log(tmp_path: Path) -> None:
    words = [*SCRIPT, *SHORT, "--log", "match.log"]
    log = tmp_path / "match.log"
    unbuffered = os.environ | {"PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        words, cwd=tmp_path, env=unbuffered, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stdout
        assert running.stderr
        running.stdout.readline()
        running.stdout.close()
        assert running.stderr.read() == b""
        assert running.wait() == 0
    assert float(log.read_text().splitlines()[-1][1:].split(")")[0]) > 2.0


def test_a_terminal_has_colours(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    lines = run(capsys, *SHORT).out.splitlines()
    (match,) = (line for line in lines if line[18:23] == "match")
    assert (match[:5], match[-4:]) == ("\x1b[36m", "\x1b[0m")
    assert "\x1b" not in lines[0]


def test_json_has_every_message(capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(run(capsys, "match", "--for", "10", "--json").out)
    frames = data["summary"]["frames"]
    assert list(frames) == EurobotProtocol.load().names()
    assert data["summary"]["messages_sent"] == sum(count > 0 for count in frames.values())
    assert not frames["Emergency Shutdown"]
    assert data["timeline"][0]["kind"] == "start"
    assert data["timeline"][-1]["moved"] == 0


def test_json_of_an_emergency_has_all_messages_and_nothing_moves_afterwards(
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = json.loads(run(capsys, "match", "--for", "10", "--emergency-at", "4", "--json").out)
    assert all(data["summary"]["frames"][name] for name in NAMES)
    kinds = [event["kind"] for event in data["timeline"]]
    assert "goto" not in kinds[kinds.index("emergency") :]
    assert data["timeline"][-1]["moved"] == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--team", "yellow"], "yellow, 2 enemies, 1 confederate"),
        (["--enemies", "0", "--confederates", "0"], "red, 0 enemies, 0 confederates"),
        (["--enemies", "1"], "red, 1 enemy, 1 confederate"),
        (["--dialect", "firmware2014"], "EDS files: firmware2014"),
        (["--for", "2.5"], "begins, 2.5 s long"),
        (["--for", "2500ms"], "begins, 2.5 s long"),
        (["--for", "0.05 min"], "begins, 3 s long"),
    ],
)
def test_options_show_in_the_timeline(capsys: pytest.CaptureFixture[str], words: list[str], told: str) -> None:
    said = run(capsys, "match", "--for", "1", *words)
    assert said.status == 0
    assert told in said.out


# Logs


def test_the_same_seed_writes_the_same_log_to_the_byte(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    logs = [tmp_path / "a.log", tmp_path / "b.log"]
    for log in logs:
        run(capsys, *SHORT, "--seed", "7", "--log", str(log))
    one, other = (log.read_bytes() for log in logs)
    assert one == other
    run(capsys, *SHORT, "--seed", "8", "--log", str(logs[1]))
    assert logs[1].read_bytes() != one


def count(log: Path) -> int:
    """Count the frames in a log that python-can reads."""
    with can.LogReader(log) as reader:
        return sum(1 for _ in reader)


@pytest.mark.long
def test_a_log_has_every_frame_of_a_whole_match(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "match.db"  # the format whose writer drops its backlog when it is stopped
    said = run(capsys, "match", "--log", str(log))
    assert said.status == 0
    assert count(log) == total(said.out) > 3000


def test_an_unknown_format_leaves_a_file_alone(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    notes = tmp_path / "notes.md"
    notes.write_text("precious")
    said = run(capsys, *SHORT, "--log", str(notes))
    assert (said.status, said.out) == (2, "")
    assert said.err.startswith(f'eurobot-od: {notes}: No write support for unknown log format ".md"; name a file of')
    assert notes.read_text() == "precious"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full, as Linux has one")
def test_a_match_goes_on_without_its_log_on_a_full_disk_and_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    log = tmp_path / "match.log"
    log.symlink_to("/dev/full")
    said = run(capsys, *SHORT, "--log", str(log))
    assert said.status == 3
    assert "the robot stands at" in said.out
    full = f"eurobot-od: {log}: No space left on device: "
    assert said.err == f"{full}nothing more is logged\n{full}the log is not whole\n"


@pytest.mark.parametrize("suffix", [".log", ".db"])
def test_a_log_in_a_missing_folder_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path, suffix: str) -> None:
    log = tmp_path / "missing" / f"match{suffix}"
    said = run(capsys, *SHORT, "--log", str(log))
    assert (said.status, said.out) == (3, "")
    assert said.err == f"eurobot-od: {log}: No such file or directory\n"


# Strategies, faults, settings, errors of the world


ARRIVES = """
async def play(core):
    print("on the way")
    await core.goto(400, 1800, 0, 15)
"""
RAISES = """
async def play(core):
    await core.goto(400, 1800, 0, 15)
    return [][0]
"""


@pytest.fixture
def mine(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a strategy, and gives its file."""

    def write(text: str) -> Path:
        file = tmp_path / "mine.py"
        file.write_text(text)
        return file

    return write


def test_a_team_plays_its_own_strategy(capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]) -> None:
    said = run(capsys, "match", "--for", "3", "--enemies", "0", "--strategy", str(mine(ARRIVES)))
    assert (said.status, said.err) == (0, "")
    assert "on the way\n" in said.out
    assert said.out.count("goto       (400, 1800) 0 deg, 15 %") == said.out.count("arrived    ") == 1
    assert said.out.splitlines()[-2:] == ["points: ours 0", "touches: none"]


def test_prints_of_a_strategy_stay_out_of_the_json(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    said = run(capsys, *SHORT, "--json", "--strategy", str(mine(ARRIVES)))
    assert json.loads(said.out)["summary"]["failure"] is None
    assert said.err == "on the way\n"


def test_a_strategy_that_raises_ends_the_match_with_log_and_picture(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path], tmp_path: Path
) -> None:
    file = mine(RAISES)
    log = tmp_path / "mine.log"
    picture = tmp_path / "mine.svg"
    words = ["--enemies", "0", "--strategy", str(file), "--log", str(log), "--field", str(picture)]
    said = run(capsys, "match", "--for", "4", *words)
    assert said.status == 1
    place = [f'  File "{file}", line 4, in play', "    return [][0]", "IndexError: list index out of range"]
    assert said.err.splitlines()[-3:] == place
    assert f"failed the strategy raised IndexError: list index out of range ({file}:4)" in " ".join(said.out.split())
    assert "since it stopped it moved 0 mm" in said.out
    assert count(log) == total(said.out)
    assert "1 of 1 goto reached" in picture.read_text()


def test_an_error_of_a_strategy_names_the_team_s_own_line(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    file = mine("async def play(core):\n    await core.goto(9999, 0, 0, 50)\n")
    said = run(capsys, *SHORT, "--strategy", str(file))
    assert said.err.splitlines()[-3:-1] == [f'  File "{file}", line 2, in play', "    await core.goto(9999, 0, 0, 50)"]
    assert said.complaint.endswith("FieldError: Goto XY: x = 9999 is not allowed; allowed: 0..3000 mm")


def test_a_parameter_that_a_goto_does_not_have_is_told_with_those_that_it_has(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    file = mine("async def play(core):\n    core.goto(9, 0, 0, velocity=50)\n")
    said = run(capsys, *SHORT, "--strategy", str(file))
    assert "argument 'velocity'; write goto(x, y, angle, speed, barriers=" in said.complaint
    assert said.complaint.endswith("route=Route.PLANNED, timeout=None)")


def test_two_strategies_play_each_other(capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]) -> None:
    said = run(capsys, *SHORT, "--against", str(mine(RAISES.replace("return", "core."))))
    assert (said.status, said.out) == (2, "")
    said = run(capsys, *SHORT, "--against", str(mine(ARRIVES)))
    assert said.status == 0
    assert "points: ours 0, enemy 1 0" in said.out.splitlines()


def test_a_fault_is_named_and_a_long_match_is_told(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    raises = str(mine("async def play(core):\n    raise ValueError\n"))
    said = run(capsys, "match", "--for", "90min", "--fault", "stop-ignored", "--strategy", raises)
    assert said.out.splitlines()[0].endswith("EDS files: canopen; faults: stop-ignored")
    assert "--for: a match of 5400 s; robot.yaml says 90 s" in said.err


def test_lines_of_the_second_robots_strategy_are_marked(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    file = str(mine("import asyncio\nasync def play(core):\n    await asyncio.sleep(0.1)\n    print('at', 'work')\n"))
    said = run(capsys, *SHORT, "--strategy", file, "--against", file)
    assert [each for each in said.out.splitlines() if "at work" in each] == ["at work", "enemy 1: at work"]


def test_an_error_of_the_other_strategy_is_reported_too(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]
) -> None:
    said = run(capsys, *SHORT, "--against", str(mine("async def play(core):\n    raise ValueError('no plan')\n")))
    assert (said.status, said.complaint) == (1, "ValueError: no plan")


def test_parts_fail_as_in_a_check(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, *SHORT, "--fault", "goto-not-sent", "--fault", "heartbeat-missing")
    frames = dict(
        line.rsplit(maxsplit=1) for line in said.out.splitlines() if line.startswith(("Goto XY", "Heartbeat"))
    )
    assert frames == {"Goto XY": "0"}


def test_a_setting_counts_in_place_of_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "match", "--set", "core.Match.Match duration=1")
    assert "begins, 1 s long" in said.out


def test_options_set_the_errors_of_the_world(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    logs = [tmp_path / "a.log", tmp_path / "b.log"]
    for log, dropouts in zip(logs, ("0", "1")):
        run(capsys, *SHORT, "--world", f"beacon_dropouts={dropouts}", "--world", "sensor_false=0", "--log", str(log))
    one, other = (log.read_bytes() for log in logs)
    assert one != other


def test_help_lists_the_errors_of_the_world_with_their_units(capsys: pytest.CaptureFixture[str]) -> None:
    told = " ".join(run(capsys, "match", "--help").out.split())
    assert all(f"{name}=" in told for name in vars(Errors()))
    assert all(f" {unit}" in told for unit in UNITS.values())
    assert UNITS.keys() <= vars(Errors()).keys()


# What is wrong


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--emergency-at", "soon"], "argument --emergency-at: 'soon' is not a duration"),
        (["--emergency-at", "0"], "argument --emergency-at: a time of 0 is not above 0"),
        (["--emergency-at", "-1"], "argument --emergency-at: '-1 s' is not a duration"),
        (["--emergency-at", "nan"], "argument --emergency-at: 'nan' is not a duration"),
        (["--for", "inf"], "argument --for: 'inf' is not a duration"),
        (["--for", "90000"], "argument --for: 90000 without a unit would be 90000 s; write 90000ms, or 90000s"),
        (["--enemies", "3"], "argument --enemies: unknown value '3'; known: 0, 1, 2"),
        (["--confederates", "2"], "argument --confederates: unknown value '2'; known: 0, 1"),
        (["--team", "blue"], "argument --team: unknown value 'blue'; known: yellow, red"),
        (["--seed", "one"], "argument --seed: one is not a whole number"),
        (["--speed", "slow"], "argument --speed: unknown value 'slow'; known: fast, real"),
        (["--seeds", "0"], "argument --seeds: 0 is neither a number of seeds nor FIRST-LAST"),
        (["--seeds", "5-2"], "argument --seeds: 5-2: the first seed is above the last; FIRST-LAST is 2-5"),
        (["--seeds", "1-"], "argument --seeds: 1- is neither a number of seeds nor FIRST-LAST"),
        (["--seeds", "9" * 5000], f"argument --seeds: {'9' * 5000} is neither"),  # more digits than int() takes
        (["--jobs", "0"], "argument --jobs: 0 is not a number of processes; allowed: 1..60"),
        (["--jobs", "0100"], "argument --jobs: 0100 is not a number of processes; allowed: 1..60"),
        (["extra"], "unrecognized arguments: extra"),
        (["--world", "wheel_noise"], "argument --world: wheel_noise: write NAME=VALUE"),
        (["--set", "drive.Motion.Speed"], "argument --set: drive.Motion.Speed: write NAME=VALUE"),
    ],
)
def test_wrong_usage_is_the_last_line(capsys: pytest.CaptureFixture[str], words: list[str], complaint: str) -> None:
    said = run(capsys, *SHORT, *words)
    assert (said.status, said.out) == (2, "")
    assert said.complaint.startswith(f"eurobot-od match: error: {complaint}")


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["--emergency-at", "2"], 2, "an emergency at 2 s is not within the match of 2 s"),
        (["--emergency-at", "40"], 2, "an emergency at 40 s is not within the match of 2 s"),
        (["--jobs", "2"], 2, "--jobs goes with --seeds only"),
        (["--seeds", "3", "--emergency-at", "40"], 2, "an emergency at 40 s is not within the match of 2 s"),
        (["--seeds", "3", "--dialect", "nonsense"], 2, "unknown dialect 'nonsense'; known: canopen, firmware2014"),
        (["--seeds", "3", "--seed", "1"], 2, "--seed 1 is for one match, and does not go with --seeds"),
        (["--seeds", "3", "--speed", "real"], 2, "--speed real is for one match, and does not go with --seeds"),
        (["--seeds", "3", "--log", "a.log"], 2, "--log a.log: write {seed} where each match's seed is to stand"),
        (["--seeds", "3", "--field", "a.svg"], 2, "--field a.svg is for one match, and does not go with --seeds"),
        (["--seeds", "3", "-i", "virtual"], 2, "--interface virtual is for one match, and does not go with --seeds"),
        (
            ["-i", "socketcan", "-c", "can0"],
            2,
            "--interface socketcan goes with --speed real only: in simulated time there is no such bus",
        ),
        (["--compare", "a.py", "b.py"], 2, "--compare needs two strategies or more, with different names, and --seeds"),
        (
            ["--compare", "a.py", "--seeds", "3"],
            2,
            "--compare needs two strategies or more, with different names, and --seeds",
        ),
        (["--compare", "a.py", "b.py", "--seeds", "3", "--log", "a.log"], 2, "--log a.log does not go with --compare"),
        (
            ["--compare", "a.py", "b.py", "--seeds", "3", "--field", "a.png"],
            2,
            "--field a.png: with --compare it is an .html",
        ),
        (["-b", "250000"], 2, "--bitrate 250000 goes with --speed real only: in simulated time there is no such bus"),
        (["--field", "nowhere/x.svg"], 3, "nowhere/x.svg: No such file or directory; make its folder first: nowhere"),
        (["--dialect", "nonsense"], 2, "unknown dialect 'nonsense'; known: canopen, firmware2014"),
        (["--strategy", "none.py"], 2, "none.py: No such file or directory"),
        (["--seeds", "3", "--strategy", "none.py"], 2, "none.py: No such file or directory"),
        (
            ["--speed", "real", "--against", "mine.py"],
            2,
            "--against is for simulated time, and does not go with --speed real",
        ),
        (
            ["--enemies", "0", "--against", strategy.__file__],
            2,
            "a second robot takes the place of an enemy, and the match has none",
        ),
        (
            ["--fault", "drive.goto-not-sent"],
            2,
            "--fault drive.goto-not-sent: no simulated device can have it (core, drive, navigation): "
            "it is one of the core; `faults` lists those of any device",
        ),
        (["--strategy", "."], 2, ". is a folder: name a Python file in it, such as strategy.py"),
        (["--fault", "goto-not-send"], 2, "unknown fault 'goto-not-send'; did you mean goto-not-sent?"),
        (
            ["--world", "wheel_nose=1"],
            2,
            "unknown error of the world 'wheel_nose'; did you mean wheel_noise or wheel_scale?",
        ),
        (
            ["--world", "wheel_noise=-1"],
            2,
            "wheel_noise=-1 is not allowed; allowed: a number from 0 on, in mm over 1 m",
        ),
        (["--world", "beacon_dropouts=30%"], 2, "beacon_dropouts=30% is not allowed; allowed: 0..1, as a share of all"),
        (["--world", "beacon_dropouts=30"], 2, "beacon_dropouts=30 is not allowed; allowed: 0..1, as a share of all"),
        (["--set", "bdy.radius=1"], 2, "unknown setting 'bdy.radius'; did you mean body.radius?"),
        (
            ["--seeds", "2", "--set", "navigation.0x2101:1=x"],
            2,
            "0x2101:1: Noise.Position deviation = 'x' is not allowed; allowed: an integer in mm",
        ),
        (
            ["--speed", "real", "-i", "remot"],
            3,
            "cannot open the remot bus: unknown interface 'remot'; did you mean remote?",
        ),
    ],
)
def test_a_match_that_cannot_be_played_is_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], status: int, complaint: str
) -> None:
    assert run(capsys, *SHORT, *words) == (status, "", f"eurobot-od: {complaint}\n")


BROKEN: list[tuple[Any, str]] = [
    (lambda core: core.write_bytes(b""), "not an EDS: it describes no object"),
    (lambda core: core.write_bytes(bytes(range(256))), "not a readable EDS"),
    (lambda core: core.write_text("no EDS\n"), "not an EDS"),
    (lambda core: core.write_text(core.read_text()[:3000]), ""),  # cut off
]


@pytest.mark.parametrize(("spoil", "what"), BROKEN)
def test_a_broken_eds_is_one_line_that_names_the_file(
    capsys: pytest.CaptureFixture[str], spoil_eds: Callable[..., Path], spoil: Callable[[Path], object], what: str
) -> None:
    folder = spoil_eds()
    spoil(folder / "core.eds")
    said = run(capsys, *SHORT, "--dialect", str(folder))
    assert (said.status, said.out) == (2, "")
    assert said.err.startswith(f"eurobot-od: {folder / 'core.eds'}: ")
    assert what in said.err
    assert said.err.count("\n") == 1


# Many seeds


ASLEEP = ("drive", "1F80", "DefaultValue", "0x0000000C")
"""A drive that waits for a master to start it (CiA 302-2, NMT startup)."""


def test_strategies_are_compared_side_by_side(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path], tmp_path: Path
) -> None:
    quick = mine(ARRIVES).rename(tmp_path / "quick.py")
    slow = mine("async def play(core):\n    pass\n")
    words = ["--seeds", "2-3", "--jobs", "1", "--for", "3"]
    said = run(capsys, "match", "--compare", str(quick), str(slow), *words)
    assert said.status == 0
    assert [line.split()[0] for line in said.out.splitlines()[2:5]] == ["2", "3", "mean"]
    assert "mine against quick: driven, m -0." in said.out


def test_the_matches_of_a_seed_are_one_page(
    capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path], tmp_path: Path
) -> None:
    talks = mine('async def play(core):\n    core.say("here")\n').rename(tmp_path / "talks.py")
    page = tmp_path / "two.html"
    words = ["--seeds", "7-7", "--jobs", "1", "--for", "3", "--field", str(page)]
    said = run(capsys, "match", "--compare", str(talks), str(mine("async def play(core):\n    pass\n")), *words)
    assert said.out.splitlines()[-1] == f"{page}: seed 7, at which the points differ most"
    content = json.loads(page.read_text().partition('id="content">')[2].partition("</script>")[0])
    assert (content["title"], [each["name"] for each in content["sources"]]) == ("Match, seed 7", ["talks", "mine"])
    assert [any(event["kind"] == "said" for event in each["events"]) for each in content["sources"]] == [True, False]


def test_many_seeds_are_one_table(capsys: pytest.CaptureFixture[str], mine: Callable[[str], Path]) -> None:
    words = ["--seeds", "2-4", "--jobs", "1", "--enemies", "0", "--strategy", str(mine(ARRIVES))]
    said = run(capsys, "match", "--for", "3", *words)
    lines = said.out.splitlines()
    assert (said.status, said.err) == (0, "".join(f"seed {seed}: on the way\n" for seed in (2, 3, 4)))
    assert [line.split() for line in lines if line.startswith("arrived")] == [["arrived", "3", "3"]]
    assert next(line for line in lines if line.startswith("points")).split()[1:4] == ["0.0", "0", "2"]
    assert lines[lines.index("matches by points") + 1].split() == ["0", "#" * 40, "3"]
    assert lines[-1] == "3 matches, seeds 2 to 4: nothing went wrong"


@pytest.mark.long
def test_json_of_many_seeds_is_an_object_a_line_the_same_on_any_number_of_processes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["match", "--for", "3", "--seeds", "3", "--json", "--jobs"]
    here = run(capsys, *words, "1")
    there = subprocess.run([*SCRIPT, *words, "3"], capture_output=True, text=True, check=False)
    assert [json.loads(line)["seed"] for line in here.out.splitlines()] == [1, 2, 3]
    assert (there.stdout, there.returncode) == (here.out, here.status)  # stderr says how far it is, if it is slow


def test_a_seed_that_went_wrong_is_listed(capsys: pytest.CaptureFixture[str], spoil_eds: Callable[..., Path]) -> None:
    said = run(capsys, "match", "--seeds", "2", "--jobs", "1", "--dialect", str(spoil_eds(ASLEEP)))
    assert (said.status, said.err) == (1, "")
    assert "matches by points" not in said.out  # nobody has played
    first, second, last = said.out.splitlines()[-3:]
    assert first.startswith("seed 1: no CheckDriveResponse after ")
    assert second.startswith("seed 2: no CheckDriveResponse after ")
    assert last == "2 matches, seeds 1 to 2: something went wrong in 2"


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.parametrize("form", [[], ["--json"]], ids=["table", "json"])
def test_ctrl_c_ends_many_seeds_with_the_table_so_far(form: list[str]) -> None:
    words = [*SCRIPT, "match", "--for", "3", "--seeds", "1000", "--jobs", "2", *form]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as running:
        assert running.stdout
        assert running.stderr
        (running.stdout if form else running.stderr).readline()
        os.killpg(running.pid, signal.SIGINT)
        said = running.stderr.read().splitlines()
        assert form or re.search(rb"\n[0-9]+ match(es)?, seeds 1 to [0-9]+: ", running.stdout.read())
        assert [line for line in said if not re.match(rb"1000 matches, about |[0-9]+ of 1000 matches", line)] == []
        assert running.wait() == 130


# In real time


def test_a_match_in_real_time_runs_on_the_virtual_bus(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "live.db"
    words = ["--for", "1", "--speed", "real", "-i", "virtual", "-c", "test-match", "-b", "1000000"]
    said = run(capsys, "match", *words, "--log", str(log))
    assert (said.status, said.err) == (0, "")
    assert "at 1000 kbit/s, in real time" in said.out
    assert "stop drive: the match is over" in said.out
    assert "since it stopped it moved 0 mm" in said.out
    assert "dropped" not in said.out
    assert "failed" not in said.out
    assert count(log) == total(said.out) > 30


def test_many_seeds_are_logged_stored_and_resumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyarrow", reason="the extra `cluster` is not installed")
    results = ["--results", str(tmp_path / "results"), "--json", "--jobs", "1"]
    words = ["match", "--for", "2", *results]
    first = run(capsys, *words, "--seeds", "2", "--log", str(tmp_path / "{seed}.log"))
    assert (first.status, first.err) == (0, "")
    assert sorted(file.name for file in tmp_path.glob("*.log")) == ["1.log", "2.log"]
    again = run(capsys, *words, "--seeds", "3", "--resume", "--log", str(tmp_path / "again-{seed}.log"))
    assert again.out.splitlines()[:2] == first.out.splitlines()
    # Points and touches are in a file beside each log.
    assert sorted(each.name for each in tmp_path.glob("again-*")) == ["again-3.log", "again-3.log.truth.json"]
    assert run(capsys, *words, "--seeds", "3").complaint.endswith("holds a campaign already: --resume goes on with it")
    other = run(capsys, *words, "--seeds", "3", "--resume", "--enemies", "0")
    assert other.complaint.endswith("holds a campaign with other settings: enemies was '2', and is '0'")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--results", "x"], "--results goes with --seeds only"),
        (["--seeds", "2", "--resume"], "--resume needs --results: the folder of the run to continue"),
        (["--seeds", "2", "--executor", "x"], "'x' is not an executor: dask://HOST:PORT, or --jobs"),
        (["--seeds", "2", "--executor", "dask://x:1", "--jobs", "2"], "does not go with --executor"),
    ],
)
def test_campaigns_that_cannot_be_are_one_line(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "match", "--for", "2", *words)
    assert (said.status, said.out, len(said.err.splitlines())) == (2, "", 1)
    assert complaint in said.complaint
