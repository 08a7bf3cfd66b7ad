"""A server that is ended in the middle of long work, by SIGTERM or killed: what is left on the bus and on the disk."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from subprocess import Popen
from typing import Any, NamedTuple

import aiohttp
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from tests.cli.processes import command, line, serve_bus
from tests.kit.devices import MOTOR, SERVO
from tests.processes import bus_server, free_port
from tests.web.scene import LONG, Served, channel
from tests.web.test_jobs import done
from tests.web.test_server import answer, snapshot, talk
from tests.web.test_settings import sent

HEARTBEAT = (0x1017, 0)


class Loader(SimulatedDevice):
    """A servo drive whose program memory is kept, as far as it was written."""

    READERS = {(0x1F51, 1): lambda device: int(device.is_running)}  # noqa: RUF012
    WRITERS = {  # noqa: RUF012
        (0x1F50, 1): lambda device, program: device.programs.append(bytes(program)),
        (0x1F51, 1): lambda device, command: device.control(command),
    }

    def __init__(self, dictionary: Dictionary) -> None:
        self.is_running, self.programs, self.commands = True, list[bytes](), list[int]()
        super().__init__(dictionary)

    def control(self, command: int) -> None:
        """Stop, start or clear the program."""
        self.commands.append(command)
        self.is_running = command == 1


class Bench(NamedTuple):
    """A served page in a process of its own, its nodes, and its workspace."""

    process: Popen[str]
    served: Served
    one: SimulatedDevice
    two: SimulatedDevice
    loader: Loader
    workspace: Path


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    one, two = (SimulatedDevice(Dictionary.load(MOTOR, each)) for each in (5, 6))
    loader, name = Loader(Dictionary.load(SERVO, 7)), channel()
    with ExitStack() as stack:
        for node in (one, two, loader):
            stack.enter_context(Live.node(stack.enter_context(open_bus("virtual", name)), node))
        bus = stack.enter_context(serve_bus(name))
        (tmp_path / "eurobot-od.yaml").write_text(
            f"nodes:\n  one: {{file: {MOTOR}, node_id: 5}}\n  two: {{file: {MOTOR}, node_id: 6}}\n"
            f"  servo: {{file: {SERVO}, node_id: 7}}\n"
        )
        words = ("serve", str(tmp_path), "--control", "--listen", "127.0.0.1:0", "-i", "remote", "-c", bus)
        process = stack.enter_context(command(*words))
        address = line(process, "http://127.0.0.1:").split()[0]
        yield Bench(process, Served(address, None), one, two, loader, tmp_path)


async def prepared(opened: aiohttp.ClientWebSocketResponse, do: str) -> dict[str, Any]:
    """Bring about what an action needs; return its words."""
    if do == "scan":
        return {"do": "scan"}
    if do == "check":
        return {"do": "check", "node": "one", "suites": "CiA 301", "tier": "reversible", "sure": True}
    if do == "program":
        await sent(opened, "program.bin", bytes(200_000))
        return {"do": "program", "node": "servo", "file": "program.bin", "number": 1, "crc": False, "sure": True}
    write = {"id": 1, "do": "write", "node": "two", "object": "0x1017", "value": "700", "sure": True}
    assert "ok" in await answer(opened, json.dumps(write))
    words: dict[str, Any] = {"node": "one", "cob_ids": "move", "sure": True}
    if do == "apply":
        saved = await done(opened, "settings", do="save", node="two")
        words["file"] = "two.dcf"
        async with aiohttp.ClientSession() as session:
            origin = opened._response.url.origin()
            async with session.get(f"{origin}/report/{saved['result']['file']}") as found:
                await sent(opened, "two.dcf", await found.read())
    else:
        words["from"] = "two"
    await done(opened, "settings", do="preview", **words)
    return {"do": "apply", **words}


async def begun(opened: aiohttp.ClientWebSocketResponse, do: str) -> None:
    """Start an action, and wait until it is under way."""
    words = await prepared(opened, do)
    assert "ok" in await answer(opened, json.dumps({"id": 1, **words}))
    while not any(each["state"] == "running" and each["done"] > 0 for each in (await snapshot(opened))["jobs"]):
        pass


ACTIONS = ("scan", "check", "apply", "clone", "program")


@pytest.mark.posix
@pytest.mark.long
@pytest.mark.parametrize("do", ACTIONS)
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL], ids=["SIGTERM", "SIGKILL"])
def test_a_server_that_ends_during_an_action_leaves_the_device_as_it_was(
    bench: Bench, do: str, how: signal.Signals
) -> None:
    async def end(opened: aiohttp.ClientWebSocketResponse) -> None:
        await begun(opened, do)
        bench.process.send_signal(how)

    talk(bench.served, end)
    bench.process.communicate(timeout=LONG + 20)
    assert bench.process.returncode == (0 if how is signal.SIGTERM else -how)
    # The configuration is ended while the node is compared once more, before the first write.
    assert bench.one.device.objects.kept(HEARTBEAT) == 500
    assert bench.one.device.state is NmtState.PRE_OPERATIONAL
    # A program that was not written whole is not started: the node is stopped, and waits for the next download.
    assert (bench.loader.commands, bench.loader.programs) == ([0, 3] if do == "program" else [], [])
    for report in (bench.workspace / "reports").glob("*.json"):
        assert json.loads(report.read_text()), "a report is whole, or not there"


@pytest.mark.long
@pytest.mark.posix
def test_a_lost_adapter_is_said_ends_what_is_sent_and_comes_back() -> None:
    port = free_port()
    words = ("serve", "--control", "--listen", "127.0.0.1:0", "-i", "remote", "-c", f"ws://127.0.0.1:{port}/")
    rows = {"id": 1, "do": "begin list", "key": "a", "title": "it", "rows": [{"send": "123#AB", "period": "10 ms"}]}

    async def lost(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
        assert "ok" in await answer(opened, json.dumps(rows))
        while (await snapshot(opened))["lists"]["a"]["sent"] < 3:
            pass
        bus.kill()
        while not (said := await snapshot(opened))["trouble"] or not said["lists"]["a"]["ended"]:
            pass
        return said

    async def back(opened: aiohttp.ClientWebSocketResponse) -> bool:
        while (await snapshot(opened))["trouble"]:
            pass
        return "ok" in await answer(opened, json.dumps({**rows, "sure": True}))

    with ExitStack() as stack:
        bus = stack.enter_context(bus_server(port))
        process = stack.enter_context(command(*words))
        served = Served(line(process, "http://127.0.0.1:").split()[0], None)
        said = talk(served, lost)
        assert said["trouble"]
        assert said["lists"]["a"]["ended"] != "STOP"
        stack.enter_context(bus_server(port))
        assert talk(served, back)
