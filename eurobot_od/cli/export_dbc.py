"""Write the messages as a DBC file: identifiers, bits, units, limits, value tables, senders and receivers."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from eurobot_od.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="left out: standard output")
    options.add_dialect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export.dbc import dbc_text
    from eurobot_od.robot.protocol import EurobotProtocol

    text = dbc_text(EurobotProtocol.load(arguments.dialect))
    if arguments.output is None:
        sys.stdout.write(text)
    else:
        arguments.output.write_text(text, encoding="ascii")
