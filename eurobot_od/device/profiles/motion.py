"""A motor with a load, the ramps that lead it, and the units it is commanded in, which are objects of its axis.

Positions are in position units of the device and velocities in position units per second, whatever unit the device
itself has for velocity; only `Units` converts. Time passes in steps of `STEP`.
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
"""Seconds in a step."""

TURN = 4096
"""Position units in a turn where the file does not say."""

REVOLUTION, MINUTE = 0xB4, 0x47
"""Numbers of the SI units "revolution" and "minute" in 0x60A9 (CiA 303-2)."""

RPM = ("rpm", "rev/min", "1/min", "min-1")
"""How files write revolutions per minute."""


class AxisValues:
    """The objects of one axis as a profile sees them, here those of its file.

    `offset` is added to the indices of the first axis; a device without axes has 0.
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
        """Return an object's value; None if the axis does not have it, or if it has no value."""
        address = self._address(index, sub)
        return None if address is None else self._value(address)

    def get(self, index: int, sub: int = 0, default: int = 0) -> int:
        """Return an object's value; `default` if the axis does not have it, or if it has no value."""
        value = self.find(index, sub)
        return default if value is None else value

    def put(self, index: int, value: int) -> None:
        """Give an object a value, if the axis has it."""
        address = self._address(index, 0)
        if address is not None and self._value(address) != value:
            self._keep(address, value)

    def unit(self, index: int) -> str:
        """Return the unit that the file gives an object; empty without one."""
        variable = self._dictionary.variable((index + self._offset, 0))
        return "" if variable is None else str(variable.unit)

    def _value(self, address: Address) -> int | None:
        """Return the default of an object, None if it has none, or one that is not a number."""
        return self._dictionary.number(address)

    def _keep(self, address: Address, value: int) -> None:
        """Keep nothing: a file stays as it is."""


class Units(NamedTuple):
    """Position units in a `turn` of the motor, and position units per second in one unit of `velocity`."""

    turn: float
    velocity: float

    @classmethod
    def of(cls, values: AxisValues) -> Units:
        """Take them from the objects: the factor group, the unit of velocity 0x60A9, or the unit that the file writes.

        A feed constant 0x6092 is for a turn of the shaft behind the gear 0x6091; without one, a turn of the motor is
        the encoder's resolution 0x608F. The velocity factor 0x6096 converts position units per second into units of
        velocity.
        """
        turn = ratio_of(values, cia402.ENCODER_RESOLUTION) or TURN
        feed = ratio_of(values, cia402.FEED_CONSTANT)
        # A feed of 1 is what a file has if nobody has set one.
        turn = feed / (ratio_of(values, cia402.GEAR_RATIO) or 1.0) if feed and feed != 1 else turn
        unit = values.get(cia402.SI_VELOCITY)
        if (unit >> 16 & 0xFF, unit >> 8 & 0xFF) == (REVOLUTION, MINUTE):
            prefix = unit >> 24
            return cls(turn, turn / 60 * 10.0 ** (prefix - 0x100 if prefix > 0x7F else prefix))  # 0xFD is milli
        factor = ratio_of(values, cia402.VELOCITY_FACTOR)
        if factor and factor != 1:
            return cls(turn, 1 / factor)
        written = {values.unit(index).lower() for index in (cia402.TARGET_VELOCITY, cia402.PROFILE_VELOCITY)}
        return cls(turn, turn / 60 if written & {*RPM} else 1.0)


def ratio_of(values: AxisValues, index: int) -> float:
    """Return numerator by divisor of a factor; 0 if the axis does not have it, or if it is not positive."""
    numerator, divisor = (values.get(index, sub) for sub in (1, 2))
    return numerator / divisor if numerator > 0 and divisor > 0 else 0.0


# What leads the motor


@dataclass
class Demand:
    """Where the motor has to be and how fast; or the share of its torque, -1 to 1, if torque leads it."""

    position: float = 0.0
    velocity: float = 0.0
    torque: float | None = None

    def to_velocity(self, wanted: float, acceleration: float, deceleration: float) -> None:
        """Take a step that brings the velocity nearer to `wanted`; accelerations are those of a ramp, above 0."""
        self.torque = None
        # Turning round leads through a stand: down along one ramp, then up along the other.
        wanted = 0.0 if wanted * self.velocity < 0 else wanted
        slower = abs(wanted) < abs(self.velocity)
        most = (deceleration if slower else acceleration) * STEP
        self.velocity += min(max(wanted - self.velocity, -most), most)
        self.position += self.velocity * STEP

    def to_position(self, target: float, velocity: float, acceleration: float, deceleration: float) -> None:
        """Take a step along a trapezoid with the top `velocity` that ends at the target."""
        distance = target - self.position
        # As fast as the ramp can still end at the target, in steps of finite length.
        half = deceleration * STEP / 2
        braking = sqrt(half * half + 2 * deceleration * abs(distance)) - half
        wanted = copysign(min(velocity, braking), distance)
        # Near and slow enough to arrive in this step: ramps alone would oscillate around the target.
        if abs(distance) <= abs(wanted) * STEP + 1e-6 and abs(self.velocity) <= 2 * deceleration * STEP + abs(wanted):
            self.position, self.velocity = target, 0.0
        else:
            self.to_velocity(wanted, acceleration, deceleration)

    def to_torque(self, wanted: float, slope: float) -> None:
        """Take a step that brings the torque nearer to `wanted`, by at most `slope` in a second."""
        present, most = self.torque or 0.0, slope * STEP
        near = abs(wanted - present) <= most
        self.torque = wanted if near else present + copysign(most, wanted - present)


