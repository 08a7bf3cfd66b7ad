"""`eurobot-od load`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.robot.commands.match import too_slow
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run
from tests.rows import rows

RATES = [("500000", 0, "all deadlines are met"), ("250000", 0, "all deadlines are met"), ("125000", 1, "can be missed")]


@rows("rate, status, verdict", RATES)
def test_the_robot(capsys: pytest.CaptureFixture[str], rate: str, status: int, verdict: str) -> None:
    said = run(capsys, "load", "-b", rate)
    assert (said.status, said.err) == (status, "")
    _, told = said.out.split("\n\n")
    assert verdict in told.splitlines()[0]
    assert told.count("125 kbit/s, load 14.5%") == 1  # the EDS files offer it


def test_a_match_on_a_bus_that_is_too_slow_says_so() -> None:
    assert "3 of 34 deadlines can be missed" in too_slow(ROBOT, None, 125_000)
    assert too_slow(ROBOT, None, 250_000) == ""


def test_errors_may_make_a_deadline_be_missed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "load", "--errors", "30/10ms").status == 1


def test_mailboxes_of_every_node(capsys: pytest.CaptureFixture[str]) -> None:
    assert "in the mailboxes" in run(capsys, "load").out
    assert "in the mailboxes" not in run(capsys, "load", "--mailboxes", "0").out
    assert (
        run(capsys, "load", "--mailboxes", "3").out
        == run(capsys, "load").out
        != run(capsys, "load", "--mailboxes", "1").out
    )


def test_the_chart_and_the_data(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    data = json.loads(run(capsys, "load", "--json", "--svg", str(tmp_path / "chart.svg")).out)
    assert data["deadlines_met"]
    assert (tmp_path / "chart.svg").read_text().startswith("<svg")


def test_a_network_file(capsys: pytest.CaptureFixture[str]) -> None:
    network = Path(__file__).parents[2] / "eds" / "network.yaml"
    assert run(capsys, "load", str(network)).out == run(capsys, "load").out


def test_a_network_that_does_not_say_how_often(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "load", str(Path(__file__).parents[2] / "eds" / "canopen"))
    assert said.status == 2
    assert said.complaint.startswith("eurobot-od: no period is known of Emergency Shutdown, ")


WRONG = [
    ["-b", "0"],
    ["-b", "2000000"],
    ["--errors", "1"],
    ["--errors", "1/0ms"],
    ["--errors", "x/1ms"],
    ["--mailboxes", "-1"],
    ["network.yaml", "--dialect", "x"],
]


@rows("words", WRONG)
def test_wrong_usage(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    said = run(capsys, "load", *words)
    assert said.status == 2
    assert said.complaint.startswith("eurobot-od")
