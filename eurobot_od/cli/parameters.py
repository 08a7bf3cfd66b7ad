"""Commands that set up a CANopen node: `configure`, `store`, `restore` and `program`."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, options
from eurobot_od.cli.remote import TARGET, Target
from eurobot_od.cli.table import CommandRow, option
from eurobot_od.errors import LocalError
from eurobot_od.od.values import MOST_SUBS
from eurobot_od.support.texts import amount, columns

if TYPE_CHECKING:
    from eurobot_od.client.configure import ChangePlan

AREAS = ("communication", "pdo", "manufacturer", "profile")
"""Of an object dictionary, as in `client.configure`, which loads more than a help text needs."""

HEARTBEAT_WAIT = 1.2
"""Seconds in which a node's heartbeat shows the state to go back to; our nodes send one a second."""


def configure(
    target: Target, file: str, dry_run: bool, only: Sequence[str] | None, no_store: bool, no_reset: bool
) -> ExitStatus:
    """Configure a CANopen node from a DCF: write what differs, read it back, store it, reset the node, verify.

    Exit status 1 if the node differs from the file and --dry-run leaves it so.
    """
    from eurobot_od.client.configure import DictionaryArea, apply, check_file, difference
    from eurobot_od.client.description import from_file

    description = from_file(file)  # never the network's: a configuration is for the one device that its DCF names
    check_file(description, target.node_id)  # the file is judged before a bus is opened
    with target.opened() as node:
        node.master.follow(description.dictionary)
        plan = difference(node, description, [*map(DictionaryArea, only or AREAS)])
        print(summary(plan, node.node_id))
        if dry_run or not plan.changes:
            return ExitStatus.FOUND if plan.changes else ExitStatus.FINE
        node.state(HEARTBEAT_WAIT)  # before the reset, as `apply` brings the node back to the state seen last
        outcome = apply(node, plan, datetime.now(), stores=not no_store, resets=not no_reset)
    if outcome.stored:
        kept = "stored, verified after a reset" if outcome.verified else "stored"
    else:
        kept = "not stored" if no_store else "not stored: the node has no 0x1010"
    print(f"node {node.node_id} configured: {amount(outcome.changed, 'object')} written and read back, {kept}")
    return ExitStatus.FINE


def summary(plan: ChangePlan, node_id: int) -> str:
    """Return the difference between the node and the file, a line an object."""
    from eurobot_od.od.objects import label

    file = Path(plan.dictionary.file).name
    if not plan.changes:
        return f"node {node_id} already is as {file} says"
    head = f"node {node_id} differs from {file} in {amount(len(plan.changes), 'object')}:"
    return "\n".join([head, *columns((label(each.thing), " -> ".join(each.texts)) for each in plan.changes)])


def store(target: Target) -> None:
    """Have a CANopen node store its parameters, so that they survive a reset (0x1010)."""
    from eurobot_od.client import configure

    with target.opened() as node:
        target.named_description(node)  # its file may say another SDO server
        configure.store(node)
    print(f"node {node.node_id} has stored all parameters")


def restore(target: Target, reset: bool) -> None:
    """Have a CANopen node restore the defaults of its parameters, from its next reset on (0x1011)."""
    from eurobot_od.client import configure

    with target.opened() as node:
        target.named_description(node)
        configure.restore(node)
        if reset:
            node.reset()
    when = "has" if reset else "will have, from its next reset on,"
    print(f"node {node.node_id} {when} the defaults of all parameters")


def program(target: Target, file: Path, number: int, no_crc: bool) -> None:
    """Download a program into a CANopen node, verify and start it (0x1F50, 0x1F51, 0x1F56, 0x1F57).

    Nothing is stopped before the node was looked at: whether it has a place for the program, and is the device of
    --eds. If a step fails, one line says why, in which state the node is, and how to go on.
    """
    from eurobot_od.client.program import load
    from eurobot_od.support.progress import bar

    content = file.read_bytes()
    if not content:
        raise LocalError(f"{file}: the file is empty")
    with target.opened() as node, bar(f"node {node.node_id}: {file.name}") as progress:
        described = target.named_description(node)
        loaded = load(node, content, number, not no_crc, progress, described.dictionary if described else None)
    verified = f"verified by {loaded.crc}" if loaded.crc else "not verified by a CRC"
    print(f"node {node.node_id}: program {number}: {amount(loaded.size, 'byte')} written, {verified}, started")


COMMANDS = {
    "configure": CommandRow(
        configure,
        TARGET,
        option("file", metavar="FILE.dcf", help="the DCF, for this device and this node-ID"),
        option("--dry-run", action="store_true", help="print what differs and write nothing"),
        option("--only", choices=AREAS, action="append", help="only these objects; repeatable"),
        option("--no-store", action="store_true", help="do not have the node store it: it is lost at a reset"),
        option("--no-reset", action="store_true", help="do not reset the node to verify what it has stored"),
    ),
    "store": CommandRow(store, TARGET),
    "restore": CommandRow(
        restore, TARGET, option("--reset", action="store_true", help="reset the node, so that they take effect")
    ),
    "program": CommandRow(
        program,
        TARGET,
        option("file", type=Path, metavar="FILE", help="the program, as the node's maker delivers it"),
        option(
            "--program",
            dest="number",
            type=options.whole(1, MOST_SUBS),
            default=1,
            metavar="N",
            help="number of the program in the node, its sub-index (1)",
        ),
        option(
            "--no-crc", action="store_true", help="do not compare 0x1F56 with the file: in this device it is not a CRC"
        ),
    ),
}
