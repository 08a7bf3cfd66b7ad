"""Run one device on a CAN bus until it is interrupted: a node of the robot, or anybody's device from its EDS."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od import bounded, durations
from eurobot_od.cli import ExitStatus, scene
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError, RemoteError, UnknownName
from eurobot_od.escaping import one_line
from eurobot_od.robot.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.cli.scene import Scene
    from eurobot_od.device.waveforms import Waveform
    from eurobot_od.frame import Frame
    from eurobot_od.live import Live
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.network_file import NodeFile
    from eurobot_od.od.values import Address
    from eurobot_od.robot.nodes import Core, Node


ONLY = {"team": "core", "drill": "core", "strategy": "core", "beacons": "navigation", "set": "", "values": ""}
"""Options that make sense for one node of the robot only, or (``) for none of them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("node", nargs="?", help="which one of the devices; left out: the only one")
    parser.add_argument("--node-id", type=int, metavar="N", help="node-ID 1..127 (default: the file's)")
    parser.add_argument("--store", metavar="FILE", help="DCF that keeps the settings which a master has it store")
    parser.add_argument("--duration", type=durations.seconds, metavar="TIME", help="end after this time, such as 10 s")
    parser.add_argument("-v", "--verbose", action="store_true", help="print every message the node hears")
    parser.add_argument("--fault", metavar="NAME", help="give the node a fault; `eurobot-od faults` lists them")
    device = parser.add_argument_group("any device")
    device.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="OBJECT=VALUE",
        help="value in place of the file's, such as 0x2000:1=5 or Motor.Speed=5; repeatable",
    )
    device.add_argument("--values", type=Path, metavar="FILE", help="YAML of waveforms: what the device measures")
    robot = parser.add_argument_group("the robot's nodes")
    colours = [colour.name.lower() for colour in TeamColour]
    robot.add_argument("--team", choices=colours, help="core only: check the nodes and configure the start")
    robot.add_argument("--drill", action="store_true", help="core only: do what the core does when it is checked")
    robot.add_argument("--beacons", action="store_true", help="navigation only: simulated beacons for a red robot")
    scene.add_arguments(robot)
    shared.add_network(parser)
    shared.add_bus(parser)
    shared.add_reconnect(parser)
    parser.add_argument(
        "--on-error",
        choices=("end", "restart"),
        default="restart",
        help="what becomes of a node that fails, after it was stopped (default: restart)",
    )


