"""Write one object of a CANopen node, by number or by the EDS's name, or a whole file into it.

A value that the EDS does not allow is refused here. Without an EDS the node is asked for the object's length first.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import remote
from eurobot_od.cli.progress import bar
from eurobot_od.errors import LocalError
from eurobot_od.od.objects import address_of, encode, find_one, is_described, label, parse, shown, written
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

    from eurobot_od.client.master import RemoteNode


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("object", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1016:1, 'Motion.Maximum speed'")
    parser.add_argument(
        "value", nargs="?", help="decimal or 0x.. number, text, or hexadecimal digits of bytes, by the type"
    )
    parser.add_argument("--file", type=Path, help="write what this file holds, byte by byte; by block transfer")


def run(arguments: argparse.Namespace) -> None:
    """Write the object."""
    if (arguments.value is None) is (arguments.file is None):
        raise LocalError("what to write: give a value or --file FILE, one of them")
    content = arguments.file.read_bytes() if arguments.file else b""
    with remote.node(arguments) as node:
        found = remote.description(arguments, node)
        thing = find_one(arguments.object, found.dictionary.objects if found else None)
        text = _write_value(node, thing, arguments.value) if arguments.file is None else _write(node, thing, content)
    print(one_line(f"node {node.node_id}: {label(thing)} = {text}"))


def _write_value(node: RemoteNode, thing: ODVariable, text: str) -> str:
    value = parse(thing, text)
    size = len(node.upload(address_of(thing))) if not is_described(thing) else 0
    node.download(address_of(thing), encode(thing, value, size), thing.qualname)
    return written(thing, value)


def _write(node: RemoteNode, thing: ODVariable, content: bytes) -> str:
    with bar(label(thing)) as progress:
        node.download(address_of(thing), content, thing.qualname, progress=progress)
    return shown(thing, content)
