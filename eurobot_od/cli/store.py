"""Have a CANopen node store its parameters, so that they survive a reset (0x1010)."""

from __future__ import annotations

import argparse

from eurobot_od.cli import remote


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)


def run(arguments: argparse.Namespace) -> None:
    """Store all parameters."""
    from eurobot_od.client.configure import store

    with remote.node(arguments) as node:
        store(node)
    print(f"node {node.node_id} has stored all parameters")
