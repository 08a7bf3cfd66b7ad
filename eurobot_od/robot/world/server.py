"""Serves a world to the nodes of other processes, over TCP and in real time (see `REQUESTS`).

One thread does it all, and never waits for a client: if one hangs, or does not read its answers, nothing more is read
from it until it does.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple, cast

from eurobot_od.errors import EurobotError, FieldError, LocalError, UnknownName, WorldError
from eurobot_od.robot.model.options import MatchOptions, WorldAddress
from eurobot_od.robot.model.values import OURS, Source
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.world.world import EventKind, LocalVehicle, MatchEvent, World
from eurobot_od.support.connections import Address, is_token

VERSION = 1
"""The version of requests and answers; a client refuses any other."""

LINE_LIMIT = 4096
"""Most bytes in a line."""

REQUEST = "request"
ROBOT = "robot"
TOKEN = "token"
ANSWER = "answer"
ERROR = "error"
"""The keys that every request, or every answer, may have."""


WHOM = {source.name.lower(): source for source in Source}


class RequestField(NamedTuple):
    """What a field of a request may be, in words and as a test; one without a default is required."""

    allowed: str
    accepts: Callable[[Any], bool]
    default: Any = None


def _number(low: float, high: float, unit: str, default: float | None = None) -> RequestField:
    return RequestField(
        f"{low:g}..{high:g} {unit}", lambda value: type(value) is float and low <= value <= high, default
    )


_WHOM = RequestField(", ".join(WHOM), lambda value: value in tuple(WHOM))
_TASK = RequestField("the name of a task", lambda value: isinstance(value, str))


class _Asked(NamedTuple):
    """A correct request: whose robot it is about, and its fields."""

    world: World
    options: MatchOptions
    robot: str
    fields: dict[str, Any]

    @property
    def vehicle(self) -> LocalVehicle:
        return self.world.vehicle(self.robot)

    def hello(self) -> dict[str, Any]:
        options = self.options
        start = {"team": options.team.name.lower(), "enemies": options.enemies, "confederates": options.confederates}
        return {"version": VERSION, ROBOT: self.robot, **start, "seed": options.seed, "errors": asdict(options.errors)}

    def truth(self) -> dict[str, Any]:
        world, robot = self.world, self.robot
        touches = sum(robot in (touch.robot, touch.thing) for touch in world.touches)
        came_to = {"points": world.game.points(robot), "touches": touches}
        return {"time": world.clock(), **world.robots[robot].pose._asdict(), **came_to}

    def ahead(self) -> dict[str, Any] | None:
        seen = self.vehicle.ahead(**self.fields)
        return None if seen is None else seen._asdict() | {"obstacle": seen.obstacle.name.lower()}


class Request(NamedTuple):
    """A request: its fields, and the function that answers it."""

    fields: dict[str, RequestField]
    answer: Callable[[_Asked], Any]


REQUESTS = {
    "hello": Request({}, _Asked.hello),
    "truth": Request({}, _Asked.truth),
    "move": Request(
        {
            "distance": _number(-10_000, 10_000, "mm"),
            "turn": _number(-3600, 3600, "degrees"),
            "seconds": _number(0, 10, "s"),
        },
        lambda asked: asked.vehicle.move(
            Odometry(asked.fields["distance"], asked.fields["turn"]), asked.fields["seconds"]
        ),
    ),
    "pose": Request(
        {"whom": _WHOM, "age": _number(0, 3600, "s", default=0.0)},
        lambda asked: (pose := asked.vehicle.pose(WHOM[asked.fields["whom"]], asked.fields["age"])) and pose._asdict(),
    ),
    "ahead": Request({"distance": _number(0, 10_000, "mm"), "angle": _number(0, 180, "degrees")}, _Asked.ahead),
    "begin": Request({"task": _TASK}, lambda asked: asked.vehicle.begin(**asked.fields)),
    "finish": Request({"task": _TASK}, lambda asked: asked.vehicle.finish(**asked.fields)),
}
"""The requests: the methods of a `Vehicle`, who one is, and what is true."""


class Channel:
    """The world's end of the side channel; `requests` counts the lines, `refused` the wrong ones.

    `matches` has, for each robot driven by nodes, the match from its side. With a `token`, a request without it is
    refused.
    """

    def __init__(self, world: World, matches: Mapping[str, MatchOptions], token: str = "") -> None:
        self.requests = self.refused = 0
        self._world, self._matches, self._token = world, matches, token

    def answer(self, line: bytes) -> bytes:
        """Return the answer to a line; the line has no line end, its answer has one."""
        self.requests += 1
        try:
            given = _parsed(line)
            name, robot, token = given.pop(REQUEST, None), given.pop(ROBOT, OURS), str(given.pop(TOKEN, ""))
            if self._token and not is_token(token, self._token):
                raise LocalError("the token is missing or wrong: give the address as the world printed it")
            # In a tuple, as JSON may bring a list, which is not hashable.
            if name not in tuple(REQUESTS):
                raise UnknownName("request", name, REQUESTS)
            if robot not in tuple(self._matches):
                raise UnknownName("robot", robot, self._matches)
            asked = _Asked(self._world, self._matches[robot], robot, _checked(name, given))
            said = {ANSWER: REQUESTS[name].answer(asked)}
        except EurobotError as error:
            self.refused += 1
            said = {ERROR: str(error)}
        return json.dumps(said).encode() + b"\n"


def _parsed(line: bytes) -> dict[str, Any]:
    """Read a line, with all its numbers as floats; raises LocalError."""
    if len(line) > LINE_LIMIT:
        raise LocalError(f"a line of more than {LINE_LIMIT} bytes")
    try:
        # All as floats, so that one test (`_number`) works for 1 and 1.0 alike.
        given = json.loads(line, parse_int=float)
    except (ValueError, RecursionError) as error:
        raise LocalError(f"not JSON: {error}") from error
    if not isinstance(given, dict):
        raise LocalError(f'not a JSON object: write {{"{REQUEST}": "hello"}}')
    return given


def _checked(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a request, with defaults for those that are left out; raises UnknownName, FieldError."""
    rules = REQUESTS[name].fields
    for field in given:
        if field not in rules:
            raise UnknownName(f"field of {name}", field, rules)
    fields = {field: given.get(field, rule.default) for field, rule in rules.items()}
    for field, value in fields.items():
        if not rules[field].accepts(value):
            raise FieldError(name, field, value, rules[field].allowed)
    return fields


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
