"""Run one device on a CAN bus until interrupted: any device from its EDS, or a node of a robot."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError, RemoteError, UnknownName
from eurobot_od.support import durations
from eurobot_od.support.files import read_whole
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    import can

    from eurobot_od.bus.live import Live
    from eurobot_od.device.node import Node
    from eurobot_od.frame import Frame
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.values import Address
    from eurobot_od.plugin import Scene


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("node", nargs="?", help="which of the devices (default: all of them, in one process)")
    parser.add_argument("--node-id", type=int, metavar="N", help="node-ID 1..127 (default: the file's)")
    parser.add_argument("--store", metavar="FILE", help="DCF in which the device stores its parameters")
    parser.add_argument("--duration", type=durations.seconds, metavar="TIME", help="end after this time, such as 10 s")
    parser.add_argument("-v", "--verbose", action="store_true", help="print every message that the node receives")
    parser.add_argument("--fault", metavar="NAME", help="give the node a fault; `faults` lists them")
    device = parser.add_argument_group("any device")
    device.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="OBJECT=VALUE",
        help="value instead of the file's, such as 0x2000:1=5 or Motor.Speed=5; for a robot's node: a fact; repeatable",
    )
    device.add_argument(
        "--profile",
        choices=("402", "401", "none"),
        help="behave as a drive (CiA 402) or an I/O module (CiA 401), or as neither (default: as 0x1000 says)",
    )
    device.add_argument(
        "--travel", type=_travel, metavar="LOW..HIGH", help="turns of a drive's motor from its start to limit switches"
    )
    device.add_argument("--values", type=Path, metavar="FILE", help="YAML with the waveforms that the device measures")
    robot = shared.robot_meant(parser)
    if robot.stage is not None:
        robot.stage().add_arguments(parser.add_argument_group(f"nodes of {robot.name}"))
    shared.add_network(parser)
    shared.add_bus(parser)
    shared.add_reconnect(parser)
    parser.add_argument(
        "--on-error",
        choices=("end", "restart"),
        default="restart",
        help="what happens to a node that fails, after it was stopped (default: restart)",
    )


def _travel(text: str) -> tuple[float, float]:
    """Read the places of two limit switches; raises ArgumentTypeError."""
    low, _, high = text.partition("..")
    try:
        ends = float(low), float(high)
    except ValueError:
        ends = 0.0, 0.0
    if not -FARTHEST <= ends[0] < ends[1] <= FARTHEST:
        raise argparse.ArgumentTypeError(f"{text!r}: LOW..HIGH in turns, such as --travel=-10..10, within {FARTHEST}")
    return ends


FARTHEST = 1_000_000
"""Turns that a drive may travel."""


def run(arguments: argparse.Namespace) -> ExitStatus | None:
    """Run the node until its time is over, an interrupt, or the bus's failure; raises BusError, WorldError."""
    from eurobot_od.bus.live import Live
    from eurobot_od.device.station import OnError
    from eurobot_od.od.dictionary import moved_server

    everybody = _all(arguments) if arguments.node is None else []
    if everybody:
        _run_all(shared.open_bus(arguments), everybody, arguments.duration)
        return None
    node, scene = _make(arguments)
    live = Live.node(
        shared.open_bus(arguments),
        node,
        opener=shared.reopener(arguments),
        on_error=OnError(arguments.on_error),
        report=lambda report: print(report, flush=True),
    )
    if arguments.verbose:
        live.gatekeeper.add_frames(lambda: node.device.identifiers, partial(_show, node), "print")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: the node stopped, the bus closed
    node.device.time_of_day.set(datetime.now(), live.clock())  # until a TIME message sets it
    with _bus_failure_first(live), live:
        print(one_line(f"{node.name} (node-ID {node.device.node_id}) on {live.name}; Ctrl-C ends it"), flush=True)
        if moved := moved_server(node.device.dictionary):
            print(moved, flush=True)
        return _stay(live, scene, arguments.duration)


FOR_ONE = ("node_id", "store", "fault", "set", "values", "verbose")
"""Options that are about one device."""


def _all(arguments: argparse.Namespace) -> list[Node]:
    """Make all the devices of the files that are named, if they are several; raises LocalError, DictionaryError."""
    devices = shared.Devices.of(arguments)
    if len(devices.files()) < 2:
        return []
    loaded, robot = devices.load_and_complain(), devices.robot
    given = [f"--{each.replace('_', '-')}" for each in FOR_ONE if getattr(arguments, each)]
    names = ", ".join(each.name for each in loaded)
    if given:
        raise LocalError(f"{given[0]} is for one device: which node? Name one of {names}")
    for each in loaded:
        if robot.role_of(each):
            raise LocalError(f"{each.name} is one of the robot's nodes, which run alone: name one of {names}")
    return [robot.kind("")(each) for each in loaded]


def _run_all(bus: can.BusABC, nodes: list[Node], duration: float | None) -> None:
    """Run several devices on one bus until the time is over, or an interrupt; raises BusError."""
    from eurobot_od.bus.live.group import LiveGroup
    from eurobot_od.device.station import NodeGroup
    from eurobot_od.od.dictionary import moved_server

    for node in nodes:
        node.alarm = partial(_alarm, node)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with LiveGroup(bus, NodeGroup(nodes)) as live:
        for node in nodes:
            node.device.time_of_day.set(datetime.now(), live.clock())
        names = ", ".join(f"{node.name} ({node.device.node_id})" for node in nodes)
        print(one_line(f"{len(nodes)} devices on {live.name}: {names}; Ctrl-C ends them"), flush=True)
        for node in nodes:
            if moved := moved_server(node.device.dictionary):
                _alarm(node, moved)
        live.run(inf if duration is None else live.clock() + duration)


