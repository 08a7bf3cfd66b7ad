"""Compare two EDS, DCF, XDD or XDC files, or one with a live node.

Exit status 0 no difference, 1 differences or a node that does not answer, 2 a file that cannot be read, 3 bus trouble.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.lint.diff import compare, compare_live, place, read_device, readable


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of `eurobot-od diff`."""
    parser.add_argument("left", metavar="A", help="an EDS, DCF, XDD or XDC")
    parser.add_argument("right", metavar="B", nargs="?", help="the file to compare it with")
    parser.add_argument("--node", type=int, metavar="ID", help="node-ID: of the live node, or to fill in for $NODEID")
    parser.add_argument("--names", action="store_true", help="compare the ParameterNames too")
    parser.add_argument("--json", action="store_true", help="write a JSON list instead of lines")
    shared.add_bus(parser)


def run(arguments: Namespace) -> ExitStatus:
    """Compare, print, and return the exit status."""
    if arguments.node is not None:
        shared.check_node_id(arguments.node)
    left = read_device(arguments.left)
    if arguments.right:
        found = compare(left, read_device(arguments.right), arguments.node, arguments.names)
    else:
        node_id = arguments.node or left.node_id  # a DCF says for which node it is, an EDS does not
        if node_id is None:
            raise LocalError("nothing to compare with: name a second file, or a live node with --node")
        from eurobot_od.client.master import Master  # two files are compared without a bus
        from eurobot_od.client.reading import read_bytes
        from eurobot_od.od.dictionary import Dictionary
        from eurobot_od.support.progress import passing

        with Master(shared.open_bus(arguments)) as master, passing(f"node {node_id}", readable(left)) as addresses:
            master.follow(Dictionary.load(arguments.left, node_id))
            found = compare_live(left, read_bytes(master.node(node_id), addresses), node_id)
    if arguments.json:
        import json

        json.dump([{**each._asdict(), "where": place(each.where)} for each in found], sys.stdout, indent=1)
        print()
    else:
        sys.stdout.writelines(f"{each}\n" for each in found)
    return ExitStatus.FOUND if found else ExitStatus.FINE
