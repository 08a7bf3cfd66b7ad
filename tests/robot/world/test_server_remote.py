"""A vehicle in a world of another process: as good as one in this process, and harmless when the world is gone."""

from __future__ import annotations

import asyncio
import json
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest

from eurobot_od.errors import LocalError, WorldError
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import NOISE_ONLY, MatchOptions, WorldAddress
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import OURS, Source, TeamColour
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.world import World, server
from eurobot_od.robot.world.server import VERSION, Channel, RemoteVehicle, Server
from eurobot_od.robot.world.world import RIVAL, Sensor, SimulatedBeacons, SimulatedWheels, Vehicle
from eurobot_od.support.connections import Address

FACTS = robot_file.read()

PATIENCE = 60.0
OPTIONS = MatchOptions(TeamColour.YELLOW, enemies=1, confederates=0, seed=7, errors=NOISE_ONLY)
MAMMOTH = FACTS.tasks(TeamColour.YELLOW)["mammoth"]
STEP = Odometry(4.0, 1.0)


def make_world() -> World:
    """A world that stands, our robot at a task and looking at an enemy."""
    world = World(OPTIONS, lambda: 0.0)
    world.robots[OURS].place(MAMMOTH.pose)
    world.robots[RIVAL].place(Pose(*MAMMOTH.pose.moved(-500, 0).point, 0.0))
    return world


@contextmanager
def served(address: Address = Address("127.0.0.1", 0), token: str = "") -> Iterator[WorldAddress]:  # noqa: B008 (immutable)
    """Serve a world from a thread; yields its address."""
    ready = threading.Event()
    where = list[WorldAddress]()
    loop = asyncio.new_event_loop()
    server = Server(world := make_world(), Channel(world, OPTIONS, token), lambda _: None)

    def listening(bound: WorldAddress) -> None:
        where.append(bound)
        ready.set()

    serving = loop.create_task(server.serve(WorldAddress(address, token), float("inf"), listening))

    def run() -> None:
        loop.run_until_complete(asyncio.wait([serving]))
        loop.run_until_complete(asyncio.sleep(0))  # the connections end
        loop.close()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(PATIENCE)
    yield where[0]
    loop.call_soon_threadsafe(serving.cancel)
    thread.join(PATIENCE)
    assert not thread.is_alive()


@contextmanager
def reaching(address: WorldAddress) -> Iterator[tuple[RemoteVehicle, list[str]]]:
    """Yield a vehicle, and what it reports."""
    reports: list[str] = []
    vehicle = RemoteVehicle(address, reports.append)
    yield vehicle, reports
    vehicle.close()


def test_a_world_with_a_token_answers_only_who_has_it() -> None:
    with served(token="secret") as where:
        assert where.token == "secret"
        assert str(where).startswith("127.0.0.1:"), "no error and no log has the token in it"
        with reaching(where) as (vehicle, _):
            assert vehicle.hello().seed == OPTIONS.seed
        for token in ("", "other", "gehe\xefm", "\ud800"):  # the last one is half a character
            with reaching(where._replace(token=token)) as (vehicle, reports):
                with pytest.raises(LocalError, match="the token is missing or wrong: give the address"):
                    vehicle.hello()
                assert vehicle.move(Odometry(100.0, 0.0), 0.01) is None
                assert "the token is missing or wrong" in reports[0]


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


SAME: list[Callable[[Vehicle], object]] = [
    lambda it: it.move(STEP, 0.01),
    lambda it: it.move(Odometry(-600.0, 0.0), 1.0),
    lambda it: [it.pose(whom, 0.5) for whom in Source],
    lambda it: it.ahead(700.0, 180.0),
    lambda it: it.ahead(1.0, 1.0),
    lambda it: (it.begin("mammoth"), it.finish("mammoth"), it.finish("mammoth")),
]


@pytest.mark.parametrize("ask", SAME)
def test_a_remote_world_answers_like_a_local_one(ask: Callable[[Vehicle], object]) -> None:
    with served() as address, reaching(address) as (vehicle, reports):
        assert ask(vehicle) == ask(make_world().vehicle())
        assert reports == []


def test_a_remote_world_has_match_and_truth() -> None:
    with served() as address, reaching(address) as (vehicle, _):
        assert vehicle.hello() == OPTIONS
        assert vehicle.truth() == (MAMMOTH.pose, 0)


def test_an_unknown_task_is_a_value_error() -> None:
    with served() as address, reaching(address) as (vehicle, reports):
        with pytest.raises(LocalError, match=r"unknown task 'mamoth'; did you mean mammoth\?"):
            vehicle.begin("mamoth")
        assert reports == []


