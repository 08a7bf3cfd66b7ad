"""List the CANopen nodes of a bus: which answer, in which state, what they are."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus, remote
from eurobot_od.device.nmt import STATE_NAMES
from eurobot_od.support import durations
from eurobot_od.support.tables import columns

if TYPE_CHECKING:
    from eurobot_od.client.scan import Found


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--listen", type=durations.seconds, default=1.5, metavar="TIME", help="for heartbeats (1.5 s)")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    remote.add_bus(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """List the nodes; 1 if there is none."""
    from eurobot_od.client.scan import scan

    with remote.master(arguments) as master:
        found = scan(master, listen=arguments.listen)
    if arguments.json:
        print(json.dumps([as_data(each) for each in found], indent=2))
    else:
        print(*(columns(rows(found)) if found else ["no node answers"]), sep="\n")
    return ExitStatus.FINE if found else ExitStatus.FOUND


def as_data(found: Found) -> dict[str, Any]:
    """Return a node as plain data."""
    identity = found.identity._asdict() if found.identity else None
    state = None if found.state is None else STATE_NAMES[found.state]
    return {"node_id": found.node_id, "name": found.name, "state": state, "identity": identity}


def rows(found: list[Found]) -> Iterator[tuple[str, ...]]:
    """Yield the table of the nodes."""
    yield "node", "name", "state", "vendor", "product", "revision", "serial"
    for each in found:
        state = "-" if each.state is None else STATE_NAMES[each.state]
        numbers = (f"0x{number:08X}" for number in each.identity) if each.identity else ("-",) * 4
        yield f"{each.node_id:>4}", each.name or "-", state, *numbers
