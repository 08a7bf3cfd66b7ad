"""A robot in the world of another process: asks over the side channel what `channel` answers there.

Rule of this file: a node's thread waits for the world only for a moment, and whatever happens to the world, the node
goes on. If a world cannot be reached, nothing moves in it and nothing is seen.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from math import inf
from threading import Lock
from typing import Any, NamedTuple, TypeVar

from eurobot_od.errors import LocalError, WorldError
from eurobot_od.robot.model.options import Errors, MatchOptions, WorldAddress
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import OURS, Obstacle, Source, TeamColour
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.node import Detection
from eurobot_od.robot.world.server import ANSWER, ERROR, LINE_LIMIT, REQUEST, ROBOT, TOKEN, VERSION
from eurobot_od.support.connections import Address

Value = TypeVar("Value")

TIMEOUT = 0.1
"""Seconds that a connection, or an answer, may take."""

RETRY = 0.5
"""Seconds between two attempts to reach a world that was not there; it is not asked meanwhile."""


class WorldTruth(NamedTuple):
    """What is true of a robot at a time of the world, in s: where it is, its points, and its number of touches."""

    time: float
    x: float
    y: float
    angle: float
    points: int
    touches: int

    @property
    def pose(self) -> Pose:
        """Its true pose."""
        return Pose(self.x, self.y, self.angle)


class _Connection:
    """A line to the world, made again when it is needed. Everything raises OSError, at the latest after TIMEOUT."""

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
                # A request is one small packet that somebody waits for: Nagle's algorithm would hold it back.
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                # From now on no name has to be looked up, which may take longer than TIMEOUT.
                self._address = self._socket.getpeername()[:2]
            connection = self._socket
            connection.settimeout(TIMEOUT)
            connection.sendall(line)
            answer = self._answer(connection)
        except OSError:
            self.close()  # a late answer would be taken for the next one
            # A world that has answered before is asked again at once: it may just have been restarted.
            self._rests_until = time.monotonic() + RETRY * (not self._has_answered)
            self._has_answered = False
            raise
        self._has_answered = True
        return answer

    def _answer(self, connection: socket.socket) -> bytes:
        end, answer = time.monotonic() + TIMEOUT, b""
        while not answer.endswith(b"\n"):
            # TIMEOUT is for the whole answer, not for each part; 0 would mean "do not wait", and raise another error.
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
    """One robot of a world in another process (see `instruments.Vehicle`); any thread may call it.

    `report` is called once when the world can no longer be reached, and once when it is back. A restarted world is
    found again.
    """

    def __init__(self, where: WorldAddress, report: Callable[[str], None], robot: str = OURS) -> None:
        self._address, self._report = where.address, report
        self._given = {ROBOT: robot} | ({TOKEN: where.token} if where.token else {})
        self._connection, self._lock = _Connection(where.address), Lock()
        self._is_away = False

    def close(self) -> None:
        """Hang up."""
        with self._lock:
            self._connection.close()

    # What the world says about itself

    def hello(self, patience: float = 0.0) -> MatchOptions:
        """Ask which match it is, for up to `patience` seconds; raises WorldError, LocalError for another version."""
        end = time.monotonic() + patience
        while True:
            try:
                return self._asked(_options, "hello")
            except WorldError:
                if time.monotonic() >= end:
                    raise
            time.sleep(RETRY)

    def truth(self) -> WorldTruth:
        """Ask what is true of the robot; raises WorldError."""
        return self._asked(lambda answer: WorldTruth(**answer), "truth")

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

    # Asking

    def _sensed(self, read: Callable[[Any], Value], request: str, **fields: object) -> Value | None:
        """Ask; None if the answer is that there is nothing, or if there is no answer."""
        try:
            return self._asked(lambda answer: None if answer is None else read(answer), request, **fields)
        except WorldError:
            return None
        except LocalError as error:  # it refuses our questions, so it is of another version
            self._tell(True, f"{error}; nothing moves, and nothing is seen")
            return None

    def _asked(self, read: Callable[[Any], Value], request: str, **fields: object) -> Value:
        """Ask; report once when answers stop, and once when they are back. Raises WorldError, LocalError (refused)."""
        with self._lock:
            try:
                line = json.dumps({REQUEST: request, **self._given, **fields}).encode() + b"\n"
                answer = json.loads(self._connection.ask(line))
                if ERROR in answer:
                    raise LocalError(f"the world at {self._address}: {answer[ERROR]}")
                value = read(answer[ANSWER])
            # The other end need not be a world: anything that is not an answer counts as no answer.
            except (OSError, WorldError, KeyError, TypeError, ValueError, AttributeError) as error:
                text = f"the world at {self._address} does not answer: {getattr(error, 'strerror', None) or error}"
                self._tell(True, f"{text}; nothing moves, and nothing is seen")
                raise WorldError(text) from error
            self._tell(False, f"the world at {self._address} answers again")
            return value

    def _tell(self, is_away: bool, text: str) -> None:
        if is_away != self._is_away:
            self._is_away = is_away
            self._report(text)


def _options(answer: dict[str, Any]) -> MatchOptions:
    """Read the answer to hello; raises LocalError for another version."""
    if answer["version"] != VERSION:
        raise LocalError(f"the world has version {answer['version']} of the side channel, this program {VERSION}")
    team, errors = TeamColour[answer["team"].upper()], Errors(**answer["errors"])
    start = answer["enemies"], answer["confederates"]
    return MatchOptions(team, *start, seed=answer["seed"], errors=errors)
