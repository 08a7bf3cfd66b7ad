"""`match`: its timeline and summary, JSON, logs in every format, and wrong command lines."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest

from eurobot_od.robot.protocol import EurobotProtocol
from tests.cli.console import run
from tests.robot.document import NAMES

SHORT = ["match", "--duration", "2"]
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
    assert kinds[:6] == ["start", "check", "configure", "position", "match", "goto"]
    assert kinds[-1] == "end"
    assert lines[lines.index("") + 1].split() == ["message", "frames"]
    assert "\x1b" not in said.out


def test_json_has_every_message(capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(run(capsys, "match", "--duration", "10", "--json").out)
    frames = data["summary"]["frames"]
    assert list(frames) == EurobotProtocol.load().names()
    assert data["summary"]["messages_sent"] == sum(count > 0 for count in frames.values())
    assert [name for name in NAMES if not frames[name]] == ["Emergency Shutdown"]
    assert data["timeline"][0]["kind"] == "start"
    assert data["timeline"][-1]["moved"] == 0


def test_json_of_an_emergency_has_all_messages_and_nothing_moves_afterwards(
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = json.loads(run(capsys, "match", "--duration", "10", "--emergency-at", "4", "--json").out)
    assert all(data["summary"]["frames"][name] for name in NAMES)
    kinds = [event["kind"] for event in data["timeline"]]
    assert "goto" not in kinds[kinds.index("emergency") :]
    assert data["timeline"][-1]["moved"] == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--team", "yellow"], "yellow, 2 enemies, 1 confederate"),
        (["--enemies", "0", "--confederates", "0"], "red, no enemies, no confederates"),
        (["--enemies", "1"], "red, 1 enemy, 1 confederate"),
        (["--dialect", "firmware2014"], "EDS files: firmware2014"),
        (["--duration", "2.5"], "2.5 s begin"),
    ],
)
def test_options_show_in_the_timeline(capsys: pytest.CaptureFixture[str], words: list[str], told: str) -> None:
    said = run(capsys, "match", "--duration", "1", *words)
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
    assert said.err == f'eurobot-od: --log {notes}: No write support for unknown log format ".md"\n'
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


# What is wrong


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--emergency-at", "soon"], "argument --emergency-at: soon is not a positive number of seconds"),
        (["--emergency-at", "0"], "argument --emergency-at: 0 is not a positive number of seconds"),
        (["--emergency-at", "-1"], "argument --emergency-at: -1 is not a positive number of seconds"),
        (["--emergency-at", "nan"], "argument --emergency-at: nan is not a positive number of seconds"),
        (["--duration", "inf"], "argument --duration: inf is not a positive number of seconds"),
        (["--enemies", "3"], "argument --enemies: invalid choice: "),
        (["--confederates", "2"], "argument --confederates: invalid choice: "),
        (["--team", "blue"], "argument --team: invalid choice: "),
        (["--seed", "one"], "argument --seed: invalid int value: 'one'"),
        (["--speed", "slow"], "argument --speed: invalid choice: "),
        (["--seeds", "0"], "argument --seeds: 0 is neither a number of seeds nor FIRST-LAST"),
        (["--seeds", "5-2"], "argument --seeds: 5-2 is neither a number of seeds nor FIRST-LAST"),
        (["--seeds", "1-"], "argument --seeds: 1- is neither a number of seeds nor FIRST-LAST"),
        (["--seeds", "9" * 5000], f"argument --seeds: {'9' * 5000} is neither"),  # more digits than int() takes
        (["--jobs", "0"], "argument --jobs: 0 is not a number from 1 to 60"),
        (["--jobs", "0100"], "argument --jobs: 0100 is not a number from 1 to 60"),
        (["extra"], "unrecognized arguments: extra"),
    ],
)
def test_wrong_usage_is_told_in_the_last_line(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
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
        (["--seeds", "3", "--log", "a.log"], 2, "--log a.log is for one match, and does not go with --seeds"),
        (["--seeds", "3", "--field", "a.svg"], 2, "--field a.svg is for one match, and does not go with --seeds"),
        (["--seeds", "3", "-i", "virtual"], 2, "--interface virtual is for one match, and does not go with --seeds"),
        (["--dialect", "nonsense"], 2, "unknown dialect 'nonsense'; known: canopen, firmware2014"),
        (["--speed", "real", "-i", "nosuch"], 3, 'cannot open the nosuch bus: Unknown interface type "nosuch"'),
    ],
)
def test_what_cannot_be_played_is_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], status: int, complaint: str
) -> None:
    assert run(capsys, *SHORT, *words) == (status, "", f"eurobot-od: {complaint}\n")


BROKEN: list[tuple[Any, str]] = [
    (lambda core: core.write_bytes(b""), "not an EDS: it describes no object"),
    (lambda core: core.write_bytes(bytes(range(256))), "not a readable EDS"),
    (lambda core: core.write_text("no EDS\n"), "not a readable EDS"),
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


def test_many_seeds_are_told_as_one_table(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "match", "--duration", "6", "--seeds", "2-4", "--jobs", "1")
    lines = said.out.splitlines()
    assert (said.status, said.err) == (0, "")
    assert lines[0].split() == ["gotos", "matches", "gotos"]
    assert [line.rsplit(maxsplit=2)[1:] for line in lines if line.startswith("stopped: object")] == [["3", "3"]]
    assert lines[-1] == "3 matches, seeds 2 to 4: nothing went wrong"


def test_json_of_many_seeds_is_an_object_a_line_the_same_on_any_number_of_processes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["match", "--duration", "6", "--seeds", "5", "--json", "--jobs"]
    here = run(capsys, *words, "1")
    there = subprocess.run([*SCRIPT, *words, "3"], capture_output=True, text=True, check=True)
    assert [json.loads(line)["seed"] for line in here.out.splitlines()] == [1, 2, 3, 4, 5]
    assert (there.stdout, there.stderr) == (here.out, here.err)


def test_a_seed_that_went_wrong_is_listed(capsys: pytest.CaptureFixture[str], spoil_eds: Callable[..., Path]) -> None:
    said = run(capsys, "match", "--seeds", "2", "--jobs", "1", "--dialect", str(spoil_eds(ASLEEP)))
    assert (said.status, said.err) == (1, "")
    first, second, last = said.out.splitlines()[-3:]
    assert first.startswith("seed 1: no CheckDriveResponse after ")
    assert second.startswith("seed 2: no CheckDriveResponse after ")
    assert last == "2 matches, seeds 1 to 2: something went wrong in 2"


def test_ctrl_c_ends_many_seeds_without_a_word() -> None:
    words = [*SCRIPT, "match", "--seeds", "1000", "--jobs", "2", "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as running:
        assert running.stdout
        assert running.stderr
        running.stdout.readline()
        os.killpg(running.pid, signal.SIGINT)
        assert running.stderr.read() == b""
        assert running.wait() == 130


# In real time


def test_a_match_in_real_time_runs_on_the_virtual_bus(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "live.db"
    words = ["--duration", "1", "--speed", "real", "-i", "virtual", "-c", "test-match", "--log", str(log)]
    said = run(capsys, "match", *words)
    assert (said.status, said.err) == (0, "")
    assert "in real time" in said.out
    assert "stop drive: the match is over" in said.out
    assert "since it stopped it moved 0 mm" in said.out
    assert "dropped" not in said.out
    assert "failed" not in said.out
    assert count(log) == total(said.out) > 30