def run(arguments: argparse.Namespace) -> ExitStatus | None:
    """Run the node until its time is over, an interrupt, or the bus's failure; raises BusError, WorldError."""
    node = _make(arguments)
    entered = scene.enter(node, arguments) if arguments.world else None
    live = _live(node, arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: the drive stopped, the bus closed
    _set_clock(node, live.clock())
    if arguments.beacons:
        from eurobot_od.robot.assembly import assemble
        from eurobot_od.robot.options import MatchOptions

        assemble([node], MatchOptions(), live.clock)  # our robot stands, the others are on their rounds
    with _bus_failure_first(live), live:
        print(one_line(f"{node.name} (node-ID {node.device.node_id}) on {live.name}; Ctrl-C ends it"), flush=True)
        return _stay(live, node, entered, arguments)


def _live(node: Node, arguments: argparse.Namespace) -> Live:
    """Open the bus, and put the node on it; raises BusError, LocalError."""
    from eurobot_od.device.station import OnError
    from eurobot_od.live import Live

    live = Live.node(
        shared.open_bus(arguments),
        node,
        opener=shared.opener(arguments),
        on_error=OnError(arguments.on_error),
        report=lambda report: print(report, flush=True),
    )
    if arguments.verbose:
        live.gatekeeper.add_frames(lambda: node.device.identifiers, partial(_show, node), "print")
    return live


def _stay(live: Live, node: Node, entered: Scene | None, arguments: argparse.Namespace) -> ExitStatus | None:
    """Have the node do what it is there for until its end. Raises BusError, NodeFailed, NoAnswer, OSError."""
    from eurobot_od.robot.nodes import Core

    if isinstance(node, Core) and entered and entered.strategy:
        return scene.play(live, node, entered, entered.strategy, arguments)
    end = float("inf") if arguments.duration is None else live.clock() + arguments.duration
    if isinstance(node, Core):
        _lead(node, arguments, lambda: max(end - live.clock(), 0.0))
    while (failure := live.failure or live.gatekeeper.report_failure) is None and live.clock() < end:
        time.sleep(0.1)
    if failure is not None:
        raise failure
    return None


@contextmanager
def _bus_failure_first(live: Live) -> Iterator[None]:
    """Raise the bus's failure in place of what follows from it, such as a robot that cannot be told to stop."""
    try:
        yield
    except (RemoteError, OSError) as error:  # drivers raise OSError when they are closed after that
        raise live.failure or error from None


def _set_clock(node: Node, now: float) -> None:
    from datetime import datetime

    node.device.time_of_day.set(datetime.now(), now)


def _make(arguments: argparse.Namespace) -> Node:
    """Make the node from its file and what was stored; raises UnknownName, LocalError, DictionaryError."""
    from eurobot_od.device.storage import FileStore
    from eurobot_od.robot import faults
    from eurobot_od.robot.nodes import ANY_DEVICE, KINDS, role_of

    dictionary = _dictionary(arguments)
    role = role_of(dictionary)
    for option, only in ONLY.items():
        if getattr(arguments, option) and role != only:
            raise LocalError(f"--{option} is for {_spoken(only)}, not for {_spoken(role)}")
    if arguments.world and role == ANY_DEVICE:
        raise LocalError(f"--world is for the robot's nodes, not for {_spoken(role)}")
    scene.check_arguments(arguments)
    kind = faults.faulty(KINDS[role], arguments.fault) if arguments.fault else KINDS[role]
    values: Mapping[str, Any] = _values(arguments, dictionary) if role == ANY_DEVICE else {}
    return kind(dictionary, store=FileStore(arguments.store, dictionary) if arguments.store else None, **values)


def _spoken(role: str) -> str:
    return f"the {role}" if role else "devices that are none of the robot's"


def _dictionary(arguments: argparse.Namespace) -> Dictionary:
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.robot import dialects

    files = shared.named_files(arguments)
    if not files:
        if arguments.node is None:
            raise LocalError("which node? Name one of the robot's, or give a device's file with --eds")
        return dialects.load(arguments.node, arguments.dialect, arguments.node_id)
    file = _chosen(files, arguments.node)
    node_id = file.node_id if arguments.node_id is None else arguments.node_id
    dictionary = Dictionary.load(file.file, node_id, file.name)
    shared.tell_repairs([dictionary])
    return dictionary


def _chosen(files: list[NodeFile], name: str | None) -> NodeFile:
    """Return the file of the device with a name, of the only one without; raises UnknownName, LocalError."""
    named = {each.name or Path(each.file).stem: each for each in files}
    if name is None and len(files) > 1:
        raise LocalError(f"which node? Name one of {', '.join(named)}")
    if name is not None and name not in named:
        raise UnknownName("node", name, named)
    return files[0] if name is None else named[name]


def _values(arguments: argparse.Namespace, dictionary: Dictionary) -> Mapping[str, Mapping[Address, Any]]:
    """Return the values of a device that the command line gives; raises LocalError, FieldError, UnknownName."""
    from eurobot_od.client.objects import given

    named = shared.assignments("--set", "OBJECT=VALUE", arguments.set)
    return {
        "given": dict(given(*each, dictionary) for each in named),
        "waveforms": _waveforms(arguments.values, dictionary) if arguments.values else {},
    }


def _waveforms(file: Path, dictionary: Dictionary) -> dict[Address, Waveform]:
    from eurobot_od.client.objects import find_one
    from eurobot_od.device.waveforms import read_waveforms

    found = read_waveforms(bounded.read(file).decode(errors="replace"), str(file))
    return {find_one(name, dictionary).address: waveform for name, waveform in found.items()}


def _show(node: Node, frame: Frame, now: float) -> None:
    from eurobot_od.errors import RemoteError
    from eurobot_od.pdo.message import describe

    try:
        message = node.device.protocol.decode(*frame)
        what = f"{node.device.protocol.name(type(message))}  {describe(message)}".rstrip()
    except RemoteError as error:
        what = str(error)
    print(one_line(f"{now:12.3f}  {frame!s:<20}  {what}"), flush=True)


def _lead(core: Core, arguments: argparse.Namespace, left: Callable[[], float]) -> None:
    """Do the core's part of the startup (document 5.1) and its drill, if asked to; raises NoAnswer.

    The drill ends after the seconds that are `left`, and its goto with it.
    """
    if arguments.team:
        for name, seconds in core.check_nodes().result().items():
            print(f"{name} answered after {seconds * 1000:.1f} ms", flush=True)
        seconds = core.configure_start(TeamColour[arguments.team.upper()]).result()
        print(f"start configuration confirmed after {seconds * 1000:.1f} ms", flush=True)
    if arguments.drill:
        import asyncio

        from eurobot_od.robot.check.drill import drill

        with suppress(asyncio.TimeoutError):
            asyncio.run(asyncio.wait_for(drill(core), left()))
