"""Objects of a node, read and written by name with their types, limits, units and words.

    drive["Profile velocity"].value = 1500        # FieldError outside the limits, before anything is sent
    drive["Profile velocity"].value = "1500 rpm"  # as a person writes it, if the file has the unit
    drive["Motion"]["Maximum speed"].value        # or drive["Motion.Maximum speed"], drive[0x2101, 1]

`bytes` are what the SDO carries, `raw` is the number in them, and `value` is what the number means: `raw` times the
Factor of the object, if the file gives one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from canopen.objectdictionary import ObjectDictionary, ODVariable

from eurobot_od.client.configure import read_object
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.procedure import finished
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.objects import (
    Range,
    address_of,
    at,
    data_type,
    decode,
    encode,
    find,
    is_described,
    label,
    limits,
    members,
    not_allowed,
    parse,
    written,
)
from eurobot_od.od.profiles.words import with_words, words
from eurobot_od.od.values import Address, Value
from eurobot_od.support.progress import Progress, unwatched

ObjectKey: TypeAlias = "str | int | Address"
"""An object's name, a number as a person writes it, an index, or an index and sub-index."""

Content: TypeAlias = bytes
"""Bytes, under a name that no property has taken."""

Wrote: TypeAlias = Callable[["ODVariable", bytes], object]


def found_variables(key: ObjectKey, objects: ObjectDictionary | None) -> list[ODVariable]:
    """Return the variables that a key names: one, or all of a record; raises UnknownName, LocalError."""
    if isinstance(key, str):
        return find(key, objects)
    if isinstance(key, int):
        return (members(objects, key) if objects is not None else []) or [at((key, 0), objects)]
    return [at(key, objects)]


class ObjectAtNode:
    """The common part of the objects of both kinds of networks; nothing in here talks to the node."""

    def __init__(self, node: RemoteNode, variables: Sequence[ODVariable], wrote: Wrote) -> None:
        self._node, self._variables, self._wrote = node, variables, wrote

    @property
    def od(self) -> ODVariable:
        """Canopen's variable; raises LocalError for a record."""
        if len(self._variables) != 1:
            names = ", ".join(map(label, self._variables))
            raise LocalError(f"0x{self._variables[0].index:04X} is not one object but a record of {names}")
        return self._variables[0]

    @property
    def address(self) -> Address:
        """Index and sub-index."""
        return address_of(self.od)

    @property
    def name(self) -> str:
        """The ParameterName in the file, `Record.Member`; empty without a file."""
        name: str = self.od.qualname
        return name

    @property
    def unit(self) -> str:
        """The Unit in the file, which is not a key of CiA 306; empty without one."""
        unit: str = self.od.unit
        return unit

    @property
    def limits(self) -> Range | None:
        """The least and the greatest `raw` value, by limits and type; None for anything but a number."""
        return limits(self.od)

    @property
    def words(self) -> dict[int, str]:
        """The meanings of its values: canopen's `value_descriptions`."""
        words: dict[int, str] = self.od.value_descriptions
        return words

    def __str__(self) -> str:
        return ", ".join(map(label, self._variables))

    def _member(self, key: str | int) -> list[ODVariable]:
        found = [each for each in self._variables if key in (each.subindex, each.name)]
        if not found:
            raise UnknownName(f"member of 0x{self._variables[0].index:04X}", key, [v.name for v in self._variables])
        return found

    def _meant(self, raw: Value) -> Any:
        """Return the meaning of a raw value."""
        factor = self.od.factor
        return raw * factor if isinstance(raw, (int, float)) and factor != 1 else raw

    def _bytes_of(self, value: Any) -> bytes:
        """Return the bytes of a value that a program gives; raises FieldError."""
        thing = self.od
        if isinstance(value, bytes):
            return value
        if not is_described(thing):
            raise not_allowed(thing, value, "bytes: no file says its type")
        if isinstance(value, str):
            return encode(thing, self._raw_of_text(value))
        if isinstance(value, (int, float)) and thing.factor != 1:
            value = self._unscaled(value)
        return encode(thing, value)

    def _raw_of_text(self, text: str) -> Value:
        """Return the raw value of a text: a word, a number with or without its unit, or a text itself."""
        for raw, word in self.words.items():
            if word.casefold() == text.strip().casefold():
                return raw
        # A person may write what was shown before, which includes the unit.
        number = text.strip().removesuffix(self.unit).strip() if self.unit else text
        value = parse(self.od, number)
        return self._unscaled(value) if isinstance(value, (int, float)) and self.od.factor != 1 else value

    def _unscaled(self, value: float) -> Value:
        raw = value / self.od.factor
        return round(raw) if data_type(self.od).is_integer else raw

    def text_of(self, raw: Value) -> str:
        """Return a raw value as text, with its word or its unit."""
        if isinstance(raw, int) and raw in self.words:
            return self.words[raw]
        value = self._meant(raw)
        return with_words(f"{written(self.od, value)} {self.unit}".rstrip(), words(self.od, raw))

    async def _read(self) -> bytes:
        return await read_object.steps(self._node, self.od)

    async def _read_block(self, progress: Progress) -> bytes:
        return await self._node.upload_block.steps(self.address, self.name, progress)

    async def _write(self, data: bytes, progress: Progress = unwatched) -> None:
        await self._node.download.steps(self.address, data, self.name, progress=progress)
        self._wrote(self.od, data)


