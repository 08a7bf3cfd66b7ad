"""Write the messages as a DBC file: identifiers, bits, units, limits, value tables, senders and receivers."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from eurobot_od.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="left out: standard output")
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.pdo.dbc import dbc_text

    text = dbc_text(options.protocol(arguments))
    if arguments.output is None:
        sys.stdout.write(text)
    else:
        arguments.output.write_text(text, encoding="ascii")
