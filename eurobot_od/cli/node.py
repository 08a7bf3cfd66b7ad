"""`node` runs simulated nodes on a CAN bus, `faults` lists their possible faults."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from eurobot_od.cli import ExitStatus, RobotName
from eurobot_od.cli.devices import Devices, complain_of_repairs
from eurobot_od.cli.options import BusOptions, Json, NoReconnect, Seconds, assigned, give, whole
from eurobot_od.cli.signature import DEVICE_FILES, NOTHING, Chosen, HelpGroup, Hint, Option, Parser, ahead
from eurobot_od.device.lss import Commissioning, LssSlave
from eurobot_od.device.node import Node
from eurobot_od.device.objects import FileStore
from eurobot_od.device.profiles import SimulatedDrive, simulated_kind
from eurobot_od.device.simulated import Waveform, read_waveforms
from eurobot_od.device.station import OnError
from eurobot_od.errors import LocalError, RemoteError, UnknownName, look_up, meant
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import NodeFile
from eurobot_od.od.objects import address_of, find_one, given
from eurobot_od.od.sdo_channels import moved_server
from eurobot_od.od.standard import SERIAL, UNCONFIGURED, node_id_words
from eurobot_od.od.values import NODE_IDS
from eurobot_od.pdo.kinds import describe
from eurobot_od.plugin import NodeRun, Plugins, Scene, Stage
from eurobot_od.support.files import read_whole
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    from eurobot_od.bus.live import Live
    from eurobot_od.bus.live.buses import Opener
    from eurobot_od.device.faults import Fault

FARTHEST = 1_000_000
"""Maximum position of a drive's limit switch, in turns."""


def _travel(text: str) -> tuple[float, float]:
    """Parse the positions of two limit switches; raises LocalError."""
    low, _, high = text.partition("..")
    try:
        ends = float(low), float(high)
    except ValueError:
        ends = 0.0, 0.0
    if not -FARTHEST <= ends[0] < ends[1] <= FARTHEST:
        raise LocalError(f"{text!r}: LOW..HIGH in turns, such as --travel=-10..10, within {FARTHEST}")
    return ends


class LoadedDevice(NamedTuple):
    """A device's file, and what LSS has configured before power-on; None for a device without LSS."""

    dictionary: Dictionary
    commissioning: Commissioning | None = None

    def worded(self, devices: Devices) -> LoadedDevice:
        """Return the device with the texts of its package."""
        return self._replace(dictionary=devices.worded(self.dictionary))

    @classmethod
    def of(cls, file: NodeFile, store: str | None = None) -> LoadedDevice:
        """Load a device; if it begins without a node-ID, with what LSS has stored. Raises DictionaryError."""
        if file.node_id != UNCONFIGURED:
            return cls.configured(file.load())
        dictionary = file.load(NODE_IDS[-1])  # any, as LSS will set another
        stored = FileStore(store, dictionary).commissioned if store else None
        return cls(dictionary, stored or Commissioning())

    @classmethod
    def configured(cls, dictionary: Dictionary) -> LoadedDevice:
        """Return a device with the node-ID of its dictionary; it has LSS if its file says so."""
        has_lss = dictionary.device.document.text("deviceinfo", "lss_supported") == "1"
        return cls(dictionary, Commissioning(dictionary.node_id) if has_lss else None)


@dataclass(frozen=True, kw_only=True)
class DeviceOptions:
    """How a device behaves, and its values; a robot's node only takes facts (--set).

    given: value instead of the file's, such as 0x2000:1=5 or Motor.Speed=5; for a robot's node: a fact; repeatable
    profile: behave as a drive (CiA 402) or an I/O module (CiA 401), or as neither (default: as 0x1000 says)
    travel: turns of a drive's motor from its start to limit switches
    values: YAML with the waveforms that the device measures
    serial: serial number (0x1018:4); of several devices each has the next one
    """

    GROUP = HelpGroup("any device")

    given: Annotated[Sequence[tuple[str, str]], Option("--set"), assigned("OBJECT=VALUE")] = ()
    profile: Annotated[int | None, Option(choices={"402": 402, "401": 401, "none": 0})] = None
    travel: Annotated[tuple[float, float] | None, Option(metavar="LOW..HIGH", read=_travel)] = None
    values: Annotated[Path | None, Option(metavar="FILE")] = None
    serial: Annotated[int | None, Option(metavar="N", read=whole(0, 0xFFFFFFFF))] = None

    def kind(self, dictionary: Dictionary) -> type[Node]:
        """Return the class of a device that is not the robot's; raises LocalError for options that do not fit."""
        kind = simulated_kind(dictionary, self.profile)
        if self.travel and not issubclass(kind, SimulatedDrive):
            raise LocalError("--travel is for drives (CiA 402)")
        return kind

    def values_of(self, device: LoadedDevice, number: int = 0) -> Mapping[str, Any]:
        """Return the arguments of a device's class; `number` counts devices.

        Raises LocalError, FieldError, UnknownName.
        """
        dictionary, commissioning = device
        serial = None if self.serial is None else self.serial + number
        waves: Mapping[str, Waveform] = {}
        if self.values:
            waves = read_waveforms(read_whole(self.values).decode(errors="replace"), str(self.values))
        found: dict[str, Any] = {
            "given": dict(given(*each, dictionary.objects) for each in self.given),
            "waveforms": {address_of(find_one(name, dictionary.objects)): wave for name, wave in waves.items()},
        }
        if serial is not None and dictionary.variable(SERIAL):
            found["given"].setdefault(SERIAL, serial)
        if commissioning:
            found["lss"] = LssSlave.of(dictionary, commissioning, serial)
        return {**found, "travel": self.travel} if self.travel else found


