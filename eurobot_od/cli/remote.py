"""What the commands for any CANopen node share: the node, its EDS, the bus, and how objects are listed.

A node is named by its node-ID, or by its name among the devices whose files are named.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od import network
from eurobot_od.od.objects import address_of, data_type, is_described, written
from eurobot_od.od.values import NODE_IDS, label
from eurobot_od.support import durations
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.client.description import Description
    from eurobot_od.client.master import Master, RemoteNode
    from eurobot_od.client.reading import ObjectReading


def add_node(parser: argparse.ArgumentParser) -> None:
    """Add the node, and what every command needs to talk to it."""
    parser.add_argument("node", metavar="NODE", help="node-ID 1..127, or a device's name")
    add_bus(parser)


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add the devices' files, the bus, and how long an answer may take."""
    shared.add_network(parser)
    parser.add_argument(
        "--timeout", type=durations.seconds, default=0.5, metavar="TIME", help="longest wait for an answer (500 ms)"
    )
    parser.add_argument(
        "--largest",
        type=_bytes,
        default=1 << 20,
        metavar="BYTES",
        help="most that is read of an object whose size its node does not say (1048576)",
    )
    shared.add_bus(parser)


def _bytes(text: str) -> int:
    if not text.isdecimal() or len(text) > 10 or not int(text):
        raise argparse.ArgumentTypeError(f"{text} is no number of bytes")
    return int(text)


def node_id(arguments: argparse.Namespace) -> int:
    """Return the node-ID that is meant; raises LocalError, UnknownName."""
    text: str = arguments.node
    if not text.isdecimal():
        named = {each.name: each.node_id for each in shared.devices(arguments)}
        if text not in named:
            raise UnknownName("node", text, named)
        return named[text]
    if len(text) > 3 or int(text) not in NODE_IDS:
        raise LocalError(f"node-ID {text} is not in 1..127")
    return int(text)


def master(arguments: argparse.Namespace) -> Master:
    """Open the bus; the context closes it. Raises BusError."""
    from eurobot_od.client.master import Master

    return Master(shared.open_bus(arguments), arguments.timeout, unannounced=arguments.largest)


@contextmanager
def node(arguments: argparse.Namespace) -> Iterator[RemoteNode]:
    """Open the bus to talk to the node."""
    number = node_id(arguments)
    with master(arguments) as opened:
        yield opened.node(number)


def description(arguments: argparse.Namespace, node: RemoteNode) -> Description | None:
    """Return the EDS of the node: the file, ours that has its identity, or its own; None if there is none.

    A file named without a node-ID is for the node that is spoken to. Its own comes last because it has to be
    transferred, tens of thousands of bytes.
    """
    from eurobot_od.client import description as found

    named = named_description(arguments, node)
    if named is not None:
        return named
    dialects = shared.robot(arguments).dialects
    names = [arguments.dialect] if arguments.dialect else dialects.names()
    known = (each for name in names for each in dialects.load_all(name))
    return found.fitting(node, known) or found.uploaded(node)


def named_description(arguments: argparse.Namespace, node: RemoteNode) -> Description | None:
    """Return the EDS that the user has named for the node; None if there is none."""
    from eurobot_od.client.description import from_file

    files = [network.node_file(text) for text in arguments.eds]
    mine = next((each.file for each in files if each.node_id in (None, node.node_id)), None)
    if mine is None and shared.named_files(arguments):
        mine = next((str(each.file) for each in shared.devices(arguments) if each.node_id == node.node_id), None)
    if mine is None:
        return None
    described = from_file(mine, node.node_id)
    shared.tell_repairs([described.dictionary])
    return described


def needed_description(arguments: argparse.Namespace, node: RemoteNode) -> Description:
    """Return the EDS of the node; raises LocalError if there is none."""
    found = description(arguments, node)
    if found is None:
        raise LocalError(f"no EDS has the identity of node {node.node_id}, and it keeps none itself: name one by --eds")
    return found


# Printing


def columns(rows: Iterable[Sequence[str]]) -> str:
    """Lay out rows of texts in columns."""
    lines = [[*map(one_line, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)


def print_readings(readings: Iterable[ObjectReading], as_json: bool) -> None:
    """Print objects and their values, or why there is none."""
    if as_json:
        print(json.dumps([as_data(each) for each in readings], indent=2))
    else:
        print(columns(_row(each) for each in readings))


def as_data(reading: ObjectReading) -> dict[str, Any]:
    """Return a reading as plain data; bytes are hexadecimal digits."""
    thing, value, refusal = reading
    type_name = data_type(thing).name if is_described(thing) else ""
    data = {"index": thing.index, "subindex": thing.subindex, "name": thing.qualname, "type": type_name}
    result = {"refused": refusal} if refusal else {"value": value.hex() if isinstance(value, bytes) else value}
    return {**data, **result}


def _row(reading: ObjectReading) -> tuple[str, str, str]:
    thing, value, refusal = reading
    return label(address_of(thing)), thing.qualname, f"({refusal})" if refusal else written(thing, value)
