"""Simulated devices with a profile, made from their files: modules of CiA 401 and drives of CiA 402.

They connect a device with its profile. Inputs and outputs are in `Outputs` and `Inputs`, drives in `axis`, `modes` and
`motion`, which access objects through `AxisValues`, without bus and clock. The profiles' tables are in `od`.
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
"""Default of 0x6421: both limits and the delta of an analogue input cause a TPDO."""


def _scaled(values: AxisValues, kind: AnalogueInputs | AnalogueOutputs, sub: int, value: int) -> int:
    """Return a value with its channel's factor and offset (CiA 401-1, objects 0x6431, 0x6432, 0x6446, 0x6447)."""
    return value * values.get(kind.scaling, sub, 1) + values.get(kind.offset, sub)


def _blocks(values: AxisValues, index: int) -> Iterator[int]:
    return (sub for sub in BLOCKS if values.has(index, sub))


# Outputs


class Outputs:
    """The terminals of a module's outputs; `failed` is set while they have their error values."""

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
            # Error mode 0 keeps the value; the default is 1 (CiA 401-1, object 0x6443).
            fails = self.failed and self._values.get(analogue.error_mode, sub, 1) == 1
            commanded = self._values.get(analogue.error_value if fails else analogue.value, sub)
            # The factor is applied last, like the polarity of a digital output.
            self.terminals[analogue.value, sub] = _scaled(self._values, analogue, sub, commanded)

    def digital(self, kind: DigitalOutputs, sub: int) -> int:
        """Return the value at the terminals of a block."""
        values = self._values
        every = (1 << kind.bits) - 1
        value = values.get(kind.value, sub)
        if self.failed:
            # An output whose error mode bit is 1 takes its error value (CiA 401-1, object 0x6206).
            mode = values.get(kind.error_mode, sub, every)
            value = value & ~mode | values.get(kind.error_value, sub) & mode
        # Polarity also inverts an error value; a 0 in the filter mask holds the terminal's value.
        terminal = (value ^ values.get(kind.polarity, sub)) & every
        passes = values.get(kind.filter, sub, every)
        return terminal & passes | self.terminals.get((kind.value, sub), 0) & ~passes


# Inputs


FILTER_TIME = 0.02
"""Filter time of inputs in s; in CiA 401-1 it is manufacturer-specific."""


class InputFilter:
    """Filter of a block of digital inputs; each bit must be steady for `FILTER_TIME`."""

    def __init__(self, terminals: int) -> None:
        self._last = self._steady = terminals
        self._since: dict[int, float] = {}

    def passed(self, terminals: int, now: float) -> int:
        """Return the filtered terminals."""
        changed = terminals ^ self._last
        self._since |= {bit: now for bit in range(changed.bit_length()) if changed >> bit & 1}
        self._last = terminals
        for bit in [bit for bit, since in self._since.items() if now - since >= FILTER_TIME - 1e-9]:
            del self._since[bit]
            self._steady = self._steady & ~(1 << bit) | terminals & 1 << bit
        return self._steady


