"""Configure a CANopen node from a DCF: write what differs, read it back, store it, reset the node, verify.

Rule of this file: the file is judged before a bus is opened, and the difference before anything is written.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, remote
from eurobot_od.support.amounts import amount
from eurobot_od.support.tables import columns

if TYPE_CHECKING:
    from eurobot_od.client.configure import ChangePlan

CHAPTERS = ("communication", "pdo", "manufacturer", "profile")
"""Of an object dictionary, as in `client.configure`, which loads more than a help text needs."""

HEARTBEAT_WAIT = 1.2
"""Seconds in which a node's heartbeat tells the state it is to go back to; ours send one a second."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("file", metavar="FILE.dcf", help="for this device and this node-ID")
    parser.add_argument("--dry-run", action="store_true", help="print what differs and write nothing")
    parser.add_argument(
        "--only",
        choices=CHAPTERS,
        action="append",
        metavar="CHAPTER",
        help=f"only these objects: {', '.join(CHAPTERS)}",
    )
    parser.add_argument("--no-store", action="store_true", help="do not have the node store it: it holds until a reset")
    parser.add_argument("--no-reset", action="store_true", help="do not reset the node to see whether it has stored it")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Configure the node; with --dry-run 1 if it differs from the file."""
    from eurobot_od.client.configure import Chapter, apply, check_file, difference
    from eurobot_od.client.description import from_file

    description = from_file(arguments.file)
    check_file(description, remote.node_id(arguments))
    with remote.node(arguments) as node:
        plan = difference(node, description, [*map(Chapter, arguments.only or CHAPTERS)])
        print(summary(plan, node.node_id))
        if arguments.dry_run or not plan.changes:
            return ExitStatus.FOUND if plan.changes else ExitStatus.FINE
        node.state(HEARTBEAT_WAIT)
        stores, resets = not arguments.no_store, not arguments.no_reset
        outcome = apply(node, plan, datetime.now(), stores=stores, resets=resets)
    if outcome.stored:
        kept = "stored, verified after a reset" if outcome.verified else "stored"
    else:
        kept = "not stored: the node has no 0x1010" if stores else "not stored"
    print(f"node {node.node_id} configured: {amount(outcome.changed, 'object')} written and read back, {kept}")
    return ExitStatus.FINE


def summary(plan: ChangePlan, node_id: int) -> str:
    """Return the difference between the node and the file, a line an object."""
    from eurobot_od.od.objects import label

    file = Path(plan.dictionary.file).name
    if not plan.changes:
        return f"node {node_id} already is as {file} says"
    head = f"node {node_id} differs from {file} in {amount(len(plan.changes), 'object')}:"
    rows = ((label(each.thing), " -> ".join(each.texts)) for each in plan.changes)
    return "\n".join([head, *columns(rows)])
