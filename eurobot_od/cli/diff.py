"""Compare two EDS or DCF files, or one with a live node.

Rule of this file: it parses, reads (a file, or a node by SDO) and prints; what a difference is says `lint.diff`. Exit
status 0 no difference, 1 differences or a node that does not answer, 2 a file that cannot be read, 3 bus trouble.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING

from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError, NodeRefused
from eurobot_od.lint.diff import NO_OBJECT, Difference, Reading, compare, compare_live, place, read_device, readable
from eurobot_od.lint.model import LintedDevice
from eurobot_od.od.values import NODE_IDS, Address

if TYPE_CHECKING:
    from eurobot_od.client.master import RemoteNode

SAME, DIFFERENT = 0, 1


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `eurobot-od diff`."""
    parser.add_argument("left", metavar="A", help="an EDS or DCF")
    parser.add_argument("right", metavar="B", nargs="?", help="the EDS or DCF to compare it with")
    parser.add_argument("--node", type=int, metavar="ID", help="node-ID: of the live node, or to fill in for $NODEID")
    parser.add_argument("--names", action="store_true", help="compare the ParameterNames too")
    parser.add_argument("--json", action="store_true", help="write a JSON list instead of lines")
    shared.add_bus(parser)


def run(arguments: Namespace) -> int:
    """Compare, print, and return the exit status."""
    if arguments.node is not None and arguments.node not in NODE_IDS:
        raise LocalError(f"node-ID {arguments.node} is not in 1..127")
    left = read_device(arguments.left)
    if arguments.right:
        found = compare(left, read_device(arguments.right), arguments.node, arguments.names)
    else:
        found = _compare_live(left, arguments)
    _print(found, arguments.json)
    return DIFFERENT if found else SAME


def _compare_live(device: LintedDevice, arguments: Namespace) -> list[Difference]:
    node_id = arguments.node or device.node_id
    if node_id is None:
        raise LocalError("nothing to compare with: name a second file, or a live node with --node")
    from eurobot_od.client.master import Master

    with Master(shared.open_bus(arguments)) as master:
        return compare_live(device, read_node(master.node(node_id), readable(device)), node_id)


def read_node(node: RemoteNode, addresses: Sequence[Address]) -> dict[Address, Reading]:
    """Read variables of a node by SDO: their bytes, or the abort code; a missing object is asked for once.

    Raises NoAnswer if the node does not answer.
    """
    found: dict[Address, Reading] = {}
    missing: set[int] = set()
    for address in addresses:
        found[address] = NO_OBJECT if address[0] in missing else _read(node, address)
        missing |= {address[0]} if found[address] == NO_OBJECT else set()
    return found


def _read(node: RemoteNode, address: Address) -> Reading:
    try:
        return node.upload(address)
    except NodeRefused as error:
        return error.code


def _print(found: Sequence[Difference], as_json: bool) -> None:
    if as_json:
        import json

        json.dump([{**each._asdict(), "where": place(each.where)} for each in found], sys.stdout, indent=1)
        print()
    else:
        sys.stdout.writelines(f"{each}\n" for each in found)
