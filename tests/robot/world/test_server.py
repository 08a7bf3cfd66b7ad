"""The served world: many clients, lines however they are cut, and one that hangs blocks nobody."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import pytest

from eurobot_od.errors import WorldError
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import MatchOptions, WorldAddress
from eurobot_od.robot.model.values import OURS, TeamColour
from eurobot_od.robot.world import World
from eurobot_od.robot.world.server import LINE_LIMIT, REMEMBERED, Channel, Server
from eurobot_od.robot.world.world import EventKind, MatchEvent
from eurobot_od.support.connections import Address

FACTS = robot_file.read()

ANY = WorldAddress(Address("127.0.0.1", 0))
FOREVER = float("inf")
HELLO = b'{"request": "hello"}\n'
PATIENCE = 60.0


class Served:
    """A world that is served while a test talks to it."""

    def __init__(self) -> None:
        options = MatchOptions(enemies=0, confederates=0)
        self.now = 0.0
        self.world = World(options, lambda: self.now)
        self.channel = Channel(self.world, options)
        self.events: list[MatchEvent] = []
        self.server = Server(self.world, self.channel, self.events.append)

    def run(self, test: Callable[[WorldAddress], Awaitable[None]]) -> None:
        """Serve until the test is done."""
        asyncio.run(self._run(test))

    async def _run(self, test: Callable[[WorldAddress], Awaitable[None]]) -> None:
        address = asyncio.get_running_loop().create_future()
        serving = asyncio.ensure_future(self.server.serve(ANY, FOREVER, address.set_result))
        await asyncio.wait_for(test(await address), PATIENCE)
        serving.cancel()
        await asyncio.wait([serving])


async def answer(reader: asyncio.StreamReader) -> Any:
    return json.loads(await reader.readline())


def test_lines_are_answered_in_their_order_however_they_are_cut() -> None:
    served = Served()

    async def talk(address: WorldAddress) -> None:
        reader, writer = await asyncio.open_connection(*address.address)
        writer.write(HELLO[:5])
        await asyncio.sleep(0)
        writer.write(HELLO[5:] + b'bad\n\n{"request": "truth"}\n' + HELLO[:7])
        assert (await answer(reader))["answer"]["team"] == "red"
        assert "error" in await answer(reader)
        assert "error" in await answer(reader)
        assert (await answer(reader))["answer"]["time"] == 0.0
        writer.write(HELLO[7:])
        assert (await answer(reader))["answer"]["team"] == "red"
        writer.close()

    served.run(talk)
    assert (served.channel.requests, served.channel.refused) == (5, 2)


MOVE = b'{"request": "move", "distance": 100, "turn": 0, "seconds": 1}\n'


@pytest.mark.parametrize(
    "begins",
    [
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1:2015\r\nContent-Type: text/plain\r\n\r\n",
        b"OPTIONS / HTTP/1.1\r\n\r\n",
        b"POST /" + bytes(3 * LINE_LIMIT) + b" HTTP/1.1\r\n\r\n",
    ],
    ids=["a form", "a question before it", "a long address"],
)
def test_a_web_page_does_not_move_a_robot(begins: bytes) -> None:
    served = Served()
    before = served.world.robots[OURS].pose

    async def talk(address: WorldAddress) -> None:
        reader, writer = await asyncio.open_connection(*address.address)
        writer.write(begins + MOVE)
        with suppress(ConnectionError):
            assert await reader.read() == b""
        writer.close()

    served.run(talk)
    assert served.channel.requests == 0
    assert served.world.robots[OURS].pose == before


@pytest.mark.parametrize("cut", [1, 3, 4, 5, 15, 60])
def test_a_web_page_does_not_move_a_robot_in_two_segments_either(cut: int) -> None:
    served = Served()
    asked = b"POST / HTTP/1.1\r\nHost: 127.0.0.1:2015\r\nContent-Type: text/plain\r\n\r\n" + MOVE

    async def talk(address: WorldAddress) -> None:
        reader, writer = await asyncio.open_connection(*address.address)
        for part in (asked[:cut], asked[cut:]):
            writer.write(part)
            await asyncio.sleep(0)
        with suppress(ConnectionError):
            assert await reader.read() == b""
        writer.close()

    served.run(talk)
    assert served.channel.requests == 0


@pytest.mark.parametrize("length", [LINE_LIMIT + 1, 3 * LINE_LIMIT, 1_000_000])
def test_a_line_that_is_too_long_is_refused_once_and_not_kept(length: int) -> None:
    served = Served()

    async def talk(address: WorldAddress) -> None:
        reader, writer = await asyncio.open_connection(*address.address)
        writer.write(b"x" * length + b"\n" + HELLO)
        assert (await answer(reader))["error"] == f"a line of more than {LINE_LIMIT} bytes"
        assert "answer" in await answer(reader)
        writer.close()

    served.run(talk)
    assert (served.channel.requests, served.channel.refused) == (2, 1)


def test_the_beginning_of_a_line_that_is_too_long_is_not_executed() -> None:
    served = Served()

    async def talk(address: WorldAddress) -> None:
        (reader, writer), (other, asking) = [await asyncio.open_connection(*address.address) for _ in range(2)]
        writer.write(HELLO[:-1] + b" " * LINE_LIMIT)
        asking.write(HELLO)
        await answer(other)  # by now the server has had the beginning
        writer.write(b"\n")
        assert "error" in await answer(reader)
        writer.close()
        asking.close()

    served.run(talk)


def test_a_client_that_hangs_or_does_not_read_blocks_nobody() -> None:
    served = Served()
    flood = 100_000

    async def talk(address: WorldAddress) -> None:
        _, silent = await asyncio.open_connection(*address.address)
        silent.write(HELLO[:-1])
        deaf, loud = await asyncio.open_connection(*address.address, limit=1)
        loud.write(HELLO * flood)
        for _ in range(10):
            reader, writer = await asyncio.open_connection(*address.address)
            writer.write(HELLO)
            assert "answer" in await answer(reader)
            writer.close()
        assert served.channel.requests < flood
        assert not deaf.at_eof()
        silent.close()
        loud.transport.abort()

    served.run(talk)


def test_touches_and_points_are_reported_once_and_in_time() -> None:
    served = Served()

    async def talk(address: WorldAddress) -> None:
        reader, writer = await asyncio.open_connection(*address.address)
        served.world.robots[OURS].place(FACTS.tasks(TeamColour.RED)["mammoth"].pose)
        for line in (
            b'{"request": "finish", "task": "mammoth"}\n',
            b'{"request": "move", "distance": 500, "turn": 0, "seconds": 1}\n',
        ):
            writer.write(line)
            assert "answer" in await answer(reader)
        writer.close()

    served.run(talk)
    start, touch, score = served.events
    assert (start.kind, start.data["host"]) == (EventKind.START, "127.0.0.1")
    assert (touch.kind, touch.text) == (EventKind.TOUCH, "ours at 500 mm/s touched border")
    assert (score.kind, score.data["points"]) == (EventKind.TASK, served.world.game.points(OURS))


def test_old_events_of_a_robot_are_dropped() -> None:
    served = Served()
    trace = served.world.robots[OURS].trace
    trace += trace * (2 * REMEMBERED)

    async def do_nothing(_: WorldAddress) -> None:
        pass

    served.run(do_nothing)
    assert len(trace) == REMEMBERED


def test_an_address_in_use_is_named() -> None:
    async def take_it_again(address: WorldAddress) -> None:
        with pytest.raises(WorldError, match=f"^cannot listen on {address}: .*in use"):
            await Served().server.serve(address, FOREVER, lambda _: None)

    Served().run(take_it_again)


def test_the_server_ends_in_time() -> None:
    served = Served()
    asyncio.run(served.server.serve(ANY, 0.0, lambda _: None))
    assert [event.kind for event in served.events] == [EventKind.START]
