"""The loss matrix: a few of its cells of every kind, and that it would see a robot that does not stand."""

from __future__ import annotations

import loss_matrix
import pytest
from loss_matrix import BOUND, Cell

from eurobot_od.device.timers import START, Script
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import Core, Drive
from tests.rows import rows

KINDS = (
    Cell("Emergency Stop", "lost for ever"),
    Cell("Stop Drive", "lost 3 times"),
    Cell("Goto Confirm", "lost for ever"),
    Cell("Goto XY", "2 s late"),
    Cell("Goto State Response", "lost 3 times"),
    Cell("Start Configuration Confirm", "doubled"),
    Cell("core", "killed", 5.0),
    Cell("core", "rebooted", 5.0),
    Cell("core", "frozen 5 s", 5.0),
    Cell("drive", "rebooted", 5.0),
    Cell("navigation", "frozen 5 s", 9.0),
    Cell("bus", "off 1 s", 5.0),
    Cell("core", "reset, navigation dead", 8.0),
    Cell("core", "second core", 8.0),
    Cell("Start Configuration Set", "stray, navigation dead", 8.0),
)


@pytest.mark.long
@rows("dialect", dialects.names())
@rows("cell", KINDS)
def test_the_robot_stands_and_every_call_ends(cell: Cell, dialect: str) -> None:
    result = loss_matrix.attempt(cell._replace(dialect=dialect))
    assert result.wrong == ""
    assert result.seconds <= BOUND


def test_every_message_and_every_loss_has_its_cells() -> None:
    cells = list(loss_matrix.cells(dialects.DEFAULT, 3))
    assert len(cells) == len(set(cells)) == 23 * 8 + (3 * 3 + 1) * 3 + 3 * 6 * 3 + (7 + 23 * 2) * 3


def test_a_core_that_asks_nobody_after_a_reset_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(_: Core) -> Script[None]:
        yield START

    monkeypatch.setattr(Core, "_recall", nothing)
    assert "does not go on" in loss_matrix.attempt(Cell("core", "reset, navigation dead", 8.0)).wrong


def test_a_match_goes_on_after_the_drive_was_frozen() -> None:
    assert loss_matrix.attempt(Cell("drive", "frozen 5 s", 5.0, seed=3)).went_on


@pytest.mark.long
def test_a_match_goes_on_in_real_time_after_the_core_hung_without_a_navigation() -> None:
    assert loss_matrix.attempt(Cell("core", "pause 1 s, navigation dead", 7.0, live=True)).wrong == ""


def test_a_drive_that_does_not_watch_the_core_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Drive, "heartbeat_lost", lambda *_: None)
    results = [loss_matrix.attempt(Cell("core", "killed", 3.5, seed=seed)) for seed in (2, 4, 6)]
    assert any("uncommanded" in result.wrong for result in results)


def test_the_exit_status_and_the_last_line_tell_how_it_went(capsys: pytest.CaptureFixture[str]) -> None:
    assert loss_matrix.main(["--times", "1", "--only", "bus off", "--jobs", "1"]) == loss_matrix.FINE
    assert capsys.readouterr().out.splitlines()[-1].startswith("1 cells, 0 wrong; uncommanded for ")
