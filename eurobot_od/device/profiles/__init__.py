"""Simulated devices that have a profile, made from their files: modules of CiA 401 and drives of CiA 402.

They connect a device to its profile and decide nothing themselves: what an input or output does stands in `Outputs` and
`Inputs`, what a drive does in `axis`, `modes` and `motion`, which see objects through `AxisValues`, and know neither a
bus nor a clock. Whatever the objects hold then goes out as any other value does. The profiles' tables are in `od`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

from eurobot_od.device.bound import Application
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.objects import OnTold
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.modes import MODES
from eurobot_od.device.profiles.motion import STEP, AxisValues, Plant
from eurobot_od.device.reaction import Reaction
from eurobot_od.device.simulated import SimulatedDevice, fitted
from eurobot_od.errors import Cause, Refused
from eurobot_od.frame import Frame
from eurobot_od.od import cia401, cia402
from eurobot_od.od.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import SYNC_PERIOD
from eurobot_od.od.values import Address, DataType, Value
from eurobot_od.od.words import profile_of
from eurobot_od.pdo.binding import Binding

BLOCKS = range(1, 255)
"""Sub-indices of the blocks of inputs and outputs."""

DEFAULT_TRIGGER = 0b111
"""What causes the TPDO of an analogue input without 0x6421: both limits, and the delta."""


def _scaled(values: AxisValues, kind: AnalogueInputs | AnalogueOutputs, sub: int, value: int) -> int:
    """Return a value by the factor and offset of its channel (CiA 401-1, objects 0x6431, 0x6432, 0x6446, 0x6447)."""
    return value * values.get(kind.scaling, sub, 1) + values.get(kind.offset, sub)


def _blocks(values: AxisValues, index: int) -> Iterator[int]:
    return (sub for sub in BLOCKS if values.has(index, sub))


# Outputs


class Outputs:
    """The terminals of a module's outputs; `failed` tells whether they have their error values."""

    def __init__(self, values: AxisValues) -> None:
        self._values = values
        self._digital = [(kind, sub) for kind in cia401.DIGITAL_OUTPUTS for sub in _blocks(values, kind.value)]
        self._analogue = [(kind, sub) for kind in cia401.ANALOGUE_OUTPUTS for sub in _blocks(values, kind.value)]
        self.terminals: dict[Address, int] = {}
        self.failed = False
        self.refresh()

    def refresh(self) -> None:
        """Update the terminals from the objects."""
        for digital, sub in self._digital:
            self.terminals[digital.value, sub] = self.digital(digital, sub)
        for analogue, sub in self._analogue:
            # Error mode 0 keeps the value; without the object it is 1 (CiA 401-1, object 0x6443).
            fails = self.failed and self._values.get(analogue.error_mode, sub, 1) == 1
            commanded = self._values.get(analogue.error_value if fails else analogue.value, sub)
            # The factor comes last, as polarity does for a digital output.
            self.terminals[analogue.value, sub] = _scaled(self._values, analogue, sub, commanded)

    def digital(self, kind: DigitalOutputs, sub: int) -> int:
        """Return the value on the terminals of a block."""
        values, every = self._values, (1 << kind.bits) - 1
        value = values.get(kind.value, sub)
        if self.failed:
            # Bit by bit: a 1 in the error mode has the output take its error value (CiA 401-1, object 0x6206).
            mode = values.get(kind.error_mode, sub, every)
            value = value & ~mode | values.get(kind.error_value, sub) & mode
        # Polarity comes last, so an error value is inverted as well; a 0 in the filter holds what is on the terminal.
        terminal = (value ^ values.get(kind.polarity, sub)) & every
        passes = values.get(kind.filter, sub, every)
        return terminal & passes | self.terminals.get((kind.value, sub), 0) & ~passes


# Inputs


FILTER_TIME = 0.02
"""Seconds that a filtered input has to be steady before it counts; CiA 401-1 leaves the constant to the maker."""


