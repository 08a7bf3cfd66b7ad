"""`check` with the robot's suites: by name, by step, for a dialect, with a world that is shared."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.plugin import Plugins
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
    assert done.status == 0
    assert "skipped: its nodes have to share a world (--shared-world: they do)" in done.out


IO, SERVO = f"5={DOCS / 'io.eds'}", f"5={DOCS / 'servo.eds'}"
