"""The loss matrix: a few of its cells of every kind, and that it would see a robot that does not stand."""

from __future__ import annotations

import loss_matrix
import pytest
from loss_matrix import AT_ONCE, BOUND, DEAD, SILENT, Cell

from eurobot_od.device.timers import START, Script
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.resumption import Resumption

KINDS = (
    Cell("Emergency Stop", "lost for ever"),
    Cell("Stop Drive", "lost 3 times", navigation=SILENT),
    Cell("Goto Confirm", "lost for ever", again=AT_ONCE),
    Cell("Goto XY", "2 s late", navigation=DEAD),
    Cell("Goto State Response", "lost 3 times"),
    Cell("Start Configuration Confirm", "doubled"),
    Cell("core", "killed", 5.0),
    Cell("core", "rebooted", 5.0, navigation=SILENT, again=AT_ONCE),
    Cell("core", "frozen 5 s", 5.0),
    Cell("drive", "rebooted", 5.0, navigation=DEAD),
    Cell("drive", "rebooted in another dialect", 5.0),
    Cell("navigation", "in another dialect"),
    Cell("navigation", "frozen 5 s", 9.0),
    Cell("bus", "off 1 s", 5.0),
    Cell("core", "reset", 8.0, navigation=DEAD, again=AT_ONCE),
    Cell("core", "second core", 8.0),
    Cell("drive", "goto by SDO", 8.0, navigation=DEAD, again=AT_ONCE),
    Cell("Start Configuration Set", "stray", 8.0, navigation=DEAD, again=AT_ONCE),
    Cell("Emergency Shutdown", "stray", 1.0),
)


@pytest.mark.long
@pytest.mark.parametrize("dialect", dialects.names())
@pytest.mark.parametrize("cell", KINDS, ids=map(str, KINDS))
def test_the_robot_stops_and_all_calls_end(cell: Cell, dialect: str) -> None:
    result = loss_matrix.attempt(cell._replace(dialect=dialect))
    assert result.wrong == ""
    assert result.seconds <= BOUND


def test_every_message_and_every_loss_has_its_cells() -> None:
    cells = list(loss_matrix.cells(dialects.DEFAULT, 3))
    assert len({*map(str, cells)}) == len(cells)  # a campaign keeps results by the names of their cells
    causes = 2 * 4 + 1 + 3 * 6 + 4 + 23
    assert len(cells) == len(set(cells)) == 6 * (23 * 8 + causes * 3) + 2 * 4 * 3 + 3


def test_moments_follow_from_the_seed() -> None:
    first, second = ([each.time for each in loss_matrix.cells(dialects.DEFAULT, 2, seed)] for seed in (1, 2))
    assert first != second


def test_a_core_that_checks_no_node_after_a_reset_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(_: Resumption) -> Script[None]:
        yield START

    monkeypatch.setattr(Resumption, "_recall", nothing)
    assert "does not go on" in loss_matrix.attempt(Cell("core", "reset", 8.0, navigation=DEAD)).wrong


def test_a_drive_that_takes_a_stray_start_configuration_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the navigation it would believe that it is at its start place, and the core would believe it."""
    monkeypatch.setattr(Drive, "_keeps_place", lambda _: False)
    monkeypatch.setattr(Resumption, "_find_place", lambda resumption, *_: flows.drive_position(resumption._core))
    stray = Cell("Start Configuration Set", "stray", 8.0, navigation=DEAD, again=AT_ONCE)
    assert "arrived" in loss_matrix.attempt(stray).wrong


def test_a_match_goes_on_after_the_drive_was_frozen() -> None:
    assert loss_matrix.attempt(Cell("drive", "frozen 5 s", 5.0, seed=3)).went_on


@pytest.mark.long
def test_a_match_that_has_lost_its_way_before_the_fault_need_not_go_on() -> None:
    late = Cell("Emergency Shutdown", "stray", 22.258, seed=739955, navigation=DEAD, again=AT_ONCE)
    assert loss_matrix.attempt(late).wrong == ""


@pytest.mark.long
def test_a_match_goes_on_in_real_time_after_the_core_hung_without_a_navigation() -> None:
    assert loss_matrix.attempt(Cell("core", "pause 1 s", 7.0, navigation=DEAD, live=True)).wrong == ""


def test_a_drive_that_does_not_watch_the_core_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Drive, "heartbeat_lost", lambda *_: None)
    results = [loss_matrix.attempt(Cell("core", "killed", 2.7, seed=seed)) for seed in (2, 4)]
    assert any("uncommanded" in result.wrong for result in results)


def test_exit_status_and_last_line_give_the_result(capsys: pytest.CaptureFixture[str]) -> None:
    only = "bus off 1 s, navigation alive, again after 2 s"
    assert loss_matrix.main(["--times", "1", "--only", only, "--jobs", "1"]) == loss_matrix.FINE
    assert capsys.readouterr().out.splitlines()[-1].startswith("1 cells, 0 wrong; uncommanded for ")
