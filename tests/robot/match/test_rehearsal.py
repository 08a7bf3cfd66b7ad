"""A rehearsal: the strategy's result, the log and the picture that a match has, whatever the strategy does."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.match import MatchOptions, rehearse
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.protocol import EurobotProtocol

ALONE = MatchOptions(enemies=0, confederates=0)


async def drive(core: Core) -> Outcome:
    await core.check_nodes()
    await core.configure_start(TeamColour.RED)
    return (await core.goto(600, 1800, 0, 20)).outcome


async def fail(core: Core) -> None:
    await drive(core)
    raise ValueError("no plan")


def test_the_result_is_the_strategys() -> None:
    assert rehearse(drive, ALONE) is Outcome.ARRIVED


def test_log_and_picture_are_those_of_a_match(tmp_path: Path) -> None:
    log, picture = tmp_path / "mine.log", str(tmp_path / "mine.svg")
    rehearse(drive, ALONE, log=log, picture=picture)
    goto = EurobotProtocol.load().cob_id(GotoXY)
    with can.LogReader(log) as reader:
        assert [message.arbitration_id for message in reader].count(goto) == 1
    text = Path(picture).read_text()
    assert "1 of 1 goto reached" in text
    assert "our path, as it really was" in text


def test_they_are_written_when_the_strategy_raises(tmp_path: Path) -> None:
    log, picture = tmp_path / "mine.log", tmp_path / "mine.svg"
    with pytest.raises(ValueError, match="no plan"):
        rehearse(fail, ALONE, log=log, picture=picture)
    assert log.stat().st_size > 0
    assert "1 of 1 goto reached" in picture.read_text()


@pytest.mark.parametrize(("files", "error"), [({"log": "mine.md"}, LocalError), ({"picture": "mine.gif"}, UnknownName)])
def test_an_unknown_suffix_is_an_error_before_anything_is_written(
    tmp_path: Path, files: dict[str, str], error: type[Exception]
) -> None:
    kind, name = files.popitem()
    with pytest.raises(error):
        rehearse(drive, ALONE, log=tmp_path / (name if kind == "log" else "mine.log"), picture=tmp_path / name)
    assert list(tmp_path.iterdir()) == []
