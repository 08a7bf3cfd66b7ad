"""Write a log as MCAP for Foxglove and PlotJuggler: a channel for each message, and poses where a message says one."""

from __future__ import annotations

import argparse
from pathlib import Path

from eurobot_od import extras
from eurobot_od.amounts import amount
from eurobot_od.cli import logs, options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""

    parser.add_argument("log", metavar="LOG", help="log in any format; -: standard input")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="the MCAP file")
    logs.add_reading(parser)
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file; say what is in it."""
    with extras.needed("mcap"):
        from eurobot_od.export.mcap import write
        from eurobot_od.robot.poses import drawings
    decoder = options.decoder(arguments)
    with logs.opened(arguments.log) as log, arguments.output.open("wb") as file:
        from eurobot_od.logs import formats

        entries = formats.read(log, arguments.format, arguments.largest)
        messages, poses, damage = write(file, entries, decoder, drawings(decoder.protocol))
    print(f"{arguments.output}: {amount(messages, 'message')}, {amount(poses, 'pose')}, {damage} damaged")
