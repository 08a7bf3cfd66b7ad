"""Simulated devices that have a profile, made from their files: modules of CiA 401 and drives of CiA 402.

They connect a device to its profile and decide nothing themselves: what an input or output does stands in
`inputs_outputs`, what an axis does in `axis`. Whatever its objects hold then goes out as any other value does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar

from eurobot_od.device.bound import Application
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.objects import OnTold
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.inputs_outputs import Inputs, Outputs
from eurobot_od.device.profiles.modes import MODES
from eurobot_od.device.profiles.motion import STEP, Plant
from eurobot_od.device.profiles.values import AxisValues
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.device.waveforms import fitted
from eurobot_od.errors import Cause, Refused
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.profiles import cia401, cia402
from eurobot_od.od.profiles.words import profile_of
from eurobot_od.od.standard import SYNC_PERIOD
from eurobot_od.od.values import Address, DataType, Value
from eurobot_od.pdo.binding import Binding


class DeviceValues:
    """The objects of a node as its profile sees them; they survive a reset of the device."""

    def __init__(self, node: SimulatedDevice) -> None:
        self._node = node
        self._known: dict[Address, bool] = {}

    def has(self, address: Address) -> bool:
        """Tell whether the file has an object."""
        if address not in self._known:
            self._known[address] = self._node.dictionary.variable(address) is not None
        return self._known[address]

    def get(self, address: Address) -> int | None:
        """Return its value, None if it has none, or one that is not a number."""
        value = self._node.device.objects.kept(address)
        return value if isinstance(value, int) else None

    def put(self, address: Address, value: int) -> None:
        """Keep a value."""
        self._node.device.objects.put(address, value)

    def unit(self, address: Address) -> str:
        """Return the unit that the file gives it; empty without one."""
        variable = self._node.dictionary.variable(address)
        return "" if variable is None else str(variable.unit)


class ProfileDevice(SimulatedDevice):
    """A device whose profile says what it does when nobody can command it."""

    def _connection_lost(self) -> None:
        """Do what the profile says about a lost heartbeat, a lost bus, and the state Stopped."""

    def halted(self) -> None:
        super().halted()
        # In Pre-operational a master can still reach it by SDO; in Stopped nobody can.
        if self.device.state is NmtState.STOPPED:
            self._connection_lost()

    def heartbeat_lost(self, node_id: int) -> None:
        super().heartbeat_lost(node_id)
        self._connection_lost()

    def cut_off(self) -> None:
        super().cut_off()
        self._connection_lost()


# Modules of CiA 401


class SimulatedModule(ProfileDevice):
    """An I/O module of CiA 401, made from its EDS or DCF.

    Waveforms are on the terminals of its inputs. `outputs` are on the terminals of its outputs: by polarity and filter,
    and with the error values if a heartbeat is lost, the bus is lost or the module is stopped. A TPDO with inputs is
    sent on a change if one of the inputs may cause it (interrupt masks, limits and deltas).
    """

    def __init__(self, dictionary: Dictionary, **options: Any) -> None:
        self._values = DeviceValues(self)
        self._inputs: Inputs | None = None
        self._begun = False
        super().__init__(dictionary, **options)

    @property
    def outputs(self) -> dict[Address, int]:
        """The values on the terminals of its outputs, by the objects that command them."""
        return dict(self._outputs.terminals)

    def _application(self, dictionary: Dictionary) -> Application:
        application = super()._application(dictionary)
        kinds = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
        subs = ((kind.value, sub) for kind in kinds for sub in dictionary.members.get(kind.value, ()) if sub)
        # The terminal of an input has the value of a waveform, or the one it was given.
        ends = dict[Address, Callable[[], Value]]((each, partial(self._kept, each)) for each in subs)
        ends |= application.measured
        types = {each: data_type(self._variable(each)) for each in ends}
        return application._replace(
            measured={each: partial(self._input, each, types[each], read) for each, read in ends.items()}
        )

    def _kept(self, address: Address) -> Value:
        return self.device.objects.kept(address)

    def _input(self, address: Address, type_: DataType, read: Callable[[], Value]) -> Value:
        terminals = read()
        if self._inputs is None or not isinstance(terminals, int):
            return terminals
        return fitted(self._inputs.value(address, terminals, self.now), type_)

    def reset(self) -> None:
        """Start over: outputs have the file's defaults, no input has changed."""
        self._inputs, self._outputs, self._begun = Inputs(self._values), Outputs(self._values), False
        super().reset()

    # What is sent

    def _changed(self) -> list[Frame]:
        self.device.settle()
        operational = self.device.operational
        if operational and not self._begun:
            self._outputs.failed = False
        self._outputs.refresh()
        inputs, caused = self._inputs, set[Address]()
        if inputs is not None and operational:
            if not self._begun:
                inputs.forget()
            caused = inputs.caused({address: self.device.objects.raw(address) for address in inputs.addresses})
        # Each TPDO is sent once when it may first be sent, whatever causes it later (CiA 301, 7.2.2.4).
        allowed = None if operational and not self._begun else partial(self._may_go, caused)
        self._begun = operational
        return self.outgoing(self.device.changed(self.now, allowed))

    def _may_go(self, caused: set[Address], binding: Binding) -> bool:
        mapped = {each.address for each in binding.pdo.mapping}
        inputs = mapped & self._inputs.addresses if self._inputs else set()
        return not inputs or bool(inputs & caused)

    # Errors

    def _connection_lost(self) -> None:
        """Give the outputs their error values, as the error modes say (CiA 401-1, objects 0x6206 and 0x6443)."""
        self._outputs.fail()