@dataclass(frozen=True, kw_only=True)
class NodeBus(BusOptions):
    """The bus of a device: an adapter's, or one that it makes itself and that other programs join.

    interface: python-can interface, such as socketcan, pcan, slcan, remote
    channel: channel of the interface, such as can0
    bitrate: bit/s, 500000 if nothing else is configured
    share: without an adapter: make a bus that other commands of this machine join at this TCP port
    """

    share: Annotated[int | None, Option(metavar="PORT", read=whole(1, 65535))] = None

    def made(self) -> BusOptions:
        """Return the bus to open; with `share`, one that is made and printed here. Raises LocalError, BusError."""
        if self.share is None:
            return self
        if self.interface or self.channel:
            raise LocalError("--share makes a bus, and does not go with -i and -c, which name one")
        from eurobot_od.bus.live import share  # here, as it imports `can`

        channel = share(self.share)
        print(f"a bus of this machine; join it by -i remote -c {channel}", flush=True)
        return BusOptions(interface="virtual", channel=channel, bitrate=self.bitrate)


@dataclass(frozen=True, kw_only=True)
class OneNode:
    """Options of a single device.

    node_id: node-ID 1..127 (default: the file's)
    store: DCF in which the device stores its parameters
    verbose: print every message that the node receives
    fault: give the node a fault; `faults` lists them
    """

    node_id: Annotated[int | None, Option(metavar="N")] = None
    store: Annotated[str | None, Option(metavar="FILE", is_file=True)] = None
    verbose: Annotated[bool, Option("-v")] = False
    fault: Annotated[str | None, Option(metavar="NAME", suggest=lambda plugins: plugins.fault_names())] = None


def _stage(parser: Parser) -> Hint:
    robot = ahead(parser, Devices).robot  # the robot of a command line that is not read yet
    return Hint(robot.stage(), group=HelpGroup(f"nodes of {robot.name}")) if robot.stage else NOTHING


def node(
    name: Annotated[str | None, Option(metavar="node", suggest=lambda plugins: plugins.robot.nodes)] = None,
    *,
    one: OneNode,
    duration: Annotated[Seconds | None, Option("--for")] = None,
    device: DeviceOptions,
    stage: Annotated[Stage | None, Chosen(_stage)] = None,
    devices: Devices,
    node_bus: NodeBus,
    no_reconnect: NoReconnect = False,
    on_error: OnError = OnError.RESTART,
) -> ExitStatus | None:
    """Run one device on a CAN bus until interrupted: any device from its EDS, or a node of a robot.

    It ends when its time is over, by an interrupt, or by the bus's failure; raises BusError, WorldError.

    name: a node of the robot, or which of the files' devices (default: all of these, in one process)
    duration: end after this time, such as 10 s
    on_error: what happens to a node that fails, after it was stopped (default: restart)

    $ node --eds 5=motor.eds --share 54701
    $ node --eds 5=motor.eds --set Motor.Speed=1200 -i socketcan -c can0
    $ node --eds 255=motor.eds --serial 1234 -i socketcan -c can0
    """
    from eurobot_od.bus.live import Live  # here, as listing faults does not need it

    devices.check_named()
    if name is None and len(devices.files()) > 1:
        about_one = {**vars(one), "set": device.given, "values": device.values}
        made_all = _all(devices, device, [option.replace("_", "-") for option, value in about_one.items() if value])
        bus = node_bus.made()
        _run_all(made_all, bus, duration, bus.reopener(no_reconnect))
        return None
    loaded = _loaded(devices, name, one)
    robot = devices.robot
    made = _made(devices.plugins, loaded, device, stage, one)
    dictionary = loaded.dictionary
    bus = node_bus.made()
    is_staged = stage and robot.role_of(dictionary)
    scene = stage.set_up(made, NodeRun(robot, devices.dialect, bus.open, duration)) if stage and is_staged else None
    report = partial(print, flush=True)
    live = Live.node(bus.open(), made, opener=bus.reopener(no_reconnect), on_error=on_error, report=report)
    if one.verbose:
        live.controller.add_frames(lambda: made.device.identifiers, partial(_show, made), "print")
    return _run(live, made, scene, duration)


