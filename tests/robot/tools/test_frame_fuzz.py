"""Hostile frames: a short run, and that the tool sees a node that acts on what it must not, or does not forget."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import frame_fuzz
import pytest
from frame_fuzz import Dice, Trial

from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import Drive

SHORT = 4000


@pytest.fixture(autouse=True)
def _nothing_kept() -> None:
    frame_fuzz.healthy.cache_clear()


@pytest.mark.long
@pytest.mark.parametrize("number", range(4), ids=["canopen", "canopen any", "firmware2014", "firmware2014 any"])
def test_meaningless_frames_change_nothing_that_the_nodes_send(number: int) -> None:
    result = frame_fuzz.attempt(Trial(seed=19, number=number, frames=SHORT))
    assert result.wrong == []
    assert result.compared > 40
    assert result.made.total() == SHORT


def test_the_nodes_drive_during_a_trial() -> None:
    sent = {frame.cob_id for _, frame in frame_fuzz.healthy(dialects.DEFAULT)}
    assert {each.cob_id for each in frame_fuzz.protocol(dialects.DEFAULT).bindings} - sent == {
        frame_fuzz.protocol(dialects.DEFAULT).cob_id("Emergency Shutdown")
    }


DEFECTS: dict[str, Callable[[Any, Any], object]] = {
    "acts on what is out of its range": lambda _self, _message: None,
    "raises": lambda _self, _message: 1 // 0,
}


@pytest.mark.parametrize("doubt", DEFECTS.values(), ids=DEFECTS)
def test_a_drive_with_a_defect_is_found(monkeypatch: pytest.MonkeyPatch, doubt: Callable[[Any, Any], object]) -> None:
    frame_fuzz.healthy(dialects.DEFAULT, SHORT * frame_fuzz.PERIOD)
    monkeypatch.setattr(Drive, "doubt", doubt)
    assert frame_fuzz.attempt(Trial(seed=19, number=0, frames=SHORT)).wrong


@pytest.mark.long
def test_nodes_that_do_not_reset_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    frame_fuzz.healthy(dialects.DEFAULT, SHORT * frame_fuzz.PERIOD, is_reset=True)
    monkeypatch.setattr(frame_fuzz, "RESET", Frame(0x000, b"\x01\x00"))
    assert frame_fuzz.attempt(Trial(seed=19, number=1, frames=SHORT)).wrong


@pytest.mark.parametrize("maker", frame_fuzz.ANY)
def test_every_kind_makes_frames_that_a_bus_can_carry(maker: frame_fuzz.Maker) -> None:
    dice = Dice.of("1", dialects.DEFAULT)
    made = [maker(dice) for _ in range(200)]
    assert all(isinstance(each, Frame) and 0 <= each.cob_id <= 0x7FF and len(each.data) <= 8 for each in made)
    assert len(set(made)) > 5


@pytest.mark.long
def test_exit_status_and_last_line_give_the_result(capsys: pytest.CaptureFixture[str]) -> None:
    assert frame_fuzz.main(["--frames", "1", "--jobs", "1"]) == frame_fuzz.FINE
    assert capsys.readouterr().out.splitlines()[-1].startswith("20000 frames in 1 trials, ")
