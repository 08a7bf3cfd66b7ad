"""Compare two logs that should be the same: which frames are missing, extra or late, or have other values.

Exit status 1 if they differ: a regression test for a node's program.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, logs, options
from eurobot_od.cli.decode import Filters, add_filters
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.support import durations

if TYPE_CHECKING:
    from eurobot_od.pdo.protocol import Protocol


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("first", metavar="LOG", help="the expected log")
    parser.add_argument("second", metavar="LOG", help="the log to compare with it")
    logs.add_reading(parser)
    parser.add_argument(
        "--time", type=durations.seconds, default="1 ms", metavar="TIME", help="tolerance of times (1 ms)"
    )
    parser.add_argument(
        "--tolerance",
        action="append",
        default=[],
        metavar="[MESSAGE.]FIELD=NUMBER",
        help="tolerance of a field, such as x=5 or 'Goto State Response.time=20'; repeatable",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object per difference")
    add_filters(parser)
    options.add_network(parser)
    options.add_emcy(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Compare; print the differences in the order of time, and how many there are."""
    from eurobot_od.traffic.compare import Tolerances, compare

    decoder = options.Devices.of(arguments).decoder()
    fields = tolerances(options.assignments("--tolerance", "FIELD=NUMBER", arguments.tolerance), decoder.protocol)
    wanted, reading = Filters.of(arguments).wanted(decoder), logs.ReadOptions.of(arguments)
    # Both are read whole, as the distance between their clocks is found from frames of both.
    read = (logs.entries([log], reading) for log in (arguments.first, arguments.second))
    first, second = (
        [(time, raw) for _, (_, time, _, raw) in entries if wanted is None or wanted(decoder(raw))] for entries in read
    )
    differences = compare(first, second, decoder, Tolerances(arguments.time, fields))
    for each in differences:
        line = f"{each.time:13.6f}  {each.kind.value:<8} {each.name:<29} {each.text}".rstrip()
        print(json.dumps(each._asdict() | {"kind": each.kind.value}) if arguments.json else line)
    if not arguments.json:
        kinds = Counter(each.kind.value for each in differences)
        found = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no difference"
        print(f"{len(first)} and {len(second)} frames: {found}")
    return ExitStatus.FOUND if differences else ExitStatus.FINE


def tolerances(given: list[tuple[str, str]], protocol: Protocol) -> dict[tuple[str, str], float]:
    """Return the tolerances by message and field; raises UnknownName, LocalError."""
    found: dict[tuple[str, str], float] = {}
    for name, text in given:
        message, _, field = name.rpartition(".")
        bindings = [protocol.binding(message)] if message else protocol.bindings
        having = [each.name for each in bindings if field in each.kinds]
        if not having:
            raise UnknownName("field", name, dict.fromkeys(field for each in bindings for field in each.kinds))
        try:
            number = float(text)
        except ValueError:
            number = -1.0
        if not 0 <= number < float("inf"):  # `float` takes "nan" and "inf", with which nothing would ever differ
            raise LocalError(f"--tolerance {name}={text}: not a number, 0 or more")
        found |= dict.fromkeys(((each, field) for each in having), number)
    return found
