"""A played match to a row of Parquet and back."""

from __future__ import annotations

import pytest

pytest.importorskip("pyarrow", reason="the extra `cluster` is not installed")

from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.seeds import PlayedMatch, play
from eurobot_od.robot.match.stage import EdsFiles
from tests.season.test_results import there_and_back


def test_a_played_match_comes_back_equal() -> None:
    match = play(MatchOptions(duration=30.0), EdsFiles.read(MatchOptions()))
    assert match.gotos
    assert isinstance(there_and_back(match), PlayedMatch)
    assert there_and_back(match) == match