def _alarm(node: Node, what: str) -> None:
    print(one_line(f"{node.name}: {what}"), flush=True)


def _stay(live: Live, scene: Scene | None, duration: float | None) -> ExitStatus | None:
    """Wait until the node's end, after `duration` in s. Raises BusError, NodeFailed, NoAnswer, OSError."""
    end = inf if duration is None else live.clock() + duration
    status = None if scene is None else scene.play(live)
    if status is not None:
        return ExitStatus(status)
    while (failure := live.failure or live.gatekeeper.report_failure) is None and live.clock() < end:
        time.sleep(0.1)  # the node runs in threads of its own; this is only how soon its end is noticed
    if failure is not None:
        raise failure
    return None


@contextmanager
def _bus_failure_first(live: Live) -> Iterator[None]:
    """Raise the bus's failure in place of what follows from it, such as a robot that cannot be stopped."""
    try:
        yield
    except (RemoteError, OSError) as error:  # drivers raise OSError when they are closed after that
        raise live.failure or error from None


def _make(arguments: argparse.Namespace) -> tuple[Node, Scene | None]:
    """Make the node from its file and what was stored; raises UnknownName, LocalError, DictionaryError."""
    from eurobot_od.device.storage import FileStore

    devices = shared.Devices.of(arguments)
    dictionary, robot = _dictionary(devices, arguments.node, arguments.node_id), devices.robot
    role, stage = robot.role_of(dictionary), robot.stage() if robot.stage else None
    if role and (option := "values" if arguments.values else "set" if arguments.set and not stage else ""):
        raise LocalError(f"--{option} is for devices that do not belong to the robot, not for the {role}")
    if stage:
        stage.check_arguments(arguments, role)
    # The fault goes in front of the class that the node would have without it.
    kind = robot.kind(role, device=_simulated(dictionary, arguments.profile, bool(arguments.travel)))
    kind = robot.faulty(kind, arguments.fault) if arguments.fault else kind
    if role:
        values = stage.values(kind, dictionary, arguments) if stage else {}
    else:
        values = _values(dictionary, arguments.set, arguments.values)
        if arguments.travel:
            values = {**values, "travel": arguments.travel}
    node = kind(dictionary, store=FileStore(arguments.store, dictionary) if arguments.store else None, **values)
    return node, stage.set_up(node, arguments) if stage and role else None


def _simulated(dictionary: Dictionary, profile: str | None, travels: bool) -> type[Node]:
    """Return the class of a device outside the robot; raises LocalError for options that it does not have."""
    from eurobot_od.device.profiles.devices import SimulatedDrive, simulated_kind

    number = None if profile is None else 0 if profile == "none" else int(profile)
    kind = simulated_kind(dictionary, number)
    if travels and not issubclass(kind, SimulatedDrive):
        raise LocalError("--travel is for drives (CiA 402)")
    return kind


def _dictionary(devices: shared.Devices, name: str | None, node_id: int | None) -> Dictionary:
    """Load the device with a name, or the only one; raises UnknownName, LocalError, DictionaryError."""
    from eurobot_od.od.dictionary import Dictionary

    files = devices.files()
    if not files:
        if name is None:
            raise LocalError("which node? Name one of the robot's, or give a device's file with --eds")
        return devices.robot.dialects.load(name, devices.dialect, node_id)
    named = {each.name or Path(each.file).stem: each for each in files}
    if name is None and len(files) > 1:
        raise LocalError(f"which node? Name one of {', '.join(named)}")
    if name is not None and name not in named:
        raise UnknownName("node", name, named)
    file = files[0] if name is None else named[name]
    dictionary = Dictionary.load(*(file if node_id is None else file._replace(node_id=node_id)))
    shared.complain_of_repairs([dictionary])
    return dictionary


def _values(dictionary: Dictionary, assigned: Iterable[str], file: Path | None) -> Mapping[str, Mapping[Address, Any]]:
    """Return the values of a device that the command line gives; raises LocalError, FieldError, UnknownName."""
    from eurobot_od.device.waveforms import read_waveforms
    from eurobot_od.od.objects import address_of, find_one, given

    named = shared.assignments("--set", "OBJECT=VALUE", assigned)
    waves = read_waveforms(read_whole(file).decode(errors="replace"), str(file)) if file else {}
    return {
        "given": dict(given(*each, dictionary.objects) for each in named),
        "waveforms": {address_of(find_one(name, dictionary.objects)): wave for name, wave in waves.items()},
    }


def _show(node: Node, frame: Frame, now: float) -> None:
    from eurobot_od.pdo.message import describe

    try:
        message = node.device.protocol.decode(*frame)
        what = f"{node.device.protocol.name(type(message))}  {describe(message)}".rstrip()
    except RemoteError as error:
        what = str(error)
    print(one_line(f"{now:12.3f}  {frame!s:<20}  {what}"), flush=True)
