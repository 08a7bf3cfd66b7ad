"""`check` with the robot's suites: by name, by step, for a dialect, with a world that is shared."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od import Drive, Live, open_bus
from eurobot_od.plugin import Plugins
from eurobot_od.robot import dialects
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run
from tests.client.servo import DOCS

FOREIGN = "spec: 1\nname: a suite\nnode: drive\ndialect: firmware2014\nsteps:\n  - send: Stop Drive\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a suite, to be the current one."""
    (tmp_path / "foreign.yaml").write_text(FOREIGN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_a_step_is_done_with_those_that_it_needs(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "drive", "--simulate", "--step", "the time falls")
    assert said.status == 0, said.out
    assert "FAILED" not in said.out


@pytest.mark.usefixtures("folder")
def test_a_suite_s_dialect_overrides_the_named_files(capsys: pytest.CaptureFixture[str]) -> None:
    motor = str(Path(__file__).parents[2] / "lint" / "samples" / "clean.eds")
    said = run(capsys, "check", "foreign.yaml", "--list", "--eds", f"5={motor}", "--robot", "eurobot2014")
    assert (said.status, said.out.split()[0]) == (0, "foreign"), said


def test_lists_the_shipped_suites(capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys, "check", "--list").out.splitlines()
    assert {line.split()[0] for line in lines} == set(Plugins(ROBOT).shipped_suites())


@pytest.mark.usefixtures("folder")
def test_takes_a_shipped_suite_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "check", "drive", "--list").out.startswith("drive ")


# Conformance


def test_a_suite_whose_nodes_have_to_share_a_world_is_skipped_by_name_on_a_bus(
    capsys: pytest.CaptureFixture[str],
) -> None:
    done = run(capsys, "check", "flows", "-i", "virtual", "-c", "apart")
    assert done.status == 1
    assert "skipped: its nodes have to share a world (--shared-world: they do)" in done.out


IO, SERVO = f"5={DOCS / 'io.eds'}", f"5={DOCS / 'servo.eds'}"


# An acceptance test, and what the robot of 2014 never had

NEVER_HAD = {
    "heartbeat-missing": "CiA 301 Heartbeat: the drive sends one",
    "sdo-not-answered": "CiA 301 SDO: the drive answers",
    "emcy-missing": "CiA 301 EMCY: a frame that is too short is reported",
    "short-frame-filled-up": "2.1 Goto: a goto that is too short is refused",
}


def test_a_drive_without_what_today_s_has_is_red_in_each_step_that_asks_for_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    faults = [word for name in NEVER_HAD for word in ("--fault", name)]
    done = run(capsys, "check", "drive", "--simulate", *faults, "--quiet")
    assert done.status == 1
    assert [step for step in NEVER_HAD.values() if step not in done.out] == []


def test_at_the_level_2014_those_steps_are_left_out_and_named(capsys: pytest.CaptureFixture[str]) -> None:
    faults = [word for name in NEVER_HAD for word in ("--fault", name)]
    done = run(capsys, "check", "drive", "--simulate", *faults, "--level", "2014")
    last = done.out.splitlines()[-1]
    assert (done.status, last[:35]) == (0, "at level 2014, 5 steps not asked: C"), done.out
    assert [step for step in NEVER_HAD.values() if step not in last] == []


def test_a_level_that_no_suite_has_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    refused = run(capsys, "check", "drive", "--simulate", "--level", "2013")
    assert (refused.status, refused.err) == (2, "eurobot-od: no step is above a level 2013; levels: 2014\n")


@pytest.mark.parametrize("dialect", dialects.names())
def test_a_tag_on_a_bus_keeps_to_the_dialect_that_the_drive_speaks(
    capsys: pytest.CaptureFixture[str], dialect: str
) -> None:
    with Live.node(open_bus("virtual", f"speaks {dialect}"), Drive(dialects.load("drive", dialect))):
        done = run(capsys, "check", "--tag", "bytes", "-i", "virtual", "-c", f"speaks {dialect}", "--step", "Table 4")
    assert f"dialect {dialect}, as 0x1018 says" in done.out
    other = next(each for each in dialects.names() if each != dialect)
    assert f"skipped: it is for the dialect {other}" in done.out


def test_where_no_node_answers_the_default_dialect_is_checked_and_named(capsys: pytest.CaptureFixture[str]) -> None:
    done = run(capsys, "check", "--tag", "bytes", "-i", "virtual", "-c", "nobody", "--step", "Table 4")
    assert "dialect canopen, as no node says another one in 0x1018; --dialect names another one" in done.out
