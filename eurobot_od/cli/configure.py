"""Configure a CANopen node from a DCF: write what differs, read it back, store it, reset the node, verify.

Rule of this file: the file is judged before a bus is opened, and the difference before anything is written.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.amounts import amount
from eurobot_od.cli import ExitStatus, remote

if TYPE_CHECKING:
    from eurobot_od.client.configure import ChangePlan

HEARTBEAT_WAIT = 1.2
"""Seconds in which a node's heartbeat tells the state it is to go back to; ours send one a second."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("file", metavar="FILE.dcf", help="for this device and this node-ID")
    parser.add_argument("--dry-run", action="store_true", help="print what differs and write nothing")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Configure the node; with --dry-run 1 if it differs from the file."""
    from eurobot_od.client.configure import apply, check_file, difference
    from eurobot_od.client.description import from_file

    description = from_file(arguments.file)
    check_file(description, remote.node_id(arguments))
    with remote.node(arguments) as node:
        plan = difference(node, description)
        print(summary(plan, node.node_id))
        if arguments.dry_run or not plan.changes:
            return ExitStatus.FOUND if plan.changes else ExitStatus.FINE
        node.state(HEARTBEAT_WAIT)
        outcome = apply(node, plan, datetime.now())
    kept = "stored, verified after a reset" if outcome.stored else "not stored: the node has no 0x1010"
    print(f"node {node.node_id} configured: {amount(outcome.changed, 'object')} written and read back, {kept}")
    return ExitStatus.FINE


def summary(plan: ChangePlan, node_id: int) -> str:
    """Return the difference between the node and the file, a line an object."""
    from eurobot_od.od.values import label

    file = Path(plan.dictionary.file).name
    if not plan.changes:
        return f"node {node_id} already is as {file} says"
    head = f"node {node_id} differs from {file} in {amount(len(plan.changes), 'object')}:"
    rows = ((label(each.thing.address, each.thing.name), " -> ".join(each.texts)) for each in plan.changes)
    return f"{head}\n{remote.columns(rows)}"