class Inputs:
    """A module's inputs: values from their terminals, and which of them cause TPDOs."""

    def __init__(self, values: AxisValues) -> None:
        self._values = values
        digital, analogue = cia401.DIGITAL_INPUTS, cia401.ANALOGUE_INPUTS
        self.digital = {(kind.value, sub): kind for kind in digital for sub in _blocks(values, kind.value)}
        self._analogue = {(kind.value, sub): kind for kind in analogue for sub in _blocks(values, kind.value)}
        self._seen: dict[Address, int] = {}
        self._filters: dict[Address, InputFilter] = {}

    @property
    def addresses(self) -> set[Address]:
        """Addresses of the inputs."""
        return {*self.digital, *self._analogue}

    def value(self, address: Address, terminals: int, now: float) -> int:
        """Return an input's value from its terminals: filtered and with polarity, or scaled."""
        sub = address[1]
        digital = self.digital.get(address)
        analogue = self._analogue.get(address)
        if analogue is not None:
            return _scaled(self._values, analogue, sub, terminals)
        if digital is None:
            return terminals
        filtered = self._values.get(digital.filter, sub)
        # Always updated, so that the filter can be enabled at any time.
        steady = self._filters.setdefault(address, InputFilter(terminals)).passed(terminals, now)
        return (steady & filtered | terminals & ~filtered) ^ self._values.get(digital.polarity, sub)

    def forget(self) -> None:
        """Start over: the present inputs cause no TPDO."""
        self._seen.clear()

    def caused(self, present: Mapping[Address, int] = MappingProxyType({})) -> set[Address]:
        """Return the inputs that have caused a TPDO since the last call; `present` are their values."""
        causes = {address for address, value in present.items() if self._causes(address, value)}
        # An analogue input is compared with the last value sent, a digital one with its last value.
        taken = {*self.digital, *causes, *(present.keys() - self._seen.keys())}
        self._seen |= {address: value for address, value in present.items() if address in taken}
        return causes

    def _causes(self, address: Address, value: int) -> bool:
        last = self._seen.get(address)
        # The first value after a start causes no TPDO.
        if last is None or last == value:
            return False
        digital = self.digital.get(address)
        return self.by_edge(digital, address[1], last, value) if digital else self._by_level(address[1], last, value)

    def by_edge(self, kind: DigitalInputs, sub: int, last: int, value: int) -> bool:
        """Return whether a change causes a TPDO by the interrupt masks (CiA 401-1, objects 0x6005 to 0x6008)."""
        values = self._values
        every = (1 << kind.bits) - 1
        if not values.get(cia401.INTERRUPT_ENABLE, default=1):  # on by default
            return False
        change = values.get(kind.change, sub, every)
        rising, falling = values.get(kind.rising, sub), values.get(kind.falling, sub)
        return bool((last ^ value) & change | value & ~last & rising | last & ~value & falling)

    def _by_level(self, sub: int, last: int, value: int) -> bool:
        """Return whether a change causes a TPDO by limits and deltas (CiA 401-1, objects 0x6421 to 0x6428)."""
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
    """Objects of a node for its profile; they outlive resets of the device."""

    def __init__(self, node: SimulatedDevice, dictionary: Dictionary, offset: int = 0) -> None:
        super().__init__(dictionary, offset)
        self._node = node

    def _value(self, address: Address) -> int | None:
        value = self._node.device.objects.kept(address)
        return value if isinstance(value, int) else None

    def _keep(self, address: Address, value: int) -> None:
        self._node.device.objects.put(address, value)


