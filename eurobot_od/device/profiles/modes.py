"""Modes of operation of a drive (CiA 402-2, clauses 9 to 17): each sets the demand and has its own bits.

A mode accesses its axis as a `MovedAxis`. It changes only the demand; homing also moves the origin.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, sqrt
from typing import ClassVar, NamedTuple

from eurobot_od.device.profiles.motion import ROUND, STEP, AxisValues, MovedAxis
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import BIT_12, BIT_13, LIMITS, TARGET_REACHED, Mode, Seek


class ModeOfOperation:
    """A mode in which nothing moves; the base class of other modes."""

    controls_position: ClassVar = True
    """Whether the position is controlled, so that a following error exists."""

    def __init__(self, axis: MovedAxis) -> None:
        self.axis = axis
        self.begin()

    def begin(self) -> None:
        """Start over when operation is enabled: earlier commands are dropped."""

    def command(self, word: int, rising: int) -> None:
        """Process a controlword; `rising` are the bits that have become 1."""

    def step(self) -> None:
        """Set the demand for one step."""
        ramp = self.axis.acceleration(cia402.PROFILE_DECELERATION)
        self.axis.demand.to_velocity(0.0, ramp, ramp)

    @property
    def bits(self) -> int:
        """The mode's bits of the statusword."""
        return 0

    @property
    def halt_bits(self) -> int:
        """The mode's bits while the axis is halted: the target is reached once it stands."""
        return self.bits & ~TARGET_REACHED | TARGET_REACHED * self.axis.stands

    @property
    def settled(self) -> bool:
        """Whether nothing changes before the next command."""
        return self.axis.demand.velocity == 0


class SetPoint(NamedTuple):
    """Target position and velocity of a motion."""

    target: float
    velocity: float


class ProfilePosition(ModeOfOperation):
    """Moves to set-points, one after the other or at once (CiA 402-2, clause 10)."""

    def begin(self) -> None:
        self._target: SetPoint | None = None
        self._next: SetPoint | None = None
        self._acknowledged = self._commanded = False
        self._inside = 0.0

    def command(self, word: int, rising: int) -> None:
        self._commanded = bool(word & cia402.NEW_SET_POINT)
        # Bit 4 acts on its rising edge, so that a repeated controlword is not a second set-point. One set-point may
        # wait while another is active (CiA 402-2, clause 10).
        if rising & cia402.NEW_SET_POINT and self._next is None:
            found = self._set_point(bool(word & cia402.RELATIVE))
            self._acknowledged = True
            if self._target is None or word & cia402.AT_ONCE or self._arrived:
                self._begin_move(found)
            else:
                self._next = found
        self._release()

    def _set_point(self, relative: bool) -> SetPoint:
        axis = self.axis
        target: float = axis.values.get(cia402.TARGET_POSITION)
        if relative:
            last = self._next or self._target
            # Relative to the previous set-point, so that errors do not add up.
            target += last.target if last else axis.demand.position
        low, high = software_limits(axis.values)
        # Limited and reported by bit 11 of the statusword, because a PDO cannot be refused.
        axis.limited = not low <= target <= high
        fastest = min(axis.velocity(cia402.MAX_PROFILE_VELOCITY), axis.velocity(cia402.MAX_MOTOR_SPEED))
        velocity = min(axis.velocity(cia402.PROFILE_VELOCITY, default=axis.units.turn), fastest)
        return SetPoint(min(max(target, low), high), velocity)

    def _begin_move(self, set_point: SetPoint) -> None:
        self._target = set_point  # seconds in the target window
        self._inside = 0.0

    def _release(self) -> None:
        # The acknowledge bit stays set until the command bit is cleared and another set-point may come.
        if not self._commanded and self._next is None:
            self._acknowledged = False

    @property
    def _arrived(self) -> bool:
        return self._target is None or self.axis.demand.position == self._target.target

    def step(self) -> None:
        axis = self.axis
        if self._target is None:
            super().step()
            return
        ramps = (axis.acceleration(each) for each in (cia402.PROFILE_ACCELERATION, cia402.PROFILE_DECELERATION))
        axis.demand.to_position(*self._target, *ramps)
        # Without a window, within one unit, because the motor's position is not a whole number.
        window = axis.values.get(cia402.POSITION_WINDOW, default=0) or 1
        # The demand must have arrived, too, because a lagging motor may pass through the window.
        is_inside = self._arrived and abs(self._target.target - axis.motor.position) <= window
        self._inside = self._inside + STEP if is_inside else 0.0
        if self._next is not None and self._arrived:
            self._begin_move(self._next)
            self._next = None
            self._release()

    @property
    def _reached(self) -> bool:
        time = self.axis.values.get(cia402.POSITION_WINDOW_TIME) / 1000
        return self._target is None or self._inside > time

    @property
    def bits(self) -> int:
        return (
            (TARGET_REACHED if self._reached and self._next is None else 0)
            | (BIT_12 if self._acknowledged else 0)
            | (BIT_13 if self.axis.following_error else 0)
        )

    @property
    def settled(self) -> bool:
        return super().settled and self._reached and self._arrived


