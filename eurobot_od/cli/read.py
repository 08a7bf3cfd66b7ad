"""Read objects of a CANopen node, by number or by the EDS's name, or one object into a file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, output, remote
from eurobot_od.cli.progress import bar
from eurobot_od.errors import LocalError
from eurobot_od.od.objects import address_of, find, label
from eurobot_od.support.amounts import amount
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

    from eurobot_od.client.master import RemoteNode


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument(
        "objects", nargs="+", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1018:1, Motion, 'Motion.Maximum speed'"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.add_argument("--file", type=Path, help="write the bytes of one object to this file; by block transfer")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Print the objects; 1 if the node refuses one."""
    from eurobot_od.client.reading import read_all

    with remote.node(arguments) as node:
        found = remote.description(arguments, node)
        known = found.dictionary.objects if found else None
        things = [thing for text in arguments.objects for thing in find(text, known)]
        if arguments.file:
            return _read_file(node, things, arguments.file)
        readings = list(read_all(node, things))
    remote.print_readings(readings, arguments.json)
    return ExitStatus.FOUND if any(each.refusal for each in readings) else ExitStatus.FINE


def _read_file(node: RemoteNode, things: list[ODVariable], file: Path) -> ExitStatus:
    """Write an object's bytes to a file. Raises NodeRefused, NoAnswer, LocalError for several objects, OSError."""
    if len(things) != 1:
        raise LocalError(f"--file takes one object, not {len(things)}")
    thing = things[0]
    with bar(label(thing)) as progress:
        content = node.upload_block(address_of(thing), thing.qualname, progress)
    output.write_bytes(file, content)
    print(one_line(f"{file}: {amount(len(content), 'byte')} of node {node.node_id}, {label(thing)}"))
    return ExitStatus.FINE
