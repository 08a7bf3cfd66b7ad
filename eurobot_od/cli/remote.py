"""What the commands for any CANopen node share: the node, its EDS, the bus, and how objects are listed.

A node is named by its node-ID, or by its name among the devices whose files are named.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.cli import options
from eurobot_od.cli.options import Devices
from eurobot_od.cli.table import Parameter
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.objects import address_of, data_type, is_described
from eurobot_od.od.profiles.words import words, written
from eurobot_od.od.values import label
from eurobot_od.support import durations
from eurobot_od.support.texts import columns

if TYPE_CHECKING:
    from eurobot_od.bus.live.connection import Opener
    from eurobot_od.client.description import Description
    from eurobot_od.client.master import Master, RemoteNode
    from eurobot_od.client.reading import ObjectReading


def add_node(parser: argparse.ArgumentParser) -> None:
    """Add the node, and what every command needs to talk to it."""
    parser.add_argument("node", metavar="NODE", help="node-ID 1..127, or a device's name")
    add_bus(parser)


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add the devices' files, the bus, and how long an answer may take."""
    options.add_network(parser)
    parser.add_argument(
        "--timeout", type=durations.seconds, default=0.5, metavar="TIME", help="longest wait for an answer (500 ms)"
    )
    parser.add_argument(
        "--largest",
        type=options.whole(1, what="a number of bytes"),
        default=1 << 20,
        metavar="BYTES",
        help="most to read of an object whose size the node does not announce (1048576)",
    )
    options.add_bus(parser)


class Target(NamedTuple):
    """The node that a command is about, and how to talk to it.

    `bit_rate` is in bit/s, None for python-can's; `timeout` in s; `largest` in bytes.
    """

    name: str
    devices: Devices
    open_bus: Opener
    bit_rate: int | None
    timeout: float
    largest: int

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> Target:
        """Take it from a command line."""
        devices, open_bus = Devices.of(arguments), options.opener(arguments)
        name = vars(arguments).get("node", "")
        return cls(name, devices, open_bus, arguments.bitrate, arguments.timeout, arguments.largest)

    @property
    def node_id(self) -> int:
        """The node-ID; raises LocalError, UnknownName."""
        text = self.name
        if not text.isdecimal():
            named = {each.name: each.node_id for each in self.devices.load()}
            if text not in named:
                raise UnknownName("node", text, named)
            return named[text]
        return options.check_node_id(int((text.lstrip("0") or "0")[:4]))  # `int` raises for thousands of digits

    def master(self) -> Master:
        """Open the bus; the context closes it. Raises BusError."""
        from eurobot_od.client.master import Master

        return Master(self.open_bus(), self.timeout, unannounced=self.largest)

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
        from eurobot_od.client import description

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
        from eurobot_od.client.description import from_file
        from eurobot_od.od.dictionary import Dictionary

        files = self.devices.files()
        named = files[: len(self.devices.eds)]
        mine = next((each for each in named if each.node_id in (None, node.node_id)), None)
        if mine is None:  # only then the network, whose files have to be loaded to know whose they are
            mine = next((each for each in files if Dictionary.load(*each).node_id == node.node_id), None)
        if mine is None:
            return None
        described = from_file(mine.file, node.node_id, mine.modules, mine.patch)
        options.complain_of_repairs([described.dictionary])
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


TARGET = Parameter("target", add_node, Target.of)
MASTER = Parameter("master", add_bus, lambda arguments: Target.of(arguments).master())


# Printing


def print_readings(readings: Iterable[ObjectReading], as_json: bool) -> None:
    """Print objects and their values, or why there is none."""
    if as_json:
        print(json.dumps([as_data(each) for each in readings], indent=2))
    else:
        rows = (
            (label(address_of(thing)), thing.qualname, f"({refusal})" if refusal else written(thing, value))
            for thing, value, refusal in readings
        )
        print(*columns(rows), sep="\n")


def as_data(reading: ObjectReading) -> dict[str, Any]:
    """Return a reading as plain data; bytes are hexadecimal digits."""
    thing, value, refusal = reading
    type_name = data_type(thing).name if is_described(thing) else ""
    data = {"index": thing.index, "subindex": thing.subindex, "name": thing.qualname, "type": type_name}
    if refusal:
        return {**data, "refused": refusal}
    said = {"words": said} if (said := words(thing, value)) else {}
    return {**data, "value": value.hex() if isinstance(value, bytes) else value, **said}
