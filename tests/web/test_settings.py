"""A node's settings and its program from the page: compared, saved, applied, cloned; put back when it is ended."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.meaning import Decoder
from tests.device.master import Memory
from tests.kit.devices import MAKERS, MOTOR, SERVO
from tests.web.scene import Served, channel, live_page
from tests.web.test_jobs import done, ended
from tests.web.test_server import answer, talk

SPEED = (0x2000, 3)
"""The target speed of the motor: process data. 0x1017 is a setting of it."""

HEARTBEAT = (0x1017, 0)


class Motors(NamedTuple):
    """Two motors on a bus, and its page."""

    served: Served
    one: Node
    two: Node


@contextmanager
def motors(folder: Path, file: Path = MOTOR) -> Iterator[Motors]:
    """Serve the page of a bus with two devices of a file, by default the motor of the documentation."""
    name = channel()
    known = [Dictionary.load(file, node_id).named(title) for title, node_id in (("one", 5), ("two", 6))]
    nodes = [SimulatedDevice(each, store=Memory()) for each in known]
    with ExitStack() as stack:
        for node in nodes:
            stack.enter_context(Live.node(stack.enter_context(open_bus("virtual", name)), node))
        served = stack.enter_context(live_page(name, folder, network=Decoder(known)))
        yield Motors(served, *nodes)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Motors]:
    with motors(tmp_path) as found:
        yield found


def act(bench: Motors, do: str, **words: Any) -> dict[str, Any]:
    """Do something with the settings of node one, to the end."""
    known = {"node": "one", "sure": True, **words}
    return dict(talk(bench.served, lambda opened: done(opened, "settings", do=do, **known)))


def value(node: Node, address: tuple[int, int]) -> Any:
    return node.device.objects.kept(address)


async def sent(opened: aiohttp.ClientWebSocketResponse, name: str, content: bytes) -> None:
    """Send a file in parts of 20 000 bytes."""
    for at in range(0, len(content), 20_000):
        part = b64encode(content[at : at + 20_000]).decode()
        said = await answer(opened, json.dumps({"id": 1, "do": "file", "name": name, "at": at, "data": part}))
        assert said["ok"] == min(at + 20_000, len(content))


async def set_to(opened: aiohttp.ClientWebSocketResponse, node: str, number: int) -> None:
    words = {"id": 1, "do": "write", "node": node, "object": "0x1017", "value": str(number), "sure": True}
    assert "ok" in await answer(opened, json.dumps(words))


def test_differences_from_the_file_are_those_of_the_command_diff(bench: Motors) -> None:
    talk(bench.served, lambda opened: set_to(opened, "one", 250))
    job = act(bench, "differences")
    found = {each["object"]: (each["before"], each["after"]) for each in job["rows"]}
    assert found["0x1017 sub 0"] == ("500", "250")


def test_a_dcf_that_was_saved_is_compared_and_applied(bench: Motors, tmp_path: Path) -> None:
    saved = act(bench, "save")
    dcf = (tmp_path / "reports" / saved["result"]["file"]).read_bytes()

    async def apply(opened: aiohttp.ClientWebSocketResponse) -> tuple[dict[str, Any], dict[str, Any]]:
        await set_to(opened, "one", 250)
        await sent(opened, "motor.dcf", dcf)
        words = {"node": "one", "file": "motor.dcf", "sure": True}
        shown = await done(opened, "settings", do="preview", **words)
        return shown, await done(opened, "settings", do="apply", **words)

    shown, applied = talk(bench.served, apply)
    assert [(each["object"], each["before"], each["after"]) for each in shown["rows"]] == [("0x1017:0", "250", "500")]
    assert applied["error"] == ""
    assert applied["result"]["text"].startswith(
        "node 5 configured: 1 object written and read back, not stored: the node has"
    )
    assert value(bench.one, HEARTBEAT) == 500


def test_a_node_is_cloned_to_another_one(bench: Motors) -> None:
    async def clone(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
        await set_to(opened, "two", 700)
        words = {"node": "one", "from": "two", "sure": True, "cob_ids": "move"}
        await done(opened, "settings", do="preview", **words)
        return await done(opened, "settings", do="apply", **words)

    assert talk(bench.served, clone)["error"] == ""
    assert value(bench.one, HEARTBEAT) == 700


def test_the_file_of_a_domain_is_found_beside_the_dcf_that_was_sent(tmp_path: Path) -> None:
    async def preview(opened: aiohttp.ClientWebSocketResponse, *beside: str) -> dict[str, Any]:
        files = "AccessType=rw\nUploadFile=blob.bin\nDownloadFile=blob.bin\n"
        text = SERVO.read_text().replace("0x000F\nAccessType=ro\n", f"0x000F\n{files}")
        text += "\n[DeviceComissioning]\nNodeID=5\n"
        await sent(opened, "servo.dcf", text.encode())
        for each in beside:
            await sent(opened, each, b"content")
        return await done(opened, "settings", do="preview", node="one", file="servo.dcf", sure=True)

    with motors(tmp_path, SERVO) as bench:
        without = talk(bench.served, preview)
        found = talk(bench.served, lambda opened: preview(opened, "blob.bin"))
    assert "blob.bin" in without["error"]
    assert "blob.bin" not in found["error"]


def test_settings_that_were_not_compared_are_not_applied(bench: Motors) -> None:
    words = json.dumps({"id": 1, "do": "apply", "node": "one", "from": "two", "sure": True})
    said = talk(bench.served, lambda opened: answer(opened, words))
    assert said["error"] == "compare first: what is written is what the comparison has shown"


def test_a_configuration_that_is_ended_leaves_the_node_as_it_was(bench: Motors) -> None:
    async def end(opened: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
        await set_to(opened, "two", 700)
        words = {"node": "one", "from": "two", "sure": True, "cob_ids": "move"}
        await done(opened, "settings", do="preview", **words)
        assert "ok" in await answer(opened, json.dumps({"id": 1, "do": "apply", **words}))
        await answer(opened, '{"id": 2, "do": "end job"}')
        return await ended(opened, "settings")

    assert talk(bench.served, end)["state"] == "ended"
    assert value(bench.one, HEARTBEAT) == 500


def test_a_node_stores_and_restores(tmp_path: Path) -> None:
    async def restored(opened: aiohttp.ClientWebSocketResponse) -> list[dict[str, Any]]:
        await set_to(opened, "one", 250)
        return [await done(opened, "settings", do=do, node="one", sure=True) for do in ("store", "restore")]

    with motors(tmp_path, MAKERS / "encoder.eds") as bench:
        default = value(bench.one, HEARTBEAT)
        stored, restored_ = talk(bench.served, restored)
    assert stored["result"]["text"] == "node 5 has stored all parameters"
    assert restored_["result"]["text"] == "node 5 has the defaults of all parameters"
    assert value(bench.one, HEARTBEAT) == default
