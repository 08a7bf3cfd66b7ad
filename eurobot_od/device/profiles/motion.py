"""A motor with a load, its ramps, and its units, which come from objects of the axis.

Positions are in the device's position units, velocities in position units per second; only `Units` converts from the
device's unit of velocity. Time advances in steps of `STEP`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, inf, sqrt
from typing import NamedTuple

from eurobot_od.od import cia402
from eurobot_od.od.cia402 import Switch
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address

STEP = 0.001
"""Length of a step in s."""

TURN = 4096
"""Default number of position units per turn."""

REVOLUTION, MINUTE = 0xB4, 0x47
"""Numbers of the SI units "revolution" and "minute" in 0x60A9 (CiA 303-2)."""

RPM = ("rpm", "rev/min", "1/min", "min-1")
"""Texts in files for revolutions per minute."""


class AxisValues:
    """Objects of one axis for its profile; in this class those of the file.

    `offset` is added to the indices of the first axis; 0 for a device without axes.
    """

    def __init__(self, dictionary: Dictionary, offset: int = 0) -> None:
        self._dictionary, self._offset = dictionary, offset
        self._known: dict[tuple[int, int], Address | None] = {}

    def _address(self, index: int, sub: int) -> Address | None:
        """Return the address of an object, None if the file does not have it."""
        if (index, sub) not in self._known:
            address = index + self._offset, sub
            self._known[index, sub] = address if self._dictionary.variable(address) is not None else None
        return self._known[index, sub]

    def has(self, index: int, sub: int = 0) -> bool:
        """Return whether the axis has an object."""
        return self._address(index, sub) is not None

    def find(self, index: int, sub: int = 0) -> int | None:
        """Return an object's value; None without the object, or without a value."""
        address = self._address(index, sub)
        return None if address is None else self._value(address)

    def get(self, index: int, sub: int = 0, default: int = 0) -> int:
        """Return an object's value; `default` without the object, or without a value."""
        value = self.find(index, sub)
        return default if value is None else value

    def put(self, index: int, value: int) -> None:
        """Set an object's value, if the axis has it."""
        address = self._address(index, 0)
        if address is not None and self._value(address) != value:
            self._keep(address, value)

    def unit(self, index: int) -> str:
        """Return an object's unit in the file; empty without one."""
        variable = self._dictionary.variable((index + self._offset, 0))
        return "" if variable is None else str(variable.unit)

    def _value(self, address: Address) -> int | None:
        """Return the default of an object, None if it is not a number."""
        return self._dictionary.number(address)

    def _keep(self, address: Address, value: int) -> None:
        """Do nothing: a file does not change."""


class Units(NamedTuple):
    """Position units per `turn` of the motor, and position units per second for one unit of `velocity`."""

    turn: float
    velocity: float

    @classmethod
    def of(cls, values: AxisValues) -> Units:
        """Return the units from the factor group, the unit of velocity 0x60A9, or the unit text in the file.

        The feed constant 0x6092 is for a turn of the shaft after the gear 0x6091; without it, a turn of the motor is
        the encoder's resolution 0x608F. The velocity factor 0x6096 converts position units per second into units of
        velocity.
        """
        turn = ratio_of(values, cia402.ENCODER_RESOLUTION) or TURN
        feed = ratio_of(values, cia402.FEED_CONSTANT)
        # A feed of 1 is the default.
        turn = feed / (ratio_of(values, cia402.GEAR_RATIO) or 1.0) if feed and feed != 1 else turn
        unit = values.get(cia402.SI_VELOCITY)
        if (unit >> 16 & 0xFF, unit >> 8 & 0xFF) == (REVOLUTION, MINUTE):
            power = int.from_bytes([unit >> 24 & 0xFF], signed=True)  # 0xFD is milli
            return cls(turn, turn / 60 * 10.0**power)
        factor = ratio_of(values, cia402.VELOCITY_FACTOR)
        if factor and factor != 1:
            return cls(turn, 1 / factor)
        written = {values.unit(index).lower() for index in (cia402.TARGET_VELOCITY, cia402.PROFILE_VELOCITY)}
        return cls(turn, turn / 60 if written & {*RPM} else 1.0)


def ratio_of(values: AxisValues, index: int) -> float:
    """Return the quotient of a factor's numerator and divisor; 0 without the object, or if it is not positive."""
    numerator, divisor = (values.get(index, sub) for sub in (1, 2))
    return numerator / divisor if numerator > 0 and divisor > 0 else 0.0


# Demand


@dataclass
class Demand:
    """Demanded position and velocity; or `torque` as a share of the maximum, -1 to 1."""

    position: float = 0.0
    velocity: float = 0.0
    torque: float | None = None

    def to_velocity(self, wanted: float, acceleration: float, deceleration: float) -> None:
        """Make a step towards the velocity `wanted`, with ramps above 0."""
        self.torque = None
        # Reversing goes through 0: down along one ramp, then up along the other.
        wanted = 0.0 if wanted * self.velocity < 0 else wanted
        slower = abs(wanted) < abs(self.velocity)
        most = (deceleration if slower else acceleration) * STEP
        self.velocity += min(max(wanted - self.velocity, -most), most)
        self.position += self.velocity * STEP

    def to_position(self, target: float, velocity: float, acceleration: float, deceleration: float) -> None:
        """Make a step along a trapezoid with the top `velocity` that ends at the target."""
        distance = target - self.position
        # The highest velocity from which the ramp can end at the target, in finite steps.
        half = deceleration * STEP / 2
        braking = sqrt(half * half + 2 * deceleration * abs(distance)) - half
        wanted = copysign(min(velocity, braking), distance)
        # Arrives in this step; ramps alone would oscillate around the target.
        if abs(distance) <= abs(wanted) * STEP + 1e-6 and abs(self.velocity) <= 2 * deceleration * STEP + abs(wanted):
            self.position = target
            self.velocity = 0.0
        else:
            self.to_velocity(wanted, acceleration, deceleration)

    def to_torque(self, wanted: float, slope: float) -> None:
        """Make a step towards the torque `wanted`, by at most `slope` per second."""
        present = self.torque or 0.0
        most = slope * STEP
        near = abs(wanted - present) <= most
        self.torque = wanted if near else present + copysign(most, wanted - present)


