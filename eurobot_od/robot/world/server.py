"""Serves a world to the nodes of other processes, over TCP and in real time (see `REQUESTS`).

One thread does it all, and never waits for a client: if one hangs, or does not read its answers, nothing more is read
from it until it does.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import time
from collections.abc import Callable
from dataclasses import asdict
from math import inf
from threading import Lock
from typing import Any, NamedTuple, TypeVar, cast

from eurobot_od.errors import EurobotError, FieldError, LocalError, UnknownName, WorldError
from eurobot_od.robot.model.options import Errors, MatchOptions, WorldAddress
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import OURS, Obstacle, Source, TeamColour
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.node import Detection
from eurobot_od.robot.world.world import EventKind, MatchEvent, World
from eurobot_od.support.connections import Address, is_token

VERSION = 2
"""Version of requests and answers; a client refuses any other."""

LINE_LIMIT = 4096
"""Maximum length of a line in bytes."""

REQUEST = "request"
TOKEN = "token"
ANSWER = "answer"
ERROR = "error"
"""Keys of every request, or of every answer."""


WHOM = {source.name.lower(): source for source in Source}


class RequestField(NamedTuple):
    """The allowed values of a request's field, as text and as a test; a field without a default is required."""

    allowed: str
    accepts: Callable[[Any], bool]
    default: Any = None


def _number(low: float, high: float, unit: str, default: float | None = None) -> RequestField:
    return RequestField(
        f"{low:g}..{high:g} {unit}", lambda value: type(value) is float and low <= value <= high, default
    )


_WHOM = RequestField(", ".join(WHOM), lambda value: value in tuple(WHOM))
_TASK = RequestField("the name of a task", lambda value: isinstance(value, str))


class Channel:
    """The world's end of the side channel; `requests` counts the lines, `refused` the wrong ones.

    `options` are those of the world's match. With a `token`, requests without it are refused.
    """

    def __init__(self, world: World, options: MatchOptions, token: str = "") -> None:
        self.requests = self.refused = 0
        self.vehicle = world.vehicle()
        self._world = world
        self._options = options
        self._token = token

    def answer(self, line: bytes) -> bytes:
        """Return the answer to a line; the line has no line end, the answer has one."""
        self.requests += 1
        try:
            given = _parsed(line)
            name = given.pop(REQUEST, None)
            token = str(given.pop(TOKEN, ""))
            if self._token and not is_token(token, self._token):
                raise LocalError("the token is missing or wrong: give the address as the world printed it")
            # A tuple, as the name may be a list, which is not hashable.
            if name not in tuple(REQUESTS):
                raise UnknownName("request", name, REQUESTS)
            said = {ANSWER: REQUESTS[name].answer(self, **_checked(name, given))}
        except EurobotError as error:
            self.refused += 1
            said = {ERROR: str(error)}
        return json.dumps(said).encode() + b"\n"

    def hello(self) -> dict[str, Any]:
        """Return the match's options."""
        options = self._options
        start = {"team": options.team.name.lower(), "enemies": options.enemies, "confederates": options.confederates}
        return {"version": VERSION, **start, "seed": options.seed, "errors": asdict(options.errors)}

    def truth(self) -> dict[str, Any]:
        """Return the truth about our robot."""
        world = self._world
        touches = sum(OURS in (touch.robot, touch.thing) for touch in world.touches)
        return {"time": world.clock(), **world.robot._asdict(), "points": world.game.points(OURS), "touches": touches}

    def pose(self, whom: str, age: float) -> dict[str, Any] | None:
        """Return where a robot was."""
        pose = self.vehicle.pose(WHOM[whom], age)
        return None if pose is None else pose._asdict()

    def ahead(self, distance: float, angle: float) -> dict[str, Any] | None:
        """Return what is ahead of our robot."""
        seen = self.vehicle.ahead(distance, angle)
        return None if seen is None else seen._asdict() | {"obstacle": seen.obstacle.name.lower()}


class Request(NamedTuple):
    """A request: its fields, and the function that answers it, called with the channel and the fields."""

    fields: dict[str, RequestField]
    answer: Callable[..., Any]


_WAY = {"distance": _number(-10_000, 10_000, "mm"), "turn": _number(-3600, 3600, "degrees")}

REQUESTS = {
    "hello": Request({}, Channel.hello),
    "truth": Request({}, Channel.truth),
    "move": Request(
        _WAY | {"seconds": _number(0, 10, "s")},
        lambda channel, seconds, **way: channel.vehicle.move(Odometry(**way), seconds),
    ),
    "pose": Request({"whom": _WHOM, "age": _number(0, 3600, "s", default=0.0)}, Channel.pose),
    "ahead": Request({"distance": _number(0, 10_000, "mm"), "angle": _number(0, 180, "degrees")}, Channel.ahead),
    "begin": Request({"task": _TASK}, lambda channel, task: channel.vehicle.begin(task)),
    "finish": Request({"task": _TASK}, lambda channel, task: channel.vehicle.finish(task)),
}
"""The requests: the methods of a `Vehicle`, the match's options, and the truth."""


