"""A device's object dictionary as its EDS or DCF describes it, with canopen's objects.

Rule of this file: canopen reads no file here. Its own reader refuses what is common practice (a byte order mark, a
section twice, a dummy left out) and misreads what it does not know (octal numbers, limits of INTEGER24, all but the
first of a compact array), so its objects are made from the one reading that `outline` has of a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od.od.description import DescribedDevice, DescribedVariable, ObjectCode
from eurobot_od.od.document import read_bytes
from eurobot_od.od.outline import Outline
from eurobot_od.od.values import DATA_TYPES, DOMAIN, DUMMIES, NODE_ID, Address, DataType, parse_number

if TYPE_CHECKING:
    from types import ModuleType

    from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable


ENTRIES = {"lowlimit": "min", "highlimit": "max", "defaultvalue": "default", "parametervalue": "value"}
"""Where canopen keeps what the keys of a variable say; its raw text stands next to it, as `default_raw`."""


class Dictionary(Outline):
    """A loaded EDS or DCF: an outline, and canopen's `objects`."""

    def __init__(self, file: Path, device: DescribedDevice, node_id: int | None = None, name: str = "") -> None:
        super().__init__(file, device, node_id, name)
        self.objects = self._objects()

    def renumbered(self, node_id: int) -> Dictionary:
        """Return the same file's dictionary for another node-ID."""
        return Dictionary(self.file, self.device, node_id, self.name)

    @cached_property
    def content(self) -> bytes:
        """The file as it is, for a device to serve; raises DictionaryError if it is gone."""
        return read_bytes(self.file)

    def variable(self, address: Address) -> ODVariable | None:
        """Return canopen's variable at an index and sub-index, None if there is none."""
        index, subindex = address
        entry: Any = self.objects.indices.get(index)
        members: Mapping[int, ODVariable] = getattr(entry, "subindices", {} if entry is None else {0: entry})
        return members.get(subindex)

    # canopen's objects

    def _objects(self) -> ObjectDictionary:
        objects: ObjectDictionary = _canopen().ObjectDictionary()
        node_id, rate = self.device.commissioned("nodeid"), self.device.commissioned("baudrate")
        objects.node_id = node_id.value if node_id else None
        objects.bitrate = rate.value * 1000 if rate else None
        for entry in [*self._dummies(), *map(self._entry, self.members)]:
            objects.add_object(entry)
        return objects

    def _dummies(self) -> Iterator[ODVariable]:
        """Give the data types that RPDOs may map to skip bits, as [DummyUsage] allows them."""
        for code in DUMMIES:
            key = f"Dummy{code:04X}"
            if parse_number(self.device.document.text("dummyusage", key.lower())) == (1, False):
                dummy = _canopen().ODVariable(key, code, 0)
                dummy.data_type, dummy.access_type = code, "const"
                yield dummy

    def _entry(self, index: int) -> ODVariable | ODArray | ODRecord:
        members = map(self._variable, self.members[index].values())
        if not self.is_composed(index):
            return next(members)
        each, od = self.device.objects[index], _canopen()
        entry: ODArray | ODRecord = (od.ODArray if each.code is ObjectCode.ARRAY else od.ODRecord)(each.name, index)
        for member in members:
            entry.add_member(member)
        return entry

    def _variable(self, each: DescribedVariable) -> ODVariable:
        made: ODVariable = _canopen().ODVariable(each.name, each.index, each.sub)
        made.data_type, made.access_type, made.pdo_mappable = self.type(each).code, each.access, each.is_mappable
        for key, attribute in ENTRIES.items():
            if key in each.section.entries:
                setattr(made, attribute, self.typed(each, key))
                setattr(made, f"{attribute}_raw", each.section.text(key))
        made.relative = NODE_ID in each.section.text("defaultvalue").upper()
        return made


def data_type(variable: ODVariable) -> DataType:
    """Return the data type of one of canopen's variables."""
    return DATA_TYPES.get(variable.data_type or 0, DOMAIN)


@cache
def _canopen() -> ModuleType:
    """Return canopen's object dictionary; its log is silent, as an error is told once: by what is raised."""
    import logging

    from canopen import objectdictionary

    logging.getLogger("canopen").addHandler(logging.NullHandler())
    return objectdictionary
