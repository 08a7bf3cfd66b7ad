"""List the faults that simulated nodes can be given, to see whether a check finds them."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

from eurobot_od.cli import options
from eurobot_od.errors import UnknownName

if TYPE_CHECKING:
    from eurobot_od.device.faults.fault import Fault


OWNERS = {"Node": "any node", "SimulatedDrive": "any drive of CiA 402"}
"""What the workbench's own kinds of nodes are called; a robot's have the names of their classes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("node", nargs="?", help="only the faults of this node of the robot")
    parser.add_argument("--json", action="store_true", help="print them as JSON, with the step that finds each")


def run(arguments: argparse.Namespace) -> None:
    """Print the faults."""
    robot = options.robot(arguments)
    if arguments.node and arguments.node not in robot.nodes:
        raise UnknownName("node", arguments.node, robot.nodes)
    kind = robot.kind(arguments.node) if arguments.node else None
    # those of the base class any node can have
    chosen: dict[str, dict[str, Fault]] = {}
    for owner, rows in robot.all_faults().items():
        if kind is None or issubclass(kind, owner):
            chosen.setdefault(OWNERS.get(owner.__name__, owner.__name__.lower()), {}).update(rows)
    print(json.dumps(as_data(chosen), indent=2) if arguments.json else as_text(chosen))


def as_data(faults: Mapping[str, Mapping[str, Fault]]) -> list[dict[str, str]]:
    """Return the faults, given by their nodes, as plain data."""
    return [
        {"name": name, "node": owner, "text": fault.text, **fault.caught_by._asdict()}
        for owner, rows in faults.items()
        for name, fault in rows.items()
    ]


def as_text(faults: Mapping[str, Mapping[str, Fault]]) -> str:
    """Return the faults as paragraphs, one for each node."""
    width = max(len(name) for rows in faults.values() for name in rows)
    paragraphs = (
        "\n".join([f"{owner}:", *(f"  {name:{width}}  {fault.text}" for name, fault in rows.items())])
        for owner, rows in faults.items()
    )
    return "\n\n".join(paragraphs)
