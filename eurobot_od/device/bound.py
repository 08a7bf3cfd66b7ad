"""Objects that are bound to the application: reading returns a measured value, writing is a command.

Also, objects as settings of a node, in their units. The meaning of an object's sub-indices comes from the file's own
PDO, even if a master has remapped it, so that SDOs, PDOs with any mapping, and answers carry the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from types import MappingProxyType
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar, overload

from eurobot_od.device.objects import NO_VALUES, TELL_NOBODY, Objects, OnRead, OnTold, OnWrite
from eurobot_od.errors import FieldError, MappingError, Refused
from eurobot_od.frame import Frame
from eurobot_od.od.objects import data_type
from eurobot_od.od.pdos import SLICES, carries_nothing
from eurobot_od.od.values import REALS, Address, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Catalogue, Message, field_name, flagged_fields
from eurobot_od.sdo.wire import Abort, Reason


class BoundObject(NamedTuple):
    """Binding of an object of a node; its sub-indices are bound to fields with their names.

    `read` returns the message with the object's present values. `write` is the message type that is handled when the
    object is written.
    """

    read: Callable[[Any], Message] | None = None
    write: type[Message] | None = None


class Application(NamedTuple):
    """Bindings of a device's objects, by ParameterName.

    `readers` return messages with present values. `writers` are the types of messages that are handled when objects are
    written. `act` handles such a message, or raises Refused without any effect.

    Single objects are bound by address: a `given` value replaces the file's, `measured` functions return the value,
    `told` functions are called with each new value.

    `overheard` is called with each frame of another node that has one of this device's own identifiers: those of its
    TPDOs and its heartbeat. Without it, the device does not receive them.
    """

    readers: Mapping[str, Callable[[], Message]] = MappingProxyType({})
    writers: Mapping[str, type[Message]] = MappingProxyType({})
    act: Callable[[Message], object] = lambda _: None
    given: Mapping[Address, Value] = NO_VALUES
    measured: Mapping[Address, Callable[[], Value]] = MappingProxyType({})
    told: Mapping[Address, OnTold] = TELL_NOBODY
    overheard: Callable[[Frame], object] | None = None


NO_APPLICATION = Application()
"""Bindings of a device without an application, whose objects keep the last value."""


class BoundObjects:
    """The bound objects of a device; `command` is called when one is written, and may raise Abort or Refused."""

    def __init__(
        self,
        objects: Objects,
        catalogue: Catalogue,
        application: Application,
        command: Callable[[Binding, Message], object],
    ) -> None:
        self._objects = objects
        self._dictionary = objects.dictionary
        self._catalogue = catalogue
        self._application, self._command = application, command
        self._bindings: dict[type[Message], Binding] = {}  # filled on first use
        self._before: dict[int, dict[Address, Value]] = {}  # values before a part of an object was written

    def readers(self) -> dict[int, OnRead]:
        """Return the functions that read bound objects, by index."""
        found = ((self._dictionary.data_index(name), read) for name, read in self._application.readers.items())
        measured: dict[int, OnRead] = {index: partial(self._measure, index) for index, _ in self._application.measured}
        return measured | {index: partial(self._read, index, read) for index, read in found if index is not None}

    def writers(self) -> dict[int, OnWrite]:
        """Return the functions that write bound objects and their slices, by index."""
        return {
            record: partial(self._write, index, message_type)
            for name, message_type in self._application.writers.items()
            if (index := self._dictionary.data_index(name)) is not None
            for record in (index, self._dictionary.data_index(name + SLICES))
            if record is not None
        }

    # Reading

    def _measure(self, index: int, subindex: int) -> Value:
        measure = self._application.measured.get((index, subindex))
        return self._objects.kept((index, subindex)) if measure is None else measure()

    def _read(self, index: int, read: Callable[[], Message], subindex: int) -> Value:
        message = read()
        binding = self._binding(type(message))
        try:
            # By way of a frame, so that an SDO reads exactly the bits of the PDO.
            raw = binding.unpack(binding.encode(message).data)
        except FieldError as error:  # the measured value does not fit its field
            raise Abort(Reason.MEASURED_VALUE, str(error)) from error
        fields = dict(self._fields(index, binding))
        if subindex not in fields:
            return self._objects.kept((index, subindex))
        type_ = data_type(self._dictionary.members[index][subindex])
        bits = raw[fields[subindex]]
        return type_.read(bits.to_bytes(type_.size, "little")) if type_ in REALS else bits

    def _fields(self, index: int, binding: Binding) -> Iterator[tuple[int, str]]:
        """Yield the sub-indices that are fields of the message, with the fields' names."""
        for subindex, variable in self._dictionary.members[index].items():
            if (field := field_name(variable.name)) in binding.layout.fields:
                yield subindex, field

    def _binding(self, message_type: type[Message]) -> Binding:
        """Return the file's mapping of a message, in a PDO that need not be valid; raises Abort without one."""
        if message_type in self._bindings:
            return self._bindings[message_type]
        # With the file's defaults, because a master may have remapped the PDO.
        for pdo in self._dictionary.read_pdos(self._dictionary.default, lambda _: None):
            entry = self._catalogue.find(pdo.name)
            if entry is not None and entry.type is message_type:
                with suppress(MappingError):  # another PDO of the file may carry the same message
                    self._bindings[message_type] = Binding(self._dictionary.file, pdo, pdo.name, entry)
                    return self._bindings[message_type]
        raise Abort(Reason.NO_MESSAGE, f"the file has no PDO for {message_type.__name__}")

    # Writing

    def _write(self, index: int, message_type: type[Message], address: Address, value: Value) -> None:
        """Keep a value; writing the last sub-index is the command. If it is refused, the object is restored."""
        values = self._objects.values  # a slice is kept in the whole value
        own = (index, address[0])
        # Noted when the first sub-index is written.
        before = self._before.setdefault(index, {each: values[each] for each in values if each[0] in own})
        self._objects.put(address, value)
        members = self._dictionary.members[address[0]].items()
        if address[1] == max(subindex for subindex, variable in members if not carries_nothing(variable.name)):
            del self._before[index]
            try:
                binding = self._binding(message_type)
                self._command(binding, self._message(index, binding))
            except (Abort, Refused):
                self._objects.values = {each: values[each] for each in values if each[0] not in own} | before
                raise

    def _message(self, index: int, binding: Binding) -> Message:
        """Return the message with the kept values; raises Abort if a value does not fit its field."""
        kept = {field: self._bits_of((index, subindex)) for subindex, field in self._fields(index, binding)}
        try:
            message = binding.decode(binding.pack({f: value for f, value in kept.items() if isinstance(value, int)}))
        except FieldError as error:
            raise Abort(Reason.COMMAND_VALUES, str(error)) from error
        if wrong := flagged_fields(message):
            raise Abort(Reason.COMMAND_VALUES, f"out of range: {', '.join(wrong)}")
        return message

    def _bits_of(self, address: Address) -> Value:
        """Return a value as a PDO carries it: for a REAL its bits."""
        value = self._objects.kept(address)
        type_ = data_type(self._dictionary.members[address[0]][address[1]])
        return int.from_bytes(type_.write(value), "little") if type_ in REALS and value is not None else value


