"""What a mapped object's name says about its bits."""

from __future__ import annotations

import pytest

from eurobot_od.od.pdos import carries_nothing


@pytest.mark.parametrize("name", ["Padding", "Padding 2", "Reserved", "Reserved_1", "Reserved3", "Reserved (5:2)"])
def test_carries_nothing(name: str) -> None:
    assert carries_nothing(name)


@pytest.mark.parametrize("name", ["", "Speed", "Reserved power", "Reserved 1 bar", "Not Reserved", "Paddington"])
def test_carries_something(name: str) -> None:
    assert not carries_nothing(name)
