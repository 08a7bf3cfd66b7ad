"""Who hears which COB-ID: the table of listeners before the start, and the routes it turns into.

Rule of this file: no listener is lost without a word. The table either takes a listener or raises an error that
names it, and it is gone once the routes are made (document section 6, first improvement): what stays is who listens to
which message, not to which identifier, as a master may move a message while we run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from eurobot_od.errors import ListenerError, StateError
from eurobot_od.gatekeeper.listeners import FunctionListener
from eurobot_od.gatekeeper.queues import MessageQueue
from eurobot_od.messages import Message


class Route(NamedTuple):
    """Who hears one COB-ID: queues, functions, and those of the functions that also take what cannot be decoded.

    `decode` is None where nobody wants the message.
    """

    decode: Callable[[int, bytes], Message] | None = None
    queues: tuple[MessageQueue[Any], ...] = ()
    functions: tuple[FunctionListener[Any], ...] = ()
    nodes: tuple[FunctionListener[Any], ...] = ()

    @property
    def listeners(self) -> tuple[MessageQueue[Any] | FunctionListener[Any], ...]:
        """All of them, in the order in which they are served."""
        return (*self.queues, *self.functions)

    def joined(self, other: Route) -> Route:
        """Return a route to the listeners of both, these first."""
        return Route(
            self.decode or other.decode,
            self.queues + other.queues,
            self.functions + other.functions,
            self.nodes + other.nodes,
        )


class Registration(NamedTuple):
    """A listener: where to ask for its COB-IDs, the way to it, and whether it wants frames decoded."""

    cob_ids: Callable[[], Iterable[int]]
    route: Route
    decoded: bool


class ListenerTable:
    """The listeners registered before the start, at most `size` (0: any number)."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._registrations: list[Registration] | None = []

    def add(self, name: str, registration: Registration) -> None:
        """Register a listener; raises ListenerError with its name if the table is full or closed."""
        if self._registrations is None:
            raise ListenerError(f"{name}: the gatekeeper has started; listeners are registered before")
        if 0 < self.size <= len(self._registrations):
            raise ListenerError(f"{name}: the listener table is full, it has {self.size} places")
        self._registrations.append(registration)

    def close(self) -> tuple[Registration, ...]:
        """Return the listeners and forget the table; raises StateError the second time."""
        if self._registrations is None:
            raise StateError("the gatekeeper has started already")
        registrations, self._registrations = self._registrations, None
        return tuple(registrations)


def routes_to(listeners: Iterable[Registration], decode: Callable[[int, bytes], Message]) -> dict[int, Route]:
    """Return the routes by the COB-IDs that the listeners have now."""
    routes: dict[int, Route] = {}
    for cob_ids, route, decoded in listeners:
        way = route._replace(decode=decode) if decoded else route
        for cob_id in set(cob_ids()):
            routes[cob_id] = routes.get(cob_id, Route()).joined(way)
    return routes
