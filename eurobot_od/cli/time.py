"""Send the time of this computer as CANopen's TIME message, once or again and again."""

from __future__ import annotations

import argparse
from datetime import datetime, timezone
from itertools import islice

from eurobot_od.cli import options as shared
from eurobot_od.cli.sync import add_production
from eurobot_od.od.values import TIME_COB_ID


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--utc", action="store_true", help="UTC instead of local time")
    add_production(parser, TIME_COB_ID, "1 s")
    parser.set_defaults(count=1)
    shared.add_bus(parser)
    shared.add_reconnect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Send until the end."""
    from eurobot_od.client.master import Master
    from eurobot_od.client.producing import produce, times

    zone = timezone.utc if arguments.utc else None
    frames = times(lambda: datetime.now(zone).replace(tzinfo=None), arguments.cob_id)
    with Master(shared.open_bus(arguments)) as master:
        produce(master, islice(frames, arguments.count), arguments.period, shared.guard(arguments, master))
