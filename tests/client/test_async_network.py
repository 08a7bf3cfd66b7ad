"""A network in an event loop: the same procedures awaited, many devices at once, cancelled as asyncio wants it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any

import pytest

from eurobot_od.client.master import Procedure
from eurobot_od.client.network import AsyncNetwork
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import FieldError, HeartbeatLost, NoAnswer, StateError
from eurobot_od.od import dcf
from tests.client.peers import new_channel
from tests.client.servo import DCF, EDS, SERVO, live_servos

PATIENCE = 60.0
"""Seconds, for a machine with much else to do."""


def run(main: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(main, PATIENCE))


def test_the_names_of_a_network_are_awaited() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=2.0) as network:
            drive = network.add(5, SERVO)
            assert (await drive.configure(DCF)).verified
            await drive["Profile velocity"].write("1250 rpm")
            assert await drive["Profile velocity"].value == 1250
            assert await drive["Current control"]["P gain"].read() == 1500
            with pytest.raises(FieldError):
                await drive["Profile velocity"].write(0)
            await drive.nmt.start(within=2.0)
            assert await drive.heartbeat() is NmtState.OPERATIONAL
            network.sync(period=0.01)
            times = [reading.time async for reading, _ in azip(drive.pdo["TPDO1"].__aiter__(), 5)]
            assert times == sorted(times)
            assert (await drive.pdo["TPDO1"]["Torque actual value"].wait()).value == 0
            assert [each.node_id for each in await network.scan([4, 5], listen=0.1)] == [5]
            with pytest.raises(HeartbeatLost, match="no heartbeat of node 6"):
                await network.add(6).heartbeat(within=0.01)

    with live_servos(5) as channel:
        run(main(channel))


async def azip(items: Any, count: int) -> Any:
    """Return the first items with their numbers."""
    for number in range(count):
        yield await items.__anext__(), number


@pytest.mark.long
def test_many_devices_are_configured_at_once_without_a_thread_each(tmp_path: Any) -> None:
    nodes = range(1, 7)
    for node_id in nodes:
        text = dcf.with_values(SERVO.renumbered(node_id).device, {(0x6081, 0): 1000 + node_id}, node_id, "servo", 500)
        (tmp_path / f"{node_id}.dcf").write_text(text)

    async def main(channel: str) -> None:
        before = threading.active_count()
        async with AsyncNetwork.open("virtual", channel, answer_wait=5.0) as network:
            drives = [network.add(node_id, SERVO) for node_id in nodes]
            await asyncio.gather(*(drive.configure(tmp_path / f"{drive.node_id}.dcf") for drive in drives))
            assert threading.active_count() <= before + 1
            assert [await drive["Profile velocity"].value for drive in drives] == [1000 + node_id for node_id in nodes]

    with live_servos(*nodes) as channel:
        run(main(channel))


def test_two_tasks_may_talk_to_one_node() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=2.0) as network:
            drive = network.add(5, SERVO)
            names = ["Profile velocity", "Manufacturer device name"] * 5
            assert await asyncio.gather(*(drive[name].read() for name in names)) == [1000, "Servo 100"] * 5

    with live_servos(5) as channel:
        run(main(channel))


def test_a_silent_node_is_told_by_name_while_others_answer() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=0.2) as network:
            drive, nobody = network.add(5, SERVO), network.add(6, SERVO)
            told = await asyncio.gather(
                nobody["Profile velocity"].read(), drive["Profile velocity"].read(), return_exceptions=True
            )
            assert isinstance(told[0], NoAnswer)
            assert str(told[0]).startswith("no answer from node 6 within 200 ms after read 0x6081:0 Profile velocity")
            assert told[1] == 1000

    with live_servos(5) as channel:
        run(main(channel))


def test_a_configuration_that_is_cancelled_takes_back_what_it_wrote() -> None:
    async def main(channel: str) -> None:
        async with AsyncNetwork.open("virtual", channel, answer_wait=2.0) as network:
            drive = network.add(5, SERVO)
            task = asyncio.ensure_future(drive.configure(DCF))
            while await drive["Producer heartbeat time"].value != 50:
                await asyncio.sleep(0)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert await drive["Producer heartbeat time"].value == 100

    with live_servos(5) as channel:
        run(main(channel))


def test_a_network_that_nobody_has_entered_says_so() -> None:
    drive = AsyncNetwork.open("virtual", new_channel()).add(5)
    with pytest.raises(StateError, match="`async with` opens it"):
        run(drive["0x1000"].read())


def test_a_network_file_names_the_nodes(tmp_path: Any) -> None:
    (tmp_path / "network.yaml").write_text(f"nodes:\n  axis: {{file: {EDS}, node_id: 5}}\n")

    async def main(channel: str) -> None:
        async with AsyncNetwork.load(tmp_path / "network.yaml", "virtual", channel, answer_wait=2.0) as network:
            assert await network["axis"]["Profile velocity"].read() == 1000

    with live_servos(5) as channel:
        run(main(channel))


def test_a_procedure_of_an_event_loop_is_awaited_and_not_called() -> None:
    async def main() -> None:
        async with AsyncNetwork.open("virtual", new_channel()) as network:
            with pytest.raises(StateError, match="await its calls"):
                network.master.pump(0.1)

    run(main())


def test_a_procedure_is_called_at_once_or_awaited() -> None:
    @Procedure
    async def double(number: int) -> int:
        """Return twice the number."""
        return 2 * number

    assert double(3) == asyncio.run(double.steps(3)) == 6
    assert double.__doc__ == "Return twice the number."
