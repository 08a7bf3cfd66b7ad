"""The catalogue: which message type stands for a PDO, by the PDO's name, and what a message type is.

The decorator `Catalogue.message` enters a message class. A PDO without a class gets a named tuple made from its
mapping.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Container, Mapping
from functools import cache
from itertools import count
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, TypeAlias, TypeVar, cast, get_type_hints

from eurobot_od.pdo.kinds import Kind, OutOfRange

Message: TypeAlias = NamedTuple
"""Any message."""

MessageT = TypeVar("MessageT", bound=Message)


def _equal(self: object, other: object) -> bool:
    return type(self) is type(other) and tuple.__eq__(self, other)  # type: ignore[operator]


def told_apart(message_type: _Class) -> _Class:
    """Make equality depend on the type: as mere tuples a Goto Confirm and a Stop Drive, both empty, would be equal."""
    message_type.__eq__ = _equal  # type: ignore[method-assign, assignment]
    # object's `!=` asks `__eq__`; tuple's own would go on comparing the fields only.
    message_type.__ne__ = object.__ne__  # type: ignore[method-assign, assignment]
    return message_type


@cache
def kinds(message_type: type[Message]) -> Mapping[str, Kind]:
    """Return the kind of every field of a message type, in their order."""
    hints = get_type_hints(message_type, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in message_type._fields}


def is_flagged(message: Message) -> bool:
    """Tell whether any value of a received message is out of range."""
    return OutOfRange in map(type, message)


def flagged_fields(message: Message) -> list[str]:
    """Return the fields of a received message whose value is out of range; empty if all may be acted on."""
    return [name for name, value in zip(message._fields, message) if isinstance(value, OutOfRange)]


def plain(message: Message) -> dict[str, Any]:
    """Return a message's fields as numbers, None (unknown), or the words that a person writes."""
    return {name: kind.plain(value) for (name, kind), value in zip(kinds(type(message)).items(), message)}


def describe(message: Message) -> str:
    """Write a message's fields for a person, without those that have their default: `x=1200 mm, angle=90 deg`."""
    defaults = message._field_defaults
    return ", ".join(
        f"{name}={kind.text(value)}"
        for (name, kind), value in zip(kinds(type(message)).items(), message)
        if name not in defaults or value != defaults[name]
    )


_Class = TypeVar("_Class", bound=type)

NO_GROUP = ""


class CatalogueEntry(NamedTuple):
    """A message type, the `group` of messages that it is one of, and whether it acts `always`: in every NMT state."""

    type: type[Message]
    group: str = NO_GROUP
    always: bool = False


class Catalogue:
    """Message types by the names of their PDOs; case, spaces, hyphens and underscores in a name do not matter.

    `errors` are the words for the emergency error codes that are the devices' own (CiA 301, Table 26: 0xFF00 and up).
    """

    def __init__(self, errors: Mapping[int, str] = MappingProxyType({})) -> None:
        self.errors = dict(errors)
        self._entries: dict[str, CatalogueEntry] = {}

    def message(self, group: str = NO_GROUP, *, always: bool = False) -> Callable[[_Class], _Class]:
        """Return the decorator that enters a message class; its name is the PDO's in CamelCase."""

        def enter(message_type: _Class) -> _Class:
            self._entries[plain_name(message_type.__name__)] = CatalogueEntry(told_apart(message_type), group, always)
            return message_type

        return enter

    def copy(self) -> Catalogue:
        """Return a catalogue with the same types, for others to be entered beside them."""
        made = Catalogue(self.errors)
        made._entries = dict(self._entries)
        return made

    def find(self, name: str) -> CatalogueEntry | None:
        """Return the entry for a PDO's name; None if there is none."""
        return self._entries.get(plain_name(name))

    @property
    def types(self) -> tuple[type[Message], ...]:
        """All message types in the order in which they were entered."""
        return tuple(entry.type for entry in self._entries.values())

    @property
    def always(self) -> frozenset[type[Message]]:
        """The message types that act in every NMT state."""
        return frozenset(entry.type for entry in self._entries.values() if entry.always)

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups in the order of their first message."""
        return tuple(dict.fromkeys(entry.group for entry in self._entries.values() if entry.group))


LONGEST_NAME = 60
"""Most characters of a file's name that a line for a person has room for."""

NOTHING = Catalogue()
"""The empty catalogue, for devices of which only the EDS is known."""


def plain_name(name: str) -> str:
    """Return a name as it is looked up: `Goto XY`, `goto-xy` and `GotoXY` are one."""
    return re.sub(r"[ _-]", "", name).casefold()


def readable_name(name: str) -> str:
    """Return a name that fits in a line: no control characters, not longer than `LONGEST_NAME`."""
    words = "".join(each if each.isprintable() else " " for each in name).split()
    return " ".join(words)[:LONGEST_NAME].rstrip()


def field_name(parameter_name: str) -> str:
    """Return the field for an EDS ParameterName: `X position` is `x`, `Enemy 1 diameter` is `enemy_1_diameter`.

    What Python does not take as a name is changed until it does: `Status (raw)` is `status_raw`, `class` is `class_`,
    `2nd axis` is `field_2nd_axis`.
    """
    words = parameter_name.lower().removesuffix(" position")
    name = re.sub(r"\W+", "_", words, flags=re.ASCII).strip("_")[:LONGEST_NAME].rstrip("_") or "field"
    if keyword.iskeyword(name):
        return f"{name}_"
    return f"field_{name}" if name[0].isdigit() else name


def first_free(name: str, taken: Container[object]) -> str:
    """Return the first of `status`, `status_2`, `status_3`, ... that is not taken."""
    names = (f"{name}_{number}" if number > 1 else name for number in count(1))
    return next(each for each in names if each not in taken)


def made_type(name: str, kinds: Mapping[str, Kind]) -> type[Message]:
    """Return a message type for a PDO that no catalogue has, by its fields' names and kinds.

    Python generates code for a named tuple; of what a file says, only fields' names go into it, and those as
    `field_name` makes them: letters, digits and underscores.
    """
    annotated: Any = [(field, Annotated[Any, kind]) for field, kind in kinds.items()]
    made: Any = NamedTuple("Message", annotated)  # type: ignore[misc]  # made at run time
    made.__name__ = made.__qualname__ = name
    made.__doc__ = ""  # what Python writes there says no more than the fields
    return cast("type[Message]", told_apart(made))
