"""Read objects of a CANopen node, by number or by the EDS's name."""

from __future__ import annotations

import argparse

from eurobot_od.cli import ExitStatus, remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument(
        "objects", nargs="+", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1018:1, Motion, 'Motion.Maximum speed'"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Print the objects; 1 if the node refuses one."""
    from eurobot_od.client.objects import find
    from eurobot_od.client.reading import read_all

    with remote.node(arguments) as node:
        found = remote.description(arguments, node)
        dictionary = found.dictionary if found else None
        things = [thing for text in arguments.objects for thing in find(text, dictionary)]
        readings = list(read_all(node, things))
    remote.print_readings(readings, arguments.json)
    return ExitStatus.FOUND if any(each.refusal for each in readings) else ExitStatus.FINE
