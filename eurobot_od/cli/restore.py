"""Have a CANopen node take the defaults of its parameters again, from its next reset on (0x1011)."""

from __future__ import annotations

import argparse

from eurobot_od.cli import remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("--reset", action="store_true", help="reset the node, so that it takes effect")


def run(arguments: argparse.Namespace) -> None:
    """Restore all default parameters."""
    from eurobot_od.client.configure import restore

    with remote.node(arguments) as node:
        restore(node)
        if arguments.reset:
            node.reset()
    when = "has" if arguments.reset else "will have, from its next reset on,"
    print(f"node {node.node_id} {when} the defaults of all parameters")
