"""Write the messages as a DBC file: identifiers, bits, units, limits, value tables, senders and receivers."""

from __future__ import annotations

import argparse

from eurobot_od.cli import options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    output.add_output(parser)
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export.dbc import dbc_text

    output.write(arguments.output, dbc_text(options.protocol(arguments)))
