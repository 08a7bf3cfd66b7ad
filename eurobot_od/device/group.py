"""Several nodes that share one connection to a bus: each hears what the others send, as on the bus itself.

There is no clock and no bus in here: every method takes the time in seconds and returns the frames to send.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import inf

from eurobot_od.device.node import Node
from eurobot_od.frame import Frame

MOST_AT_ONCE = 1000
"""Most frames among the nodes before time goes on: two nodes that answer each other for ever must not stop it."""


class NodeGroup:
    """Nodes that hear what comes from outside and what the others of the group send."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self.nodes = tuple(nodes)
        self._heard_by: dict[int, list[Node]] = {}
        self._identifiers: dict[Node, list[int]] = {}
        self._wakeups: dict[Node, float] = {}
        self._waiting: deque[tuple[Node | None, Frame]] = deque()
        self._now = 0.0
        for node in self.nodes:
            self._note(node)

    @property
    def next_wakeup(self) -> float:
        """Time at which `tick` wants to be called, infinite if nothing is planned."""
        return self._now if self._waiting else min(self._wakeups.values(), default=inf)

    def start(self, now: float) -> list[Frame]:
        """Switch all nodes on."""
        for node in self.nodes:
            self._waiting.extend((node, frame) for frame in node.start(now))
            self._note(node)
        return self._settled(now)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        """Take in one frame, which may be a remote frame, and return the frames to send."""
        self._waiting.append((None, frame))
        return self._settled(now)

    def tick(self, now: float) -> list[Frame]:
        """Do what is due by now and return the frames to send."""
        for node in [node for node, time in self._wakeups.items() if time <= now]:
            self._waiting.extend((node, frame) for frame in node.tick(now))
            self._note(node)
        return self._settled(now)

    def _settled(self, now: float) -> list[Frame]:
        """Let the nodes hear what is waiting, and each other's answers; return what they have sent."""
        self._now, sent = now, list[Frame]()
        for _ in range(MOST_AT_ONCE):
            if not self._waiting:
                break
            sender, frame = self._waiting.popleft()
            if sender is not None:
                sent.append(frame)
            for node in tuple(self._heard_by.get(frame.cob_id, ())):
                if node is not sender:
                    answers = node.requested(frame.cob_id, now) if frame.is_remote else node.receive(frame, now)
                    self._waiting.extend((node, each) for each in answers)
                    self._note(node)
        return sent

    def _note(self, node: Node) -> None:
        """Note when a node wants to be called and what it listens to: a master may have changed that."""
        self._wakeups[node] = node.next_wakeup
        identifiers = node.device.identifiers
        before = self._identifiers.get(node)
        if identifiers is not before:  # the device replaces the whole list
            for each in before or ():
                self._heard_by[each].remove(node)
            for each in identifiers:
                self._heard_by.setdefault(each, []).append(node)
            self._identifiers[node] = identifiers
