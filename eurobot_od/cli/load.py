"""Compute how full a CAN bus is and how late each message can be, for a network or a robot.

Worst-case response times by Davis, Burns, Bril and Lukkien (2007), with transmit mailboxes and errors. Exit status 1 if
a deadline can be missed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, options
from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.network_file import NetworkFile
    from eurobot_od.plugin import Plugin
    from eurobot_od.traffic.load.analysis import ErrorRate, MessageSet

BIT_RATE = 500_000
"""bit/s where neither the option nor the file says it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "path",
        nargs="?",
        metavar="NETWORK",
        help="network file or folder of EDS files (default: the robot's network)",
    )
    parser.add_argument("--network", metavar="PATH", help="the same, as for other commands")
    parser.add_argument("-b", "--bitrate", type=options.bit_rate, help="bit/s (default: the file's, or 500000)")
    parser.add_argument(
        "--errors", type=_errors, metavar="N/TIME", help="at most N bit errors in any TIME, such as 1/10ms"
    )
    parser.add_argument(
        "--mailboxes",
        type=options.whole(0, what="a number of mailboxes"),
        metavar="N",
        help="transmit mailboxes without abort in every node, 0 for enough (default: each node's setting)",
    )
    parser.add_argument("--json", action="store_true", help="print as JSON, times in us")
    parser.add_argument("--svg", type=Path, metavar="FILE", help="write a chart of the response times")
    options.add_dialect(parser)


def _errors(text: str) -> ErrorRate:
    from eurobot_od.support import durations
    from eurobot_od.traffic.load.analysis import ErrorRate

    number, slash, time = text.partition("/")
    try:
        rate = ErrorRate(int(number), durations.microseconds(time))
    except (ValueError, LocalError):
        rate = ErrorRate(-1)  # one message for whichever half is wrong
    if not slash or rate.number < 0 or rate.interval < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number and a time, such as 1/10ms")
    return rate


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Print the table, and write the chart."""
    from eurobot_od.cli.output import write
    from eurobot_od.traffic.load.report import as_data, chart, load_report, table, too_slow

    if arguments.path and arguments.network:
        raise LocalError("one network: name it by NETWORK or by --network")
    path = arguments.path or arguments.network
    messages = _read(path, arguments.dialect, options.robot(arguments, path))
    if arguments.mailboxes is not None:
        nodes = {each.node for each in messages.messages}
        messages = messages._replace(mailboxes=dict.fromkeys(nodes, arguments.mailboxes) if arguments.mailboxes else {})
    if arguments.errors is not None:
        messages = messages._replace(errors=arguments.errors)
    bit_rate = arguments.bitrate or messages.bit_rate or BIT_RATE
    report = load_report(messages, bit_rate)
    if arguments.json:
        print(json.dumps(as_data(report), indent=2))
    else:
        slower = () if bit_rate in messages.offered and not report.holds else too_slow(messages)
        print(*table(report), *slower, sep="\n")
    if arguments.svg:
        write(arguments.svg, chart(report, f"Response times at {bit_rate / 1000:g} kbit/s") + "\n")
    return ExitStatus.FINE if report.holds else ExitStatus.FOUND


def _read(path: str | None, dialect: str | None, robot: Plugin) -> MessageSet:
    """Return the messages that the command line is about; raises LocalError, FileError, OSError."""
    from eurobot_od.od.network import load, read_network

    if path is None:
        return of_robot(robot, dialect)
    if dialect:
        raise LocalError("--dialect is for a robot's network: leave it out, or the file")
    network = read_network(path)
    return _of_dictionaries(load(network.nodes), network, path, robot)


def of_robot(robot: Plugin, dialect: str | None = None) -> MessageSet:
    """Return what the nodes of a dialect send, with the periods of the dialects' network file, if there is one."""
    from eurobot_od.od.network import read_network
    from eurobot_od.od.network_file import NetworkFile

    file = robot.dialects.network_file()
    dictionaries = robot.dialects.load_all(dialect)
    return _of_dictionaries(dictionaries, read_network(file) if file else NetworkFile(), str(file), robot)


def _of_dictionaries(dictionaries: Sequence[Dictionary], network: NetworkFile, path: str, robot: Plugin) -> MessageSet:
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.traffic.load.network_set import network_set

    with options.left_out() as refused:
        bindings = Protocol.of_devices(dictionaries, robot.catalogue(), refused).bindings
    return network_set(dictionaries, {each.cob_id: each.name for each in bindings}, network, path)
