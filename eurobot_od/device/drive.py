"""A simulated drive: a device from its file that behaves as CiA 402 says, each axis that the file has.

Rule of this file: it only connects. What an axis does stands in `profiles.axis`; what its objects hold goes out as any
other value does.
"""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

from eurobot_od.device.bound import Application
from eurobot_od.device.device_values import DeviceValues, ProfileDevice
from eurobot_od.device.objects import OnTold
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.modes import MODES
from eurobot_od.device.profiles.motion import STEP, Plant
from eurobot_od.device.profiles.values import AxisValues
from eurobot_od.errors import Cause, Refused
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.profiles import cia402
from eurobot_od.od.standard import SYNC_PERIOD
from eurobot_od.od.values import Address, Value

BEAT = 0.005
"""Seconds between two looks at an axis that moves, for TPDOs that go on a change; a frame finds the values of now."""

SIMULATED_MODES = sum(1 << mode - 1 for mode in MODES if mode)
"""The bits in 0x6502 of the modes that are simulated: mode n has bit n - 1 (CiA 402-2, clause 9)."""


class SimulatedDrive(ProfileDevice):
    """A drive of CiA 402, made from its EDS or DCF: it is enabled, homes and moves as its objects say.

    `travel` are the places of the limit switches in turns of the motor from where it is switched on; without it there
    are none. Whatever is simulated is read from objects that the file has: state machine, option codes, profile
    position and velocity, homing, cyclic synchronous position and velocity, following error and software limits.
    """

    AXIS: ClassVar[type[DriveAxis]] = DriveAxis

    def __init__(self, dictionary: Dictionary, *, travel: tuple[float, float] | None = None, **options: Any) -> None:
        self._axes: tuple[DriveAxis, ...] = ()
        self._plant, self._beats = Plant(travel), False
        super().__init__(dictionary, **options)

    @property
    def axes(self) -> tuple[DriveAxis, ...]:
        """The axes, the first one at index 0x6000."""
        return self._axes

    def _offsets(self, dictionary: Dictionary) -> list[int]:
        """Return what is added to the indices of each axis that the file has."""
        found = (number * cia402.AXIS_STEP for number in range(cia402.MOST_AXES))
        return [each for each in found if dictionary.variable((cia402.CONTROLWORD + each, 0))]

    def _application(self, dictionary: Dictionary) -> Application:
        application = super()._application(dictionary)
        told, given = dict[Address, OnTold](), dict[Address, Value]()
        for number, offset in enumerate(self._offsets(dictionary)):
            told[cia402.MODE + offset, 0] = partial(self._check_mode, number)
            modes = cia402.SUPPORTED_MODES + offset, 0
            said = dictionary.default(modes) if dictionary.variable(modes) else None
            if isinstance(said, int):  # less what is not simulated: a master would choose it in vain
                given[modes] = said & SIMULATED_MODES
        return application._replace(told={**told, **application.told}, given={**given, **application.given})

    def _check_mode(self, number: int, mode: int) -> None:
        if self._axes and not self._axes[number].takes(mode):
            raise Refused(Cause.VALUES, f"mode of operation {mode} is none of the drive's")

    # Time and frames

    def reset(self) -> None:
        """Begin anew, with the motor where it was switched on."""
        values = DeviceValues(self)
        self._beats = False
        self._axes = tuple(
            self.AXIS(AxisValues(values, offset), self._plant, partial(self._report, number))
            for number, offset in enumerate(self._offsets(self.dictionary))
        )
        super().reset()

    def _report(self, number: int, code: int | None) -> None:
        what = DriveAxis, number
        if code is None:
            self.clear_error(what)
        else:
            self.raise_error(code, what)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        # First: a SYNC has to find the values of now, and what it brings acts from now on.
        for axis in self._axes:
            axis.advance(now)
        return super().receive(frame, now)

    def _changed(self) -> list[Frame]:
        self.device.settle()
        # 0x1006 is in microseconds (CiA 301, 7.5.2.6); 0 says that nobody sends SYNC.
        period = self.device.number(SYNC_PERIOD) / 1_000_000 if self.dictionary.variable(SYNC_PERIOD) else 0.0
        for axis in self._axes:
            axis.sync_period = period or STEP
            axis.control(self.now)
        if not self._beats and any(axis.busy for axis in self._axes):
            self._beats = True
            self.at(self.now + BEAT, self._beat)
        return super()._changed() + self._flush()

    def _beat(self, _: float) -> None:
        self._beats = False  # the tick that has called this looks after the axes, and plans the next one

    # Connection

    def _connection_lost(self) -> None:
        """Do what each axis' abort connection option code says (CiA 402-2, clause 8.4.4)."""
        for axis in self._axes:
            axis.connection_lost()
