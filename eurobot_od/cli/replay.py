"""Replay a log onto a bus with its recorded timing, so that one real node meets yesterday's others.

`--except drive` leaves out what the drive sent in the log: the drive on the bus sends it itself.
"""

from __future__ import annotations

import argparse

from eurobot_od.cli import logs, options
from eurobot_od.support.texts import amount


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    logs.add_log(parser)
    parser.add_argument(
        "--speed", type=options.positive, default=1.0, metavar="N", help="how many times faster (default: 1)"
    )
    whose = parser.add_mutually_exclusive_group()
    whose.add_argument(
        "--only", action="append", default=[], metavar="NODE", help="only frames that this node sent; repeatable"
    )
    whose.add_argument(
        "--except",
        dest="without",
        action="append",
        default=[],
        metavar="NODE",
        help="no frames that this node sent; repeatable",
    )
    options.add_network(parser)
    options.add_bus(parser)


def run(arguments: argparse.Namespace) -> None:
    """Send the frames; say how many, and how late."""
    from eurobot_od.client.master import Master
    from eurobot_od.client.producing import LATE, replay
    from eurobot_od.frame import Frame
    from eurobot_od.traffic.filters import by_sender

    decoder, entries = (
        options.Devices.of(arguments).decoder(),
        logs.entries(arguments.logs, logs.ReadOptions.of(arguments)),
    )
    wanted = by_sender(decoder.dictionaries, decoder.protocol, arguments.only, arguments.without)
    # What a log has besides frames is damage, which nobody can send.
    timed = ((time, raw) for _, (_, time, _, raw) in entries if isinstance(raw, Frame) and wanted(raw))
    with Master(options.open_bus(arguments)) as master:
        frames, late, worst = replay(master, timed, arguments.speed)
    print(
        f"{amount(frames, 'frame')} sent, {late} of them later than {LATE * 1000:g} ms, {worst * 1000:.1f} ms at most"
    )