class InputFilter:
    """The filter of a block of digital inputs, bit by bit: it hides what is shorter than `FILTER_TIME`."""

    def __init__(self, terminals: int) -> None:
        self._last = self._steady = terminals
        self._since: dict[int, float] = {}

    def passed(self, terminals: int, now: float) -> int:
        """Return the terminals as they have been for long enough."""
        changed = terminals ^ self._last
        self._since |= {bit: now for bit in range(changed.bit_length()) if changed >> bit & 1}
        self._last = terminals
        for bit in [bit for bit, since in self._since.items() if now - since >= FILTER_TIME - 1e-9]:
            del self._since[bit]
            self._steady = self._steady & ~(1 << bit) | terminals & 1 << bit
        return self._steady


class Inputs:
    """A module's inputs: what its objects say about their terminals, and which of them cause TPDOs."""

    def __init__(self, values: AxisValues) -> None:
        self._values = values
        digital, analogue = cia401.DIGITAL_INPUTS, cia401.ANALOGUE_INPUTS
        self.digital = {(kind.value, sub): kind for kind in digital for sub in _blocks(values, kind.value)}
        self._analogue = {(kind.value, sub): kind for kind in analogue for sub in _blocks(values, kind.value)}
        self._seen: dict[Address, int] = {}
        self._filters: dict[Address, InputFilter] = {}

    @property
    def addresses(self) -> set[Address]:
        """The objects that are inputs."""
        return {*self.digital, *self._analogue}

    def value(self, address: Address, terminals: int, now: float) -> int:
        """Return an input's value from the value on its terminals: filtered and by polarity, or scaled."""
        sub, digital, analogue = address[1], self.digital.get(address), self._analogue.get(address)
        if analogue is not None:
            return _scaled(self._values, analogue, sub, terminals)
        if digital is None:
            return terminals
        filtered = self._values.get(digital.filter, sub)
        # Always asked, so that a filter that is switched on knows the input's past.
        steady = self._filters.setdefault(address, InputFilter(terminals)).passed(terminals, now)
        return (steady & filtered | terminals & ~filtered) ^ self._values.get(digital.polarity, sub)

    def forget(self) -> None:
        """Start over: the present inputs cause no TPDO."""
        self._seen.clear()

    def caused(self, present: Mapping[Address, int] = MappingProxyType({})) -> set[Address]:
        """Return the inputs that have caused a TPDO since this was last asked; `present` are their values."""
        causes = {address for address, value in present.items() if self._causes(address, value)}
        # An analogue input is compared with the last value sent, a digital one with its last value.
        taken = {*self.digital, *causes, *(present.keys() - self._seen.keys())}
        self._seen |= {address: value for address, value in present.items() if address in taken}
        return causes

    def _causes(self, address: Address, value: int) -> bool:
        last = self._seen.get(address)
        # The first value after a start causes nothing itself; later ones are compared with it.
        if last is None or last == value:
            return False
        digital = self.digital.get(address)
        return self.by_edge(digital, address[1], last, value) if digital else self._by_level(address[1], last, value)

    def by_edge(self, kind: DigitalInputs, sub: int, last: int, value: int) -> bool:
        """Compare with the masks of change, rising and falling edge (CiA 401-1, objects 0x6005 to 0x6008)."""
        values, every = self._values, (1 << kind.bits) - 1
        if not values.get(cia401.INTERRUPT_ENABLE, default=1):  # on by default
            return False
        change = values.get(kind.change, sub, every)
        rising, falling = values.get(kind.rising, sub), values.get(kind.falling, sub)
        return bool((last ^ value) & change | value & ~last & rising | last & ~value & falling)

    def _by_level(self, sub: int, last: int, value: int) -> bool:
        """Compare with the limits and deltas of an analogue input (CiA 401-1, objects 0x6421 to 0x6428)."""
        values = self._values
        if not values.get(cia401.ANALOGUE_INTERRUPT_ENABLE):  # off by default
            return False
        by = values.get(cia401.ANALOGUE_TRIGGER, sub, DEFAULT_TRIGGER)
        held = {
            0: value > values.get(cia401.ANALOGUE_UPPER, sub),
            1: value < values.get(cia401.ANALOGUE_LOWER, sub),
            2: abs(value - last) > values.get(cia401.ANALOGUE_DELTA, sub),
            3: last - value > values.get(cia401.ANALOGUE_FALL, sub),
            4: value - last > values.get(cia401.ANALOGUE_RISE, sub),
        }
        return any(by >> bit & 1 and holds for bit, holds in held.items())


