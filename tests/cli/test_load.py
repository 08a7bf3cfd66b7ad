"""`eurobot-od load`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.console import run
from tests.kit import plant

RATES = [("500000", 0, "all deadlines are met"), ("250000", 0, "all deadlines are met"), ("125000", 1, "can be missed")]


@pytest.mark.parametrize(("rate", "status", "verdict"), RATES)
def test_the_verdict_on_a_robot_s_own_traffic(
    capsys: pytest.CaptureFixture[str], rate: str, status: int, verdict: str
) -> None:
    said = run(capsys, "load", "-b", rate)
    assert (said.status, said.err) == (status, "")
    _, told = said.out.split("\n\n")
    assert verdict in told.splitlines()[0]
    assert told.count("125 kbit/s, load 7.3%") == 1  # the EDS files offer it


def test_bus_errors_can_cause_a_missed_deadline(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "load", "--errors", "30/10ms").status == 1


def test_the_chart_and_the_data(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    data = json.loads(run(capsys, "load", "--json", "--svg", str(tmp_path / "chart.svg")).out)
    assert data["deadlines_met"]
    assert (tmp_path / "chart.svg").read_text().startswith("<svg")


def test_a_network_file(capsys: pytest.CaptureFixture[str]) -> None:
    network = plant.FILES.folder().parent / "network.yaml"
    assert run(capsys, "load", str(network)).out == run(capsys, "load").out


def test_a_network_file_without_periods(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "load", str(plant.FILES.folder()))
    assert said.status == 2
    assert said.complaint.startswith("eurobot-od: no period is known of Halt All, ")


WRONG = [
    ["-b", "0"],
    ["-b", "2000000"],
    ["--errors", "1"],
    ["--errors", "1/0ms"],
    ["--errors", "x/1ms"],
    ["--mailboxes", "-1"],
    ["network.yaml", "--dialect", "x"],
]


@pytest.mark.parametrize("words", WRONG)
def test_wrong_usage(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    said = run(capsys, "load", *words)
    assert said.status == 2
    assert said.complaint.startswith("eurobot-od")
