"""Who hears which COB-ID: the table of listeners before the start, and the routes it turns into.

Rule of this file: no listener is lost without a word. The table either takes a listener or raises an error that
names it, and it is gone once the routes are made (document section 6, first improvement): what stays is who listens to
which message, not to which identifier, as a master may move a message while we run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import IntEnum
from itertools import groupby
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import ListenerError, StateError
from eurobot_od.frame import Data, Frame
from eurobot_od.gatekeeper.listeners import FunctionListener
from eurobot_od.pdo.protocol import Protocol

Listener: TypeAlias = FunctionListener[Any]


class Kind(IntEnum):
    """Kinds of listeners in the order in which they are served, so that none is held up by one that may take longer.

    A node gets frames, the others get messages.
    """

    NODE = 0
    QUEUE = 1
    FUNCTION = 2


Make: TypeAlias = Callable[[Data], Any]
"""Makes what a listener gets of a frame's data; raises FrameLengthError."""

Stop: TypeAlias = tuple[Make | None, Listener]
"""What makes what a listener gets of a frame's data, and the listener; None: it gets what the one before it got.

A plain tuple, as Python takes a named one apart more slowly.
"""

Route: TypeAlias = tuple[Stop, ...]
"""Who hears one COB-ID, in the order in which they are served."""


class Registration(NamedTuple):
    """A listener, its kind, and where to ask for its COB-IDs."""

    cob_ids: Callable[[], Iterable[int]]
    kind: Kind
    listener: Listener


class ListenerTable:
    """The listeners registered before the start, at most `size` (0: any number)."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._registrations: list[Registration] | None = []

    def add(self, registration: Registration) -> None:
        """Register a listener; raises ListenerError with its name if the table is full or closed."""
        name = registration.listener.name
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
    return {cob_id: tuple(_stops(cob_id, each, protocol)) for cob_id, each in ways.items()}


def _stops(cob_id: int, listeners: Sequence[Registration], protocol: Protocol) -> Iterator[Stop]:
    """Give all listeners by their kind, those of a kind in the order of their registration."""
    ordered = sorted(listeners, key=lambda each: each.kind)
    for wants_frames, group in groupby(ordered, lambda each: each.kind is Kind.NODE):
        make: Make | None = _to_frame(cob_id) if wants_frames else protocol.binding_of(cob_id).decode
        for each in group:
            yield make, each.listener
            make = None


def _to_frame(cob_id: int) -> Callable[[Data], Frame]:
    new = tuple.__new__  # twice as quick as Frame()
    return lambda data: new(Frame, (cob_id, bytes(data)))
