"""Settings of a node as attributes of its class, read from the object dictionary at each use.

    class Lift(Node):
        speed = setting("Lift drive.Maximum speed")

What a master writes holds from the next use on. The names are looked up once, when the node is made: one that its file
does not have is refused then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Generic, Protocol, TypeAlias, TypeVar, overload

SHORTEST_PERIOD = 0.001
"""In seconds: what repeats after no time at all would always be due."""

ValueT = TypeVar("ValueT")

NumberOf: TypeAlias = Callable[[str], int]
"""Gives the number in a setting, by its ParameterNames, `Record.Member`."""


class HasSettings(Protocol):
    """A node, as far as its settings are concerned."""

    def setting(self, name: str) -> int:
        """Return the number of a setting by its ParameterNames."""


class Setting(Generic[ValueT]):
    """The value that `read` makes of the numbers in the settings with these `names`."""

    def __init__(self, names: Iterable[str], read: Callable[[NumberOf], ValueT]) -> None:
        self.names, self.read = tuple(names), read

    @overload
    def __get__(self, node: None, kind: type) -> Setting[ValueT]: ...

    @overload
    def __get__(self, node: HasSettings, kind: type | None = None) -> ValueT: ...

    def __get__(self, node: HasSettings | None, kind: type | None = None) -> Setting[ValueT] | ValueT:
        return self if node is None else self.read(node.setting)


def setting(name: str) -> Setting[int]:
    """A number, as it is in the object."""
    return Setting([name], lambda number: number(name))


def seconds(name: str) -> Setting[float]:
    """A time in seconds, which the object has in milliseconds."""
    return Setting([name], lambda number: number(name) / 1000)


def period(name: str) -> Setting[float]:
    """The period of something that repeats, in seconds: never 0, whatever a file says."""
    return Setting([name], lambda number: max(number(name) / 1000, SHORTEST_PERIOD))


def scaled(name: str, unit: float) -> Setting[float]:
    """A number times a unit."""
    return Setting([name], lambda number: number(name) * unit)


def together(kind: Callable[..., ValueT], **parts: Setting[Any]) -> Setting[ValueT]:
    """A value with several fields, each of them a setting."""
    names = (name for each in parts.values() for name in each.names)
    return Setting(names, lambda number: kind(**{field: each.read(number) for field, each in parts.items()}))


def names_of(kind: type) -> set[str]:
    """Return the names of all settings that a class has."""
    found = (each for base in kind.__mro__ for each in vars(base).values() if isinstance(each, Setting))
    return {name for each in found for name in each.names}