def _made(plugins: Plugins, loaded: LoadedDevice, options: DeviceOptions, stage: Stage | None, one: OneNode) -> Node:
    """Make the robot's node or the device of a dictionary; raises LocalError, FieldError, UnknownName."""
    dictionary = loaded.dictionary
    role = plugins.robot.role_of(dictionary)
    not_for_a_role = {"values": options.values, "set": options.given and not stage, "serial": options.serial}
    for option in (each for each, value in not_for_a_role.items() if role and value):
        raise LocalError(f"--{option} is for devices that do not belong to the robot, not for the {role}")
    if stage:
        stage.check(role)
    # The fault derives from the node's class.
    kind = _kind(plugins, options, dictionary)
    kind = plugins.faulty(kind, one.fault) if one.fault else kind
    store = FileStore(one.store, dictionary) if one.store else None
    of_role = stage.values(kind, dictionary, options.given) if stage and role else {}
    kept = {"store": store} if store else {}  # a user's file takes precedence over the role's values
    return kind(dictionary, **{**(of_role if role else options.values_of(loaded)), **kept})


def _kind(plugins: Plugins, options: DeviceOptions, device: Dictionary) -> type[Node]:
    """Return the class of a node: its plug-in's, or that of its profile; raises LocalError."""
    # An explicit profile takes precedence over a package's class.
    counting = plugins if options.profile is None else Plugins(plugins.robot)
    return counting.kind(device, otherwise=options.kind(device))


def _run(live: Live, made: Node, scene: Scene | None, duration: float | None) -> ExitStatus | None:
    """Run one device until its end; raises as `node`."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: stop the node, close the bus
    made.device.time_of_day.set(datetime.now(), live.clock())  # until a TIME message sets it
    with _bus_failure_first(live), live:
        print(
            one_line(f"{made.name} ({node_id_words(made.device.node_id)}) on {live.name}; Ctrl-C ends it"), flush=True
        )
        if moved := moved_server(made.device.dictionary):
            print(moved, flush=True)
        return _stay(live, scene, duration)


def _loaded(devices: Devices, name: str | None, one: OneNode) -> LoadedDevice:
    """Load the device with a name, or the only one; raises UnknownName, LocalError, DictionaryError."""
    files = devices.files()
    if not files:
        if name is None:
            known = ", ".join(devices.robot.nodes)
            one_of_these = f"Name one of {known}, or give" if known else "Give"
            raise LocalError(f"which node? {one_of_these} a device's file with --eds")
        if name.lower().endswith(DEVICE_FILES):
            raise LocalError(f"{name} is a device's file: write --eds 5={name}, with its node-ID")
        nodes = sorted(devices.robot.nodes)
        if name not in nodes and not meant(name, nodes) and devices.robot_name is None:
            raise LocalError(f"{UnknownName('node', name, nodes)}; --robot FOLDER takes another robot's")
        dictionary = devices.robot.dialects.load(name, devices.dialect, one.node_id)
        return LoadedDevice(dictionary)
    named = {each.name or Path(each.file).stem: each for each in files}
    file = files[0] if name is None else look_up("node", name, named)
    device = LoadedDevice.of(file if one.node_id is None else file._replace(node_id=one.node_id), one.store)
    complain_of_repairs([device.dictionary])
    return device.worded(devices)


def _stay(live: Live, scene: Scene | None, duration: float | None) -> ExitStatus | None:
    """Wait for the node's end, for up to `duration` s. Raises BusError, NodeFailed, NoAnswer, OSError."""
    end = inf if duration is None else live.clock() + duration
    status = None if scene is None else scene(live)
    if status is not None:
        return ExitStatus(status)
    while (failure := live.failure or live.controller.report_failure) is None and live.clock() < end:
        time.sleep(0.1)  # the node runs in its own threads; this only limits how soon its end is noticed
    if failure is None and live.station is not None:
        failure = live.station.last_failure  # the node was restarted after a failure
    if failure is not None:
        raise failure
    return None


@contextmanager
def _bus_failure_first(live: Live) -> Iterator[None]:
    """Replace errors by the failure of the bus that causes them, such as that of a robot that cannot be stopped."""
    try:
        yield
    except (RemoteError, OSError) as error:  # drivers raise OSError when they are closed after a failure
        raise live.failure or error from None


