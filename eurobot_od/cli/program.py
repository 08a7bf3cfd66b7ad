"""Download a program into a CANopen node, verify and start it (0x1F50, 0x1F51, 0x1F56, 0x1F57).

Nothing is stopped before the node was looked at: whether it has a place for the program, and is the device of --eds.
If a step fails, one line says why, in which state the node is, and how to go on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from eurobot_od.cli import remote
from eurobot_od.cli.progress import bar
from eurobot_od.errors import LocalError
from eurobot_od.od.values import MOST_SUBS
from eurobot_od.support.amounts import amount


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    remote.add_node(parser)
    parser.add_argument("file", type=Path, metavar="FILE", help="the program, as the node's maker delivers it")
    parser.add_argument("--program", type=_subindex, default=1, metavar="N", help="sub-index of the program (1)")
    parser.add_argument(
        "--no-crc", action="store_true", help="do not compare 0x1F56 with the file: it is no CRC in this device"
    )


def _subindex(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_SUBS:
        raise argparse.ArgumentTypeError(f"{text} is not in 1..{MOST_SUBS}")
    return int(text)


def run(arguments: argparse.Namespace) -> None:
    """Download the program."""
    from eurobot_od.client.program import load

    content = arguments.file.read_bytes()
    if not content:
        raise LocalError(f"{arguments.file}: the file is empty")
    with remote.node(arguments) as node, bar(f"node {node.node_id}: {arguments.file.name}") as progress:
        described = remote.named_description(arguments, node)
        dictionary = described.dictionary if described else None
        loaded = load(node, content, arguments.program, not arguments.no_crc, progress, dictionary)
    verified = f"verified by {loaded.crc}" if loaded.crc else "not verified by a CRC"
    print(
        f"node {node.node_id}: program {arguments.program}: {amount(loaded.size, 'byte')} written, {verified}, started"
    )
