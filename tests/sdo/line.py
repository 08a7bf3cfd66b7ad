"""A line between our client and a server, on which frames can be lost; it counts them from 1."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from typing import Protocol

from eurobot_od.sdo.client import Transfer
from eurobot_od.sdo.server import TIMEOUT

WAIT = TIMEOUT / 4
"""Timeout of the client, in s; shorter than the server's, so that it can repeat lost frames."""


class Server(Protocol):
    """An SDO server without a bus."""

    deadline: float

    def receive(self, data: bytes, now: float) -> list[bytes]: ...

    def tick(self, now: float) -> list[bytes]: ...


class Line:
    """Carries requests to a server and its answers back, but for those that are to be lost; time passes in silence."""

    def __init__(self, server: Server, lost_answers: Collection[int] = (), lost_requests: Collection[int] = ()) -> None:
        self._server, self._lost_answers, self._lost_requests = server, lost_answers, lost_requests
        self.now = 0.0
        self.lost: set[int] = set()

    def run(self, transfer: Transfer) -> bytes:
        """Do a transfer to its end."""
        requests, answers = deque(transfer.start(self.now)), deque[bytes]()
        sent = answered = 0
        while requests or not transfer.done:
            if requests:
                sent += 1
                request = requests.popleft()
                answers += self._server.receive(request, self.now) if self._passes(sent, self._lost_requests) else []
            elif answers:
                answered += 1
                data = answers.popleft()
                requests += transfer.receive(data, self.now) if self._passes(answered, self._lost_answers) else []
            else:
                self.now = min(transfer.deadline, self._server.deadline)
                requests += transfer.tick(self.now)
                answers += self._server.tick(self.now)
        return transfer.result()

    def _passes(self, number: int, lost: Collection[int]) -> bool:
        self.lost |= {number} & set(lost)
        return number not in lost
