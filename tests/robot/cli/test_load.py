"""`load` of the robot's own traffic, and what a match says of a bus that is too slow for it."""

from __future__ import annotations

import pytest

from eurobot_od.robot.commands.match import too_slow
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run

RATES = [("500000", 0, "all deadlines are met"), ("250000", 0, "all deadlines are met"), ("125000", 1, "can be missed")]


@pytest.mark.parametrize(("rate", "status", "verdict"), RATES)
def test_the_robot(capsys: pytest.CaptureFixture[str], rate: str, status: int, verdict: str) -> None:
    said = run(capsys, "load", "-b", rate)
    assert (said.status, said.err) == (status, "")
    _, told = said.out.split("\n\n")
    assert verdict in told.splitlines()[0]
    assert told.count("125 kbit/s, load 14.5%") == 1  # the EDS files offer it


def test_too_slow_counts_missed_deadlines() -> None:
    assert "3 of 34 deadlines can be missed" in too_slow(ROBOT, None, 125_000)
    assert too_slow(ROBOT, None, 250_000) == ""


def test_mailboxes_of_every_node(capsys: pytest.CaptureFixture[str]) -> None:
    assert "in the mailboxes" in run(capsys, "load").out
    assert "in the mailboxes" not in run(capsys, "load", "--mailboxes", "0").out
    assert (
        run(capsys, "load", "--mailboxes", "3").out
        == run(capsys, "load").out
        != run(capsys, "load", "--mailboxes", "1").out
    )
