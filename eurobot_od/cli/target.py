"""The node that a command is about: its EDS, the bus, and how to talk to it.

A node is named by its node-ID, or by its name among the devices whose files are named.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from eurobot_od.cli.devices import Devices, complain_of_repairs
from eurobot_od.cli.options import BusOptions, Seconds, check_node_id, whole
from eurobot_od.cli.signature import Option
from eurobot_od.client import description
from eurobot_od.client.description import Description, from_file
from eurobot_od.client.master import Master, RemoteNode
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.dictionary import Dictionary


@dataclass(frozen=True, kw_only=True)
class Access:
    """How to talk to nodes; `timeout` is in s, `largest` in bytes.

    timeout: longest wait for an answer (500 ms)
    largest: most to read of an object whose size the node does not announce (1048576)
    """

    devices: Devices
    timeout: Seconds = 0.5
    largest: Annotated[int, Option(metavar="BYTES", read=whole(1, what="a number of bytes"))] = 1 << 20
    bus: BusOptions

    def master(self) -> Master:
        """Open the bus; the context closes it. Raises LocalError, BusError."""
        return Master(self.bus.open(), self.timeout, unannounced=self.largest)


@dataclass(frozen=True)
class Target(Access):
    """The node that a command is about.

    node: node-ID 1..127, or a device's name
    """

    node: Annotated[str, Option(metavar="NODE", suggest=lambda robot: robot.nodes)]

    @property
    def node_id(self) -> int:
        """The node-ID; raises LocalError, UnknownName."""
        text = self.node
        if not text.isdecimal():
            named = {each.name: each.node_id for each in self.devices.load()}
            if text not in named:
                raise UnknownName("node", text, named)
            return named[text]
        return check_node_id(int((text.lstrip("0") or "0")[:4]))  # `int` raises for thousands of digits

    @contextmanager
    def opened(self) -> Iterator[RemoteNode]:
        """Open the bus to talk to the node."""
        number = self.node_id  # first, so that a wrong name opens no bus
        with self.master() as master:
            yield master.node(number)

    def description(self, node: RemoteNode) -> Description | None:
        """Return the EDS of the node: the file, ours that has its identity, or its own; None if there is none.

        A file named without a node-ID is for the node that is spoken to. Its own comes last because it has to be
        transferred, tens of thousands of bytes.
        """
        named = self.named_description(node)
        if named is not None:
            return named
        dialects = self.devices.robot.dialects
        names = [self.devices.dialect] if self.devices.dialect else dialects.names()
        known = (each for name in names for each in dialects.load_all(name))
        return description.fitting(node, known) or description.uploaded(node)

    def named_description(self, node: RemoteNode) -> Description | None:
        """Return the EDS that the user has named for the node; None if there is none.

        From then on the node is spoken to where its file says that its SDO server is.
        """
        files = self.devices.files()
        named = files[: len(self.devices.eds)]
        mine = next((each for each in named if each.node_id in (None, node.node_id)), None)
        if mine is None:  # only then the network, whose files have to be loaded to know whose they are
            mine = next((each for each in files if Dictionary.load(*each).node_id == node.node_id), None)
        if mine is None:
            return None
        described = from_file(mine.file, node.node_id, mine.modules, mine.patch)
        complain_of_repairs([described.dictionary])
        node.master.follow(described.dictionary)
        return described

    def needed_description(self, node: RemoteNode) -> Description:
        """Return the EDS of the node; raises LocalError if there is none."""
        found = self.description(node)
        if found is None:
            raise LocalError(
                f"no EDS has the identity of node {node.node_id}, and it keeps none itself: name one by --eds"
            )
        return found
