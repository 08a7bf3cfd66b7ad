"""Two axes and a module under SYNC of 1 ms: nothing is lost, and the axes follow."""

from __future__ import annotations

import pytest
import sync_axes


def test_each_millisecond_has_its_seven_frames(capsys: pytest.CaptureFixture[str]) -> None:
    assert sync_axes.main(["--seconds", "0.2"]) == 0
    # SYNC, two targets, outputs, and three answers; and each axis' heartbeat
    assert capsys.readouterr().out.startswith("7020 frames/s, bus load 59%, lag at most 0 position units")


def test_the_axes_swing_against_each_other() -> None:
    places = [axis.motor.position for axis in sync_axes.run(0.3).axes]
    assert places[0] == -places[1] != 0
