"""One axis of a drive: state machine of CiA 402, supervision of the motion, and its objects.

`control` is called after each frame and processes controlword and mode of operation; `advance` advances the axis to a
time, in steps of `motion.STEP`. Both update the objects at the end. An axis has a state (`cia402.State`), a mode that
sets the demand (`modes`), a motor that follows it (`motion`), and perhaps a stop: a ramp, and the transition to make
once the motor stands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import copysign
from typing import NamedTuple

from eurobot_od.device.profiles.modes import MODES, Homing, ModeOfOperation
from eurobot_od.device.profiles.motion import STEP, AxisValues, Demand, MovedAxis, Plant
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import ARROWS, POWERED, DriveCommand, Mode, Ramp, State, Transition

MOST_STEPS = 1000
"""Most steps of one call; an axis that was not updated for longer has stood still."""

FOLLOWING_ERROR_CODE = 0x8611
"""Error code for a following error that is too large for too long (CiA 402-1)."""

OFF = 0xFFFFFFFF
"""Following error window that disables the supervision (CiA 402-2, clause 12.3.3)."""

NO_TORQUE = 0.0005
"""Share of the torque below which the object of the torque is 0."""

STOPS: Mapping[tuple[State, State], int] = {
    (State.ENABLED, State.READY): cia402.SHUTDOWN_OPTION,
    (State.ENABLED, State.SWITCHED_ON): cia402.DISABLE_OPTION,
    (State.ENABLED, State.QUICK_STOP): cia402.QUICK_STOP_OPTION,
}
"""Option codes for stopping the motor, by states of the transition."""

DECELERATIONS: Mapping[Ramp, int] = {
    Ramp.SLOW_DOWN: cia402.PROFILE_DECELERATION,
    Ramp.QUICK_STOP: cia402.QUICK_STOP_DECELERATION,
}
"""Objects with the deceleration of a ramp; other ramps are as steep as possible."""


class Stop(NamedTuple):
    """A stop: its ramp, and the state after it (None: unchanged)."""

    ramp: Ramp
    after: State | None


class DriveAxis(MovedAxis):
    """An axis with its objects; `report` is called with the error code of a fault, and with None at its reset.

    `plant` is the machine that the motor moves.
    """

    def __init__(self, values: AxisValues, plant: Plant, report: Callable[[int | None], object]) -> None:
        super().__init__(values, plant)
        self._report = report
        self.state = State.NOT_READY
        self._word, self._left, self._lag = 0, 0, 0.0
        self._stop: Stop | None = None
        self._time: float | None = None
        self._mode_number = 0
        self._mode = ModeOfOperation(self)

    # Controlword and mode

    def control(self, now: float) -> None:
        """Process written objects: mode of operation, controlword, and the commands of the mode."""
        self.advance(now)
        if self.state is State.NOT_READY:
            self._enter(State.DISABLED)  # transition 1: there is nothing to test
        self._take_mode()
        word = self.values.get(cia402.CONTROLWORD)
        # Fault reset, new set-point and start of homing act on rising edges, other bits by level.
        rising = word & ~self._word
        self._word = word
        self._obey(word, rising)
        if self.state is State.ENABLED and not self._is_halted:
            self._mode.command(word, rising)
        self._show()

    def commanded(self) -> None:
        """Note that a controlword was written, perhaps the same as before."""
        self._word &= ~self._left
        self._left = 0

    def _take_mode(self) -> None:
        number = _signed(self.values.get(cia402.MODE))
        if not self.values.has(cia402.MODE):  # optional for a drive with one mode
            number = next(iter(cia402.supported(self.values.get(cia402.SUPPORTED_MODES))), Mode.NONE)
        if number != self._mode_number and self.takes(number):
            self._mode_number = number
            self._mode = MODES[number](self)
            # Bit 4 that was set for a set-point starts homing only with the next controlword (CiA 402-2, clause 11:
            # "start or continue"); the mode alone must not move the axis.
            self._left = cia402.HOMING_START if number == Mode.HOMING else 0
            # The torque of the old mode ends; the new mode starts with the present velocity.
            self.demand.torque = None
            self.following_error, self._lag = False, 0.0

    def takes(self, mode: int) -> bool:
        """Return whether the drive has a mode in its file that can be simulated."""
        said = self.values.get(cia402.SUPPORTED_MODES, default=-1)
        return mode in MODES and (mode == Mode.NONE or bool(said >> mode - 1 & 1))

    def _obey(self, word: int, rising: int) -> None:
        command = cia402.command_of(word)
        # Fault reset needs a rising edge (CiA 402-2).
        if command is DriveCommand.FAULT_RESET and not rising & cia402.FAULT_RESET:
            return
        # "Enable operation" makes two transitions in READY (CiA 402-2, table of commands).
        for _ in range(2 if command is DriveCommand.ENABLE else 1):
            arrow = self.arrow(command)
            if arrow is not None:
                self.take(arrow)

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        """Return the transition of a command in the present state, or None."""
        if command is DriveCommand.ENABLE and self.state is State.READY:
            command = DriveCommand.SWITCH_ON
        if self._stop is not None and command is DriveCommand.ENABLE and self.state is State.ENABLED:
            self._stop = None  # the stop is cancelled
        arrow = ARROWS.get((self.state, command)) if command else None
        # A repeated controlword does not restart the ramp.
        if arrow is None or (self._stop and self._stop.after is arrow.after):
            return None
        stays = self._option(cia402.QUICK_STOP_OPTION) in cia402.STAYING
        return None if arrow.number == 16 and not stays else arrow

    def take(self, arrow: Transition) -> None:
        """Make a transition, after a stop if its option code requires one."""
        if arrow.before is State.FAULT:
            self.values.put(cia402.ERROR_CODE, 0)
            self._report(None)
        option = STOPS.get((arrow.before, arrow.after))
        ramp = Ramp.FREE if option is None else self._ramp(option)
        is_quick_stop = arrow.after is State.QUICK_STOP
        if is_quick_stop and ramp is not Ramp.FREE:
            self._enter(State.QUICK_STOP)
            stays = self._option(cia402.QUICK_STOP_OPTION) in cia402.STAYING
            self._stop = Stop(ramp, None if stays else State.DISABLED)
        elif ramp is Ramp.FREE or self.stands:
            # Without a ramp, a quick stop removes the torque at once.
            self._enter(State.DISABLED if is_quick_stop else arrow.after)
        else:
            self._stop = Stop(ramp, arrow.after)

    def _option(self, index: int) -> int:
        return _signed(self.values.get(index, default=cia402.DEFAULT_OPTION[index]))

    def _ramp(self, index: int) -> Ramp:
        """Return the ramp of an option code; the default for an undefined code."""
        ramps = cia402.OPTIONS[index]
        return ramps.get(self._option(index), ramps[cia402.DEFAULT_OPTION[index]])

    def _enter(self, state: State) -> None:
        powered = self.state in POWERED
        self.state = state
        self._stop = None
        if state is State.ENABLED or not powered:
            # With torque again, the demand starts from the motor's position and velocity.
            self.demand = Demand(self.motor.position, self.motor.velocity)
        if state not in POWERED:
            self.demand.velocity = 0.0
        if state is State.ENABLED:
            self._lag, self.following_error = 0.0, False
            self._mode.begin()

    # Faults

    def fault(self, code: int) -> None:
        """Make transition 13: stop the motor by the fault reaction option code, and enter Fault."""
        # The first fault is the cause; later ones must not replace it.
        if self.state in (State.FAULT, State.FAULT_REACTION):
            return
        self.values.put(cia402.ERROR_CODE, code)
        self._report(code)
        ramp = self._ramp(cia402.FAULT_OPTION)
        if self.state not in POWERED or ramp is Ramp.FREE or self.stands:
            self._enter(State.FAULT)
        else:
            self._enter(State.FAULT_REACTION)
            self._stop = Stop(ramp, State.FAULT)
        self._show()

    def connection_lost(self) -> None:
        """Apply the abort connection option code (CiA 402-2, clause 8.4.4) after a lost heartbeat or bus."""
        reaction = _signed(self.values.get(cia402.ABORT_CONNECTION, default=1))
        # 0 and undefined codes do nothing.
        if reaction == 1:
            self.fault(0x8130)  # life guard or heartbeat error (CiA 301, Table 26)
        elif reaction in (2, 3):
            arrow = self.arrow(DriveCommand.DISABLE_VOLTAGE if reaction == 2 else DriveCommand.QUICK_STOP)
            if arrow is not None:
                self.take(arrow)
                self._show()

    # Time

    @property
    def busy(self) -> bool:
        """Whether the axis changes with time, so that `advance` has to be called at each step."""
        if self.state not in POWERED:
            return self.motor.velocity != 0
        # The objects have whole units.
        lags = self._mode.controls_position and abs(self.demand.position - self.motor.position) > 0.5
        # The torque becomes 0 one step after the end of the motion.
        pushes = self.demand.torque is None and abs(self.motor.torque) >= NO_TORQUE
        still = self.stands and abs(self.motor.velocity) < 1e-3 and not (lags or pushes) and self._stop is None
        return not (still and (self._mode.settled or self._is_halted or self.state is not State.ENABLED))

    @property
    def _is_halted(self) -> bool:
        return bool(self._word & cia402.HALT)

    def advance(self, now: float) -> None:
        """Advance the axis to a time."""
        if self._time is None or not self.busy:
            self._time = now
            return
        # 1e-6 for rounding errors of many steps.
        steps = int((now - self._time) / STEP + 1e-6)
        # After a long halt, as in a debugger, the missed time is skipped.
        self._time = now if steps > MOST_STEPS else self._time + steps * STEP
        for _ in range(min(steps, MOST_STEPS)):
            self.step()
        if steps:
            self._show()

    def step(self) -> None:
        """Make one STEP: set the demand, and let the motor follow it."""
        if self.state not in POWERED:
            # The demand follows the motor, so that it does not jump when there is torque again.
            self.motor.coast()
            self.demand.position = self.motor.position
            return
        self.lead()
        self._follow()
        if self._stop is not None and self._stop.after is not None and self.stands:
            self._enter(self._stop.after)

    def _follow(self) -> None:
        # A fault is stopped by velocity control, because the position may be wrong.
        controls_position = self._mode.controls_position and self.state is not State.FAULT_REACTION
        if self.demand.torque is None:
            self.motor.follow(self.demand, controls_position)
        else:
            self.motor.push(self.demand.torque, self.velocity(cia402.MAX_MOTOR_SPEED))
            self.demand.velocity = self.motor.velocity  # a ramp that stops it starts from here
        if controls_position:
            self._supervise()
        else:
            self.demand.position = self.motor.position

    def lead(self) -> None:
        """Move the demand by one STEP: along a stop's ramp, or by the mode of operation."""
        ramp = self._ramp_now
        if ramp is not None:
            self.demand.to_velocity(0.0, 1.0, self._deceleration(ramp))
            return
        # Homing searches the limit switches; in other modes they end the motion.
        if isinstance(self._mode, Homing):
            self._mode.step()
            return
        position, velocity = self.demand.position, self.demand.velocity
        self._mode.step()
        leads = self.demand.velocity if self.demand.torque is None else self.demand.torque
        # Only the switch ahead, so that an axis on a switch can leave it.
        moves = int(copysign(1, leads)) if leads else 0
        if moves and self.motor.switches & cia402.LIMITS[moves]:
            self.demand.position, self.demand.velocity = position, velocity
            self.demand.to_velocity(0.0, 1.0, self._deceleration(Ramp.QUICK_STOP))
            self.limited = True

    @property
    def _ramp_now(self) -> Ramp | None:
        """Ramp of the present stop or halt, None while the mode moves the axis."""
        if self._stop is not None:
            return self._stop.ramp
        if self.state is not State.ENABLED:
            return Ramp.QUICK_STOP
        return self._ramp(cia402.HALT_OPTION) if self._is_halted else None

    def _deceleration(self, ramp: Ramp) -> float:
        index = DECELERATIONS.get(ramp, cia402.MAX_ACCELERATION)
        if ramp is Ramp.SLOW_DOWN and isinstance(self._mode, Homing):
            index = cia402.HOMING_ACCELERATION
        return self.acceleration(index)

    def _supervise(self) -> None:
        """Check the following error (CiA 402-2, clause 12.3)."""
        window = self.values.get(cia402.FOLLOWING_WINDOW, default=OFF) & OFF
        if window == OFF:
            return
        outside = abs(self.demand.position - self.motor.position) > window
        self._lag = self._lag + STEP if outside else 0.0
        self.following_error = self._lag > self.values.get(cia402.FOLLOWING_TIME) / 1000
        if self.following_error:
            self.fault(FOLLOWING_ERROR_CODE)

    # Objects

    @property
    def statusword(self) -> int:
        """The statusword: state, voltage, remote, and the bits of the mode."""
        word = self.state.bits | cia402.VOLTAGE | cia402.REMOTE
        if self.state not in (State.QUICK_STOP, State.FAULT, State.FAULT_REACTION):
            # Bit 5 is 0 during a quick stop, and undefined in a fault (CiA 402-2, table of states).
            word |= cia402.NO_QUICK_STOP
        if self.state is State.ENABLED:
            word |= self._mode.halt_bits if self._is_halted else self._mode.bits
        if self.state is State.QUICK_STOP and self.stands:
            word |= cia402.TARGET_REACHED
        if self.limited and self.state is State.ENABLED:
            word |= cia402.INTERNAL_LIMIT
        return word

    def _show(self) -> None:
        motor = self.motor
        demand = self.demand
        velocity = self.units.velocity
        powered = self.state in POWERED
        torque = round(1000 * motor.torque) if powered else 0
        shown = {
            cia402.STATUSWORD: self.statusword,
            cia402.MODE_DISPLAY: self._mode_number,
            cia402.POSITION_DEMAND: round(demand.position),
            cia402.POSITION_DEMAND_INTERNAL: round(demand.position),
            cia402.POSITION_INTERNAL: round(motor.position),
            cia402.POSITION: round(motor.position),
            cia402.VELOCITY_DEMAND: round(demand.velocity / velocity),
            cia402.VELOCITY_SENSOR: round(motor.velocity / velocity),
            cia402.VELOCITY: round(motor.velocity / velocity),
            cia402.FOLLOWING_ERROR: round(demand.position - motor.position) if powered else 0,
            cia402.DIGITAL_INPUTS: motor.switches,
            cia402.TORQUE_DEMAND: torque if demand.torque is None else round(1000 * demand.torque),
            cia402.TORQUE: torque,
            cia402.CURRENT: torque,
        }
        for index, value in shown.items():
            self.values.put(index, value)


def _signed(value: int) -> int:
    """Return a signed number of 8 or 16 bits; some files write -1 as 0xFF."""
    return value - 0x100 if 0x80 <= value <= 0xFF else value
