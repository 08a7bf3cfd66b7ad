"""A device's object dictionary as its EDS or DCF describes it, and the PDOs in it.

Rule of this file: files are read by the `canopen` package and by nothing else. canopen gives objects, defaults and
limits; whatever it lets pass in silence and a PDO needs (a mapped object that is missing, a value that is not there)
stops the load with file and index. A file's bytes are handed on as they are, never looked into.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.errors import DictionaryError, MappingError
from eurobot_od.od.pdos import PADDING, MappedObject, Pdo
from eurobot_od.od.values import (
    BASE_IDENTIFIER,
    DUMMIES,
    EXTENDED,
    MAPPING_OFFSET,
    NOT_VALID,
    PDO_COUNT,
    SLICE,
    Address,
    Limits,
    PdoDirection,
    Value,
)

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODVariable

NODE_ID: Address = (0x2100, 1)
"""Where a node keeps its own node-ID, among its settings."""


DATA = 0x2000
"""First index of manufacturer-specific objects (CiA 301, 7.4.1), where the messages' data is."""

SLICES = " slices"
"""End of the ParameterName of a record that holds another record's values in parts."""

ALL_BITS = (1 << 64) - 1
"""HighLimit of an object without one: whatever its width allows."""


class Part(NamedTuple):
    """What a slice is: `bits` bits of the object `whole`, from its bit `low` on."""

    whole: ODVariable
    low: int
    bits: int


class Dictionary:
    """A loaded EDS or DCF: `file`, `node_id`, `name` (the file's stem) and canopen's `objects`."""

    def __init__(self, file: Path, objects: ObjectDictionary, node_id: int) -> None:
        self.file, self.objects, self.node_id = file, objects, node_id
        self.name = file.stem
        self._addresses: dict[str, Address] = {}

    @classmethod
    def load(cls, file: str | Path, node_id: int | None = None) -> Dictionary:
        """Read an EDS or DCF; without `node_id` the file's own default node-ID is taken.

        Raises DictionaryError if the file cannot be read as an EDS.
        """
        path = Path(file)
        objects = _import(path)
        number = (objects.node_id or _default(objects, NODE_ID)) if node_id is None else node_id
        if not isinstance(number, int) or not 1 <= number <= 127:
            raise DictionaryError(path, None, f"node-ID {number!r} is not in 1..127")
        _resolve_node_id(path, objects, number)
        return cls(path, objects, number)

    def renumbered(self, node_id: int) -> Dictionary:
        """Return the same file's dictionary for another node-ID."""
        from copy import deepcopy

        objects = deepcopy(self.objects)
        _resolve_node_id(self.file, objects, node_id)
        return Dictionary(self.file, objects, node_id)

    @cached_property
    def content(self) -> bytes:
        """The file as it is, for a device to serve; raises DictionaryError if it is gone."""
        try:
            return self.file.read_bytes()
        except OSError as error:
            raise DictionaryError(self.file, None, error.strerror or str(error)) from error

    def variable(self, address: Address) -> ODVariable | None:
        """Return canopen's variable at an index and sub-index, None if there is none."""
        return _variable(self.objects, address)

    def default(self, address: Address) -> Value:
        """Return an object's ParameterValue (DCF) or DefaultValue; None if it has neither."""
        return _default(self.objects, address)

    def address(self, name: str) -> Address:
        """Return index and sub-index of `record.member` or `object` by ParameterName.

        Raises DictionaryError if there is none of that name.
        """
        if name not in self._addresses:
            self._addresses[name] = self._find(name)
        return self._addresses[name]

    def _find(self, name: str) -> Address:
        try:
            found = self.objects[name]
        except KeyError:
            raise DictionaryError(self.file, None, f"no object is named {name!r}") from None
        return found.index, getattr(found, "subindex", 0)

    @cached_property
    def pdos(self) -> tuple[Pdo, ...]:
        """All PDOs with their default communication and mapping parameters; see `read_pdos`."""
        return self.read_pdos(self.default)

    def read_pdos(self, value: Callable[[Address], Value]) -> tuple[Pdo, ...]:
        """Read RPDOs, then TPDOs, from the parameter values that `value` gives.

        Raises MappingError with file and index if a mapping does not hold.
        """
        return tuple(
            self._pdo(direction, index, value) for direction in PdoDirection for index in self._records(direction)
        )

    def _records(self, direction: PdoDirection) -> Iterator[int]:
        return (i for i in range(direction.value, direction.value + PDO_COUNT) if i in self.objects)

    def _pdo(self, direction: PdoDirection, index: int, value: Callable[[Address], Value]) -> Pdo:
        entry = self._number((index, 1), value)
        if entry & EXTENDED:
            raise MappingError(self.file, index, f"COB-ID 0x{entry:08X} asks for a 29-bit identifier")
        return Pdo(
            direction=direction,
            index=index,
            name=self.objects[index].name,
            cob_id=entry & BASE_IDENTIFIER,
            valid=not entry & NOT_VALID,
            transmission_type=self._number((index, 2), value),
            mapping=tuple(self._mapping(index + MAPPING_OFFSET, value)),
        )

    def _mapping(self, index: int, value: Callable[[Address], Value]) -> Iterator[MappedObject]:
        for subindex in range(1, self._number((index, 0), value) + 1):
            entry = self._number((index, subindex), value)
            yield self.mapped_object(index, entry)

    def mapped_object(self, mapping_index: int, entry: int) -> MappedObject:
        """Return what a mapping entry (index, sub-index, length in one UNSIGNED32) stands for.

        Raises MappingError if the object is missing or longer than its type.
        """
        index, subindex, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
        if index in DUMMIES:
            return MappedObject(index, subindex, bits, PADDING, Limits(0, 0))
        variable = self.variable((index, subindex))
        where = f"maps 0x{index:04X} sub {subindex}"
        if variable is None:
            raise MappingError(self.file, mapping_index, f"{where}, which is missing")
        if not 1 <= bits <= len(variable):
            raise MappingError(self.file, mapping_index, f"{where} with {bits} bits, its type has {len(variable)}")
        part = self.part(variable)
        return MappedObject(index, subindex, bits, variable.name, _limits(part.whole if part else variable))

    def part(self, variable: ODVariable) -> Part | None:
        """Return what a slice is a part of: the member so named of the record without ` slices`.

        None for an object that is no slice, and for a slice without a whole.
        """
        match = SLICE.match(variable.name)
        if match is None or variable.parent is None:
            return None
        record = variable.parent.name.removesuffix(SLICES)
        wholes = (each for index, each in self.objects.indices.items() if index >= DATA and each.name == record)
        whole = next((each[match["name"]] for each in wholes if match["name"] in each), None)
        high, low = int(match["high"]), int(match["low"])
        return None if whole is None else Part(whole, low, high - low + 1)

    def _number(self, address: Address, value: Callable[[Address], Value]) -> int:
        number = value(address)
        if not isinstance(number, int):
            raise MappingError(self.file, address[0], f"sub {address[1]} is missing or has no number as its value")
        return number