class ProfileDevice(SimulatedDevice):
    """A device with a reaction of its profile to lost connections."""

    def _connection_lost(self) -> None:
        """Apply the profile's reaction to a lost heartbeat, a lost bus, and the state Stopped."""

    _is_stopped = False

    def _react(self, reaction: Reaction) -> None:
        super()._react(reaction)
        # In Stopped, unlike Pre-operational, no master can access it by SDO.
        was_stopped = self._is_stopped
        self._is_stopped = self.device.state is NmtState.STOPPED
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

    Waveforms are at the terminals of its inputs. `outputs` are the values at the terminals of its outputs, with
    polarity and filter, and with the error values if a heartbeat or the bus is lost or the module is stopped. A TPDO
    with inputs is sent on a change that one of its inputs may cause (interrupt masks, limits and deltas).
    """

    def __init__(self, dictionary: Dictionary, **options: Any) -> None:
        self._values = DeviceValues(self, dictionary)
        self._inputs: Inputs | None = None
        self._begun = False
        super().__init__(dictionary, **options)

    @property
    def outputs(self) -> dict[Address, int]:
        """Values at the terminals of its outputs, by their objects."""
        return dict(self._outputs.terminals)

    def _application(self, dictionary: Dictionary) -> Application:
        application = super()._application(dictionary)
        kinds = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
        subs = ((kind.value, sub) for kind in kinds for sub in dictionary.members.get(kind.value, ()) if sub)
        # The terminal of an input has the value of a waveform, or a given one.
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
        self._inputs = Inputs(self._values)
        self._outputs = Outputs(self._values)
        self._begun = False
        super().reset()

    # Sending

    def _changed(self) -> list[Frame]:
        self.device.pdo_service.settle()
        operational = self.device.operational
        if operational and not self._begun:
            self._outputs.failed = False
        self._outputs.refresh()
        inputs = self._inputs
        caused = set[Address]()
        if inputs is not None and operational:
            if not self._begun:
                inputs.forget()
            caused = inputs.caused({address: self.device.objects.raw(address) for address in inputs.addresses})
        # On entering OPERATIONAL, every TPDO is sent once (CiA 301, 7.2.2.4).
        allowed = None if operational and not self._begun else partial(self._may_go, caused)
        self._begun = operational
        return self.device.pdo_service.changed(self.now, allowed)

    def _may_go(self, caused: set[Address], binding: Binding) -> bool:
        mapped = {each.address for each in binding.pdo.mapping}
        inputs = mapped & self._inputs.addresses if self._inputs else set()
        return not inputs or bool(inputs & caused)

    # Errors

    def _connection_lost(self) -> None:
        """Set the outputs to their error values by error mode (CiA 401-1, objects 0x6206 and 0x6443)."""
        self._outputs.failed = True
        self._outputs.refresh()


# Drives of CiA 402


BEAT = 0.005
"""Time between two updates of a moving axis for event-driven TPDOs, in s; frames always have present values."""

SIMULATED_MODES = sum(1 << mode - 1 for mode in MODES if mode)
"""Bits of 0x6502 for the simulated modes: mode n has bit n - 1 (CiA 402-2, clause 9)."""


class SimulatedDrive(ProfileDevice):
    """A drive of CiA 402, made from its EDS or DCF, with simulated motion.

    The simulation supports the objects that the file has of: state machine, option codes, profile position and
    velocity, homing, cyclic synchronous position and velocity, following error and software limits.

    Args:
        dictionary: the drive's EDS or DCF
        travel: positions of the limit switches, in turns of the motor from where it is switched on; None: no switches
        options: arguments of SimulatedDevice
    """

    AXIS: ClassVar[type[DriveAxis]] = DriveAxis

    def __init__(self, dictionary: Dictionary, *, travel: tuple[float, float] | None = None, **options: Any) -> None:
        self._axes: tuple[DriveAxis, ...] = ()
        self._plant = Plant(travel)
        self._beats = False
        super().__init__(dictionary, **options)

    @property
    def axes(self) -> tuple[DriveAxis, ...]:
        """The axes, the first one at index 0x6000."""
        return self._axes

    def _offsets(self, dictionary: Dictionary) -> list[int]:
        """Return the offset of the indices of each axis in the file."""
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
            if isinstance(said, int):  # only simulated modes
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
        # First, because a SYNC needs the present values.
        for axis in self._axes:
            axis.advance(now)
        return super().receive(frame, now)

    def _changed(self) -> list[Frame]:
        self.device.pdo_service.settle()
        # 0x1006 is in us (CiA 301, 7.5.2.6); 0: no SYNC.
        period = self.device.objects.number(SYNC_PERIOD) / 1_000_000 if self.dictionary.variable(SYNC_PERIOD) else 0.0
        for axis in self._axes:
            axis.sync_period = period or STEP
            axis.control(self.now)
        if not self._beats and any(axis.busy for axis in self._axes):
            self._beats = True
            self.at(self.now + BEAT, self._beat)
        return super()._changed() + self._flush()

    def _beat(self, _: float) -> None:
        self._beats = False  # the tick that calls this updates the axes, and plans the next one

    # Connection

    def _connection_lost(self) -> None:
        """Apply the abort connection option code of each axis (CiA 402-2, clause 8.4.4)."""
        for axis in self._axes:
            axis.connection_lost()


# Class of a device


KINDS: Mapping[int, type[SimulatedDevice]] = {cia401.PROFILE: SimulatedModule, cia402.PROFILE: SimulatedDrive}
"""Classes by the low word of 0x1000."""


def simulated_kind(dictionary: Dictionary, profile: int | None = None) -> type[SimulatedDevice]:
    """Return the class that simulates a device with a `profile`, 0 for none; default: the one in its 0x1000."""
    return KINDS.get(profile_of(dictionary.objects) if profile is None else profile, SimulatedDevice)
