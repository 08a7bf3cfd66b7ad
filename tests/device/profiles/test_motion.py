"""The units that a drive's objects say: position units of a turn of the motor, and of velocity."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from eurobot_od.device.profiles.motion import TURN, AxisValues, Units
from eurobot_od.od.values import Address
from tests.device.profiles.bench import Shelf
from tests.rows import rows


def _factors(**pairs: tuple[int, int]) -> Mapping[Address, int]:
    index = {"encoder": 0x608F, "gear": 0x6091, "feed": 0x6092, "velocity": 0x6096}
    return {(index[name], sub): value for name, pair in pairs.items() for sub, value in enumerate(pair, 1)}


TURNS = [
    ({}, TURN),  # nothing said
    (_factors(encoder=(2000, 1)), 2000),
    (_factors(encoder=(2000, 4)), 500),
    (_factors(encoder=(2000, 0)), TURN),  # no ratio
    (_factors(encoder=(2000, 1), gear=(10, 1)), 2000),  # without a feed constant positions are the encoder's
    (_factors(encoder=(2000, 1), feed=(1, 1)), 2000),  # a feed that nobody has set
    (_factors(encoder=(2000, 1), feed=(360, 1)), 360),
    (_factors(encoder=(2000, 1), feed=(5000, 1), gear=(10, 1)), 500),
    (_factors(encoder=(2000, 1), feed=(5000, 2), gear=(1, 2)), 5000),
]


@rows("objects, turn", TURNS)
def test_position_units_of_a_turn(objects: Mapping[Address, int], turn: float) -> None:
    assert Units.of(AxisValues(Shelf(objects))).turn == turn


VELOCITIES = [
    (_factors(encoder=(6000, 1)), 1.0),
    (_factors(encoder=(6000, 1), velocity=(1, 1)), 1.0),
    (_factors(encoder=(6000, 1), velocity=(60, 6000)), 100.0),  # revolutions a minute
    (_factors(encoder=(6000, 1), velocity=(1000, 1)), 0.001),
    ({**_factors(encoder=(6000, 1)), (0x60A9, 0): 0x00B44700}, 100.0),
    ({**_factors(encoder=(6000, 1)), (0x60A9, 0): 0xFDB44700}, 0.1),  # thousandths of one
    ({**_factors(encoder=(6000, 1), velocity=(7, 1)), (0x60A9, 0): 0x00B44700}, 100.0),  # the unit has the last word
]


@pytest.mark.parametrize(("objects", "velocity"), VELOCITIES)
def test_position_units_a_second_in_a_unit_of_velocity(objects: Mapping[Address, int], velocity: float) -> None:
    assert Units.of(AxisValues(Shelf(objects))).velocity == pytest.approx(velocity)
