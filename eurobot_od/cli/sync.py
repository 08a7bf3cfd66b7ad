"""Send SYNC messages at a fixed period, until Ctrl-C or --count."""

from __future__ import annotations

import argparse
from itertools import islice

from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.od.values import BASE_IDENTIFIER, SYNC_COB_ID, parse_number
from eurobot_od.support import durations


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--counter", type=int, metavar="N", help="count the messages from 1 to N, 2..240, and again")
    add_production(parser, SYNC_COB_ID, "100 ms")
    shared.add_bus(parser)
    shared.add_reconnect(parser)


def add_production(parser: argparse.ArgumentParser, cob_id: int, period: str) -> None:
    """Add what all that is sent again and again has."""
    parser.add_argument("--period", type=_period, default=period, metavar="TIME", help=f"({period})")
    parser.add_argument("--count", type=int, metavar="N", help="end after N messages")
    parser.add_argument("--cob-id", type=identifier, default=cob_id, metavar="ID", help=f"(0x{cob_id:03X})")


def _period(text: str) -> float:
    seconds = durations.seconds(text)
    if not seconds:
        raise LocalError("a period is longer than 0")
    return seconds


def identifier(text: str) -> int:
    """Read an 11-bit identifier; raises LocalError."""
    number = parse_number(text)
    if number is None or number.relative or not 0 <= number.value <= BASE_IDENTIFIER:
        raise LocalError(f"{text!r} is no 11-bit identifier")
    return number.value


def run(arguments: argparse.Namespace) -> None:
    """Send until the end."""
    from eurobot_od.client.master import Master
    from eurobot_od.client.producing import produce, syncs

    frames = syncs(arguments.counter, arguments.cob_id)
    with Master(shared.open_bus(arguments)) as master:
        produce(master, islice(frames, arguments.count), arguments.period, shared.guard(arguments, master))
