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
            # The name may only lack its beginning, as people write `Maximum speed` for `drive.Motion.Maximum speed`.
            known = (
                f"{each}.{object_.qualname}"
                for each in dictionaries
                for object_ in all_objects(dictionaries[each].objects)
            )
            whole = [each for each in (*robot_file.names(), *known) if f".{each}".lower().endswith(f".{name}".lower())]
            if whole:
                raise LocalError(f"unknown setting {name!r}; did you mean {' or '.join(whole)}?")
            raise UnknownName("node or fact", node, [*dictionaries, *robot_file.SECTIONS])
        address, value = given(thing, text, dictionaries[node].objects)
        values[node][address] = value
    return {node: MemoryStore(each) for node, each in values.items()}
