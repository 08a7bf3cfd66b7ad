"""Command-line options that several commands share."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from eurobot_od.robot import dialects

if TYPE_CHECKING:
    import can


def add_bus(parser: argparse.ArgumentParser) -> None:
    """Add -i, -c and -b; what is left out comes from python-can's own configuration."""
    group = parser.add_argument_group("bus", "left out: python-can's configuration; without one, the in-process bus")
    group.add_argument("-i", "--interface", help="python-can interface, such as socketcan, pcan, slcan, remote")
    group.add_argument("-c", "--channel", help="channel of the interface, such as can0")
    group.add_argument("-b", "--bitrate", type=int, help="bit/s, 500000 if nothing else is configured")


def open_bus(arguments: argparse.Namespace) -> can.BusABC:
    """Open the bus that the options name; raises BusError."""
    from eurobot_od import live as runtime

    return runtime.open_bus(arguments.interface, arguments.channel, arguments.bitrate)


def add_dialect(parser: argparse.ArgumentParser) -> None:
    """Add --dialect: a folder of EDS files."""
    parser.add_argument(
        "--dialect",
        metavar="NAME",
        help=f"EDS files to load: {', '.join(dialects.names())}, or a folder; "
        f"left out: the variable {dialects.DIALECT_VARIABLE}, else {dialects.DEFAULT}",
    )
