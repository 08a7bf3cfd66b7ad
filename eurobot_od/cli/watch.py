"""Watch CANopen nodes: a line when one boots, is lost or is back, by its heartbeat or by guarding it.

Without nodes all that are heard are watched. Exit status 1 if a node is lost at the end.
"""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import suppress
from math import inf
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.device.nmt import STATE_NAMES
from eurobot_od.errors import LocalError
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support import durations

if TYPE_CHECKING:
    from eurobot_od.client.watch import NodeEvent


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("nodes", nargs="*", type=int, metavar="NODE-ID", help="nodes that have to be there")
    parser.add_argument(
        "--within", type=durations.seconds, default=2.0, metavar="TIME", help="they have to be heard within (2 s)"
    )
    parser.add_argument(
        "--guard", type=durations.seconds, metavar="TIME", help="ask them by a remote frame every so often"
    )
    parser.add_argument(
        "--for", dest="span", type=durations.seconds, default=inf, metavar="TIME", help="left out: until Ctrl-C"
    )
    parser.add_argument("--json", action="store_true", help="print a JSON object a line")
    shared.add_bus(parser)
    shared.add_reconnect(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Watch to the end."""
    from eurobot_od.client.master import Master
    from eurobot_od.client.watch import NodeWatch, watch_nodes

    wrong = [node_id for node_id in arguments.nodes if node_id not in NODE_IDS]
    if wrong:
        raise LocalError(f"node-ID {wrong[0]} is not in 1..127")
    if arguments.guard is not None and not (arguments.nodes and arguments.guard):
        raise LocalError("--guard asks nodes that are named, every so often: name them, and a time longer than 0")
    guarded: dict[int, float] = dict.fromkeys(arguments.nodes, arguments.guard) if arguments.guard else {}
    with Master(shared.open_bus(arguments)) as master:
        started = master.clock()
        write = _json if arguments.json else _line

        def told(event: NodeEvent) -> None:
            print(write(event._replace(time=event.time - started)))
            sys.stdout.flush()

        watch = NodeWatch(told, expected=arguments.nodes, patience=arguments.within, guarded=guarded)
        with suppress(KeyboardInterrupt):  # the usual way to end it
            watch_nodes(master, watch, started + arguments.span, shared.guard(arguments, master))
    return ExitStatus.FOUND if any(node.lost for node in watch.nodes.values()) else ExitStatus.FINE


def _line(event: NodeEvent) -> str:
    state = "" if event.state in (None, 0) else f" ({STATE_NAMES[event.state]})"
    return f"{event.time:9.3f}  node {event.node_id} {event.change.value}{state}"


def _json(event: NodeEvent) -> str:
    state = None if event.state is None else STATE_NAMES[event.state]
    return json.dumps(event._asdict() | {"change": event.change.name.lower(), "state": state})
