"""Who hears which COB-ID: the table of listeners before the start, and the routes that are made of it.

What is kept is which message a listener wants, never under which identifier: a master may move a message while we run,
and then the routes are made anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import ListenerError, StateError
from eurobot_od.frame import Data
from eurobot_od.gatekeeper.listeners import FunctionListener, MessageQueue
from eurobot_od.pdo.protocol import Protocol


class Kind(IntEnum):
    """Kinds of listeners in the order in which they are served; the first two get frames, the others messages.

    Nodes come first: their answers are what other nodes wait for.
    """

    NODE = 0
    FRAME_FUNCTION = 1
    QUEUE = 2
    FUNCTION = 3


Deliver: TypeAlias = Callable[[Any, float], object]
"""Takes a frame or a message, and its timestamp; it neither raises nor waits."""


class Registration(NamedTuple):
    """A listener, its kind, where to ask for its COB-IDs, and how it gets what it listens to."""

    listener: FunctionListener[Any] | MessageQueue[Any]
    kind: Kind
    cob_ids: Callable[[], Iterable[int]]
    deliver: Deliver


class ListenerTable:
    """The listeners registered before the start, at most `size` (0: any number)."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.registrations: list[Registration] = []
        self._closed = False

    def add(self, registration: Registration) -> None:
        """Register a listener; raises ListenerError with its name if the table is full or closed."""
        name = registration.listener.name
        if self._closed:
            raise ListenerError(f"{name}: the gatekeeper has started; listeners are registered before")
        if 0 < self.size <= len(self.registrations):
            raise ListenerError(f"{name}: the listener table is full, it has {self.size} places")
        self.registrations.append(registration)

    def close(self) -> None:
        """End the registration; raises StateError the second time."""
        if self._closed:
            raise StateError("the gatekeeper has started already")
        self._closed = True


class Route(NamedTuple):
    """How the frames of one COB-ID are delivered: as they are to some, to others as the message that they `decode`
    to."""

    frames: tuple[Deliver, ...]
    messages: tuple[Deliver, ...]
    decode: Callable[[Data], Any] | None


def routes_to(registrations: Iterable[Registration], protocol: Protocol) -> dict[int, Route]:
    """Return the routes by the COB-IDs that the listeners have now; each in the order of kind, then of registration."""
    heard: dict[int, list[Registration]] = {}
    for each in sorted(registrations, key=lambda each: each.kind):
        for cob_id in set(each.cob_ids()):
            heard.setdefault(cob_id, []).append(each)
    return {cob_id: _route(cob_id, each, protocol) for cob_id, each in heard.items()}


def _route(cob_id: int, registrations: list[Registration], protocol: Protocol) -> Route:
    frames = tuple(each.deliver for each in registrations if each.kind < Kind.QUEUE)
    messages = tuple(each.deliver for each in registrations if each.kind >= Kind.QUEUE)
    return Route(frames, messages, protocol.binding_of(cob_id).decode if messages else None)
