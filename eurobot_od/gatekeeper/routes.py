"""Who hears which COB-ID: the listeners registered before the start, and the routes that are made of them.

What is kept is which message a listener wants, never under which identifier: a master may move a message while we run,
and then the routes are made anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.frame import Data
from eurobot_od.gatekeeper.listeners import FunctionListener, MessageQueue
from eurobot_od.pdo.protocol import Protocol


class ListenerKind(IntEnum):
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
    kind: ListenerKind
    cob_ids: Callable[[], Iterable[int]]
    deliver: Deliver


class Delivery(NamedTuple):
    """How the frames of one COB-ID are delivered: as they are to some, to others as the message that they `decode`
    to."""

    frames: tuple[Deliver, ...]
    messages: tuple[Deliver, ...]
    decode: Callable[[Data], Any] | None


def deliveries_to(registrations: Iterable[Registration], protocol: Protocol) -> dict[int, Delivery]:
    """Return who gets what by the COB-IDs that listeners have now; each in the order of kind, then of registration."""
    heard: dict[int, list[Registration]] = {}
    # The sort is stable, so registrations of one kind keep their order.
    for each in sorted(registrations, key=lambda each: each.kind):
        # A set: a node whose EDS uses one identifier twice must hear each frame once.
        for cob_id in set(each.cob_ids()):
            heard.setdefault(cob_id, []).append(each)
    deliveries = {}
    for cob_id, those in heard.items():
        frames = tuple(each.deliver for each in those if each.kind < ListenerKind.QUEUE)
        messages = tuple(each.deliver for each in those if each.kind >= ListenerKind.QUEUE)
        deliveries[cob_id] = Delivery(frames, messages, protocol.binding_of(cob_id).decode if messages else None)
    return deliveries
