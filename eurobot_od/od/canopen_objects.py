"""canopen's objects, made from a normalized EDS or DCF.

canopen's own reader refuses or misreads common practice. Its functions read the normal form (`normal`) except for a few
attributes, which are set here.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from copy import copy
from functools import partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.errors import DictionaryError
from eurobot_od.od import objects as od
from eurobot_od.od.description import SIMPLE, DescribedDevice, DescribedObject, ObjectCode
from eurobot_od.od.document import Section
from eurobot_od.od.normal import NormalizedEds
from eurobot_od.od.values import Number

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable


class _Read:
    """The two methods of `configparser` that canopen calls for a variable, for a section that is already read."""

    @staticmethod
    def get(section: Section, key: str, fallback: str | None = None) -> str | None:
        entry = section.entries.get(key.lower())
        return fallback if entry is None else entry.value

    @staticmethod
    def has_option(section: Section, key: str) -> bool:
        return key.lower() in section.entries


def _add(objects: ObjectDictionary, each: DescribedObject, node_id: int, left_out: Container[object]) -> None:
    """Add an object of a normal form, with its sub-indices, as canopen reads it."""
    from canopen.objectdictionary import ODArray, ODRecord, eds

    read = partial(eds.build_variable, _Read, node_id=node_id, index=each.index)
    kinds: dict[ObjectCode | None, type[ODArray | ODRecord]] = {ObjectCode.ARRAY: ODArray, ObjectCode.RECORD: ODRecord}
    kind = kinds.get(each.code)
    if each.section and kind:
        whole = kind(each.section.text("parametername"), each.index)
        whole.storage_location = _Read.get(each.section, "StorageLocation")  # type: ignore[assignment]
        for sub, member in each.subs.items():
            if (each.index, sub) not in left_out:
                whole.add_member(read(section=member.section, subindex=sub))
        objects.add_object(whole)
    elif each.section and each.code in SIMPLE:
        objects.add_object(read(section=each.section))


def completed(objects: ObjectDictionary, more: Mapping[int, Mapping[int, ODVariable]]) -> ObjectDictionary:
    """Return objects with added or replaced variables, given by index and sub-index."""
    made = copy(objects)
    made.indices = dict(objects.indices)
    for index, subs in more.items():
        made.indices[index] = _joined(objects.indices.get(index), index, subs)
    return made


def _joined(
    entry: ODVariable | ODArray | ODRecord | None, index: int, more: Mapping[int, ODVariable]
) -> ODVariable | ODArray | ODRecord:
    """Return an object with more variables; a replaced one keeps its name."""
    from canopen.objectdictionary import ODRecord

    subs = {} if entry is None else od.members_of(entry)
    joined = subs | {sub: od.changed(each, name=subs[sub].name) if sub in subs else each for sub, each in more.items()}
    if list(joined) == [0]:
        return joined[0]
    whole = next(iter(more.values())).parent if entry is None else entry
    record = ODRecord("" if whole is None else str(getattr(whole, "name", "")), index)
    for sub in sorted(joined):
        record.add_member(od.changed(joined[sub]))
    return record


def imported(file: Path, normal: NormalizedEds, device: DescribedDevice, node_id: int) -> ObjectDictionary:
    """Import the normalized EDS with canopen, then set the attributes that it ignores.

    Only the sections about the device go through canopen's `configparser`, which is slow.
    """
    import configparser
    import logging

    from canopen.objectdictionary import ObjectDictionaryError, eds

    logging.getLogger("canopen").addHandler(logging.NullHandler())  # errors are reported by exceptions only
    try:
        objects: ObjectDictionary = eds.import_eds(StringIO(normal.about), node_id)  # type: ignore[no-untyped-call]
        left_out = {(each.index, each.sub) for each in normal.refusals}
        for described in device.objects.values():
            if (described.index, None) not in left_out:
                _add(objects, described, node_id, left_out)
    except (ValueError, KeyError, configparser.Error, ObjectDictionaryError) as error:
        raise DictionaryError(file, None, f"canopen cannot read it: {error}") from error
    objects.node_id = node_id
    for index, sub, attribute, value in normal.canopen_attributes:
        entry = objects.indices.get(index)
        target = od.members_of(entry).get(sub) if entry is not None and sub is not None else entry
        if target is not None:  # None for a refused object
            setattr(target, attribute, value.at(node_id) if isinstance(value, Number) else value)
    return objects
