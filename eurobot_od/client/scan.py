"""Finds the nodes of a bus.

A node is there if it answers one of our SDO requests, or if its heartbeat is heard. Other frames prove nothing: a
protocol's own identifiers may look like PDOs of any node.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import NamedTuple

from eurobot_od.client.description import Identity, device_name, read_identity
from eurobot_od.client.master import Master
from eurobot_od.client.procedure import Procedure
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import RemoteError
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import NODE_IDS
from eurobot_od.sdo.wire import LENGTH, ClientCommand, Initiate, ServerCommand, initiate

PACE = 0.005
"""Seconds between two requests, so that 127 of them do not fill a bus that others use."""

UPLOADED = (ServerCommand.UPLOAD, ServerCommand.ABORT)
"""The ways in which an SDO server answers an upload."""

LISTEN = 1.5
"""Seconds of waiting for heartbeats; most nodes send one every second."""


class Found(NamedTuple):
    """A node: its NMT `state` if a heartbeat was heard, its `identity` if it answers SDO, its `name` in 0x1008."""

    node_id: int
    state: NmtState | None
    identity: Identity | None
    name: str


@Procedure
async def scan(
    master: Master, node_ids: Iterable[int] = NODE_IDS, pace: float = PACE, listen: float = LISTEN
) -> list[Found]:
    """Return the nodes that are there, by node-ID. Raises BusError."""
    wanted = sorted(node_ids)
    answered: set[int] = set()

    def received(node_id: int, data: bytes) -> None:
        # An abort of 0x1000 is an answer, too. A transfer would not do here: it ends with the first odd answer, and
        # another master may be asking the node as well.
        answer = Initiate.of(data) if len(data) == LENGTH else None
        if answer is not None and answer.address == DEVICE_TYPE and answer.command >> 5 in UPLOADED:
            answered.add(node_id)

    # All are asked before the first has to answer: one after the other, silent node-IDs would take a minute.
    for node_id in wanted:
        server = master.sdo_server(node_id)
        master.listeners[server.answers] = partial(received, node_id)
        master.send(server.requests, initiate(ClientCommand.UPLOAD << 5, DEVICE_TYPE))
        await master.pump.steps(pace)
    await master.pump.steps(max(listen - pace * len(wanted), master.answer_wait))
    return [await _found(master, node_id) for node_id in sorted(answered | set(master.states)) if node_id in wanted]


async def _found(master: Master, node_id: int) -> Found:
    """Ask a node that is there for its identity; one that is STOPPED does not answer."""
    node = master.node(node_id)
    try:
        identity, name = await read_identity.steps(node), await device_name.steps(node)
    except RemoteError:
        identity, name = None, ""
    return Found(node_id, node.last_state, identity, name)
