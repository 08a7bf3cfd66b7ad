"""Devices in processes of their own on a bus of python-can-remote: what is noticed, and what comes back by itself."""

from __future__ import annotations

import gc
import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial

import can
import pytest

from eurobot_od.bus.live import open_bus
from eurobot_od.check.on_bus import run_live
from eurobot_od.check.report import Status, StepResult, SuitePart
from eurobot_od.check.runner import RunOptions
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.session import Session
from tests.bus.live.loose import wait_for
from tests.kit import lift
from tests.kit.devices import MOTOR, read
from tests.processes import PATIENCE, bus_server, free_port, motor, node, shared

pytest.importorskip("can_remote")

from can_remote.websocket import WebSocket

pytestmark = pytest.mark.live


@pytest.mark.long
def test_a_bus_server_that_is_restarted_is_found_again() -> None:
    port = free_port()
    with bus_server(port) as first, node(*motor(5), *shared(port)) as one, node(*motor(6), *shared(port)) as another:
        first.kill()
        for each in (one, another):
            assert each.line("bus failed").endswith("; it is opened again")
        with bus_server(port), joined(port) as bus:
            for each in (one, another):
                assert "after a gap of " in each.line("bus back")
            wait_for(bus, 0x705)
            wait_for(bus, 0x706)


def joined(port: int) -> can.BusABC:
    return open_bus("remote", f"ws://127.0.0.1:{port}/")


@pytest.fixture
def _collected() -> Iterator[None]:
    """Make the garbage collector close the sockets that python-can-remote leaves open after a failed connection."""
    yield
    gc.collect()


LEAKING = pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning")


@pytest.mark.long
@LEAKING
@pytest.mark.usefixtures("_collected")
def test_a_page_goes_on_when_the_bus_server_is_restarted() -> None:
    port = free_port()
    with bus_server(port) as first:
        session = Session(partial(joined, port), Decoder(lift.dictionaries(), lift.CATALOGUE), 500_000)
        first.kill()
        until(session, lambda: bool(session.trouble))
        with bus_server(port), joined(port) as other:
            until(session, lambda: not session.trouble)
            other.send(can.Message(arbitration_id=0x702, data=b"\5", is_extended_id=False))
            until(session, lambda: session.frames == 1)
        session.close()


def until(session: Session, reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not reached():
        session.poll()
        assert time.monotonic() < deadline


SUITE = """
spec: 1
name: a suite
node: motor
steps: [{send: {raw: "205#0100"}}, {wait: 1 min}]
teardown: [{send: {raw: "205#0000"}}]
"""


@LEAKING
@pytest.mark.usefixtures("_collected")
def test_a_check_has_its_teardown_when_the_bus_server_is_restarted() -> None:
    port = free_port()
    (suite,) = read(Dictionary.load(MOTOR, 5), SUITE)
    restarted = ExitStack()
    first = restarted.enter_context(bus_server(port))

    def restart(step: StepResult) -> None:
        if step.status is Status.PASSED and step.section is SuitePart.STEPS:
            first.kill()
            restarted.enter_context(bus_server(port))

    with restarted:
        result = run_live(suite, RunOptions(show=restart), partial(joined, port))
    assert "failed" in str(result.error)
    assert [step.status for step in result.steps] == [Status.PASSED, Status.BUS_FAILED, Status.PASSED]


@pytest.mark.long
@LEAKING
@pytest.mark.usefixtures("_collected")
def test_a_server_that_no_longer_delivers_is_noticed() -> None:
    """An identifier below 0 ends the threads of python-can-remote's server that send to its clients, of all of them."""
    port = free_port()
    with (
        bus_server(port),
        node(*motor(5), *shared(port)) as first,
        node(*motor(6), *shared(port)),
        joined(port) as bus,
    ):
        for _ in range(3):
            wait_for(bus, 0x706)  # a heartbeat, which the other hears, too
        peer = WebSocket(f"ws://127.0.0.1:{port}/", ["can.json.v1"])
        peer.send(json.dumps({"type": "bus_request", "payload": {"config": {}}}))
        peer.read()
        peer.send(json.dumps({"type": "message", "payload": {"arbitration_id": -1, "is_extended_id": False}}))
        assert "nothing has been heard for 5 s" in first.line("bus silent")
        peer.close()


@pytest.mark.long
def test_without_reconnection_a_lost_bus_ends_a_node_with_status_3() -> None:
    port = free_port()
    with bus_server(port) as server, node(*motor(), "--no-reconnect", *shared(port)) as running:
        server.kill()
        assert running.wait() == 3
        [line] = [line for line in running.told() if line.startswith("eurobot-od: ")]
        assert line.startswith("eurobot-od: the bus Virtual bus channel shared on ws://127.0.0.1:")
