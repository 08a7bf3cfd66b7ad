"""Finds the nodes of a bus, their identities (0x1018) and their EDS files.

An EDS is taken only for a node with the same identity; a file that a person names is taken as it is. In a scan a node
is there if it answers one of our SDO requests, or if its heartbeat is heard. Other frames prove nothing: a protocol's
own identifiers may look like PDOs of any node.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.client.master import Master, Procedure, RemoteNode
from eurobot_od.device.nmt import STATE_NAMES, NmtState
from eurobot_od.errors import LocalError, NoAnswer, NodeRefused, RemoteError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.standard import DEVICE_NAME, DEVICE_TYPE, IDENTITY, STORE_FORMAT, STORED_EDS, node_id_words
from eurobot_od.od.values import NODE_IDS, Address
from eurobot_od.sdo.wire import EXPEDITED_SIZE, LENGTH, ClientCommand, Initiate, ServerCommand, initiate
from eurobot_od.support.progress import Progress, unwatched

LONGEST_NAME = 1024
"""Maximum length of a device name in bytes, so that an endless upload does not block a scan."""

PLAIN_TEXT = b"\0"
"""Store format (0x1022) of an uncompressed EDS (CiA 301, 7.5.2.25)."""


@Procedure
async def read_identity(node: RemoteNode) -> Identity:
    """Read the identity of a node; only the vendor-ID is mandatory. Raises NoAnswer, RemoteError, BusError."""
    addresses = {(IDENTITY, subindex): name for subindex, name in enumerate(Identity._fields, start=1)}
    numbers = [await _optional(node, address, name) for address, name in addresses.items()]
    return Identity(*(int.from_bytes(each, "little") for each in numbers))


@Procedure
async def check_free(master: Master, node_id: int | None, identity: Identity | None = None) -> None:
    """Check that no device, but for the one with an identity, answers at a node-ID that is to be set.

    None and 255, for no node-ID, are free. Raises RemoteError if one does, and BusError.
    """
    if node_id is None or node_id not in NODE_IDS:
        return
    try:
        found = await read_identity.steps(master.node(node_id))
    except NoAnswer:
        return
    if found != identity:
        raise RemoteError(f"node-ID {node_id} is taken: a device answers there, with the identity {found}")


Addressing: TypeAlias = Callable[[Master, Identity, int], object]
"""A manufacturer's procedure that sets the node-ID of the device with an identity."""

ADDRESSED_ATTEMPTS = 5
"""How often the device is asked for its identity at its new node-ID."""


def addressed(
    master: Master, address: Addressing, identity: Identity, node_id: int | None = None, **others: object
) -> str:
    """Set a device's node-ID by its manufacturer's procedure; return what is done, in words.

    Raises LocalError if `others` are to be set as well, RemoteError, NoAnswer, BusError.
    """
    if node_id is None or any(others.values()):
        raise LocalError(f"the device package for {identity} sets the node-ID: give a node-ID, and nothing else")
    check_free(master, node_id, identity)
    address(master, identity, node_id)
    for attempt in range(ADDRESSED_ATTEMPTS):
        try:
            found = read_identity(master.node(node_id))
            break
        except NoAnswer:  # it may still be booting
            if attempt + 1 == ADDRESSED_ATTEMPTS:
                raise
    if difference := found.difference(identity):
        raise RemoteError(f"another device answers as node {node_id}: it has {difference}")
    return f"{identity}  {node_id_words(node_id)}, by its maker's procedure"


@Procedure
async def read_numbers(node: RemoteNode) -> dict[Address, int]:
    """Read the identity and device type of a node, as numbers by address. Raises as `read_identity`."""
    identity = await read_identity.steps(node)
    type_ = await _optional(node, DEVICE_TYPE, "Device type")
    return numbers_of(identity, int.from_bytes(type_, "little") if type_ else None)


def numbers_of(identity: Identity, device_type: int | None) -> dict[Address, int]:
    """Return identity and device type as numbers by address."""
    numbers = {(IDENTITY, sub): number for sub, number in enumerate(identity, start=1)}
    return numbers if device_type is None else numbers | {DEVICE_TYPE: device_type}


