"""What a message is: a named tuple whose fields are annotated with their kinds.

    class EnemyPosition(NamedTuple):
        x: Annotated[int, Kind("mm")]

A message type says what its fields mean. Identifier, bits and limits come from the EDS; a protocol binds them to the
type.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple, TypeAlias, TypeVar, get_type_hints

from eurobot_od.pdo.kinds import Kind, OutOfRange

Message: TypeAlias = NamedTuple
"""Any message."""

MessageT = TypeVar("MessageT", bound=Message)

_Class = TypeVar("_Class", bound=type)


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
