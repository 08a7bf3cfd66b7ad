"""Which EDS another node is loaded from: its revision number, read by SDO (CiA 301, 7.2.4.3.3 and 7.5.2.21).

Rule of this file: a node that does not answer is no CANopen node, such as the 2014 robot's own; it cannot be asked and
is believed. One that answers with another revision speaks another dialect, and is not driven.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from eurobot_od.device.device import Device
from eurobot_od.errors import DictionaryError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.robot import dialects
from eurobot_od.sdo.server import EXPEDITED, Client, Request, Server

REVISION: Address = (0x1018, 3)
"""Where a node keeps the revision number of its EDS."""

CHANNEL = "SDO client parameter {}"
"""ParameterName of the record that says how to reach a node by SDO."""


class DialectMismatch(RemoteError):
    """A node is loaded from the EDS of another dialect; the text names both, where they can be named."""

    def __init__(self, node: str, node_id: int, theirs: str, ours: str) -> None:
        self.node, self.node_id = node, node_id
        what = f"{node} (node {node_id}) speaks another dialect"
        super().__init__(f"{what}: it is loaded from {theirs}, the core from {ours}")


class Channel(NamedTuple):
    """How a device reaches another one by SDO (CiA 301, 7.5.2.34)."""

    request: int
    answer: int
    node_id: int

    @classmethod
    def to(cls, node: str, device: Device) -> Channel | None:
        """Return the way to a node, None if the device's EDS knows none."""
        try:
            index, _ = device.dictionary.address(CHANNEL.format(node))
        except DictionaryError:
            return None
        return cls(*(device.number((index, subindex)) for subindex in (1, 2, 3)))

    def ask(self) -> Frame:
        """Return the request for the revision number."""
        index, subindex = REVISION
        return Frame(self.request, bytes([Client.UPLOAD << 5, index & 0xFF, index >> 8, subindex]).ljust(8, b"\0"))


def revision_in(answer: Frame) -> int | None:
    """Return the revision number in an answer, None if it says something else."""
    if len(answer.data) != 8:
        return None
    request = Request.of(answer.data)
    expedited = request.command & ~0x1F == Server.UPLOAD and request.command & EXPEDITED
    return request.number if expedited and request.address == REVISION else None


def description(node: str, revision: int) -> str:
    """Say in words what EDS has a revision number, by the dialect that has it."""
    loaded: Callable[[str], Dictionary] = lambda dialect: dialects.load(node, dialect)  # noqa: E731
    known = [dialect for dialect in dialects.names() if loaded(dialect).default(REVISION) == revision]
    return f"an EDS of revision 0x{revision:08X}" + (f" ({known[0]})" if known else "")