# Drives of CiA 402


BEAT = 0.005
"""Seconds between two looks at a moving axis, for TPDOs that are sent on a change; any frame finds present values."""

SIMULATED_MODES = sum(1 << mode - 1 for mode in MODES if mode)
"""The bits in 0x6502 of the modes that are simulated: mode n has bit n - 1 (CiA 402-2, clause 9)."""


class SimulatedDrive(ProfileDevice):
    """A drive of CiA 402, made from its EDS or DCF: it is enabled, homes and moves as its objects say.

    `travel` gives the places of the limit switches, in turns of the motor from where it is switched on; without it
    there are none. The simulation reads the objects that the file has: state machine, option codes, profile position
    and velocity, homing, cyclic synchronous position and velocity, following error and software limits.
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
        """Return the offset of each axis that the file has, which is added to the indices."""
        found = (number * cia402.AXIS_STEP for number in range(cia402.MOST_AXES))
        return [each for each in found if dictionary.variable((cia402.CONTROLWORD + each, 0))]

    def _application(self, dictionary: Dictionary) -> Application:
        application = super()._application(dictionary)
        told, given = dict[Address, OnTold](), dict[Address, Value]()
        for number, offset in enumerate(self._offsets(dictionary)):
            told[cia402.MODE + offset, 0] = partial(self._check_mode, number)
            modes = cia402.SUPPORTED_MODES + offset, 0
            said = dictionary.default(modes) if dictionary.variable(modes) else None
            if isinstance(said, int):  # without what is not simulated: a master would choose it in vain
                given[modes] = said & SIMULATED_MODES
        return application._replace(told={**told, **application.told}, given={**given, **application.given})

    def _check_mode(self, number: int, mode: int) -> None:
        if self._axes and not self._axes[number].takes(mode):
            raise Refused(Cause.VALUES, f"the drive does not have the mode of operation {mode}")

    # Time and frames

    def reset(self) -> None:
        """Start over, with the motor where it was switched on."""
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
        # First: a SYNC has to find the present values, and what it brings acts from now on.
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
        self._beats = False  # the tick that calls this looks after the axes, and plans the next one

    # Connection

    def _connection_lost(self) -> None:
        """Obey the abort connection option code of each axis (CiA 402-2, clause 8.4.4)."""
        for axis in self._axes:
            axis.connection_lost()


# The class for a device


KINDS: Mapping[int, type[SimulatedDevice]] = {cia401.PROFILE: SimulatedModule, cia402.PROFILE: SimulatedDrive}
"""The classes by the low word of 0x1000."""


def simulated_kind(dictionary: Dictionary, profile: int | None = None) -> type[SimulatedDevice]:
    """Return the class that simulates a device of a `profile`, 0 for none; by default of the one in its 0x1000."""
    return KINDS.get(profile_of(dictionary.objects) if profile is None else profile, SimulatedDevice)
