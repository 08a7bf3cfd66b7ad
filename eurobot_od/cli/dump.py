"""Print all objects of a CANopen node that can be read, with their values."""

from __future__ import annotations

import argparse

from eurobot_od.cli import remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> None:
    """Print the objects; an object that the node refuses is listed with its reason."""
    from eurobot_od.cli.progress import passing
    from eurobot_od.client.reading import read_all, readable

    with remote.node(arguments) as node:
        dictionary = remote.needed_description(arguments, node).dictionary
        with passing(f"node {node.node_id}", readable(dictionary)) as things:
            readings = list(read_all(node, things))
    remote.print_readings(readings, arguments.json)