@cache
def _reader() -> Callable[[str, int | None], ObjectDictionary]:
    """Return canopen's reader of files; its log is silent, as an error is told once: by what is raised."""
    import logging

    import canopen

    logging.getLogger("canopen").addHandler(logging.NullHandler())
    return canopen.import_od


def _import(path: Path) -> ObjectDictionary:
    """Let canopen read a file; whatever it raises becomes one line."""
    try:
        objects = _reader()(str(path), None)
    except OSError as error:
        raise DictionaryError(path, None, error.strerror or str(error)) from error
    except Exception as error:  # canopen and configparser raise what comes to hand
        what = str(error).replace("\n", " ") or type(error).__name__
        raise DictionaryError(path, None, f"not a readable EDS: {what}") from error
    if not len(objects):
        raise DictionaryError(path, None, "not an EDS: it describes no object")
    return objects


def _variable(objects: ObjectDictionary, address: Address) -> ODVariable | None:
    index, subindex = address
    entry: Any = objects.indices.get(index)
    members: Mapping[int, ODVariable] = getattr(entry, "subindices", {} if entry is None else {0: entry})
    return members.get(subindex)


def _limits(variable: ODVariable) -> Limits:
    return Limits(variable.min or 0, ALL_BITS if variable.max is None else variable.max)


def _default(objects: ObjectDictionary, address: Address) -> Value:
    variable = _variable(objects, address)
    if variable is None:
        return None
    return variable.default if variable.value is None else variable.value


def _resolve_node_id(file: Path, objects: ObjectDictionary, node_id: int) -> None:
    """Add the node-ID to `$NODEID+...` values, which canopen leaves open while it is not known."""
    for entry in objects.values():
        for variable in getattr(entry, "subindices", {0: entry}).values():
            if variable.relative:
                offset = variable.default_raw.upper().replace("$NODEID", "").strip("+ ")
                try:
                    variable.default = int(offset or "0", 0) + node_id
                except ValueError:
                    what = f"sub {variable.subindex}: {variable.default_raw!r} is no number with $NODEID"
                    raise DictionaryError(file, variable.index, what) from None
