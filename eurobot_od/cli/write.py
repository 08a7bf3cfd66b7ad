"""Write one object of a CANopen node, by number or by the EDS's name.

A value that the EDS does not allow is refused here. Without an EDS the node is asked for the object's length first.
"""

from __future__ import annotations

import argparse

from eurobot_od.cli import remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("object", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1016:1, 'Motion.Maximum speed'")
    parser.add_argument("value", help="decimal or 0x.. number, text, or hexadecimal digits of bytes, by the type")


def run(arguments: argparse.Namespace) -> None:
    """Write the object."""
    from eurobot_od.client.objects import encode, find_one, parse, written
    from eurobot_od.od.values import label

    with remote.node(arguments) as node:
        found = remote.description(arguments, node)
        thing = find_one(arguments.object, found.dictionary if found else None)
        value = parse(thing, arguments.value)
        size = len(node.upload(thing.address)) if thing.variable is None else 0
        node.download(thing.address, encode(thing, value, size), thing.name)
    print(f"node {node.node_id}: {label(thing.address, thing.name)} = {written(thing, value)}")