def test_a_lost_world_moves_nothing_and_is_reported_once() -> None:
    with served() as address:
        pass
    with reaching(address) as (vehicle, reports):
        wheels = SimulatedWheels(vehicle, OPTIONS.errors, random.Random(1))
        sensor = Sensor(vehicle, OPTIONS.errors, random.Random(1))
        for _ in range(3):
            assert wheels.advance(WheelCommand(400.0, 30.0), 0.01) == Odometry(0.0, 0.0)
            assert sensor.look(0.0) is None
            assert (
                SimulatedBeacons(vehicle, FACTS.field, OPTIONS.errors, lambda: (0.0, 0.0), "1").locate(
                    Source.INTERNAL, 0.0
                )
                is None
            )
            for call in (vehicle.truth, vehicle.hello, lambda: vehicle.begin("mammoth")):
                with pytest.raises(WorldError, match=f"^the world at {address} does not answer: "):
                    call()
        assert [report.partition(": ")[0] for report in reports] == [f"the world at {address} does not answer"]


def test_a_restarted_world_is_found_again() -> None:
    with ExitStack() as stack:
        with served() as address:
            vehicle, reports = stack.enter_context(reaching(address))
            assert vehicle.move(STEP, 0.01) is not None
        assert vehicle.move(STEP, 0.01) is None
        with served(address.address):
            wait_for(lambda: vehicle.move(STEP, 0.01) is not None)
    assert len(reports) == 2
    assert reports[1] == f"the world at {address} answers again"


def test_a_missing_world_is_not_asked_again_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "RETRY", 1000.0)
    with served() as address:
        pass
    with reaching(address) as (vehicle, _):
        assert vehicle.move(STEP, 0.01) is None
        with served(address.address), pytest.raises(WorldError, match="it is asked again soon"):
            vehicle.truth()


@contextmanager
def saying(answer: bytes | None) -> Iterator[WorldAddress]:
    """Run something else in the place of a world: it says the same to everybody, or hangs up; None hangs."""
    listener = socket.create_server(("127.0.0.1", 0))
    waiting: list[socket.socket] = []

    def accept() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            waiting.append(connection)
            if answer is not None:
                with suppress(OSError):  # who asked may have gone
                    connection.recv(1)
                    connection.sendall(answer)
                    connection.shutdown(socket.SHUT_WR)

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    yield WorldAddress(Address(*listener.getsockname()))
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    thread.join(PATIENCE)
    for connection in waiting:
        connection.close()


def hello_of(**changed: object) -> bytes:
    options = {"team": "red", "enemies": 0, "confederates": 0, "seed": 1, "errors": {}}
    return json.dumps({"answer": {"version": VERSION, **options, **changed}}).encode() + b"\n"


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (None, "never answers"),
        (b"", "hangs up"),
        (b'{"answer": 4', "an answer without its end"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "a web server"),
        (b"\xff\n", "no UTF-8"),
        (b"5\n", "no object"),
        (b"{}\n", "neither an answer nor an error"),
        (b'{"answer": "far"}\n', "no number"),
        (b'{"answer": {"z": 1}}\n', "other fields"),
        (b'{"error": "unknown request"}\n', "a world that refuses what we ask"),
        (b"x" * 100_000, "a line that does not end"),
        (b" " * 100_000 + b'{"answer": 4}\n', "a line that is too long"),
    ],
)
def test_a_malformed_answer_counts_as_a_missing_world(answer: bytes | None, why: str) -> None:
    with saying(answer) as address, reaching(address) as (vehicle, reports):
        assert vehicle.move(STEP, 0.01) is None, why
        assert vehicle.pose(Source.INTERNAL) is None, why
        assert vehicle.ahead(700.0, 35.0) is None, why
        assert len(reports) == 1
        assert reports[0].endswith("nothing moves, and nothing is seen")


@pytest.mark.parametrize(
    ("answer", "kind", "complaint"),
    [
        (hello_of(version=1), LocalError, f"has version 1 of the side channel, this program {VERSION}"),
        (hello_of(team="green"), WorldError, "does not answer: 'GREEN'"),
        (hello_of(errors={"wheel_wear": 1.0}), WorldError, "unexpected keyword argument 'wheel_wear'"),
    ],
)
def test_a_world_of_another_kind_is_refused(answer: bytes, kind: type[Exception], complaint: str) -> None:
    with saying(answer) as address, reaching(address) as (vehicle, _), pytest.raises(kind, match=complaint):
        vehicle.hello()
