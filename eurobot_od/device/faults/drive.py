"""Faults of drives (CiA 402): what is wrong with the motor, its encoder, or what the drive makes of its commands.

The step that finds each is one of `check --profile 402`.
"""

from __future__ import annotations

from typing import ClassVar

from eurobot_od.device.faults.hooks import Caught, Mixin
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.devices import SimulatedDrive
from eurobot_od.device.profiles.modes import Homing
from eurobot_od.device.profiles.motion import STEP
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import DriveCommand, State, Transition

OVERCURRENT, ENCODER = 0x2310, 0x7305
"""Error codes: continuous over-current, and sensor 1 (CiA 402-1)."""

HOLDS = 0.2
"""Seconds with torque after which the over-current comes."""


class BlockedAxis(DriveAxis):
    """Its motor does not turn."""

    def step(self) -> None:
        place = self.motor.position
        super().step()
        self.motor.position, self.motor.velocity = place, 0.0


class OvercurrentAxis(DriveAxis):
    """Its current is too high for the power stage."""

    powered_for = 0.0

    @property
    def busy(self) -> bool:
        return super().busy or self.state in cia402.POWERED

    def step(self) -> None:
        super().step()
        self.powered_for = self.powered_for + STEP if self.state is State.ENABLED else 0.0
        if self.powered_for > HOLDS:
            self.fault(OVERCURRENT)


class EncoderLostAxis(DriveAxis):
    """Its encoder is lost as soon as it has turned a little."""

    def step(self) -> None:
        super().step()
        if self.state is State.ENABLED and abs(self.motor.position - self.motor.origin) > self.motor.turn / 4:
            self.fault(ENCODER)


class NeverEnablesAxis(DriveAxis):
    """It stays in Switched on."""

    def take(self, arrow: Transition) -> None:
        if arrow.after is not State.ENABLED:
            super().take(arrow)


class HomingStuckAxis(DriveAxis):
    """It starts homing and never gets on with it."""

    def lead(self) -> None:
        if not isinstance(self._mode, Homing):
            super().lead()


class QuickStopIgnoredAxis(DriveAxis):
    """It does not hear the quick stop."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        return None if command is DriveCommand.QUICK_STOP else super().arrow(command)


class ResetIgnoredAxis(DriveAxis):
    """It cannot leave Fault."""

    def take(self, arrow: Transition) -> None:
        if arrow.before is not State.FAULT:
            super().take(arrow)


class NeverReachedAxis(DriveAxis):
    """It does not say that it has reached its target."""

    @property
    def statusword(self) -> int:
        return super().statusword & ~cia402.TARGET_REACHED


class HastyAxis(DriveAxis):
    """It enables without being commanded to switch on first."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        if self.state is State.DISABLED and command is DriveCommand.ENABLE:
            return Transition(0, State.DISABLED, command, State.ENABLED)
        return super().arrow(command)


def _with(axis: type[DriveAxis]) -> Mixin:
    class WithAxis(SimulatedDrive):
        AXIS: ClassVar[type[DriveAxis]] = axis

    return WithAxis


SUITE = "profile-402"
"""What `check --profile 402` makes."""

HOMING = Caught(SUITE, "11.1 Homing: present position is home")
MOVE = Caught(SUITE, "10.1 Profile position: there and back")
TABLE = "8.1 States: {} [reversible]"
ENABLE = "8.1 States with torque: Enable operation in Ready to switch on: Operation enabled"

FAULTS = {
    "following-error": MOVE.fault("its motor is blocked", _with(BlockedAxis)),
    "overcurrent": HOMING.fault("its current is too high soon after it is enabled", _with(OvercurrentAxis)),
    "encoder-lost": MOVE.fault("loses its encoder as it turns", _with(EncoderLostAxis)),
    "never-enables": Caught(SUITE, ENABLE).fault("stays in Switched on", _with(NeverEnablesAxis)),
    "homing-stuck": HOMING.fault("starts homing and never gets on with it", _with(HomingStuckAxis)),
    "quick-stop-ignored": Caught(SUITE, TABLE.format("Quick stop in Ready to switch on: Switch on disabled")).fault(
        "does not hear the quick stop", _with(QuickStopIgnoredAxis)
    ),
    "fault-reset-ignored": Caught(SUITE, "8.4 Connection: a lost heartbeat, and its reset").fault(
        "cannot leave Fault", _with(ResetIgnoredAxis)
    ),
    "target-never-reached": HOMING.fault("never says that a target is reached", _with(NeverReachedAxis)),
    "enables-at-once": Caught(SUITE, TABLE.format("Enable operation in Switch on disabled: stays")).fault(
        "enables from Switch on disabled", _with(HastyAxis)
    ),
}
