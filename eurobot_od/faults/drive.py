"""Faults of drives (CiA 402): what is wrong with the motor, its encoder, or what the drive makes of its commands.

The step that finds each is one of `check --profile 402`.
"""

from __future__ import annotations

from typing import ClassVar

from eurobot_od.device.drive import SimulatedDrive
from eurobot_od.faults.fault import Caught
from eurobot_od.faults.hooks import Mixin
from eurobot_od.profiles import cia402
from eurobot_od.profiles.axis import Axis
from eurobot_od.profiles.cia402 import Command, State, Transition
from eurobot_od.profiles.motion import STEP

OVERCURRENT, ENCODER = 0x2310, 0x7305
"""Error codes: continuous over-current, and sensor 1 (CiA 402-1)."""

HOLDS = 0.2
"""Seconds with torque after which the over-current comes."""


class BlockedAxis(Axis):
    """Its motor does not turn."""

    def _step(self) -> None:
        place = self.motor.position
        super()._step()
        self.motor.position, self.motor.velocity = place, 0.0


class OvercurrentAxis(Axis):
    """Its current is too high for the power stage."""

    powered_for = 0.0

    @property
    def busy(self) -> bool:
        return super().busy or self.state in cia402.POWERED

    def _step(self) -> None:
        super()._step()
        self.powered_for = self.powered_for + STEP if self.state is State.ENABLED else 0.0
        if self.powered_for > HOLDS:
            self.fault(OVERCURRENT)


class EncoderLostAxis(Axis):
    """Its encoder is lost as soon as it has turned a little."""

    def _step(self) -> None:
        super()._step()
        if self.state is State.ENABLED and abs(self.motor.position - self.motor.origin) > self.motor.turn / 4:
            self.fault(ENCODER)


class NeverEnablesAxis(Axis):
    """It stays in Switched on."""

    def take(self, arrow: Transition) -> None:
        if arrow.after is not State.ENABLED:
            super().take(arrow)


class HomingStuckAxis(Axis):
    """Its home and limit switches never say anything, and its encoder has no index pulse."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)  # type: ignore[arg-type]
        nowhere = (float("inf"), float("inf"))
        self.motor.plant = self.motor.plant._replace(travel=(-nowhere[0], nowhere[0]), home=nowhere)


class QuickStopIgnoredAxis(Axis):
    """It does not hear the quick stop."""

    def arrow(self, command: Command | None) -> Transition | None:
        return None if command is Command.QUICK_STOP else super().arrow(command)


class ResetIgnoredAxis(Axis):
    """It cannot leave Fault."""

    def take(self, arrow: Transition) -> None:
        if arrow.before is not State.FAULT:
            super().take(arrow)


class NeverReachedAxis(Axis):
    """It does not say that it has reached its target."""

    @property
    def statusword(self) -> int:
        return super().statusword & ~cia402.TARGET_REACHED


class HastyAxis(Axis):
    """It enables without being commanded to switch on first."""

    def arrow(self, command: Command | None) -> Transition | None:
        if self.state is State.DISABLED and command is Command.ENABLE:
            return Transition(0, State.DISABLED, command, State.ENABLED)
        return super().arrow(command)


def _with(axis: type[Axis]) -> Mixin:
    class WithAxis(SimulatedDrive):
        AXIS: ClassVar[type[Axis]] = axis

    return WithAxis


def _caught(step: str) -> Caught:
    return Caught("profile-402", step)


FAULTS = {
    "following-error": _caught("profile position").fault("its motor is blocked", _with(BlockedAxis)),
    "overcurrent": _caught("states").fault("its current is soon too high", _with(OvercurrentAxis)),
    "encoder-lost": _caught("profile position").fault("loses its encoder as it turns", _with(EncoderLostAxis)),
    "never-enables": _caught("states").fault("stays in Switched on", _with(NeverEnablesAxis)),
    "homing-stuck": _caught("homing").fault("never finds a switch or an index pulse", _with(HomingStuckAxis)),
    "quick-stop-ignored": _caught("quick stop").fault("does not hear the quick stop", _with(QuickStopIgnoredAxis)),
    "fault-reset-ignored": _caught("fault").fault("cannot leave Fault", _with(ResetIgnoredAxis)),
    "target-never-reached": _caught("profile position").fault(
        "says of no target that it is reached", _with(NeverReachedAxis)
    ),
    "enables-at-once": _caught("states").fault("enables from Switch on disabled", _with(HastyAxis)),
}
