"""List the faults that simulated nodes can be given, to see whether a check finds them."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eurobot_od.robot.faults import Fault


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("node", nargs="?", choices=("core", "drive", "navigation"), help="only the faults of this node")
    parser.add_argument("--json", action="store_true", help="print them as JSON, with the step that finds each")


def run(arguments: argparse.Namespace) -> None:
    """Print the faults."""
    from eurobot_od.robot import faults
    from eurobot_od.robot.nodes import ROLES

    role = ROLES[arguments.node] if arguments.node else None
    # those of the base class any node can have
    chosen = {
        "any node" if owner.__name__ == "Node" else owner.__name__.lower(): rows
        for owner, rows in faults.FAULTS.items()
        if role is None or issubclass(role, owner)
    }
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
