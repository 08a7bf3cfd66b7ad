"""Write the DCF of a live CANopen node: its EDS with the values that its parameters have now."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from eurobot_od.cli import ExitStatus, remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="left out: standard output")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Write the file; 1 if the node refuses objects of its EDS, which are left out."""
    from eurobot_od.client.reading import dcf_text
    from eurobot_od.live import BITRATE
    from eurobot_od.od.values import label

    with remote.node(arguments) as node:
        description = remote.needed_description(arguments, node)
        text, refused = dcf_text(node, description, (arguments.bitrate or BITRATE) // 1000)
    if arguments.output:
        Path(arguments.output).write_text(text, encoding="utf-8", errors="surrogateescape")
    else:
        print(text, end="")
    for thing, _, reason in refused:
        print(f"left out {label(thing.address, thing.name)}: {reason}", file=sys.stderr)
    return ExitStatus.FOUND if refused else ExitStatus.FINE
