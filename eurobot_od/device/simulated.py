"""Anybody's device, run from its file: it has the values that it is given, or waveforms, and sends what changes.

Theory of operation. The device itself (`device.Device`) does everything that CANopen asks for. This file adds what an
application would: where values come from, and when an event-driven TPDO is sent. After each frame and each tick the
device is asked for the TPDOs whose contents have changed, and these are sent as their transmission type, inhibit time
and NMT state allow. A value that changes by itself is looked at every `SAMPLING` seconds; an SDO, a SYNC, an event
timer and a remote frame ask for it when they come.
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
from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import Address, DataType, Value, parse_number
from eurobot_od.support import yaml_shapes
from eurobot_od.support.yaml_places import Problems, compose, refuse, refuse_aliases, telling
from eurobot_od.support.yaml_shapes import DURATION, SCALAR, Shape, mapping, pairs_of, shape_of

ObjectName: TypeAlias = "str | Address"
"""An object by its ParameterNames, such as `Motor.Speed`, or by index and sub-index."""


class SimulatedDevice(Node):
    """A device, made from its EDS or DCF.

    A program of its own is a subclass with `READERS`, which give the values of objects, and `WRITERS`, which get each
    new value that an SDO or an RPDO brings, and raise Refused for one they do not accept. Both get the device, whose
    `now` is the time in seconds. For all other objects, `given` values replace the file's, and `waveforms` are asked
    for theirs. Raises DictionaryError for an object that the file does not have.
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
        self._dictionary, self._given, self._waveforms = dictionary, given or {}, waveforms or {}
        self._switched_on = 0.0
        super().__init__(dictionary, store=store, lss=lss)

    @classmethod
    def load(cls, file: str | Path, node_id: int | None = None, **options: Any) -> Self:
        """Make a device from an EDS or DCF file; `options` are those of the class. Raises DictionaryError."""
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
        """Give an object a value, from any thread, and send what this changes; raises the errors of `value`."""
        with self.guard:
            self.device.objects.put(self._address(name), value)
            self.soon(lambda _: None)

    def _application(self, dictionary: Dictionary) -> Application:
        readers: dict[ObjectName, Callable[[Any], Value]] = {
            name: partial(lambda waveform, device: waveform(device.now - device._switched_on), waveform)
            for name, waveform in self._waveforms.items()
        }
        readers |= self.READERS  # after the waveforms: a program's own reader takes precedence
        measured = [(self._address(name), read) for name, read in readers.items()]
        application = super()._application(dictionary)
        return application._replace(
            given={self._address(name): value for name, value in self._given.items()},
            measured={address: partial(self._measure, address, read) for address, read in measured},
            told={self._address(name): partial(write, self) for name, write in self.WRITERS.items()},
        )

    def _measure(self, address: Address, read: Callable[[Any], Value]) -> Value:
        value = read(self)
        return fitted(value, data_type(self._variable(address))) if isinstance(value, (int, float)) else value

    def _address(self, name: ObjectName) -> Address:
        address = self._dictionary.address(name) if isinstance(name, str) else name
        self._variable(address)
        return address

    def _variable(self, address: Address) -> Any:
        variable = self._dictionary.variable(address)
        if variable is None:
            raise DictionaryError(self._dictionary.file, address[0], f"sub {address[1]} is missing")
        return variable

    # What is sent

    def start(self, now: float) -> list[Frame]:
        return super().start(now) + self._changed()

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return super().receive(frame, now) + self._changed()

    def tick(self, now: float) -> list[Frame]:
        return super().tick(now) + self._changed()

    def _changed(self) -> list[Frame]:
        return self.device.pdo_service.changed(self.now)

    def reset(self) -> None:
        """Start over, and the waveforms as well."""
        super().reset()
        self._switched_on = self.now
        if self._waveforms or self.READERS:
            self._sample(self.now)

    def _sample(self, now: float) -> None:
        """Look at what changes by itself, which each `tick` does."""
        self.at(now + self.SAMPLING, self._sample)


Waveform: TypeAlias = Callable[[float], float]
"""Gives the value at a time in seconds."""

Period: TypeAlias = Annotated[float, DURATION, yaml_shapes.longer_than_0]
"""In seconds; in the file a duration with its unit."""


def constant(value: float) -> Waveform:
    """A waveform that does not change."""
    return lambda _: value


def ramp(low: float, high: float, period: Period) -> Waveform:
    """Rises from `low` to `high` in each period, in seconds, and drops back to `low` at once."""
    return lambda time: low + (high - low) * (time / period % 1)


def sine(low: float, high: float, period: Period) -> Waveform:
    """Swings between `low` and `high`, starting upwards from the middle."""
    return lambda time: (low + high) / 2 + (high - low) / 2 * sin(2 * pi * time / period)


def square(low: float, high: float, period: Period) -> Waveform:
    """`low` for the first half of each period, `high` for the second."""
    return lambda time: low if time / period % 1 < 0.5 else high


def steps(values: Annotated[Sequence[float], yaml_shapes.filled], every: Period) -> Waveform:
    """One value after the other, each for `every` seconds, then from the beginning."""
    return lambda time: values[int(time / every) % len(values)]


def walk(start: float, step: float, every: Period, seed: int = 1, low: float = -inf, high: float = inf) -> Waveform:
    """A random walk within limits: up to `step` up or down `every` so many seconds, the same for the same seed."""
    chance, steps_done, place = Random(seed), 0, start

    def at(time: float) -> float:
        nonlocal chance, steps_done, place
        if time < steps_done * every:  # the time has started over
            chance, steps_done, place = Random(seed), 0, start
        # Every step, however seldom anybody looks: the same seed must give the same walk at any sampling rate.
        for _ in range(int(time / every) - steps_done):
            place = min(max(place + chance.uniform(-step, step), low), high)
            steps_done += 1
        return place

    return at


def fitted(value: float, type_: DataType) -> Value:
    """Return what an object of a type holds of a value: an integer is rounded, and kept within the type's range."""
    if not type_.is_integer:
        return value
    # A user's function may return infinity or NaN, for which round() raises.
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
"""The reader of each waveform, by its name in the file."""


def _waveform(node: yaml.Node, problems: Problems) -> Waveform:
    if isinstance(node, yaml.ScalarNode):
        return constant(NUMBER.read(node, problems))
    pairs = pairs_of(node, problems)
    if len(pairs) != 1 or not pairs.keys() <= WAVEFORMS.keys():
        refuse(node, problems, f"expected a number or one of {', '.join(WAVEFORMS)}, found {', '.join(pairs)}")
    ((name, shape),) = pairs.items()
    return WAVEFORMS[name].read(shape, problems)


def read_waveforms(text: str, file: str) -> Mapping[str, Waveform]:
    """Read the waveforms of a YAML text by the names of their objects; `file` is its name in errors.

    Raises YamlError.
    """
    with telling(file) as problems:
        root = compose(text, problems)
        refuse_aliases(root, problems)
        return {str(name): each for name, each in mapping(Shape(_waveform), SCALAR).read(root, problems).items()}
