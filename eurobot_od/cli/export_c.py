"""Write the messages as a C99 header: identifiers, lengths, structs, functions that pack and unpack."""

from __future__ import annotations

import argparse

from eurobot_od.cli import options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    output.add_output(parser)
    output.add_name(parser)
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export.c import c_header

    output.write(arguments.output, c_header(options.protocol(arguments), output.name(arguments)))
