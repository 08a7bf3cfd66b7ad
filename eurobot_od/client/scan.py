"""Finds the nodes of a bus.

Rule of this file: a node is there if it answers an SDO request of ours, or if its heartbeat is heard. Other frames
prove nothing: this protocol's own identifiers look like PDOs of a node 64.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from eurobot_od.client.description import Identity, device_name
from eurobot_od.client.master import SDO_LENGTH, Master
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import RemoteError
from eurobot_od.od.values import NODE_IDS, SDO_REQUEST_BASE, SDO_RESPONSE_BASE

PACE = 0.005
"""Seconds between two requests: 127 of them are not to fill a bus that others use."""

LISTEN = 1.5
"""Seconds for which heartbeats are awaited; most nodes send one a second."""

DEVICE_TYPE = bytes([0x00, 0x10, 0x00])
"""Index and sub-index of 0x1000, as an SDO frame has them."""

UPLOAD = bytes([0x40])
ANSWERS = (0x40, 0x80)
"""Command bytes of an upload request, and of an answer or abort to it, by their three highest bits."""


class Found(NamedTuple):
    """A node: its NMT `state` if a heartbeat told it, its `identity` if it answers SDO, its `name` in 0x1008."""

    node_id: int
    state: NmtState | None
    identity: Identity | None
    name: str


def scan(master: Master, node_ids: Iterable[int] = NODE_IDS, pace: float = PACE, listen: float = LISTEN) -> list[Found]:
    """Return the nodes that are there, by node-ID. Raises BusError."""
    wanted = sorted(node_ids)
    answered = _Answers(master, wanted)
    for node_id in wanted:
        master.send(SDO_REQUEST_BASE + node_id, (UPLOAD + DEVICE_TYPE).ljust(SDO_LENGTH, b"\0"))
        master.pump(_never, pace)
    master.pump(_never, max(listen - pace * len(wanted), master.answer_wait))
    return [_found(master, node_id) for node_id in sorted(answered.nodes | set(master.states)) if node_id in wanted]


class _Answers:
    """Takes note of the `nodes` that answer the upload of 0x1000, be it by an abort."""

    def __init__(self, master: Master, node_ids: Iterable[int]) -> None:
        self.nodes: set[int] = set()
        for node_id in node_ids:
            master.network.subscribe(SDO_RESPONSE_BASE + node_id, self._received)

    def _received(self, cob_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == SDO_LENGTH and data[0] & 0xE0 in ANSWERS and data[1:4] == DEVICE_TYPE:
            self.nodes.add(cob_id - SDO_RESPONSE_BASE)


def _found(master: Master, node_id: int) -> Found:
    """Ask a node that is there who it is; one in STOPPED does not answer."""
    node = master.node(node_id)
    try:
        identity, name = Identity.read(node), device_name(node)
    except RemoteError:
        identity, name = None, ""
    return Found(node_id, node.last_state, identity, name)


def _never() -> bool:
    return False