class VelocityMode(ModeOfOperation):
    """Moves with the sum of the objects `TARGETS`, limited by the objects `MOST`."""

    controls_position = False
    TARGETS: ClassVar[tuple[int, ...]] = (cia402.TARGET_VELOCITY,)
    MOST: ClassVar[tuple[int, ...]] = (cia402.MAX_MOTOR_SPEED,)

    @property
    def _wanted(self) -> float:
        axis = self.axis
        wanted = sum(axis.velocity(each, default=0.0) for each in self.TARGETS)
        # Infinite without the object.
        fastest = min(axis.velocity(each) for each in self.MOST)
        return within_limits(axis, min(max(wanted, -fastest), fastest))

    @property
    def settled(self) -> bool:
        return super().settled and self._wanted == 0


class ProfileVelocity(VelocityMode):
    """Turns at a velocity (CiA 402-2, clause 14)."""

    MOST = (cia402.MAX_PROFILE_VELOCITY, cia402.MAX_MOTOR_SPEED)

    def step(self) -> None:
        axis = self.axis
        ramps = (axis.acceleration(each) for each in (cia402.PROFILE_ACCELERATION, cia402.PROFILE_DECELERATION))
        axis.demand.to_velocity(self._wanted, *ramps)

    def _near(self, velocity: float, window: int) -> bool:
        # Without the object, only rounding errors are allowed.
        allowed = self.axis.velocity(window, default=self.axis.units.velocity)
        return abs(self.axis.motor.velocity - velocity) <= max(allowed, self.axis.units.velocity)

    @property
    def bits(self) -> int:
        wanted = self.axis.velocity(cia402.TARGET_VELOCITY, default=0.0)
        # In this mode, bit 12 means "speed is 0" (CiA 402-2, clause 14).
        reached = self._near(wanted, cia402.VELOCITY_WINDOW)
        return TARGET_REACHED * reached | BIT_12 * self._near(0.0, cia402.VELOCITY_THRESHOLD)


class CyclicPosition(ModeOfOperation):
    """Follows a target that comes with each SYNC (CiA 402-2, clause 15)."""

    def begin(self) -> None:
        self._target = self.axis.demand.position
        self._rate, self._left = 0.0, 0.0
        # Only a new target moves the axis.
        self._seen = self.axis.values.get(cia402.TARGET_POSITION)

    def command(self, word: int, rising: int) -> None:
        axis = self.axis
        target = self.axis.values.get(cia402.TARGET_POSITION)
        if target != self._seen:
            self._seen = target
            low, high = software_limits(axis.values)
            wanted = target + axis.values.get(cia402.POSITION_OFFSET)
            self._target = min(max(wanted, low), high)
            axis.limited = wanted != self._target
            # With constant velocity, so that the target is reached when the next one comes: after the interpolation
            # time, or else the period of SYNC.
            value, exponent = (axis.values.get(cia402.INTERPOLATION_TIME, sub) for sub in (1, 2))
            self._left = max(value * 10.0**exponent if value else axis.sync_period, STEP)
            self._rate = (self._target - axis.demand.position) / self._left

    def step(self) -> None:
        demand = self.axis.demand
        self._left -= STEP
        if self._left > STEP / 2:
            demand.velocity = self._rate
            demand.position += self._rate * STEP
        else:  # the velocity stays until the next target is overdue
            demand.velocity = self._rate if self._left > -STEP else 0.0
            demand.position = self._target

    @property
    def bits(self) -> int:
        return BIT_12 | BIT_13 * self.axis.following_error

    @property
    def settled(self) -> bool:
        return super().settled and self.axis.demand.position == self._target


class CyclicVelocity(VelocityMode):
    """Turns at a velocity that comes with each SYNC (CiA 402-2, clause 16)."""

    # The offset is optional, and added to each target (CiA 402-2, clause 16).
    TARGETS = (cia402.TARGET_VELOCITY, cia402.VELOCITY_OFFSET)

    def step(self) -> None:
        limit = self.axis.acceleration(cia402.MAX_ACCELERATION)
        self.axis.demand.to_velocity(self._wanted, limit, limit)

    @property
    def bits(self) -> int:
        return BIT_12


class CyclicTorque(ModeOfOperation):
    """Turns with a torque that comes with each SYNC (CiA 402-2, clause 17)."""

    controls_position = False

    @property
    def wanted(self) -> float:
        """The commanded torque within its limit, as a share of the motor's torque."""
        values = self.axis.values
        # Both objects are in 0.1 % of the rated torque, which is this motor's maximum.
        per_mille = values.get(cia402.TARGET_TORQUE) + values.get(cia402.TORQUE_OFFSET)
        most = min(values.get(cia402.MAX_TORQUE, default=1000), 1000)
        return min(max(per_mille, -most), most) / 1000

    def step(self) -> None:
        self.axis.demand.to_torque(self.wanted, inf)

    @property
    def bits(self) -> int:
        return BIT_12

    @property
    def settled(self) -> bool:
        plant = self.axis.motor.plant
        held = abs(self.wanted) * plant.acceleration <= plant.friction  # otherwise it turns
        return super().settled and held and self.axis.demand.torque == self.wanted


