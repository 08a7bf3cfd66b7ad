"""Decode logs of a CAN bus: messages with their fields and units, CANopen services, and whatever is wrong.

Lines go to standard output, progress and the report to standard error.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, options
from eurobot_od.cli.logs import add_log, entries, opened
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.logs.filters import Wanted
    from eurobot_od.logs.meaning import Decoder
    from eurobot_od.logs.output import Output

BIT_RATE = 500_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_log(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="one JSON object a line")
    form.add_argument("--csv", action="store_true", help="comma-separated values")
    add_filters(parser)
    parser.add_argument("--since", type=float, default=0.0, metavar="S", help="from this time on, in s")
    parser.add_argument("--until", type=float, default=float("inf"), metavar="S", help="up to this time, in s")
    parser.add_argument("--relative", action="store_true", help="count the time from a log's first entry")
    parser.add_argument(
        "--statistics",
        action="store_true",
        help="instead of lines: load, gaps, jitter, response times and their bounds",
    )
    parser.add_argument(
        "-b", "--bitrate", type=options.bit_rate, default=BIT_RATE, help="bit/s for --statistics; left out: %(default)s"
    )
    parser.add_argument("--strict", action="store_true", help="exit status 1 if anything is wrong in the logs")
    options.add_network(parser)


def add_filters(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which frames are wanted."""
    group = parser.add_argument_group("filters", "an entry has to pass all kinds of them that are given")
    group.add_argument(
        "--message",
        action="append",
        metavar="NAME",
        help="message or service by name (`Goto XY`, goto-xy, SDO), or a protocol: GTP, ELP, GIP, CANopen; repeatable",
    )
    group.add_argument("--node", action="append", metavar="NAME", help="what a node sends or receives; repeatable")
    group.add_argument(
        "--where",
        action="append",
        metavar="CONDITION",
        help="field value: `x>1000`, `Goto XY.speed<=20`, `team_colour=red`, `time=unknown`; several must all hold",
    )


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Decode all logs; report what is wrong in them."""
    from eurobot_od.logs.decoding import Decoding
    from eurobot_od.logs.filters import Window

    if arguments.statistics:
        return _statistics(arguments)
    decoder = options.decoder(arguments)
    output = _output(arguments, decoder)
    window = Window(arguments.since, arguments.until, arguments.relative)
    decoding = Decoding(decoder, output, filters(arguments, decoder), window)
    sys.stdout.write(output.header)
    for log in arguments.logs:
        with opened(log, is_watched=not sys.stdout.isatty()) as file:
            sys.stdout.writelines(decoding.lines(file, log, arguments.format, arguments.largest))
    sys.stdout.flush()
    sys.stderr.writelines(f"{line}\n" for line in decoding.damage.report())
    return ExitStatus.FOUND if arguments.strict and decoding.damage.total else ExitStatus.FINE


def _statistics(arguments: argparse.Namespace) -> ExitStatus:
    """Print the statistics of all logs, one after the other; report what is wrong in them."""
    from functools import lru_cache

    from eurobot_od.frame import Frame
    from eurobot_od.load.seen import SeenTraffic, table
    from eurobot_od.logs.entries import REMEMBERED
    from eurobot_od.logs.filters import Window
    from eurobot_od.logs.statistics import DamageCounts

    decoder = options.decoder(arguments)
    decode, wanted, damage = lru_cache(REMEMBERED)(decoder), filters(arguments, decoder), DamageCounts()
    promised = options.promised(arguments, decoder)
    for log in arguments.logs:
        seen = SeenTraffic(arguments.bitrate, promised)
        shown_time = Window(arguments.since, arguments.until, arguments.relative).clock()
        for _, (line, time, _, raw) in entries([log], arguments):
            meaning, shown = decode(raw), shown_time(time)
            damage.add(log, line, meaning.defects)
            if isinstance(raw, Frame) and shown is not None and (wanted is None or wanted(meaning)):
                seen.take(shown, raw, meaning.name or "?", meaning.nodes[0] if meaning.nodes else "")
        print("\n".join(([one_line(f"{log}:")] if len(arguments.logs) > 1 else []) + list(table(seen))))
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    return ExitStatus.FOUND if arguments.strict and damage.total else ExitStatus.FINE


def _output(arguments: argparse.Namespace, decoder: Decoder) -> Output:
    from eurobot_od.logs.output import TextOutput

    if arguments.json or arguments.csv:
        from eurobot_od.logs.records import CsvOutput, JsonOutput

        fields = (field for each in decoder.protocol.bindings for field in each.kinds)
        return JsonOutput() if arguments.json else CsvOutput(fields)
    return TextOutput(several=len(arguments.logs) > 1)


def filters(arguments: argparse.Namespace, decoder: Decoder) -> Wanted | None:
    """Return the filter that the options describe, None for none.

    Raises LocalError for a name or a value that cannot be.
    """
    from eurobot_od.logs.filters import by_name, by_node, by_value

    wanted: list[Wanted] = [by_value(text, decoder.protocol) for text in arguments.where or ()]
    if arguments.message:
        wanted.append(by_name(arguments.message, decoder.protocol))
    if arguments.node:
        wanted.append(by_node(arguments.node, [each.name for each in decoder.outlines]))
    return (lambda meaning: all(each(meaning) for each in wanted)) if wanted else None
