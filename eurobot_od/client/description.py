"""What a node is: its identity 0x1018, and its EDS, wherever that is found. And which nodes there are on a bus.

An EDS is taken only for a node with the same identity; a file that a person names is taken as it is. In a scan a node
is there if it answers one of our SDO requests, or if its heartbeat is heard. Other frames prove nothing: a protocol's
own identifiers may look like PDOs of any node.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from eurobot_od.client.master import Master, Procedure, RemoteNode
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import NoAnswer, NodeRefused, RemoteError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import DEVICE_NAME, DEVICE_TYPE, IDENTITY, STORE_FORMAT, STORED_EDS
from eurobot_od.od.values import NODE_IDS, Address
from eurobot_od.sdo.wire import EXPEDITED_SIZE, LENGTH, ClientCommand, Initiate, ServerCommand, initiate

LONGEST_NAME = 1024
"""Most bytes of a device's name: a node that never ends it must not hold whoever looks for nodes."""

PLAIN_TEXT = b"\0"
"""Value of 0x1022 for an EDS that is not compressed (CiA 301, 7.5.2.25)."""


class Identity(NamedTuple):
    """The identity object 0x1018; 0 for a number that a node does not have (CiA 301, 7.5.2.21)."""

    vendor: int = 0
    product: int = 0
    revision: int = 0
    serial: int = 0

    def __str__(self) -> str:
        return ":".join(f"0x{number:08X}" for number in self)

    @classmethod
    def of(cls, dictionary: Dictionary) -> Identity:
        """Return the identity that an EDS or DCF is for."""
        return cls(*dictionary.identity)

    def difference(self, other: Identity) -> str | None:
        """Return in what another device is of another kind than this one; None if it is of the same kind.

        The serial number tells devices of one kind apart. Only the upper half of the revision must agree: the lower
        half does not change the CANopen behaviour (CiA 301, 7.5.2.21).
        """
        pairs = {
            "vendor-ID": (self.vendor, other.vendor),
            "product code": (self.product, other.product),
            "major revision": (self.revision >> 16, other.revision >> 16),
        }
        return next((f"{name} 0x{b:X}, not 0x{a:X}" for name, (a, b) in pairs.items() if a != b), None)


@Procedure
async def read_identity(node: RemoteNode) -> Identity:
    """Ask a node what it is; only the vendor-ID is mandatory. Raises NoAnswer, RemoteError, BusError."""
    addresses = {(IDENTITY, subindex): name for subindex, name in enumerate(Identity._fields, start=1)}
    numbers = [await _optional(node, address, name) for address, name in addresses.items()]
    return Identity(*(int.from_bytes(each, "little") for each in numbers))


@Procedure
async def uploaded(node: RemoteNode) -> Dictionary | None:
    """Return the EDS that a node keeps of itself in 0x1021; None if it has none in plain text.

    Raises DictionaryError for one that cannot be read.
    """
    try:
        if await node.upload.steps(STORE_FORMAT, "Store format", most=EXPEDITED_SIZE) != PLAIN_TEXT:
            return None
        content = await node.upload_block.steps(STORED_EDS, "Store EDS")
    except NodeRefused:
        return None
    return Dictionary.read(content, Path(f"EDS of node {node.node_id}"), node.node_id) if content else None


@Procedure
async def fitting(node: RemoteNode, known: Iterable[Dictionary]) -> Dictionary | None:
    """Return the first of the known EDS files with the node's identity, None if there is none.

    Raises DictionaryError, and the errors of reading the identity.
    """
    try:
        identity = await read_identity.steps(node)
    except NoAnswer as error:  # to a question of ours, whose object the caller has never heard of
        raise NoAnswer("the question which device it is", error.answer, 1, error.waited, node.node_id) from None
    found = next((each for each in known if Identity.of(each).difference(identity) is None), None)
    return None if found is None else Dictionary.load(found.file, node.node_id)


@Procedure
async def device_name(node: RemoteNode) -> str:
    """Return the name in 0x1008, an empty one if the node has none."""
    name = await _optional(node, DEVICE_NAME, "Manufacturer device name", LONGEST_NAME)
    return name.decode(errors="replace").rstrip("\0")


async def _optional(node: RemoteNode, address: Address, name: str, most: int = EXPEDITED_SIZE) -> bytes:
    """Read an object that a node need not have; without it, return no bytes."""
    try:
        return await node.upload.steps(address, name, most=most)
    except NodeRefused:
        return b""


# The nodes of a bus


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