class RemoteObject(ObjectAtNode):
    """An object of a node of a `Network`, or a record of them.

    Every read and write is an SDO transfer, and raises NodeRefused (the node aborts, with the reason in words),
    NoAnswer, WrongAnswer, BusError. Writing also raises FieldError for a value that type or limits do not allow, before
    anything is sent. Errors name node and object.
    """

    def __getitem__(self, key: str | int) -> RemoteObject:
        """Return a member of a record by its name or sub-index; raises UnknownName."""
        return RemoteObject(self._node, self._member(key), self._wrote)

    def __iter__(self) -> Iterator[RemoteObject]:
        return (RemoteObject(self._node, [each], self._wrote) for each in self._variables)

    def read(self) -> Any:
        """Return `value`."""
        return self._meant(decode(self.od, finished(self._read())))

    def write(self, value: Any) -> None:
        """Set `value`."""
        finished(self._write(self._bytes_of(value)))

    @property
    def value(self) -> Any:
        """The value of the object's type: int, float, str or bytes; in the file's unit if it has a Factor."""
        return self.read()

    @value.setter
    def value(self, value: Any) -> None:
        self.write(value)

    @property
    def raw(self) -> Any:
        """The value without the Factor."""
        return decode(self.od, finished(self._read()))

    @raw.setter
    def raw(self, value: Value) -> None:
        finished(self._write(encode(self.od, value)))

    @property
    def bytes(self) -> Content:
        """The bytes of the SDO; what is written is not checked."""
        return finished(self._read())

    @bytes.setter
    def bytes(self, data: Content) -> None:
        finished(self._write(data))

    @property
    def text(self) -> str:
        """The value as text: `1500 rpm`, or its word."""
        return self.text_of(self.raw)

    def read_block(self, progress: Progress = unwatched) -> Content:
        """Read a long object by block transfer, or by segments if the node has none; `progress` gets bytes so far."""
        return finished(self._read_block(progress))


class AsyncRemoteObject(ObjectAtNode):
    """An object of a node of an `AsyncNetwork`, or a record: `await object.read()`, `await object.write(5)`.

    Every read and write is an SDO transfer, and raises the same errors as RemoteObject. `value`, `raw`, `bytes` and
    `text` are awaited and can only be read: a property cannot be written in an event loop.
    """

    def __getitem__(self, key: str | int) -> AsyncRemoteObject:
        """Return a member of a record by its name or sub-index; raises UnknownName."""
        return AsyncRemoteObject(self._node, self._member(key), self._wrote)

    def __iter__(self) -> Iterator[AsyncRemoteObject]:
        return (AsyncRemoteObject(self._node, [each], self._wrote) for each in self._variables)

    async def read(self) -> Any:
        """Return the value of the object's type: int, float, str or bytes; in the file's unit if it has a Factor."""
        return self._meant(decode(self.od, await self._read()))

    async def write(self, value: Any) -> None:
        """Write a value that type and limits allow; raises FieldError for any other."""
        await self._write(self._bytes_of(value))

    @property
    async def value(self) -> Any:
        """The same as `read` returns."""
        return await self.read()

    @property
    async def raw(self) -> Any:
        """The value without the Factor."""
        return decode(self.od, await self._read())

    @property
    async def bytes(self) -> Content:
        """The bytes of the SDO."""
        return await self._read()

    @property
    async def text(self) -> str:
        """The value as text: `1500 rpm`, or its word."""
        return self.text_of(await self.raw)

    async def read_block(self, progress: Progress = unwatched) -> Content:
        """Read a long object by block transfer, or by segments if the node has none; `progress` gets bytes so far."""
        return await self._read_block(progress)
