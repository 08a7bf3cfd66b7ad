"""Run one node of the robot on a CAN bus, until it is interrupted."""

from __future__ import annotations

import argparse
import signal
import time
from functools import partial
from typing import TYPE_CHECKING

from eurobot_od import durations
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.robot.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.frame import Frame
    from eurobot_od.robot.nodes import Core, Node


ONLY = {"team": "core", "drill": "core", "beacons": "navigation"}
"""Options that make sense for one node only."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("node", choices=("core", "drive", "navigation"), help="which node")
    parser.add_argument("--node-id", type=int, metavar="N", help="node-ID 1..127 (default: the EDS file's)")
    parser.add_argument("--store", metavar="FILE", help="DCF that keeps the settings which a master has it store")
    parser.add_argument("--duration", type=durations.seconds, metavar="TIME", help="end after this time, such as 10 s")
    parser.add_argument("-v", "--verbose", action="store_true", help="print every message the node hears")
    colours = [colour.name.lower() for colour in TeamColour]
    parser.add_argument("--team", choices=colours, help="core only: check the nodes and configure the start")
    parser.add_argument("--drill", action="store_true", help="core only: do what the core does when it is checked")
    parser.add_argument("--beacons", action="store_true", help="navigation only: simulated beacons for a red robot")
    parser.add_argument("--fault", metavar="NAME", help="give the node a fault; `eurobot-od faults` lists them")
    shared.add_dialect(parser)
    shared.add_bus(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the node until its time is over, an interrupt, or the bus's failure; raises BusError."""
    from eurobot_od import live as runtime
    from eurobot_od.robot.nodes import Core

    node = _make(arguments)
    live = runtime.Live.node(shared.open_bus(arguments), node, report=lambda report: print(report, flush=True))
    if arguments.verbose:
        live.gatekeeper.add_frames(lambda: node.device.identifiers, partial(_show, node), "print")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: the drive stopped, the bus closed
    if arguments.beacons:
        from eurobot_od.robot.assembly import assemble
        from eurobot_od.robot.options import MatchOptions

        assemble([node], MatchOptions(), live.clock)  # our robot stands, the others are on their rounds
    with live:
        print(f"{node.name} (node-ID {node.device.node_id}) on {live.bus.channel_info}; Ctrl-C ends it", flush=True)
        if isinstance(node, Core):
            _lead(node, arguments)
        end = float("inf") if arguments.duration is None else live.clock() + arguments.duration
        while live.failure is None and live.clock() < end:
            time.sleep(0.1)
        if live.failure is not None:
            raise live.failure


def _make(arguments: argparse.Namespace) -> Node:
    """Make the node from its EDS file and what was stored; raises UnknownName, LocalError, DictionaryError."""
    from eurobot_od.device.storage import FileStore
    from eurobot_od.robot import dialects, faults
    from eurobot_od.robot.nodes import ROLES

    for option, node in ONLY.items():
        if getattr(arguments, option) and arguments.node != node:
            raise LocalError(f"--{option} is for the {node}, not for the {arguments.node}")
    role = ROLES[arguments.node]
    if arguments.fault:
        role = faults.faulty(role, arguments.fault)
    dictionary = dialects.load(arguments.node, arguments.dialect, arguments.node_id)
    return role(dictionary, store=FileStore(arguments.store, dictionary) if arguments.store else None)


def _show(node: Node, frame: Frame, now: float) -> None:
    from eurobot_od.errors import RemoteError
    from eurobot_od.pdo.message import describe

    try:
        message = node.device.protocol.decode(*frame)
        what = f"{node.device.protocol.name(type(message))}  {describe(message)}".rstrip()
    except RemoteError as error:
        what = str(error)
    print(f"{now:12.3f}  {frame!s:<20}  {what}", flush=True)


def _lead(core: Core, arguments: argparse.Namespace) -> None:
    """Do the core's part of the startup (document 5.1) and its drill, if asked to; raises NoAnswer."""
    if arguments.team:
        for name, seconds in core.check_nodes().result().items():
            print(f"{name} answered after {seconds * 1000:.1f} ms", flush=True)
        seconds = core.configure_start(TeamColour[arguments.team.upper()]).result()
        print(f"start configuration confirmed after {seconds * 1000:.1f} ms", flush=True)
    if arguments.drill:
        import asyncio

        from eurobot_od.robot.check.drill import drill

        asyncio.run(drill(core))