# The motor


ROUND = 10
"""Turns of the motor for one turn of a round table."""


class Plant(NamedTuple):
    """The machine that the motor moves; positions are in turns from where it is switched on.

    `travel` are the ends with the limit switches; None for a round table, which returns to its start after `ROUND`
    turns. The home switch is active between the positions in `home`. `acceleration` is that of the full torque, and
    `friction` the deceleration without torque, in turns/s²; `fastest` is the highest velocity in turns/s.
    """

    travel: tuple[float, float] | None = None
    home: tuple[float, float] = (2.0, 3.0)
    acceleration: float = 2000.0
    friction: float = 50.0
    fastest: float = 200.0

    def switches(self, turns: float) -> int:
        """Return the bits of the active switches at a position."""
        place = turns % ROUND if self.travel is None else turns
        active = Switch.HOME if self.home[0] <= place <= self.home[1] else 0
        if self.travel is not None:
            active |= Switch.NEGATIVE_LIMIT if turns <= self.travel[0] else 0
            active |= Switch.POSITIVE_LIMIT if turns >= self.travel[1] else 0
        return active


GAIN = 100.0
"""Gain of the position controller: velocity by following error, in 1/s."""


CREEP = 0.01
"""Velocity below which friction is ignored, in turns/s; a held position oscillates by less."""


@dataclass
class Motor:
    """The motor: `position` of its encoder, `velocity`, and `torque` as a share of its maximum, -1 to 1.

    `origin` is the position of the machine's 0, which homing moves.
    """

    plant: Plant
    turn: float
    position: float = 0.0
    velocity: float = 0.0
    torque: float = 0.0
    origin: float = 0.0

    def follow(self, demand: Demand, controls_position: bool) -> None:
        """Make a step towards the demand, as far as the torque allows."""
        # The motor should be at the demand at the end of this step.
        lag = demand.position - demand.velocity * STEP - self.position
        wanted = demand.velocity + (GAIN * lag if controls_position else 0.0)
        self._turn(wanted, self.plant.acceleration * self.turn)

    def push(self, torque: float, fastest: float) -> None:
        """Make a step with a share of the torque against friction, with at most the velocity `fastest`."""
        brake = self.plant.friction * self.turn * STEP
        most = min(fastest, self.plant.fastest * self.turn)
        free = self.velocity + torque * self.plant.acceleration * self.turn * STEP
        moves = copysign(min(max(abs(free) - brake, 0.0), most), free)
        # At top speed, only friction needs torque.
        self.torque = copysign(self.plant.friction / self.plant.acceleration, free) if abs(moves) == most else torque
        self.velocity = moves
        self.position += self.velocity * STEP

    def coast(self) -> None:
        """Make a step without torque."""
        self._turn(0.0, self.plant.friction * self.turn)
        self.torque = 0.0

    def _turn(self, wanted: float, acceleration: float) -> None:
        most = acceleration * STEP
        change = min(max(wanted - self.velocity, -most), most)
        # The mean over the step, because the velocity may change its sign.
        during = self.velocity + change / 2
        is_turning = abs(during) > CREEP * self.turn
        rubs = copysign(self.plant.friction / self.plant.acceleration, during) if is_turning else 0.0
        self.velocity += change
        self.torque = min(max(change / most + rubs, -1.0), 1.0)
        self.position += self.velocity * STEP

    @property
    def switches(self) -> int:
        """Bits of the active switches."""
        return self.plant.switches((self.position - self.origin) / self.turn)

    @property
    def index(self) -> int:
        """Number of the encoder's turn, which changes at each index pulse."""
        return int((self.position - self.origin) // self.turn)

    def shift(self, by: float) -> None:
        """Change the position without moving."""
        self.position += by
        # Switches and index pulses stay at their places.
        self.origin += by


class MovedAxis:
    """An axis for a mode of operation: the objects, the demand to set, and the motor that follows.

    `sync_period` is the period of SYNC in s, if it is known.
    """

    def __init__(self, values: AxisValues, plant: Plant) -> None:
        self.values = values
        self.units = Units.of(values)
        self.demand = Demand()
        self.motor = Motor(plant, self.units.turn)
        self.limited = self.homed = self.following_error = False
        self.sync_period = STEP

    def velocity(self, index: int, sub: int = 0, default: float = inf) -> float:
        """Return a velocity in position units/s; `default` without the object."""
        value = self.values.find(index, sub)
        return default if value is None else value * self.units.velocity

    def acceleration(self, index: int) -> float:
        """Return an acceleration in position units/s²; without a value, the motor's maximum."""
        said = self.values.get(index) * self.units.velocity
        return said if said > 0 else self.motor.plant.acceleration * self.units.turn

    @property
    def stands(self) -> bool:
        """Whether motor and demand stand still."""
        return self.demand.velocity == 0 and abs(self.motor.velocity) < 1.0
