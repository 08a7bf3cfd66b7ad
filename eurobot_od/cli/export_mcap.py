"""Write a log as MCAP for Foxglove and PlotJuggler: a channel for each message, and poses where a message says one."""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

from eurobot_od.cli import logs, options
from eurobot_od.support import extras, files
from eurobot_od.support.amounts import amount


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
    decoder = options.decoder(arguments)
    files.check_writable(arguments.output)
    file = BytesIO()
    with logs.opened(arguments.log) as log:
        from eurobot_od.logs import formats

        entries = formats.read(log, arguments.format, arguments.largest)
        messages, poses, damage = write(file, entries, decoder, options.robot(arguments).drawings(decoder.protocol))
    files.write_whole(arguments.output, file.getvalue())
    print(f"{arguments.output}: {amount(messages, 'message')}, {amount(poses, 'pose')}, {damage} damaged")
