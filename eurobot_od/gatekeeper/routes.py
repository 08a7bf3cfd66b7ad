"""Who hears which COB-ID: the table of listeners before the start, and the routes it turns into.

Rule of this file: no listener is lost without a word. The table either takes a listener or raises an error that
names it, and it is gone once the routes are made (document section 6, first improvement): what stays is who listens to
which message, not to which identifier, as a master may move a message while we run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import ListenerError, StateError
from eurobot_od.gatekeeper.listeners import FunctionListener
from eurobot_od.gatekeeper.queues import MessageQueue
from eurobot_od.messages import Message
from eurobot_od.protocol import Protocol

Functions: TypeAlias = tuple[FunctionListener[Any], ...]
"""Functions in the order in which they are called."""


class Route(NamedTuple):
    """Who hears one COB-ID: queues, functions, and those of the functions that also take what cannot be decoded.

    `decode` makes the message of a frame's data; it is None where nobody wants the message.
    """

    decode: Callable[[bytes], Message] | None = None
    queues: tuple[MessageQueue[Any], ...] = ()
    functions: Functions = ()
    nodes: Functions = ()

    @property
    def listeners(self) -> tuple[MessageQueue[Any] | FunctionListener[Any], ...]:
        """All of them, in the order in which they are served."""
        return (*self.queues, *self.functions)


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


def routes_to(listeners: Iterable[Registration], protocol: Protocol) -> dict[int, Route]:
    """Return the routes by the COB-IDs that the listeners have now."""
    ways: dict[int, list[Registration]] = {}
    for each in listeners:
        for cob_id in set(each.cob_ids()):
            ways.setdefault(cob_id, []).append(each)
    return {cob_id: _joined(cob_id, each, protocol) for cob_id, each in ways.items()}


def _joined(cob_id: int, listeners: Sequence[Registration], protocol: Protocol) -> Route:
    """Return one route to all of the listeners, in their order."""
    routes = [listener.route for listener in listeners]
    decoded = any(listener.decoded for listener in listeners)
    return Route(
        protocol.binding_of(cob_id).decode if decoded else None,
        tuple(queue for route in routes for queue in route.queues),
        tuple(function for route in routes for function in route.functions),
        tuple(node for route in routes for node in route.nodes),
    )
