"""`faults`, and `--fault` of `node` and `check`: names that exist, names that do not, and what they make red."""

from __future__ import annotations

import json

import pytest

from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run


def test_all_faults_are_listed_by_node(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "faults")
    lines = said.out.splitlines()
    assert said.status == 0
    nodes = ["core:", "drive:", "navigation:", "any node:", "any drive of CiA 402:"]
    assert [line for line in lines if line.endswith(":")] == nodes
    assert [line.split()[0] for line in lines if line.startswith("  ")] == ROBOT.fault_names()


def test_the_faults_of_one_node_are_its_own_and_those_of_any_node(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "faults", "navigation").out
    assert [line for line in out.splitlines() if line.endswith(":")] == ["navigation:", "any node:"]


def test_faults_as_json_name_the_step_that_finds_them(capsys: pytest.CaptureFixture[str]) -> None:
    rows = json.loads(run(capsys, "faults", "--json").out)
    assert {
        "name": "goto-not-confirmed",
        "node": "drive",
        "text": "sends no Goto Confirm",
        "suite": "drive",
        "step": "2.1 Goto ACK: a goto is confirmed",
    } in rows
    assert len(rows) == len(ROBOT.fault_names())


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["node", "drive", "--fault", "goto-not-confirmd"], "unknown fault 'goto-not-confirmd'; did you mean"),
        (["node", "drive", "--fault", "goto-not-sent"], "the fault goto-not-sent is one of the core, not of the drive"),
        (["check", "drive", "--simulate", "--fault", "nonsense"], "unknown fault 'nonsense'; 2"),
        (["check", "drive", "--fault", "goto-not-confirmed"], "--fault needs --simulate"),
    ],
)
def test_a_fault_that_is_not_there_is_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    said = run(capsys, *words)
    assert said.status == 2
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(("fault", "status"), [([], 0), (["--fault", "goto-not-confirmed"], 1)])
def test_a_check_finds_a_fault(capsys: pytest.CaptureFixture[str], fault: list[str], status: int) -> None:
    assert run(capsys, "check", "drive", "--simulate", *fault).status == status