@Procedure
async def uploaded(node: RemoteNode) -> Dictionary | None:
    """Return the EDS that a node stores in 0x1021, None if it has none in plain text.

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
    except NoAnswer as error:  # the caller did not ask for this object, so the error does not name it
        silent = NoAnswer("the question which device it is", error.answer, 1, error.waited, node.node_id)
        for note in getattr(error, "__notes__", ()):
            silent.add_note(note)
        raise silent from None
    found = next((each for each in known if Identity.of(each).difference(identity) is None), None)
    return None if found is None else Dictionary.load(found.file, node.node_id)


@Procedure
async def device_name(node: RemoteNode) -> str:
    """Return the device name (0x1008), empty if the node has none."""
    name = await _optional(node, DEVICE_NAME, "Manufacturer device name", LONGEST_NAME)
    return name.decode(errors="replace").rstrip("\0")


async def _optional(node: RemoteNode, address: Address, name: str, most: int = EXPEDITED_SIZE) -> bytes:
    """Read an optional object; return no bytes if the node does not have it."""
    try:
        return await node.upload.steps(address, name, most=most)
    except NodeRefused:
        return b""


# The nodes of a bus


PACE = 0.005
"""Interval between two requests, in s, so that a scan does not fill the bus."""

UPLOADED = (ServerCommand.UPLOAD, ServerCommand.ABORT)
"""Commands of an SDO server's answer to an upload."""

LISTEN = 1.5
"""Time to wait for heartbeats, in s; most nodes send one every second."""


class Found(NamedTuple):
    """A node on the bus: its NMT `state` from a heartbeat, its `identity` from SDO, its `name` (0x1008).

    `device_type` is its 0x1000, None if it did not say it.
    """

    node_id: int
    state: NmtState | None
    identity: Identity | None
    name: str
    device_type: int | None = None

    def as_data(self) -> dict[str, Any]:
        """Return the node as plain data."""
        state = None if self.state is None else STATE_NAMES[self.state]
        identity = self.identity._asdict() if self.identity else None
        return {"node_id": self.node_id, "name": self.name, "state": state, "identity": identity}

    @property
    def numbers(self) -> dict[Address, int]:
        """Identity and device type as numbers by address."""
        return numbers_of(self.identity, self.device_type) if self.identity else {}


@Procedure
async def scan(
    master: Master,
    node_ids: Iterable[int] = NODE_IDS,
    pace: float = PACE,
    listen: float = LISTEN,
    progress: Progress = unwatched,
    tell: Callable[[Found], object] = lambda _: None,
) -> list[Found]:
    """Return the nodes on the bus by node-ID, and call `tell` with each as it is found. Raises BusError.

    `progress` counts the node-IDs that were asked.
    """
    wanted = sorted(node_ids)
    answered: dict[int, int | None] = {}

    def received(node_id: int, data: bytes) -> None:
        # An abort of 0x1000 is an answer too. An SDO transfer would end at the first unexpected answer, but another
        # master may be asking the node as well.
        answer = Initiate.of(data) if len(data) == LENGTH else None
        if answer is not None and answer.address == DEVICE_TYPE and answer.command >> 5 in UPLOADED:
            answered[node_id] = None if answer.content is None else int.from_bytes(answer.content, "little")

    # All are asked before waiting, as one by one the timeouts of silent node-IDs would take a minute.
    for number, node_id in enumerate(wanted, start=1):
        server = master.sdo_server(node_id)
        master.listeners[server.answers] = partial(received, node_id)
        master.send(server.requests, initiate(ClientCommand.UPLOAD << 5, DEVICE_TYPE))
        await master.pump.steps(pace)
        progress(number, len(wanted))
    await master.pump.steps(max(listen - pace * len(wanted), master.answer_wait))
    found = list[Found]()
    for each in sorted({*answered, *master.states} & set(wanted)):
        found.append(await _found(master, each, answered.get(each)))
        tell(found[-1])
    return found


async def _found(master: Master, node_id: int, device_type: int | None) -> Found:
    """Read the identity of a node that is there; a STOPPED node does not answer."""
    node = master.node(node_id)
    try:
        identity, name = await read_identity.steps(node), await device_name.steps(node)
    except RemoteError:
        identity, name = None, ""
    return Found(node_id, node.last_state, identity, name, device_type)