class ProfileTorque(CyclicTorque):
    """Turns with a torque that changes along a slope (CiA 402-2, clause 13)."""

    def step(self) -> None:
        slope = self.axis.values.get(cia402.TORQUE_SLOPE) / 1000
        self.axis.demand.to_torque(self.wanted, slope or inf)  # at once without a slope

    @property
    def bits(self) -> int:
        return TARGET_REACHED * (self.axis.demand.torque == self.wanted)


FARTHEST = 2 * ROUND
"""Turns after which homing of an axis without ends fails."""


class Homing(ModeOfOperation):
    """Finds the home position by the method in 0x6098 (CiA 402-2, clause 11)."""

    def begin(self) -> None:
        self._steps: Iterator[Seek] = iter(())
        self._seek: Seek | None = None
        self._turned = 0
        self._home: float | None = None
        self._runs = self._failed = False

    def command(self, word: int, rising: int) -> None:
        if rising & cia402.HOMING_START:
            self.begin()
            self.axis.homed = False
            method = cia402.METHODS.get(self.axis.values.get(cia402.HOMING_METHOD))
            self._failed = method is None
            self._runs = method is not None
            self._steps = iter(method.steps if method else ())
            self._go_on()
        # Clearing the bit interrupts homing (CiA 402-2, clause 11).
        elif self._runs and not word & cia402.HOMING_START:
            self._runs, self._seek = False, None

    def _go_on(self) -> None:
        self._seek = next(self._steps, None)
        self._turned = 0
        self._index, self._begun = self.axis.motor.index, self.axis.motor.position

    def step(self) -> None:
        axis = self.axis
        ramp = axis.acceleration(cia402.HOMING_ACCELERATION)
        seek = self._seek
        if seek is None:
            axis.demand.to_velocity(0.0, ramp, ramp)
            if self._runs and axis.stands:
                self._arrive()
            return
        direction = -seek.direction if self._turned % 2 else seek.direction
        speed = axis.velocity(cia402.HOMING_SPEEDS, seek.speed.value, default=axis.units.turn)
        axis.demand.to_velocity(direction * speed, ramp, ramp)
        self._look(seek, direction)

    def _look(self, seek: Seek, direction: int) -> None:
        motor = self.axis.motor
        switch = seek.switch
        is_there = motor.index != self._index if switch is None else bool(motor.switches & switch) is seek.active
        if self.axis.demand.velocity * direction <= 0:  # while it reverses, switches are ignored
            self._index = motor.index
        elif is_there:
            self._home = motor.position
            self._go_on()
        elif motor.switches & LIMITS[direction]:
            self._turned += 1
            if not seek.turns or self._turned > 1:  # it has reached both ends without the switch
                self._fail()
        elif motor.plant.travel is None and abs(motor.position - self._begun) > FARTHEST * motor.turn:
            self._fail()

    def _fail(self) -> None:
        self._failed, self._runs, self._seek = True, False, None

    def _arrive(self) -> None:
        """Make the found place home, whose position is the home offset (clause 11.4.1)."""
        axis = self.axis
        home = axis.motor.position if self._home is None else self._home
        # Home has the position of the home offset.
        by = -axis.values.get(cia402.HOME_OFFSET) - home
        axis.motor.shift(by)
        axis.demand.position += by
        self._runs, axis.homed = False, True

    @property
    def bits(self) -> int:
        stands = self.axis.stands
        if self._failed:
            return BIT_13 | TARGET_REACHED * stands
        # Homing stays completed even if the mode was changed since.
        if self.axis.homed:
            return BIT_12 | TARGET_REACHED * stands
        return 0 if self._runs else TARGET_REACHED  # if not started, or interrupted

    @property
    def settled(self) -> bool:
        return super().settled and not self._runs


MODES: Mapping[int, type[ModeOfOperation]] = {
    Mode.NONE: ModeOfOperation,
    Mode.PROFILE_POSITION: ProfilePosition,
    Mode.PROFILE_VELOCITY: ProfileVelocity,
    Mode.PROFILE_TORQUE: ProfileTorque,
    Mode.HOMING: Homing,
    Mode.CYCLIC_POSITION: CyclicPosition,
    Mode.CYCLIC_VELOCITY: CyclicVelocity,
    Mode.CYCLIC_TORQUE: CyclicTorque,
}
"""Classes of the modes that can be simulated; a drive has those in its file."""


def software_limits(values: AxisValues) -> tuple[float, float]:
    """Return the lowest and highest position; infinite without valid limits in the file."""
    low, high = (values.get(cia402.SOFTWARE_LIMIT, sub) for sub in (1, 2))
    return (low, high) if low < high else (-inf, inf)


def within_limits(axis: MovedAxis, velocity: float) -> float:
    """Return the velocity, limited so that the axis can stop before the software limit; note if it is limited."""
    low, high = software_limits(axis.values)
    way = high - axis.demand.position if velocity > 0 else axis.demand.position - low
    ramp = axis.acceleration(cia402.PROFILE_DECELERATION)
    most = sqrt(2 * ramp * max(way, 0.0))
    axis.limited = most < abs(velocity)
    return max(min(velocity, most), -most)
