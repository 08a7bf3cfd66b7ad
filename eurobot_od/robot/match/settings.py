"""Settings of a match: values that stand in a node's object dictionary in place of its EDS file's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from eurobot_od.device.storage import MemoryStore
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import all_objects, given
from eurobot_od.od.values import Address, Value
from eurobot_od.robot.model import robot_file


def stores(settings: Iterable[tuple[str, str]], dictionaries: Mapping[str, Dictionary]) -> dict[str, MemoryStore]:
    """Return what each node finds stored when it is switched on: settings as a person writes them.

    A name is that of the node and of the object, `drive.Motion.Maximum speed` or `navigation.0x2101:1`. Raises
    UnknownName, LocalError, FieldError.
    """
    values: dict[str, dict[Address, Value]] = {node: {} for node in dictionaries}
    for name, text in settings:
        node, _, thing = name.partition(".")
        if node not in values:
            raise _unknown(name, node, dictionaries)
        address, value = given(thing, text, dictionaries[node].objects)
        values[node][address] = value
    return {node: MemoryStore(each) for node, each in values.items()}


def _unknown(name: str, node: str, dictionaries: Mapping[str, Dictionary]) -> LocalError:
    """Return the error for a name that begins with no node: it may lack its beginning only."""
    settings = (
        f"{each}.{thing.qualname}" for each in dictionaries for thing in all_objects(dictionaries[each].objects)
    )
    whole = [each for each in (*robot_file.names(), *settings) if f".{each}".lower().endswith(f".{name}".lower())]
    if whole:
        return LocalError(f"unknown setting {name!r}; did you mean {' or '.join(whole)}?")
    return UnknownName("node or fact", node, [*dictionaries, *robot_file.SECTIONS])
