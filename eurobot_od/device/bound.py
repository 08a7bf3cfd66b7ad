"""Objects that are bound to the application: reading one asks for what it measures, writing one commands it.

Or a node has an object as a setting, in its unit.

What an object's sub-indices mean is what the file's own PDO says, even if a master has remapped that PDO since. So an
SDO, a PDO under any mapping and the answer to a request all carry the bits of one message.
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
    """What an object of a node is bound to; its sub-indices are bound to fields of the same name.

    `read` gives the message with the object's present values. `write` is the type of message that writing it stands
    for.
    """

    read: Callable[[Any], Message] | None = None
    write: type[Message] | None = None


class Application(NamedTuple):
    """What a device's objects are bound to, by their ParameterNames.

    `readers` give messages with their present values. `writers` are the types of messages that writing them stands for.
    `act` acts on such a message, or raises Refused and has done nothing.

    Single objects are bound by their addresses: a `given` value replaces the file's, a `measured` one is asked for, and
    a new one is `told`.

    `overheard` gets each frame that somebody else sends under an identifier that is this device's own: of its TPDOs, of
    its heartbeat. Without it the device does not listen to them.
    """

    readers: Mapping[str, Callable[[], Message]] = MappingProxyType({})
    writers: Mapping[str, type[Message]] = MappingProxyType({})
    act: Callable[[Message], object] = lambda _: None
    given: Mapping[Address, Value] = NO_VALUES
    measured: Mapping[Address, Callable[[], Value]] = MappingProxyType({})
    told: Mapping[Address, OnTold] = TELL_NOBODY
    overheard: Callable[[Frame], object] | None = None


NO_APPLICATION = Application()
"""For a device without an application: its objects keep what was written or received last."""


class BoundObjects:
    """The bound objects of a device; `command` gets what writing one stands for, and may raise Abort or Refused."""

    def __init__(
        self,
        objects: Objects,
        catalogue: Catalogue,
        application: Application,
        command: Callable[[Binding, Message], object],
    ) -> None:
        self._objects, self._dictionary, self._catalogue = objects, objects.dictionary, catalogue
        self._application, self._command = application, command
        self._bindings: dict[type[Message], Binding] = {}  # filled when first asked for
        self._before: dict[int, dict[Address, Value]] = {}  # what the objects held before a part of them was written

    def readers(self) -> dict[int, OnRead]:
        """Return the functions that read bound objects, by index."""
        found = ((self._dictionary.data_index(name), read) for name, read in self._application.readers.items())
        measured: dict[int, OnRead] = {index: partial(self._measure, index) for index, _ in self._application.measured}
        return measured | {index: partial(self._read, index, read) for index, read in found if index is not None}

    def writers(self) -> dict[int, OnWrite]:
        """Return the functions that write bound objects, by index; slices of an object are written in the same way."""
        return {
            record: partial(self._write, index, message_type)
            for name, message_type in self._application.writers.items()
            if (index := self._dictionary.data_index(name)) is not None
            for record in (index, self._dictionary.data_index(name + SLICES))
            if record is not None
        }

    # A value

    def _measure(self, index: int, subindex: int) -> Value:
        measure = self._application.measured.get((index, subindex))
        return self._objects.kept((index, subindex)) if measure is None else measure()

    def _read(self, index: int, read: Callable[[], Message], subindex: int) -> Value:
        message = read()
        binding = self._binding(type(message))
        try:
            # Through the frame, so that an SDO reads exactly the bits that the PDO would carry.
            raw = binding.unpack(binding.encode(message).data)
        except FieldError as error:  # its own field cannot hold what it measures: not the client's fault
            raise Abort(Reason.MEASURED_VALUE, str(error)) from error
        fields = dict(self._fields(index, binding))
        if subindex not in fields:
            return self._objects.kept((index, subindex))
        type_ = data_type(self._dictionary.members[index][subindex])
        bits = raw[fields[subindex]]
        return type_.read(bits.to_bytes(type_.size, "little")) if type_ in REALS else bits

    def _fields(self, index: int, binding: Binding) -> Iterator[tuple[int, str]]:
        """Yield the sub-indices that are a field of the message, with its name."""
        for subindex, variable in self._dictionary.members[index].items():
            if (field := field_name(variable.name)) in binding.layout.fields:
                yield subindex, field

    def _binding(self, message_type: type[Message]) -> Binding:
        """Return how the file maps a message, in a PDO that need not be valid; raises Abort if it does not map it."""
        if message_type in self._bindings:
            return self._bindings[message_type]
        # By the file's defaults: a master may have remapped the PDO and taken the message apart.
        for pdo in self._dictionary.read_pdos(self._dictionary.default, lambda _: None):
            entry = self._catalogue.find(pdo.name)
            if entry is not None and entry.type is message_type:
                with suppress(MappingError):  # another PDO of the file may carry the same message
                    self._bindings[message_type] = Binding(self._dictionary.file, pdo, pdo.name, entry)
                    return self._bindings[message_type]
        raise Abort(Reason.NO_MESSAGE, f"the file has no PDO for {message_type.__name__}")

    # A command

    def _write(self, index: int, message_type: type[Message], address: Address, value: Value) -> None:
        """Keep a value. The last one of an object is the command; if it is refused, the object is as it was before."""
        values, own = self._objects.values, (index, address[0])  # a slice is kept in the whole
        # Noted when the first part is written: by the last one, half of the command is already in the objects.
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
        """Return the message with the values kept; raises Abort if one of its fields cannot hold its value."""
        kept = {field: self._bits_of((index, subindex)) for subindex, field in self._fields(index, binding)}
        try:
            message = binding.decode(binding.pack({f: value for f, value in kept.items() if isinstance(value, int)}))
        except FieldError as error:
            raise Abort(Reason.COMMAND_VALUES, str(error)) from error
        if wrong := flagged_fields(message):
            raise Abort(Reason.COMMAND_VALUES, f"out of range: {', '.join(wrong)}")
        return message

    def _bits_of(self, address: Address) -> Value:
        """Return a value as a PDO carries it: of a REAL its bits."""
        value, type_ = self._objects.kept(address), data_type(self._dictionary.members[address[0]][address[1]])
        return int.from_bytes(type_.write(value), "little") if type_ in REALS and value is not None else value


SHORTEST_PERIOD = 0.001
"""In seconds: what repeats after no time at all would always be due."""

ValueT = TypeVar("ValueT")

NumberOf: TypeAlias = Callable[[str], Any]
"""Gives the number in a setting, by its ParameterNames, `Record.Member`: an int, or a float of a REAL."""


class Setting(Generic[ValueT]):
    """The value that `read` makes of the numbers in the settings of a node with these `names`."""

    def __init__(self, names: Iterable[str], read: Callable[[NumberOf], ValueT]) -> None:
        self.names, self.read = tuple(names), read

    @overload
    def __get__(self, node: None, kind: type) -> Setting[ValueT]: ...

    @overload
    def __get__(self, node: object, kind: type | None = None) -> ValueT: ...

    def __get__(self, node: Any, kind: type | None = None) -> Setting[ValueT] | ValueT:
        return self if node is None else self.read(node.setting)


def setting(name: str) -> Setting[int]:
    """A number, as it is in the object: of a REAL32 a float."""
    return Setting([name], lambda number: number(name))


def seconds(name: str) -> Setting[float]:
    """A time in seconds, which the object has in milliseconds."""
    return Setting([name], lambda number: number(name) / 1000)


def period(name: str) -> Setting[float]:
    """The period of something that repeats, in seconds: never 0, whatever a file says."""
    return Setting([name], lambda number: max(number(name) / 1000, SHORTEST_PERIOD))


def scaled(name: str, unit: float) -> Setting[float]:
    """A number times a unit."""
    return Setting([name], lambda number: number(name) * unit)


def together(kind: Callable[..., ValueT], **parts: Setting[Any]) -> Setting[ValueT]:
    """A value with several fields, each of them a setting."""
    names = (name for each in parts.values() for name in each.names)
    return Setting(names, lambda number: kind(**{field: each.read(number) for field, each in parts.items()}))


def names_of(kind: type) -> set[str]:
    """Return the names of all settings that a class has."""
    found = (each for base in kind.__mro__ for each in vars(base).values() if isinstance(each, Setting))
    return {name for each in found for name in each.names}