# The motor


ROUND = 10
"""Turns of the motor in one turn of a round table."""


class Plant(NamedTuple):
    """The machine that the motor moves: places are in turns from where it is switched on.

    `travel` are the ends, where the limit switches are; None for a round table, which has no ends and is back at its
    start after `ROUND` turns. The home switch is active between the places of `home`. `acceleration` is the most that
    the motor's torque allows, in turns/s²; `friction` alone brakes it. It turns no faster than `fastest`, in turns/s.
    """

    travel: tuple[float, float] | None = None
    home: tuple[float, float] = (2.0, 3.0)
    acceleration: float = 2000.0
    friction: float = 50.0
    fastest: float = 200.0

    def switches(self, turns: float) -> int:
        """Return the bits of the switches that are active at a place."""
        place = turns % ROUND if self.travel is None else turns
        active = Switch.HOME if self.home[0] <= place <= self.home[1] else 0
        if self.travel is not None:
            active |= Switch.NEGATIVE_LIMIT if turns <= self.travel[0] else 0
            active |= Switch.POSITIVE_LIMIT if turns >= self.travel[1] else 0
        return active


GAIN = 100.0
"""Gain of the position controller: velocity for each position unit of following error, in 1/s."""


CREEP = 0.01
"""Turns/s below which friction is not shown: a position that is held swings by less."""


@dataclass
class Motor:
    """The motor: `position` as its encoder reports it, `velocity`, and `torque` as a share of its most, -1 to 1.

    `origin` is the position 0 of the machine, which homing moves.
    """

    plant: Plant
    turn: float
    position: float = 0.0
    velocity: float = 0.0
    torque: float = 0.0
    origin: float = 0.0

    def follow(self, demand: Demand, controls_position: bool) -> None:
        """Take a step after the demand, as far as the motor's torque allows."""
        # The demand is one step ahead: the motor should be there at the end of this step.
        lag = demand.position - demand.velocity * STEP - self.position
        wanted = demand.velocity + GAIN * lag * controls_position
        self._turn(wanted, self.plant.acceleration * self.turn)

    def push(self, torque: float, fastest: float) -> None:
        """Take a step with a share of the torque against friction, no faster than `fastest`."""
        brake, most = self.plant.friction * self.turn * STEP, min(fastest, self.plant.fastest * self.turn)
        free = self.velocity + torque * self.plant.acceleration * self.turn * STEP
        moves = copysign(min(max(abs(free) - brake, 0.0), most), free)
        # At top speed it only needs torque against friction.
        self.torque = copysign(self.plant.friction / self.plant.acceleration, free) if abs(moves) == most else torque
        self.velocity = moves
        self.position += self.velocity * STEP

    def coast(self) -> None:
        """Take a step without torque."""
        self._turn(0.0, self.plant.friction * self.turn)
        self.torque = 0.0

    def _turn(self, wanted: float, acceleration: float) -> None:
        most = acceleration * STEP
        change = min(max(wanted - self.velocity, -most), most)
        # The mean over the step: where the velocity changes its sign, the friction at either end would be wrong.
        during = self.velocity + change / 2
        rubs = copysign(self.plant.friction / self.plant.acceleration, during) * (abs(during) > CREEP * self.turn)
        self.velocity += change
        self.torque = min(max(change / most + rubs, -1.0), 1.0)
        self.position += self.velocity * STEP

    @property
    def switches(self) -> int:
        """The bits of the switches that are active now."""
        return self.plant.switches((self.position - self.origin) / self.turn)

    @property
    def index(self) -> int:
        """The turn of the encoder, which changes at each index pulse."""
        return int((self.position - self.origin) // self.turn)

    def shift(self, by: float) -> None:
        """Renumber the place where it stands."""
        self.position += by
        # The machine has not moved: its switches and index pulses stay where they are.
        self.origin += by


class MovedAxis:
    """What a mode of operation sees of its axis: the objects, the demand that it leads, and the motor that follows.

    `sync_period` is the time between two SYNCs in seconds, if it is known.
    """

    def __init__(self, values: AxisValues, plant: Plant) -> None:
        self.values, self.units = values, Units.of(values)
        self.demand, self.motor = Demand(), Motor(plant, self.units.turn)
        self.limited = self.homed = self.following_error = False
        self.sync_period = STEP

    def velocity(self, index: int, sub: int = 0, default: float = inf) -> float:
        """Return a velocity in position units/s; `default` if the axis does not have the object."""
        value = self.values.find(index, sub)
        return default if value is None else value * self.units.velocity

    def acceleration(self, index: int) -> float:
        """Return an acceleration in position units/s²; if the object gives none, the most that the motor can do."""
        said = self.values.get(index) * self.units.velocity
        return said if said > 0 else self.motor.plant.acceleration * self.units.turn

    @property
    def stands(self) -> bool:
        """Whether both motor and demand stand still."""
        return self.demand.velocity == 0 and abs(self.motor.velocity) < 1.0
