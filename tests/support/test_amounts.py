"""Numbers of things agree with their nouns."""

from __future__ import annotations

import pytest

from eurobot_od.support.amounts import amount


@pytest.mark.parametrize(("number", "words"), [(0, "0 frames"), (1, "1 frame"), (2, "2 frames")])
def test_one_is_singular(number: int, words: str) -> None:
    assert amount(number, "frame") == words
