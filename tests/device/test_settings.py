"""Settings as attributes of a node's class: they follow the dictionary, and their names are looked up once."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.device.node import Node
from eurobot_od.device.settings import period, scaled, seconds, setting, together
from eurobot_od.errors import DictionaryError
from eurobot_od.od.dictionary import Dictionary
from tests.eds_text import record

EDS = record(0x2100, "Lift", (1, "UNSIGNED16", "100"), (2, "UNSIGNED16", "250"), (3, "UNSIGNED16", "0"))


class Motion(NamedTuple):
    speed: int
    pause: float


class Lift(Node):
    speed = setting("Lift.Entry 1")
    metres = scaled("Lift.Entry 1", 0.001)
    pause = seconds("Lift.Entry 2")
    step = period("Lift.Entry 3")
    motion = together(Motion, speed=setting("Lift.Entry 1"), pause=seconds("Lift.Entry 2"))


def dictionary(eds: str = EDS) -> Dictionary:
    return Dictionary.read(eds.encode(), Path("lift.eds"), 1)


def test_a_setting_is_what_the_object_has_in_its_unit() -> None:
    lift = Lift(dictionary())
    assert (lift.speed, lift.metres, lift.pause, lift.step) == (100, 0.1, 0.25, 0.001)
    assert lift.motion == Motion(100, 0.25)


def test_what_is_written_holds_from_the_next_use_on() -> None:
    lift = Lift(dictionary())
    assert (lift.speed, lift.motion) == (100, Motion(100, 0.25))
    lift.device.objects.write((0x2100, 1), (7).to_bytes(2, "little"))
    assert (lift.speed, lift.motion) == (7, Motion(7, 0.25))


def test_names_are_looked_up_when_the_node_is_made_and_not_again(monkeypatch: pytest.MonkeyPatch) -> None:
    lift = Lift(dictionary())
    monkeypatch.setattr(Dictionary, "address", None)
    assert lift.motion == Motion(100, 0.25)


def test_a_file_without_a_setting_is_refused_when_the_node_is_made() -> None:
    with pytest.raises(DictionaryError, match=r"lift\.eds: no object is named 'Lift\.Entry 1'"):
        Lift(dictionary(EDS.replace("Entry 1", "Entry 9")))