def _show(node: Node, frame: Frame, now: float) -> None:
    try:
        message = node.device.protocol.decode(*frame)
        binding = node.device.protocol.binding(type(message))
        what = f"{binding.name}  {describe(message, binding.kinds)}".rstrip()
    except RemoteError as error:
        what = str(error)
    print(one_line(f"{now:12.3f}  {frame!s:<20}  {what}"), flush=True)


# Several devices


def _all(devices: Devices, options: DeviceOptions, about_one: Iterable[str]) -> list[Node]:
    """Make the devices of all named files; raises DictionaryError, and LocalError for options of a single device."""
    files = devices.files()
    plugins = devices.plugins
    with_node_id = devices.load_and_complain([each for each in files if each.node_id != UNCONFIGURED])
    loaded = list(map(LoadedDevice.configured, with_node_id))
    loaded += [LoadedDevice.of(each) for each in files if each.node_id == UNCONFIGURED]
    loaded = [each.worded(devices) for each in loaded]
    names = ", ".join(each.name for each, *_ in loaded)
    for option in about_one:
        raise LocalError(f"--{option} is for one device: which node? Name one of {names}")
    for dictionary, *_ in loaded:
        if plugins.robot.role_of(dictionary):
            raise LocalError(f"{dictionary.name} is one of the robot's nodes, which run alone: name one of {names}")
    return [
        _kind(plugins, options, each.dictionary)(each.dictionary, **options.values_of(each, number))
        for number, each in enumerate(loaded)
    ]


def _run_all(nodes: Sequence[Node], bus: BusOptions, duration: float | None, opener: Opener | None) -> None:
    """Run several devices on one bus until the time is over, or an interrupt; raises BusError."""
    from eurobot_od.bus.live.live import LiveGroup  # here, as a single node does not need it
    from eurobot_od.device.station import NodeGroup

    for node in nodes:
        node.alarm = partial(_alarm, node)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    report = partial(print, flush=True)
    with LiveGroup(bus.open(), NodeGroup(nodes), opener=opener, report=report) as live:
        for node in nodes:
            node.device.time_of_day.set(datetime.now(), live.clock())
        names = ", ".join(f"{node.name} ({node_id_words(node.device.node_id)})" for node in nodes)
        print(one_line(f"{len(nodes)} devices on {live.name}: {names}; Ctrl-C ends them"), flush=True)
        for node in nodes:
            if moved := moved_server(node.device.dictionary):
                _alarm(node, moved)
        live.run(inf if duration is None else live.clock() + duration)


def _alarm(node: Node, what: str) -> None:
    print(one_line(f"{node.name}: {what}"), flush=True)


# Faults

OWNERS = {"Node": "any node", "SimulatedDrive": "any drive of CiA 402"}
"""Names of the workbench's own classes of nodes; a robot's have the names of their classes."""


def faults(
    node: Annotated[str | None, Option(suggest=lambda plugins: plugins.robot.nodes)] = None,
    *,
    as_json: Json = False,
    robot_name: RobotName = None,
) -> None:
    """List the faults that simulated nodes can be given, to see whether a check finds them.

    node: only the faults of this node of the robot
    as_json: print them as JSON, with the step that finds each

    $ faults
    $ faults --json
    """
    plugins = Devices(robot_name=robot_name).plugins
    if node and not plugins.robot.nodes:
        raise LocalError(f"{node}: only a robot's nodes are named; without a robot write `faults` alone")
    kind = look_up("node", node, plugins.robot.nodes)() if node else None
    # any node can have the faults of the base class
    chosen: dict[str, dict[str, Fault]] = {}
    for owner, rows in plugins.all_faults().items():
        if kind is None or issubclass(kind, owner):
            chosen.setdefault(OWNERS.get(owner.__name__, owner.__name__.lower()), {}).update(rows)
    give(as_json, faults_as_data(chosen), faults_as_text(chosen))


def faults_as_data(faults: Mapping[str, Mapping[str, Fault]]) -> list[dict[str, str]]:
    """Return faults by node as plain data."""
    return [
        {"name": name, "node": owner, "text": fault.text, **fault.caught_by._asdict()}
        for owner, rows in faults.items()
        for name, fault in rows.items()
    ]


def faults_as_text(faults: Mapping[str, Mapping[str, Fault]]) -> Iterator[str]:
    """Yield the lines of the faults, a paragraph per node."""
    width = max(len(name) for rows in faults.values() for name in rows)
    for number, (owner, rows) in enumerate(faults.items()):
        yield f"{owner}:" if number == 0 else f"\n{owner}:"
        yield from (f"  {name:{width}}  {fault.text}" for name, fault in rows.items())
