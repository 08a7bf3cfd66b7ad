"""Send an NMT command to a CANopen node, or to all, and see by the heartbeat what it did.

An NMT command has no answer: what is printed is what the node's heartbeat or boot-up said.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, remote
from eurobot_od.device.nmt import ALL_NODES, COMMAND_NAMES, STATE_NAMES, TARGET, NmtCommand
from eurobot_od.od.values import NMT_COB_ID

if TYPE_CHECKING:
    from eurobot_od.client.master import RemoteNode

COMMANDS = {name.replace(" ", "-"): NmtCommand(command) for command, name in COMMAND_NAMES.items()}
"""The NMT commands by their words on the command line."""

HEARTBEAT_WAIT = 1.2
"""Seconds in which the heartbeat after the command is awaited; our nodes send one a second."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("command", choices=COMMANDS, help="what to do; NODE may be `all`")


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Send the command; 1 if the node's heartbeat tells that it did not follow."""
    command = COMMANDS[arguments.command]
    if arguments.node == "all":
        with remote.master(arguments) as master:
            master.send(NMT_COB_ID, bytes([command, ALL_NODES]))
        print(f"{arguments.command} sent to all nodes")
        return ExitStatus.FINE
    with remote.node(arguments) as node:
        return _go(node, command) if command in TARGET else _reset(node, command)


def _reset(node: RemoteNode, command: NmtCommand) -> ExitStatus:
    """Reset the node; raises NoAnswer if it does not boot."""
    node.reset(command)
    state = node.state(HEARTBEAT_WAIT)
    print(f"node {node.node_id} has booted" + ("" if state is None else f" and is {STATE_NAMES[state]}"))
    return ExitStatus.FINE


def _go(node: RemoteNode, command: NmtCommand) -> ExitStatus:
    node.command(command)
    followed = node.wait_for(TARGET[command], HEARTBEAT_WAIT)
    state = node.last_state
    if state is None:
        print(f"sent; node {node.node_id} has no heartbeat that would tell its state")
        return ExitStatus.FINE
    print(f"node {node.node_id} is {STATE_NAMES[state]}")
    return ExitStatus.FINE if followed else ExitStatus.FOUND
