"""Run one device on a CAN bus until it is interrupted: anybody's from its EDS, or a node of a robot."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od import plugin
from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError, RemoteError, UnknownName
from eurobot_od.support import bounded, durations
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.device.node import Node
    from eurobot_od.device.waveforms import Waveform
    from eurobot_od.frame import Frame
    from eurobot_od.live import Live
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.network_file import NodeFile
    from eurobot_od.od.values import Address
    from eurobot_od.plugin import Scene


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
        help="value in place of the file's, such as 0x2000:1=5 or Motor.Speed=5; of a robot's node: a fact; repeatable",
    )
    device.add_argument("--values", type=Path, metavar="FILE", help="YAML of waveforms: what the device measures")
    robot = plugin.find(getattr(parser, "robot", None))
    if robot.stage is not None:
        robot.stage().add_arguments(parser.add_argument_group(f"nodes of {robot.name}"))
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
    node, scene = _make(arguments)
    live = _live(node, arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: the node's say, the bus closed
    _set_clock(node, live.clock())
    with _bus_failure_first(live), live:
        print(one_line(f"{node.name} (node-ID {node.device.node_id}) on {live.name}; Ctrl-C ends it"), flush=True)
        return _stay(live, scene, arguments)


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


def _stay(live: Live, scene: Scene | None, arguments: argparse.Namespace) -> ExitStatus | None:
    """Have the node do what it is there for until its end. Raises BusError, NodeFailed, NoAnswer, OSError."""
    end = float("inf") if arguments.duration is None else live.clock() + arguments.duration
    status = None if scene is None else scene.play(live)
    if status is not None:
        return ExitStatus(status)
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


def _make(arguments: argparse.Namespace) -> tuple[Node, Scene | None]:
    """Make the node from its file and what was stored; raises UnknownName, LocalError, DictionaryError."""
    from eurobot_od.device.storage import FileStore

    dictionary, robot = _dictionary(arguments), shared.robot(arguments)
    role, stage = robot.role_of(dictionary), robot.stage() if robot.stage else None
    if role and (option := "values" if arguments.values else "set" if arguments.set and not stage else ""):
        raise LocalError(f"--{option} is for devices that are none of the robot's, not for the {role}")
    if stage:
        stage.check_arguments(arguments, role)
    kind = robot.kind(role)
    kind = robot.faulty(kind, arguments.fault) if arguments.fault else kind
    values = _values(arguments, dictionary) if not role else stage.values(kind, dictionary, arguments) if stage else {}
    node = kind(dictionary, store=FileStore(arguments.store, dictionary) if arguments.store else None, **values)
    return node, stage.set_up(node, arguments) if stage and role else None


def _dictionary(arguments: argparse.Namespace) -> Dictionary:
    from eurobot_od.od.dictionary import Dictionary

    files = shared.named_files(arguments)
    if not files:
        if arguments.node is None:
            raise LocalError("which node? Name one of the robot's, or give a device's file with --eds")
        return shared.robot(arguments).dialects.load(arguments.node, arguments.dialect, arguments.node_id)
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
    from eurobot_od.od.objects import given

    named = shared.assignments("--set", "OBJECT=VALUE", arguments.set)
    return {
        "given": dict(given(*each, dictionary.objects) for each in named),
        "waveforms": _waveforms(arguments.values, dictionary) if arguments.values else {},
    }


def _waveforms(file: Path, dictionary: Dictionary) -> dict[Address, Waveform]:
    from eurobot_od.device.waveforms import read_waveforms
    from eurobot_od.od.objects import address_of, find_one

    found = read_waveforms(bounded.read(file).decode(errors="replace"), str(file))
    return {address_of(find_one(name, dictionary.objects)): waveform for name, waveform in found.items()}


def _show(node: Node, frame: Frame, now: float) -> None:
    from eurobot_od.errors import RemoteError
    from eurobot_od.pdo.message import describe

    try:
        message = node.device.protocol.decode(*frame)
        what = f"{node.device.protocol.name(type(message))}  {describe(message)}".rstrip()
    except RemoteError as error:
        what = str(error)
    print(one_line(f"{now:12.3f}  {frame!s:<20}  {what}"), flush=True)
