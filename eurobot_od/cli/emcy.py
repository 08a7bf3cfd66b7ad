"""Print the errors that a CANopen node remembers, newest first, or clear them (0x1001, 0x1003)."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus, options, remote
from eurobot_od.device.emergency import error_words
from eurobot_od.support.tables import columns

if TYPE_CHECKING:
    from eurobot_od.client.history import History


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("--clear", action="store_true", help="empty the history")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Print the history; 1 if there is an error now."""
    from eurobot_od.client.history import clear, history

    with remote.node(arguments) as node:
        if arguments.clear:
            clear(node)
        found = history(node)
    own = options.robot(arguments).catalogue().errors
    print(json.dumps(as_data(found, own), indent=2) if arguments.json else text(found, node.node_id, own))
    return ExitStatus.FOUND if found.register else ExitStatus.FINE


def as_data(found: History, own: Mapping[int, str]) -> dict[str, Any]:
    """Return a history as plain data; `own` are the words for the codes that are the devices' own."""
    history = [each._asdict() | {"text": error_words(each.code, own)} for each in found.entries]
    return {"register": found.register, "history": history}


def text(found: History, node_id: int, own: Mapping[int, str]) -> str:
    """Return a history for a person."""
    register = ", ".join(found.register_bits) or "no error"
    head = f"node {node_id}: {register} (error register 0x{found.register:02X})"
    rows = [
        (f"0x{each.code:04X}", error_words(each.code, own), f"0x{each.info:04X}" if each.info else "")
        for each in found.entries
    ]
    return "\n".join([head, *columns(rows)] if rows else [head, "no error remembered"])
