"""What decoding needs of an EDS or DCF: PDOs, defaults of the services, and what the objects are called.

Rule of this file: everything in an outline was read by `Dictionary`, and so by canopen; an outline is plain data and
back, so that it can be kept (see `outline_cache`). For whatever it does not say, `dictionary` loads the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import MappedObject, Pdo
from eurobot_od.od.values import Address, Limits, PdoDirection

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

SERVICES = range(0x1000, 0x1400)
"""Indices of the objects that the services have, without the PDOs (CiA 301, 7.5.2)."""

Plain: TypeAlias = "dict[str, Any]"
"""A part of an outline as JSON can write it, by address or by name."""


class Described(NamedTuple):
    """An object: its `name` with that of its record, `size` in bytes and `signed` of an integer (0: no integer)."""

    name: str
    size: int
    signed: bool


class Outline:
    """The outline of one file; `name` is the file's stem, as a dictionary's is.

    `plain` is what `plain_outline` gives; `objects` is asked for what `plain_objects` gives if a description is wanted.
    """

    def __init__(self, file: Path, plain: Plain, objects: Callable[[], Plain]) -> None:
        self.file, self.name = file, file.stem
        self.node_id: int = plain["node_id"]
        self.pdos = tuple(map(_pdo, plain["pdos"]))
        self._defaults: Mapping[str, int] = plain["defaults"]
        self._load_objects = objects

    @classmethod
    def of(cls, dictionary: Dictionary) -> Outline:
        """Return the outline of a loaded dictionary; raises MappingError if a mapping does not hold."""
        made = cls(dictionary.file, plain_outline(dictionary), lambda: plain_objects(dictionary))
        made.dictionary = dictionary
        return made

    def default(self, address: Address) -> int | None:
        """Return the number that an object of the SERVICES has by default; None if it has none."""
        return self._defaults.get(_key(address))

    def described(self, address: Address) -> Described | None:
        """Return what is known of an object, None if there is none."""
        entry = self._objects.get(_key(address))
        return None if entry is None else Described(*entry)

    @cached_property
    def _objects(self) -> Mapping[str, Sequence[Any]]:
        return self._load_objects()

    @cached_property
    def dictionary(self) -> Dictionary:
        """The whole dictionary, loaded if need be; raises DictionaryError."""
        return Dictionary.load(self.file, self.node_id)


def plain_outline(dictionary: Dictionary) -> Plain:
    """Return node-ID, PDOs and defaults; raises MappingError if a mapping does not hold."""
    defaults = ((address, dictionary.default(address)) for address, _ in _variables(dictionary))
    return {
        "node_id": dictionary.node_id,
        "pdos": list(map(_plain_pdo, dictionary.pdos)),
        "defaults": {_key(a): value for a, value in defaults if a[0] in SERVICES and isinstance(value, int)},
    }


def plain_objects(dictionary: Dictionary) -> Plain:
    """Return the descriptions of all objects."""
    return {_key(address): Described(each.qualname, *_integer(each)) for address, each in _variables(dictionary)}


def _variables(dictionary: Dictionary) -> Iterator[tuple[Address, ODVariable]]:
    for entry in dictionary.objects.values():
        for subindex, variable in getattr(entry, "subindices", {0: entry}).items():
            yield (entry.index, subindex), variable


def _key(address: Address) -> str:
    return f"{address[0]:X}:{address[1]:X}"


def _integer(variable: ODVariable) -> tuple[int, bool]:
    from canopen.objectdictionary import datatypes

    if variable.data_type not in datatypes.INTEGER_TYPES:
        return 0, False
    return len(variable) // 8, variable.data_type in datatypes.SIGNED_TYPES


def _plain_pdo(pdo: Pdo) -> Pdo:
    return pdo._replace(direction=pdo.direction.value)  # type: ignore[arg-type]  # an enum's member is no JSON


def _pdo(plain: Sequence[Any]) -> Pdo:
    direction, index, name, cob_id, valid, transmission_type, mapping = plain
    mapped = tuple(MappedObject(*entry)._replace(limits=Limits(*entry[-1])) for entry in mapping)
    return Pdo(PdoDirection(direction), index, name, cob_id, valid, transmission_type, mapped)
