"""Nodes for a master to talk to: ours, canopen's own, and peers that answer as a test wants them to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from datetime import datetime
from pathlib import Path

import can
import canopen
from interop_rows.bench import new_channel as new_channel
from interop_rows.bench import open_bus as open_bus

from eurobot_od.bus.live import Live
from eurobot_od.client.boot import BootedSlave, hear_slave, order_start, prepare_slave, started_state
from eurobot_od.client.master import Master, RemoteNode
from eurobot_od.device.nmt import NmtState
from eurobot_od.od import dictionary
from eurobot_od.od.values import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from tests.kit import plant

EDS = plant.FILES.folder()
LIFT = EDS / "lift.eds"

ANSWER_WAIT = 2.0
"""Seconds, for a machine with much else to do; tests of silence have a wait of their own."""


@contextmanager
def line(*names: str) -> Iterator[str]:
    """Run nodes of the packaging line on a new bus inside the process; gives its channel."""
    channel = new_channel()
    with ExitStack() as stack:
        for name in names:
            stack.enter_context(Live.node(open_bus(channel), plant.NODES[name](plant.load(name))))
        yield channel


@contextmanager
def stock_lift(file: Path = LIFT) -> Iterator[tuple[str, canopen.LocalNode]]:
    """Run canopen's own node 2 with the lift's EDS on a new bus; gives its channel and the node."""
    channel = new_channel()
    network = canopen.Network(open_bus(channel))
    network.NOTIFIER_CYCLE = 0.01
    network.connect()
    # Its own, as tests take objects out of it; the one that was loaded is everybody's.
    node = network.create_node(2, deepcopy(dictionary.Dictionary.load(file, 2).objects))
    try:
        yield channel, node
    finally:
        network.disconnect()


@contextmanager
def peer(answers: Callable[[bytes], list[bytes]], node_id: int = 2) -> Iterator[str]:
    """Run a peer that answers each SDO request with the frames that `answers` gives; gives the channel."""
    channel = new_channel()
    bus = open_bus(channel)

    def received(message: can.Message) -> None:
        if message.arbitration_id == SDO_REQUEST_BASE + node_id:
            for data in answers(bytes(message.data)):
                bus.send(can.Message(arbitration_id=SDO_RESPONSE_BASE + node_id, data=data, is_extended_id=False))

    notifier = can.Notifier(bus, [received], timeout=0.01)
    try:
        yield channel
    finally:
        notifier.stop()
        bus.shutdown()


@contextmanager
def master_on(channel: str, answer_wait: float = ANSWER_WAIT) -> Iterator[Master]:
    """Open a master on a channel."""
    with Master(open_bus(channel), answer_wait) as master:
        yield master


def boot_slave(node: RemoteNode, file: dictionary.Dictionary, now: datetime) -> BootedSlave:
    """Boot one slave up to its start."""
    return hear_slave(node, prepare_slave(node, file, now))


def start_slave(node: RemoteNode, slave: BootedSlave, file: dictionary.Dictionary) -> NmtState | None:
    """Start one slave and return its state."""
    started = order_start(node, slave, file)
    return started_state(node, started) if started else None
