"""What decoding needs of an EDS or DCF: PDOs, names, types and default numbers, without the object dictionary itself.

Rule of this file: everything in an outline was read by `Dictionary`, and so by canopen; an outline is plain data and
back, so that it can be kept (see `outline_cache`). For whatever it does not say, `dictionary` loads the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.dictionary import Address, Dictionary, MappedObject, Pdo, PdoDirection
from eurobot_od.kinds import Limits

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

Plain: TypeAlias = "dict[str, Any]"
"""An outline as JSON can write it."""


class Described(NamedTuple):
    """An object: its `name` with that of its record, `size` in bytes and `signed` of an integer (0: no integer)."""

    name: str
    size: int
    signed: bool
    default: int | None


class Outline:
    """The outline of one file; `name` is the file's stem, as a dictionary's is."""

    def __init__(self, file: Path, plain: Plain, dictionary: Dictionary | None = None) -> None:
        self.file, self.name, self.plain, self._dictionary = file, file.stem, plain, dictionary
        self.node_id: int = plain["node_id"]
        self.pdos = tuple(map(_pdo, plain["pdos"]))

    @classmethod
    def of(cls, dictionary: Dictionary) -> Outline:
        """Return the outline of a loaded dictionary; raises MappingError if a mapping does not hold."""
        plain = {
            "node_id": dictionary.node_id,
            "pdos": list(map(_plain_pdo, dictionary.pdos)),
            "objects": json.dumps(dict(_described(dictionary))),
        }
        return cls(dictionary.file, plain, dictionary)

    @cached_property
    def _objects(self) -> Mapping[str, Sequence[Any]]:
        """What is said of the objects; it is text until it is asked for, as few logs ask."""
        objects: Mapping[str, Sequence[Any]] = json.loads(self.plain["objects"])
        return objects

    def described(self, address: Address) -> Described | None:
        """Return what is known of an object, None if there is none."""
        entry = self._objects.get(_key(address))
        return None if entry is None else Described(*entry)

    def default(self, address: Address) -> int | None:
        """Return an object's ParameterValue or DefaultValue; None if it has neither, or it is no number."""
        described = self.described(address)
        return None if described is None else described.default

    @cached_property
    def dictionary(self) -> Dictionary:
        """The whole dictionary, loaded if need be; raises DictionaryError."""
        return self._dictionary or Dictionary.load(self.file, self.node_id)


def _key(address: Address) -> str:
    return f"{address[0]:X}:{address[1]:X}"


def _described(dictionary: Dictionary) -> Iterator[tuple[str, Described]]:
    for entry in dictionary.objects.values():
        for subindex, variable in getattr(entry, "subindices", {0: entry}).items():
            default = dictionary.default((entry.index, subindex))
            number = default if isinstance(default, int) else None
            yield _key((entry.index, subindex)), Described(variable.qualname, *_integer(variable), number)


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