def _parsed(line: bytes) -> dict[str, Any]:
    """Parse a line, with all its numbers as floats; raises LocalError."""
    if len(line) > LINE_LIMIT:
        raise LocalError(f"a line of more than {LINE_LIMIT} bytes")
    try:
        # As floats, so that `_number` accepts 1 and 1.0.
        given = json.loads(line, parse_int=float)
    except (ValueError, RecursionError) as error:
        raise LocalError(f"not JSON: {error}") from error
    if not isinstance(given, dict):
        raise LocalError(f'not a JSON object: write {{"{REQUEST}": "hello"}}')
    return given


def _checked(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a request, with defaults for missing ones; raises UnknownName, FieldError."""
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
"""Time between two checks for new events, in s."""

HTTP = re.compile(rb"(GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|TRACE|CONNECT) ")
"""Beginning of a browser's request, which ends the connection; our own lines begin with a brace."""

REMEMBERED = 10_000
"""Number of steps of each robot that are kept, as a world may run for days."""


class _Client(asyncio.Protocol):
    """A connection, one of `clients`: splits the bytes into lines, and answers them."""

    def __init__(self, answer: Callable[[bytes], bytes], clients: set[asyncio.Transport]) -> None:
        self._answer = answer
        self._clients = clients
        self._rest = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._clients.add(self._transport)

    def connection_lost(self, _: Exception | None) -> None:
        self._clients.remove(self._transport)

    def data_received(self, data: bytes) -> None:
        *lines, rest = (self._rest + data).split(b"\n")
        if any(map(HTTP.match, (*lines, rest))):  # a web page could make a browser send our lines
            self._transport.abort()
            return
        self._rest = rest[: LINE_LIMIT + 1]  # keep only enough of a long line to refuse it
        self._transport.write(b"".join(map(self._answer, lines)))  # writelines() of 3.12 cannot pause

    def pause_writing(self) -> None:
        # If a client does not read its answers, stop reading its requests.
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        self._transport.resume_reading()


class Server:
    """A served world; `show` is called with its address, then with each touch and score."""

    def __init__(self, world: World, channel: Channel, show: Callable[[MatchEvent], None]) -> None:
        self._world = world
        self._channel = channel
        self._show = show
        self._clients: set[asyncio.Transport] = set()
        self._touches = self._scores = 0

    async def serve(
        self, where: WorldAddress, duration: float, listening: Callable[[WorldAddress], object] = lambda _: None
    ) -> None:
        """Serve for `duration` s; call `listening` with the address at the start. Raises WorldError."""
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
        """Report new events, and drop old poses."""
        world = self._world
        world.pose(OURS, 0.0)  # this moves the robots on their rounds, even without requests
        for touch in world.touches[self._touches :]:
            self._show(MatchEvent(touch.time, EventKind.TOUCH, str(touch), touch._asdict()))
        for score in world.game.scores[self._scores :]:
            text = f"{score.robot}, {score.task}: {score.points}"
            self._show(MatchEvent(score.time, EventKind.TASK, text, score._asdict()))
        self._touches, self._scores = len(world.touches), len(world.game.scores)
        for body in world.robots.values():
            del body.trace[:-REMEMBERED]


# A robot in the world of another process: the client of `Channel`.
#
# A node's thread waits for the world only briefly, and the node goes on without a world. If the world cannot be
# reached, nothing moves and nothing is seen.


Value = TypeVar("Value")

TIMEOUT = 0.1
"""Maximum time for a connection, or an answer, in s."""

RETRY = 0.5
"""Time between two attempts to connect to a missing world, in s."""


class WorldTruth(NamedTuple):
    """The truth about a robot: its pose and its points."""

    pose: Pose
    points: int


class _Connection:
    """A connection to the world, opened when needed. Everything raises OSError, at the latest after TIMEOUT."""

    def __init__(self, address: Address) -> None:
        self._address: tuple[str, int] = address
        self._socket: socket.socket | None = None
        self._rests_until = -inf
        self._has_answered = False

    def ask(self, line: bytes) -> bytes:
        if time.monotonic() < self._rests_until:
            raise ConnectionError("it is asked again soon")
        try:
            if self._socket is None:
                self._socket = socket.create_connection(self._address, TIMEOUT)
                # Nagle's algorithm would delay the small packets of requests.
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                # Without a later look-up of the name, which may take longer than TIMEOUT.
                self._address = self._socket.getpeername()[:2]
            connection = self._socket
            connection.settimeout(TIMEOUT)
            connection.sendall(line)
            answer = self._answer(connection)
        except OSError:
            self.close()  # or a late answer would be taken for the next one
            # A world that has answered before may have been restarted, so it is asked again at once.
            self._rests_until = time.monotonic() + (0.0 if self._has_answered else RETRY)
            self._has_answered = False
            raise
        self._has_answered = True
        return answer

    def _answer(self, connection: socket.socket) -> bytes:
        end = time.monotonic() + TIMEOUT
        answer = b""
        while not answer.endswith(b"\n"):
            # TIMEOUT is for the whole answer. A timeout of 0 would mean non-blocking.
            connection.settimeout(max(end - time.monotonic(), 0.001))
            part = connection.recv(LINE_LIMIT)
            if not part or len(answer) > LINE_LIMIT:
                raise ConnectionError("it has hung up")
            answer += part
        return answer

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None


class RemoteVehicle:
    """Our robot in a world of another process (see `world.Vehicle`); any thread may call it.

    `report` is called once when the world can no longer be reached, and once when it is back. A restarted world is
    found again.
    """

    def __init__(self, where: WorldAddress, report: Callable[[str], None]) -> None:
        self._address = where.address
        self._report = report
        self._given = {TOKEN: where.token} if where.token else {}
        self._connection = _Connection(where.address)
        self._lock = Lock()
        self._is_away = False

    def close(self) -> None:
        """Close the connection."""
        with self._lock:
            self._connection.close()

    # Match and truth

    def hello(self, patience: float = 0.0) -> MatchOptions:
        """Return the match's options, waiting up to `patience` s; raises WorldError, LocalError for another version."""
        end = time.monotonic() + patience
        while True:
            try:
                return self._asked(_options, "hello")
            except WorldError as error:
                if time.monotonic() >= end:
                    raise WorldError(f"{error}; `eurobot-od world` starts one") from error
            time.sleep(RETRY)

    def truth(self) -> WorldTruth:
        """Return the truth about the robot; raises WorldError."""
        return self._asked(lambda each: WorldTruth(Pose(each["x"], each["y"], each["angle"]), each["points"]), "truth")

    # Wheels, beacons, distance sensor

    def move(self, wanted: Odometry, dt: float) -> float | None:
        return self._sensed(float, "move", distance=wanted.distance, turn=wanted.turn, seconds=dt)

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        return self._sensed(lambda answer: Pose(**answer), "pose", whom=whom.name.lower(), age=age)

    def ahead(self, distance: float, angle: float) -> Detection | None:
        return self._sensed(
            lambda seen: Detection(Obstacle[seen["obstacle"].upper()], seen["distance"], seen["bearing"]),
            "ahead",
            distance=distance,
            angle=angle,
        )

    # Actuators

    def begin(self, task: str) -> float:
        """Begin a task; raises LocalError for an unknown one, WorldError."""
        return self._asked(float, "begin", task=task)

    def finish(self, task: str) -> int:
        """Finish a task; raises as `begin`."""
        return self._asked(int, "finish", task=task)

    # Requests

    def _sensed(self, read: Callable[[Any], Value], request: str, **fields: object) -> Value | None:
        """Send a request; return None if there is nothing, or no answer."""
        try:
            return self._asked(lambda answer: None if answer is None else read(answer), request, **fields)
        except WorldError:
            return None
        except LocalError as error:  # it refuses our requests, so it has another version
            self._note(True, f"{error}; nothing moves, and nothing is seen")
            return None

    def _asked(self, read: Callable[[Any], Value], request: str, **fields: object) -> Value:
        """Send a request; raises WorldError, and LocalError if it is refused.

        Report once when answers stop, and once when they return.
        """
        with self._lock:
            try:
                line = json.dumps({REQUEST: request, **self._given, **fields}).encode() + b"\n"
                answer = json.loads(self._connection.ask(line))
                if ERROR in answer:
                    raise LocalError(f"the world at {self._address}: {answer[ERROR]}")
                value = read(answer[ANSWER])
            # The other end may not be a world, so anything but an answer counts as none.
            except (OSError, WorldError, KeyError, TypeError, ValueError, AttributeError) as error:
                text = f"the world at {self._address} does not answer: {getattr(error, 'strerror', None) or error}"
                self._note(True, f"{text}; nothing moves, and nothing is seen")
                raise WorldError(text) from error
            self._note(False, f"the world at {self._address} answers again")
            return value

    def _note(self, is_away: bool, text: str) -> None:
        if is_away != self._is_away:
            self._is_away = is_away
            self._report(text)


def _options(answer: dict[str, Any]) -> MatchOptions:
    """Parse the answer to hello; raises LocalError for another version."""
    if answer["version"] != VERSION:
        raise LocalError(f"the world has version {answer['version']} of the side channel, this program {VERSION}")
    team = TeamColour[answer["team"].upper()]
    errors = Errors(**answer["errors"])
    start = answer["enemies"], answer["confederates"]
    return MatchOptions(team, *start, seed=answer["seed"], errors=errors)
