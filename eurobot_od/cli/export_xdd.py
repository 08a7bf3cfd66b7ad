"""Write the device description in XML (CiA 311) of an EDS or DCF: every object with all the file says of it."""

from __future__ import annotations

import argparse

from eurobot_od.cli import output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", metavar="FILE", help="an EDS or DCF")
    output.add_output(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export import xdd

    output.write(arguments.output, xdd.xdd_text(xdd.load(arguments.file)))
