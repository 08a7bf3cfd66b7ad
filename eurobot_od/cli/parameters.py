"""Commands on the parameters of a CANopen node: `configure`, `store`, `restore`, `export-dcf` and `program`."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated

from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.options import Output, whole, write_dcf
from eurobot_od.cli.signature import Option
from eurobot_od.cli.target import Target
from eurobot_od.client import configure as configuring
from eurobot_od.client.configure import ChangePlan, DictionaryArea, apply, check_file, difference
from eurobot_od.client.description import from_file
from eurobot_od.client.program import load
from eurobot_od.client.reading import dcf_of_node, parameters
from eurobot_od.errors import LocalError
from eurobot_od.od.objects import label
from eurobot_od.od.values import MOST_SUBS
from eurobot_od.support.progress import bar, passing
from eurobot_od.support.texts import amount, columns

HEARTBEAT_WAIT = 1.2
"""Seconds in which a node's heartbeat shows the state to go back to; our nodes send one a second."""


def configure(
    target: Target,
    file: Annotated[str, Option(metavar="FILE.dcf", is_file=True)],
    *,
    dry_run: bool = False,
    only: Sequence[DictionaryArea] = tuple(DictionaryArea),
    no_store: bool = False,
    no_reset: bool = False,
) -> ExitStatus:
    """Configure a CANopen node from a DCF: write what differs, read it back, store it, reset the node, verify.

    Exit status 1 if the node differs from the file and --dry-run leaves it so.

    file: the DCF, for this device and this node-ID
    dry_run: print what differs and write nothing
    only: only these objects; repeatable
    no_store: do not have the node store it: it is lost at a reset
    no_reset: do not reset the node to verify what it has stored
    """
    description = from_file(file)  # never the network's: a configuration is for the one device that its DCF names
    check_file(description, target.node_id)  # the file is judged before a bus is opened
    with target.opened() as node:
        node.master.follow(description.dictionary)
        plan = difference(node, description, only)
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
    file = Path(plan.dictionary.file).name
    if not plan.changes:
        return f"node {node_id} already is as {file} says"
    head = f"node {node_id} differs from {file} in {amount(len(plan.changes), 'object')}:"
    return "\n".join([head, *columns((label(each.thing), " -> ".join(each.texts)) for each in plan.changes)])


def store(target: Target) -> None:
    """Have a CANopen node store its parameters, so that they survive a reset (0x1010)."""
    with target.opened() as node:
        target.named_description(node)  # its file may say another SDO server
        configuring.store(node)
    print(f"node {node.node_id} has stored all parameters")


def restore(target: Target, *, reset: bool = False) -> None:
    """Have a CANopen node restore the defaults of its parameters, from its next reset on (0x1011).

    reset: reset the node, so that they take effect
    """
    with target.opened() as node:
        target.named_description(node)
        configuring.restore(node)
        if reset:
            node.reset()
    when = "has" if reset else "will have, from its next reset on,"
    print(f"node {node.node_id} {when} the defaults of all parameters")


def export_dcf(target: Target, *, output: Output = None) -> ExitStatus:
    """Write the DCF of a live CANopen node: its EDS with the values that its parameters have now.

    What no line of a DCF can hold, and every DOMAIN, is written to files beside it, which `configure` reads back. Exit
    status 1 if the node refuses objects of its EDS, which are left out.
    """
    with target.opened() as node:
        dictionary = target.needed_description(node).dictionary
        stem = output.stem if output else dictionary.name
        with passing(f"node {node.node_id}", parameters(dictionary)) as things:
            dcf, left_out = dcf_of_node(node, dictionary, (target.bus.bitrate or BITRATE) // 1000, stem, things)
    write_dcf(output, dcf)
    for thing, _, reason in left_out:
        complain(f"left out {label(thing)}: {reason}")
    return ExitStatus.FOUND if left_out else ExitStatus.FINE


def program(
    target: Target,
    file: Annotated[Path, Option(metavar="FILE")],
    *,
    number: Annotated[int, Option("--program", metavar="N", read=whole(1, MOST_SUBS))] = 1,
    no_crc: bool = False,
) -> None:
    """Download a program into a CANopen node, verify and start it (0x1F50, 0x1F51, 0x1F56, 0x1F57).

    Nothing is stopped before the node was looked at: whether it has a place for the program, and is the device of
    --eds. If a step fails, one line says why, in which state the node is, and how to go on.

    file: the program, as the node's maker delivers it
    number: number of the program in the node, its sub-index (1)
    no_crc: do not compare 0x1F56 with the file: in this device it is not a CRC
    """
    content = file.read_bytes()
    if not content:
        raise LocalError(f"{file}: the file is empty")
    with target.opened() as node, bar(f"node {node.node_id}: {file.name}") as progress:
        described = target.named_description(node)
        loaded = load(node, content, number, not no_crc, progress, described.dictionary if described else None)
    verified = f"verified by {loaded.crc}" if loaded.crc else "not verified by a CRC"
    print(f"node {node.node_id}: program {number}: {amount(loaded.size, 'byte')} written, {verified}, started")