SHORTEST_PERIOD = 0.001
"""Shortest period of a repeated action, in s."""

ValueT = TypeVar("ValueT")

NumberOf: TypeAlias = Callable[[str], Any]
"""Function from ParameterNames, `Record.Member`, to the number in a setting: an int, or a float for a REAL."""


class Setting(Generic[ValueT]):
    """A value that `read` makes from the settings of a node with these `names`."""

    def __init__(self, names: Iterable[str], read: Callable[[NumberOf], ValueT]) -> None:
        self.names = tuple(names)
        self.read = read

    @overload
    def __get__(self, node: None, kind: type) -> Setting[ValueT]: ...

    @overload
    def __get__(self, node: object, kind: type | None = None) -> ValueT: ...

    def __get__(self, node: Any, kind: type | None = None) -> Setting[ValueT] | ValueT:
        return self if node is None else self.read(node.setting)


def setting(name: str) -> Setting[int]:
    """Return the setting of a number as in the object; a float for a REAL32."""
    return Setting([name], lambda number: number(name))


def seconds(name: str) -> Setting[float]:
    """Return the setting of a time in s, which the object has in ms."""
    return Setting([name], lambda number: number(name) / 1000)


def period(name: str) -> Setting[float]:
    """Return the setting of a period in s, which is never 0."""
    return Setting([name], lambda number: max(number(name) / 1000, SHORTEST_PERIOD))


def scaled(name: str, unit: float) -> Setting[float]:
    """Return the setting of a number times a unit."""
    return Setting([name], lambda number: number(name) * unit)


def combined(kind: Callable[..., ValueT], **parts: Setting[Any]) -> Setting[ValueT]:
    """Return the setting of a value with several fields, each of them a setting."""
    names = (name for each in parts.values() for name in each.names)
    return Setting(names, lambda number: kind(**{field: each.read(number) for field, each in parts.items()}))


def names_of(kind: type) -> set[str]:
    """Return the names of all settings that a class has."""
    found = (each for base in kind.__mro__ for each in vars(base).values() if isinstance(each, Setting))
    return {name for each in found for name in each.names}
