"""A simulation of any device from its file: it has given values, or waveforms, and sends changes.

`device.Device` is the CANopen side. This module is the application: the source of values, and the sending of
event-driven TPDOs. After each frame and each tick, TPDOs whose contents have changed are sent as their transmission
type, inhibit time and NMT state allow. Values that change by themselves are sampled every `SAMPLING` s, and read for
each SDO, SYNC, event timer and remote frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf, isfinite, nan, pi, sin
from pathlib import Path
from random import Random
from typing import Annotated, Any, ClassVar, Self, TypeAlias

import yaml

from eurobot_od.device.bound import Application
from eurobot_od.device.lss import LssSlave
from eurobot_od.device.node import Node
from eurobot_od.device.objects import Store
from eurobot_od.errors import DictionaryError, FieldError, LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type, not_allowed
from eurobot_od.od.values import Address, DataType, Value, parse_number
from eurobot_od.support import yaml_shapes
from eurobot_od.support.yaml_places import Problems, compose, refuse, refuse_aliases, telling
from eurobot_od.support.yaml_shapes import DURATION, SCALAR, Shape, mapping, pairs_of, shape_of

ObjectName: TypeAlias = "str | Address"
"""An object by ParameterNames, such as `Motor.Speed`, or by index and sub-index."""


class SimulatedDevice(Node):
    """A simulated device, made from its EDS or DCF.

    A subclass may have `READERS`, functions that return values of objects, and `WRITERS`, functions that are called
    with each new value from an SDO or RPDO, and raise Refused for one that they do not accept. The first argument of
    both is the device, whose `now` is the time in s.

    Args:
        dictionary: the device's dictionary
        store: keeps the settings over a restart
        given: values that replace the file's
        waveforms: functions from time in s to an object's value
        lss: LSS slave, by which a master can set the node-ID

    Raises:
        DictionaryError: the file does not have a named object
    """

    READERS: ClassVar[Mapping[ObjectName, Callable[[Any], Value]]] = {}
    WRITERS: ClassVar[Mapping[ObjectName, Callable[[Any, Any], object]]] = {}
    SAMPLING: ClassVar[float] = 0.01

    def __init__(
        self,
        dictionary: Dictionary,
        *,
        store: Store | None = None,
        given: Mapping[ObjectName, Value] | None = None,
        waveforms: Mapping[ObjectName, Waveform] | None = None,
        lss: LssSlave | None = None,
    ) -> None:
        if not isinstance(dictionary, Dictionary):
            load = f"{type(self).__name__}.load(file, node_id)"
            raise LocalError(f"{dictionary!r} is not a Dictionary; `{load}` reads a file")
        self._dictionary = dictionary
        self._given = given or {}
        self._waveforms = waveforms or {}
        self._switched_on = 0.0
        super().__init__(dictionary, store=store, lss=lss)

    @classmethod
    def load(cls, file: str | Path, node_id: int | None = None, **options: Any) -> Self:
        """Return a device from an EDS or DCF.

        Args:
            file: the EDS or DCF
            node_id: node-ID; default: that of the DCF
            options: arguments of the class, such as `given` and `waveforms`

        Raises:
            DictionaryError: the file cannot be used
        """
        return cls(Dictionary.load(file, node_id), **options)

    @property
    def dictionary(self) -> Dictionary:
        """The dictionary of its file."""
        return self._dictionary

    # Values

    def value(self, name: ObjectName) -> Value:
        """Return an object's present value; raises DictionaryError for one that the file does not have."""
        with self.guard:
            return self.device.objects.value(self._address(name))

    def set_value(self, name: ObjectName, value: Value) -> None:
        """Set an object's value, from any thread, and send the changes; raises as `value`, and FieldError."""
        with self.guard:
            self.device.objects.put(*self._fitting(name, value))
            self.soon(lambda _: None)

    def _application(self, dictionary: Dictionary) -> Application:
        readers: dict[ObjectName, Callable[[Any], Value]] = {
            name: partial(lambda waveform, device: waveform(device.now - device._switched_on), waveform)
            for name, waveform in self._waveforms.items()
        }
        readers |= self.READERS  # have priority over waveforms
        measured = [(self._address(name), read) for name, read in readers.items()]
        application = super()._application(dictionary)
        return application._replace(
            given=dict(self._fitting(name, value) for name, value in self._given.items()),
            measured={address: partial(self._measure, address, read) for address, read in measured},
            told={self._address(name): partial(write, self) for name, write in self.WRITERS.items()},
        )

    def _measure(self, address: Address, read: Callable[[Any], Value]) -> Value:
        value, variable = read(self), self._variable(address)
        if isinstance(value, (int, float)):
            return fitted(value, data_type(variable))
        try:
            return value if value is None else self._fitting(address, value)[1]
        except FieldError as error:  # as a FieldError it would only be an abort, for whoever reads the object
            raise LocalError(f"READERS: {error}") from None

    def _address(self, name: ObjectName) -> Address:
        address = self._dictionary.address(name) if isinstance(name, str) else name
        self._variable(address)
        return address

    def _fitting(self, name: ObjectName, value: Value) -> tuple[Address, Value]:
        """Return an object's address and a value of its type; raises FieldError for a value of another type."""
        address = self._address(name)
        variable = self._variable(address)
        try:
            data_type(variable).write(value)
        except (ValueError, OverflowError):
            raise not_allowed(variable, value, data_type(variable).allowed) from None
        return address, value

    def _variable(self, address: Address) -> Any:
        variable = self._dictionary.variable(address)
        if variable is None:
            raise DictionaryError(self._dictionary.file, address[0], f"sub {address[1]} is missing")
        return variable

    # Sending

    def start(self, now: float) -> list[Frame]:
        return super().start(now) + self._changed()

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return super().receive(frame, now) + self._changed()

    def tick(self, now: float) -> list[Frame]:
        return super().tick(now) + self._changed()

    def _changed(self) -> list[Frame]:
        return self.device.pdo_service.changed(self.now)

    def reset(self) -> None:
        """Start over, waveforms included."""
        super().reset()
        self._switched_on = self.now
        if self._waveforms or self.READERS:
            self._sample(self.now)

    def _sample(self, now: float) -> None:
        """Sample the values that change by themselves, which each `tick` does."""
        self.at(now + self.SAMPLING, self._sample)


