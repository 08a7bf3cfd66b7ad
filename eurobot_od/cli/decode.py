"""Decode logs of a CAN bus: messages with their fields and units, CANopen services, and whatever is wrong.

Lines go to standard output, progress and the report to standard error.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.cli import ExitStatus, options
from eurobot_od.cli.logs import add_log, opened

if TYPE_CHECKING:
    from eurobot_od.traffic.filters import Wanted
    from eurobot_od.traffic.meaning import Decoder
    from eurobot_od.traffic.output import Output

BIT_RATE = 500_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_log(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="one JSON object per line")
    form.add_argument("--csv", action="store_true", help="comma-separated values")
    add_filters(parser)
    parser.add_argument("--since", type=float, default=0.0, metavar="S", help="from this time on, in s")
    parser.add_argument("--until", type=float, default=float("inf"), metavar="S", help="up to this time, in s")
    parser.add_argument("--relative", action="store_true", help="count the time from a log's first entry")
    parser.add_argument(
        "--statistics",
        action="store_true",
        help="print load, gaps, jitter, response times and their bounds instead of lines",
    )
    parser.add_argument(
        "-b", "--bitrate", type=options.bit_rate, default=BIT_RATE, help="bit/s for --statistics (default: %(default)s)"
    )
    parser.add_argument("--strict", action="store_true", help="exit status 1 if anything is wrong in the logs")
    options.add_network(parser)
    options.add_emcy(parser)


def add_filters(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which frames are wanted."""
    group = parser.add_argument_group("filters", "an entry has to pass all that are given")
    group.add_argument(
        "--message",
        action="append",
        default=[],
        metavar="NAME",
        help="message or service by name (`Goto XY`, goto-xy, SDO), or a protocol: GTP, ELP, GIP, CANopen; repeatable",
    )
    group.add_argument(
        "--node",
        action="append",
        default=[],
        metavar="NAME",
        help="messages that this node sends or receives; repeatable",
    )
    group.add_argument(
        "--where",
        action="append",
        default=[],
        metavar="CONDITION",
        help="condition on a field: `x>1000`, `Goto XY.speed<=20`, `team_colour=red`, `time=unknown`; repeatable",
    )


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Decode all logs; report what is wrong in them."""
    from eurobot_od.traffic.decoding import Decoding
    from eurobot_od.traffic.filters import Window

    devices = options.Devices.of(arguments)
    decoder = devices.decoder()
    several = len(arguments.logs) > 1
    if arguments.statistics:
        from eurobot_od.traffic.load.seen import TrafficOutput

        output: Output = TrafficOutput(arguments.bitrate, devices.promised(decoder), several)
    else:
        output = _output(decoder, arguments.json, arguments.csv, several)
    window = Window(arguments.since, arguments.until, arguments.relative)
    decoding = Decoding(decoder, output, Filters.of(arguments).wanted(decoder), window)
    sys.stdout.write(output.header)
    for log in arguments.logs:
        # Lines on the same terminal would tear the bar apart.
        with opened(log, is_watched=arguments.statistics or not sys.stdout.isatty()) as file:
            sys.stdout.writelines(decoding.lines(file, log, arguments.format, arguments.largest))
    sys.stdout.flush()  # the report comes after the lines, also where both go to one file
    sys.stderr.writelines(f"{line}\n" for line in decoding.damage.report())
    return ExitStatus.FOUND if arguments.strict and decoding.damage.total else ExitStatus.FINE


def _output(decoder: Decoder, as_json: bool, as_csv: bool, several: bool) -> Output:
    from eurobot_od.traffic.output import TextOutput

    if not (as_json or as_csv):
        return TextOutput(several)  # the usual case starts without the modules of the others
    from eurobot_od.traffic.output import CsvOutput, JsonOutput

    fields = (field for each in decoder.protocol.bindings for field in each.kinds)
    return JsonOutput() if as_json else CsvOutput(fields)


class Filters(NamedTuple):
    """The entries that are wanted: names of messages and nodes, conditions on fields."""

    messages: Sequence[str]
    nodes: Sequence[str]
    conditions: Sequence[str]

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> Filters:
        """Take them from a command line."""
        return cls(arguments.message, arguments.node, arguments.where)

    def wanted(self, decoder: Decoder) -> Wanted | None:
        """Return the filter, None for none; raises LocalError for a name or a value that cannot be."""
        from eurobot_od.traffic.filters import by_name, by_node, by_value

        wanted: list[Wanted] = [by_value(text, decoder.protocol) for text in self.conditions]
        if self.messages:
            wanted.append(by_name(self.messages, decoder.protocol))
        if self.nodes:
            wanted.append(by_node(self.nodes, [each.name for each in decoder.dictionaries]))
        return (lambda meaning: all(each(meaning) for each in wanted)) if wanted else None