class DeviceValues(AxisValues):
    """The objects of a node as its profile sees them; they survive a reset of the device."""

    def __init__(self, node: SimulatedDevice, dictionary: Dictionary, offset: int = 0) -> None:
        super().__init__(dictionary, offset)
        self._node = node

    def _value(self, address: Address) -> int | None:
        value = self._node.device.objects.kept(address)
        return value if isinstance(value, int) else None

    def _keep(self, address: Address, value: int) -> None:
        self._node.device.objects.put(address, value)


class ProfileDevice(SimulatedDevice):
    """A device whose profile says what it does when nobody can command it."""

    def _connection_lost(self) -> None:
        """Do what the profile says about a lost heartbeat, a lost bus, and the state Stopped."""

    _is_stopped = False

    def _react(self, reaction: Reaction) -> None:
        super()._react(reaction)
        # In Pre-operational a master can still reach it by SDO; in Stopped nobody can.
        was_stopped, self._is_stopped = self._is_stopped, self.device.state is NmtState.STOPPED
        if self._is_stopped and not was_stopped:
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
        self._values = DeviceValues(self, dictionary)
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
        measured = {each: partial(self._input, each, types[each], read) for each, read in ends.items()}
        return application._replace(measured=measured)

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
        self.device.pdo_service.settle()
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
        return self.device.pdo_service.changed(self.now, allowed)

    def _may_go(self, caused: set[Address], binding: Binding) -> bool:
        mapped = {each.address for each in binding.pdo.mapping}
        inputs = mapped & self._inputs.addresses if self._inputs else set()
        return not inputs or bool(inputs & caused)

    # Errors

    def _connection_lost(self) -> None:
        """Give the outputs their error values, as the error modes say (CiA 401-1, objects 0x6206 and 0x6443)."""
        self._outputs.failed = True
        self._outputs.refresh()


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
            told[cia402.CONTROLWORD + offset, 0] = partial(self._commanded, number)
            modes = cia402.SUPPORTED_MODES + offset, 0
            said = dictionary.default(modes) if dictionary.variable(modes) else None
            if isinstance(said, int):  # without what is not simulated: a master would choose it in vain
                given[modes] = said & SIMULATED_MODES
        return application._replace(told={**told, **application.told}, given={**given, **application.given})

    def _commanded(self, number: int, _: int) -> None:
        if self._axes:
            self._axes[number].commanded()

    def _check_mode(self, number: int, mode: int) -> None:
        if self._axes and not self._axes[number].takes(mode):
            raise Refused(Cause.VALUES, f"the drive does not have the mode of operation {mode}")

    # Time and frames

    def reset(self) -> None:
        """Start over, with the motor where it was switched on."""
        self._beats = False
        self._axes = tuple(
            self.AXIS(DeviceValues(self, self.dictionary, offset), self._plant, partial(self._report, number))
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
        self.device.pdo_service.settle()
        # 0x1006 is in microseconds (CiA 301, 7.5.2.6); 0 says that nobody sends SYNC.
        period = self.device.objects.number(SYNC_PERIOD) / 1_000_000 if self.dictionary.variable(SYNC_PERIOD) else 0.0
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
