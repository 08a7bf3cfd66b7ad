"""Serves a world to the nodes of other processes, over TCP and in real time (see `channel` for the requests).

One thread does it all, and never waits for a client: if one hangs, or does not read its answers, nothing more is read
from it until it does.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import cast

from eurobot_od.errors import WorldError
from eurobot_od.robot.model.options import WorldAddress
from eurobot_od.robot.world.channel import LINE_LIMIT, TOKEN, Channel
from eurobot_od.robot.world.timeline import EventKind, MatchEvent
from eurobot_od.robot.world.world import OURS, World
from eurobot_od.support.connections import Address

LOOKS = 0.1
"""Seconds between two looks for news."""

HTTP = re.compile(rb"(GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|TRACE|CONNECT) ")
"""The beginning of a browser's request, which ends the connection; our own lines begin with a brace."""

REMEMBERED = 10_000
"""Steps of each robot that are kept: a world that runs for days must not grow without end."""


class _Client(asyncio.Protocol):
    """A connection, one of all `clients`: splits bytes into lines, and answers them."""

    def __init__(self, answer: Callable[[bytes], bytes], clients: set[asyncio.Transport]) -> None:
        self._answer, self._clients, self._rest = answer, clients, b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._clients.add(self._transport)

    def connection_lost(self, _: Exception | None) -> None:
        self._clients.remove(self._transport)

    def data_received(self, data: bytes) -> None:
        *lines, rest = (self._rest + data).split(b"\n")
        if any(map(HTTP.match, (*lines, rest))):  # a web page can make its browser send our lines
            self._transport.abort()
            return
        self._rest = rest[: LINE_LIMIT + 1]  # enough of a line that is too long to be refused when it ends
        self._transport.write(b"".join(map(self._answer, lines)))  # writelines() of 3.12 cannot pause

    def pause_writing(self) -> None:
        # A client that does not read its answers must not fill our memory with them.
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        self._transport.resume_reading()


class Server:
    """A served world; `show` is called with its address, then with each touch and each score as it comes."""

    def __init__(self, world: World, channel: Channel, show: Callable[[MatchEvent], None]) -> None:
        self._world, self._channel, self._show = world, channel, show
        self._clients: set[asyncio.Transport] = set()
        self._touches = self._scores = 0

    async def serve(
        self, where: WorldAddress, duration: float, listening: Callable[[WorldAddress], object] = lambda _: None
    ) -> None:
        """Serve for `duration` seconds; `listening` is called with the address once it does. Raises WorldError."""
        loop = asyncio.get_running_loop()
        try:
            server = await loop.create_server(lambda: _Client(self._channel.answer, self._clients), *where.address)
        except OSError as error:
            raise WorldError(f"cannot listen on {where}: {error.strerror or error}") from error
        bound = Address(*server.sockets[0].getsockname()[:2])
        full = f"{where.token}@{bound}" if where.token else str(bound)
        data = bound._asdict() | ({TOKEN: where.token} if where.token else {})
        self._show(MatchEvent(self._world.clock(), EventKind.START, f"world on {full}; Ctrl-C ends it", data))
        listening(WorldAddress(bound, where.token))
        try:
            end = self._world.clock() + duration
            while (left := end - self._world.clock()) > 0:
                await asyncio.sleep(min(LOOKS, left))
                self._look()
        finally:
            server.close()
            for client in self._clients:
                client.abort()
            self._look()

    def _look(self) -> None:
        """Report what is new, and forget what is old."""
        world = self._world
        world.pose(OURS, 0.0)  # the others are on their rounds, and run into each other even if nobody asks
        for touch in world.touches[self._touches :]:
            self._show(MatchEvent(touch.time, EventKind.TOUCH, str(touch), touch._asdict()))
        for score in world.game.scores[self._scores :]:
            text = f"{score.robot}, {score.task}: {score.points}"
            self._show(MatchEvent(score.time, EventKind.TASK, text, score._asdict()))
        self._touches, self._scores = len(world.touches), len(world.game.scores)
        for body in world.robots.values():
            del body.trace[:-REMEMBERED]