Waveform: TypeAlias = Callable[[float], float]
"""Function from time in s to value."""

Period: TypeAlias = Annotated[float, DURATION, yaml_shapes.longer_than_0]
"""Time in s; in the file a duration with its unit."""


def constant(value: float) -> Waveform:
    """Return a constant waveform."""
    return lambda _: value


def ramp(low: float, high: float, period: Period) -> Waveform:
    """Return a sawtooth from `low` to `high`, with its period in s."""
    return lambda time: low + (high - low) * (time / period % 1)


def sine(low: float, high: float, period: Period) -> Waveform:
    """Return a sine between `low` and `high`, which starts upwards from the middle."""
    return lambda time: (low + high) / 2 + (high - low) / 2 * sin(2 * pi * time / period)


def square(low: float, high: float, period: Period) -> Waveform:
    """Return a square wave: `low` for the first half of each period, `high` for the second."""
    return lambda time: low if time / period % 1 < 0.5 else high


def steps(values: Annotated[Sequence[float], yaml_shapes.filled], every: Period) -> Waveform:
    """Return a waveform of `values` in turn, each for `every` s."""
    return lambda time: values[int(time / every) % len(values)]


def walk(start: float, step: float, every: Period, seed: int = 1, low: float = -inf, high: float = inf) -> Waveform:
    """Return a random walk within limits: up to `step` up or down `every` s; the same for the same seed."""
    chance = Random(seed)
    steps_done = 0
    place = start

    def at(time: float) -> float:
        nonlocal chance, steps_done, place
        if time < steps_done * every:  # the time has been reset
            chance = Random(seed)
            steps_done = 0
            place = start
        # Every step, so that the walk does not depend on the sampling rate.
        for _ in range(int(time / every) - steps_done):
            place = min(max(place + chance.uniform(-step, step), low), high)
            steps_done += 1
        return place

    return at


def fitted(value: float, type_: DataType) -> Value:
    """Return a value as an object of a type stores it: an integer is rounded and limited to the type's range."""
    if not type_.is_integer:
        return value
    # `round` raises for infinity and NaN.
    return min(max(round(value), type_.low), type_.high) if isfinite(value) else type_.low


# The file


def _number(text: str) -> float:
    whole = parse_number(text)
    try:
        number = whole.value if whole and not whole.relative else float(text)
    except ValueError:
        number = nan
    if not isfinite(number):  # float() accepts `nan` and `inf` as well
        raise LocalError(f"expected a number, found {str(text)!r}")
    return number


NUMBER: Shape[float] = yaml_shapes.converted(SCALAR, _number)
WAVEFORMS: Mapping[str, Shape[Waveform]] = {
    each.__name__: shape_of(each, {float: NUMBER, int: NUMBER}) for each in (ramp, sine, square, steps, walk)
}
"""Shapes of waveforms, by name in the file."""


def _waveform(node: yaml.Node, problems: Problems) -> Waveform:
    if isinstance(node, yaml.ScalarNode):
        return constant(NUMBER.read(node, problems))
    pairs = pairs_of(node, problems)
    if len(pairs) != 1 or not pairs.keys() <= WAVEFORMS.keys():
        refuse(node, problems, f"expected a number or one of {', '.join(WAVEFORMS)}, found {', '.join(pairs)}")
    ((name, shape),) = pairs.items()
    return WAVEFORMS[name].read(shape, problems)


def read_waveforms(text: str, file: str) -> Mapping[str, Waveform]:
    """Parse the waveforms of a YAML text, by the names of their objects; `file` is its name in errors.

    Raises YamlError.
    """
    with telling(file) as problems:
        root = compose(text, problems)
        refuse_aliases(root, problems)
        return {str(name): each for name, each in mapping(Shape(_waveform), SCALAR).read(root, problems).items()}
