"""Write the DCF of a live CANopen node: its EDS with the values that its parameters have now.

What no line of a DCF can hold, and every DOMAIN, stands in files beside it, which `configure` reads back.
"""

from __future__ import annotations

import argparse

from eurobot_od.cli import ExitStatus, complain, output, remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    output.add_output(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Write the file; 1 if the node refuses objects of its EDS, which are left out."""
    from eurobot_od.cli.progress import passing
    from eurobot_od.client.reading import dcf_of_node, parameters
    from eurobot_od.live import BITRATE
    from eurobot_od.od.objects import label

    with remote.node(arguments) as node:
        dictionary = remote.needed_description(arguments, node).dictionary
        stem = arguments.output.stem if arguments.output else dictionary.name
        with passing(f"node {node.node_id}", parameters(dictionary)) as things:
            dcf, left_out = dcf_of_node(node, dictionary, (arguments.bitrate or BITRATE) // 1000, stem, things)
    output.write_dcf(arguments.output, dcf)
    for thing, _, reason in left_out:
        complain(f"left out {label(thing)}: {reason}")
    return ExitStatus.FOUND if left_out else ExitStatus.FINE
