"""Anybody's device, run from its file: it has the values that it is given, and sends what changes.

Theory of operation. The device itself (`device.Device`) does everything that CANopen asks for. This file adds what an
application would: where values come from, and when an event-driven TPDO is sent. After each frame and each tick the
device is asked for the TPDOs whose contents have changed, and these are sent as their transmission type, inhibit time
and NMT state allow. A value that changes by itself is looked at every `SAMPLING` seconds; an SDO, a SYNC, an event
timer and a remote frame ask for it when they come.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self, TypeAlias

from eurobot_od.device.bound import Application
from eurobot_od.device.node import Node
from eurobot_od.device.storage import Store
from eurobot_od.device.waveforms import Waveform, fitted
from eurobot_od.errors import DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import Address, Value

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
    ) -> None:
        self._dictionary, self._given, self._waveforms = dictionary, given or {}, waveforms or {}
        self._switched_on = 0.0
        super().__init__(dictionary, store=store)

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
        return (
            super()
            ._application(dictionary)
            ._replace(
                given={self._address(name): value for name, value in self._given.items()},
                measured={address: partial(self._measure, address, read) for address, read in measured},
                told={self._address(name): partial(write, self) for name, write in self.WRITERS.items()},
            )
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
        return self.outgoing(self.device.changed(self.now))

    def reset(self) -> None:
        """Start over, and the waveforms as well."""
        super().reset()
        self._switched_on = self.now
        if self._waveforms or self.READERS:
            self._sample(self.now)

    def _sample(self, now: float) -> None:
        """Look at what changes by itself, which each `tick` does."""
        self.at(now + self.SAMPLING, self._sample)
