"""Commands for the nodes of a CANopen bus: `scan`, `boot`, `nmt`, `watch`, `sync`, `time` and `lss`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.devices import (
    HEARTBEAT_WAIT,
    Access,
    Devices,
    LibraryFolders,
    PackagePaths,
    Target,
    hexadecimal_node_id,
)
from eurobot_od.cli.options import (
    LONG_PERIOD,
    BusOptions,
    Json,
    NoReconnect,
    Seconds,
    Wait,
    give,
    span_below,
)
from eurobot_od.cli.signature import Option
from eurobot_od.client import lss as services
from eurobot_od.client.description import Found, addressed, check_free
from eurobot_od.client.description import scan as scan_nodes
from eurobot_od.client.lss import LssSteps, perform
from eurobot_od.client.master import Master, produce, syncs, times
from eurobot_od.client.watch import NodeChange, NodeEvent, NodeWatch, watch_nodes, without_heartbeat
from eurobot_od.device.nmt import COMMAND_NAMES, STATE_NAMES, NmtCommand, NmtState
from eurobot_od.device.nmt import TARGET as TARGET_STATES
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.library.library import Library
from eurobot_od.loading import packages
from eurobot_od.od import DEFAULT, network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity, absence
from eurobot_od.od.standard import LssState
from eurobot_od.od.values import (
    ALL_NODES,
    BASE_IDENTIFIER,
    NMT_COB_ID,
    RESTRICTED,
    SYNC_COB_ID,
    TIME_COB_ID,
    check_node_id,
    owner,
    parse_number,
)
from eurobot_od.plugin import Plugins
from eurobot_od.support.progress import Unit, bar
from eurobot_od.support.texts import columns, one_line


def scan(access: Access, *, listen: Wait = 1.5, as_json: Json = False) -> ExitStatus:
    """List the CANopen nodes of a bus: which answer, in which state, what they are.

    With a library also which of its files fits each of them. With --network or --eds also what they are called there,
    and which of them are missing. Exit status 1 if one is missing, or if there is no node at all.

    listen: listen for heartbeats for this time (1.5 s)

    $ scan -i socketcan -c can0
    $ scan --json -i socketcan -c can0
    """
    devices = access.devices
    known = devices.load_and_complain() if devices.are_listed and devices.files() else ()
    with access.master() as master:
        for each in known:
            master.follow(each)  # some devices answer at other COB-IDs
        found = scan_nodes(master, listen=listen)
    names = {node_id: name for name, node_id in devices.names().items()} if devices.are_listed else {}
    if absent := absence(names, (each.node_id for each in found)):
        complain(absent)
    files = {each.node_id: ScannedFile(each.file) for each in known} | _library_files(devices, known, found)
    missing = [node_id for node_id in names if node_id not in {each.node_id for each in found}]
    rows = [each.as_data() for each in (*found, *(Found(each, None, None, "") for each in missing))]
    for row in rows:
        if names:  # null for a node that is not in the network
            row.update(network_name=names.get(row["node_id"]), missing=row["node_id"] in missing)
        if files:
            row.update(files.get(row["node_id"], NO_FILE).as_data())
    lines = list(columns(found_rows(found, names, files))) if found else ["no node answers"]
    lines += [one_line(f"node {node_id}: {each.further}") for node_id, each in files.items() if each.further]
    if missing:
        lines.append(one_line(f"missing: {', '.join(f'{names[each]} ({each})' for each in missing)}"))
    give(as_json, rows, lines)
    return ExitStatus.FINE if found and not missing else ExitStatus.FOUND


class ScannedFile(NamedTuple):
    """The file of a node that was found, `others` for its product, and remarks about them."""

    file: Path | None
    others: Sequence[Path] = ()
    further: str = ""

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"file": self.file and str(self.file), "other_files": list(map(str, self.others))}


NO_FILE = ScannedFile(None)


def _library_files(devices: Devices, known: Iterable[Dictionary], found: Iterable[Found]) -> dict[int, ScannedFile]:
    """Return the library's files for the nodes that were found, and report devices that do not fit their file."""
    named = {each.node_id: each for each in known}
    describe = devices.describer(known)
    fitting: dict[int, ScannedFile] = {}
    for each in found:
        if each.identity is None:
            continue
        describe.check(each.node_id, each.identity, named.get(each.node_id), each.device_type)
        fit = None if each.node_id in named else devices.known_library.find(each.identity, each.device_type)
        if fit is not None:
            fitting[each.node_id] = ScannedFile(fit.entry.path, [other.path for other in fit.others], fit.further)
    return fitting


def found_rows(
    found: Sequence[Found],
    names: Mapping[int, str] = MappingProxyType({}),
    files: Mapping[int, ScannedFile] = MappingProxyType({}),
) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table of nodes, with columns for their `names` in a network and their `files`."""
    title = "node", *["in network"] * bool(names), "name", "state", "vendor", "product", "revision", "serial"
    yield *title, *["file"] * bool(files)
    for each in found:
        state = "-" if each.state is None else STATE_NAMES[each.state]
        numbers = (f"0x{number:08X}" for number in each.identity) if each.identity else ("-",) * 4
        there = [names.get(each.node_id, "-")] * bool(names)
        file = files.get(each.node_id, NO_FILE).file
        shown = [file.name if file else "-"] * bool(files)
        yield f"{each.node_id:>4}", *there, each.name or "-", state, *numbers, *shown


# Boot


def boot(path: Annotated[str, Option(metavar="NETWORK", is_file=True)] = "", *, access: Access) -> ExitStatus:
    """Start a network as CiA 302-2 says: each slave reset, checked, configured and heard, then all started.

    The slaves are those of the network file, in its order; a DCF is loaded, unless 0x1020 says that the slave has it.
    Exit status 1 if a slave does not boot: then none is started.

    path: network file, or a folder of EDS and DCF files (or --network; default: eurobot-od.yaml in this folder)

    $ boot network.yaml -i socketcan -c can0
    """
    from eurobot_od.client.boot import hear_slave, order_start, prepare_slave, started_state  # with canopen

    path = path or access.devices.network_file
    if not path:
        raise LocalError(f"which network? Name its file, `boot network.yaml`, or have a {DEFAULT} here")
    named = network.read_network(path)
    devices = replace(access.devices, network=path).found_on(access.bus)
    if lacking := devices.unnamed():
        said = lacking.partition(":")[0]
        complain(f"{said}; it does not answer, or the library has none for its identity: no node is started")
        return ExitStatus.FOUND
    loaded = {each.node_id: each for each in devices.load_and_complain()}
    # `load` sorts by node-ID; the standard starts slaves in the network's own order
    order = [(each.load() if each.file else each).node_id or 0 for each in named.nodes]
    slaves = [loaded[each] for each in order if loaded[each].name != named.master]
    with access.master() as master:
        nodes = [master.node(each.node_id) for each in slaves]
        prepared = [prepare_slave(node, each, datetime.now()) for node, each in zip(nodes, slaves)]
        booted = []
        for slave in map(hear_slave, nodes, prepared):
            words = "; ".join([*slave.done, *([str(slave.failed)] if slave.failed else [])])
            print(one_line(f"node {slave.node_id} {slave.name}: {words}"), flush=True)
            booted.append(slave)
        missing = [each.name for each in booted if each.failed]
        if missing:
            print(one_line(f"not started: {', '.join(missing)} did not boot"))
            return ExitStatus.FOUND
        started = [*map(order_start, nodes, booted, slaves)]
        states = {each.name: one and started_state(node, one) for node, each, one in zip(nodes, slaves, started)}
    for name, state in states.items():
        print(one_line(f"{name}: {'started; it says no state' if state is None else STATE_NAMES[state]}"))
    is_fine = all(state in (None, NmtState.OPERATIONAL) for state in states.values())
    return ExitStatus.FINE if is_fine else ExitStatus.FOUND


# NMT

NMT_COMMANDS = {name.replace(" ", "-"): NmtCommand(command) for command, name in COMMAND_NAMES.items()}
"""The NMT commands by their names on the command line."""

NAMES_OF_NMT = {command: name for name, command in NMT_COMMANDS.items()}


def nmt(target: Target, command: Annotated[NmtCommand, Option(choices=NMT_COMMANDS)]) -> ExitStatus:
    """Send an NMT command to a CANopen node, or to all, and print the state that the heartbeat reports.

    An NMT command has no answer: the heartbeat or the boot-up message shows what the node did. Exit status 1 if the
    heartbeat shows that the node did not follow.

    command: the command; NODE may be `all`

    $ nmt 5 start -i socketcan -c can0
    $ nmt all pre-operational -i socketcan -c can0
    """
    if target.node == "0":
        raise LocalError(f"node 0 stands for all nodes: write `nmt all {NAMES_OF_NMT[command]}`")
    if target.node == "all":
        with target.master() as master:
            master.send(NMT_COB_ID, bytes([command, ALL_NODES]))
        print(f"{COMMAND_NAMES[command]} sent to all nodes")
        return ExitStatus.FINE
    with target.opened() as node:
        if command not in TARGET_STATES:  # a reset, which the boot-up message confirms (CiA 301, 7.3.2.2.3)
            node.reset(command)
            state = node.state(HEARTBEAT_WAIT)  # None without a heartbeat; a reset restores the default heartbeat time
            print(
                f"node {node.node_id} {NodeChange.BOOTED.value}"
                + ("" if state is None else f" and is {STATE_NAMES[state]}")
            )
            return ExitStatus.FINE
        node.command(command)
        followed = node.wait_for(TARGET_STATES[command], HEARTBEAT_WAIT)
        state = node.last_state
    if state is None:  # with 0x1017 = 0 a node sends no heartbeat, and may have followed
        print(f"sent; node {node.node_id} has no heartbeat that would show its state")
        return ExitStatus.FINE
    print(f"node {node.node_id} is {STATE_NAMES[state]}")
    return ExitStatus.FINE if followed else ExitStatus.FOUND


# Watching


def watch(
    nodes: Annotated[Sequence[str], Option(metavar="NODE", suggest=lambda plugins: plugins.robot.nodes)] = (),
    *,
    within: Wait = 2.0,
    guard: Wait | None = None,
    span: Annotated[Seconds, Option("--for")] = inf,
    as_json: Json = False,
    no_reconnect: NoReconnect = False,
    devices: Devices,
    bus: BusOptions,
) -> ExitStatus:
    """Watch CANopen nodes by heartbeat or node guarding: a line when one boots, is lost or comes back.

    Without nodes all of --network or --eds have to be there; without these, too, every node that is heard is watched.
    Exit status 1 if a node is lost at the end.

    nodes: nodes that must be there: node-IDs, or devices' names
    within: time in which they must be heard (2 s)
    guard: poll them by remote frames with this period
    span: how long to watch (default: until Ctrl-C)
    as_json: print one JSON object per line

    $ watch --for 2s -i socketcan -c can0
    $ watch 5 --within 2s --for 2s -i socketcan -c can0
    """
    # The devices' files are read only if they, or a node by name, are given.
    is_named = devices.are_listed or not all(each.isdecimal() for each in nodes)
    named = devices.names() if is_named else {}
    titles = {node_id: name for name, node_id in named.items()}
    expected = [_node_id(each, named) for each in nodes] or ([*titles] if devices.are_listed else [])
    if guard is not None and not (expected and guard):
        raise LocalError("--guard polls the nodes that are named: name them, and a time longer than 0")
    with Master(bus.open()) as master:
        started = master.clock()
        write = event_as_json if as_json else event_as_line

        def show(event: NodeEvent) -> None:
            print(one_line(write(event._replace(time=event.time - started), titles.get(event.node_id, ""))), flush=True)

        watched = NodeWatch(
            show,
            expected=expected,
            patience=within,
            # A node with a heartbeat does not answer remote frames.
            guarded=dict.fromkeys(without_heartbeat(master, expected), guard) if guard else {},
        )
        with suppress(KeyboardInterrupt):  # the usual way to end it
            watch_nodes(master, watched, started + span, bus.guard(master, no_reconnect))
            watched.end(master.clock())
    return ExitStatus.FOUND if any(node.lost for node in watched.nodes.values()) else ExitStatus.FINE


def _node_id(text: str, named: Mapping[str, int]) -> int:
    """Return the node-ID for a name or number; raises LocalError, UnknownName."""
    if text in named:
        return named[text]
    if (number := hexadecimal_node_id(text)) is not None:
        return check_node_id(number)
    if not text.isdecimal() or len(text) > MOST_DIGITS:
        raise UnknownName("node", text, named)
    return check_node_id(int(text))


MOST_DIGITS = 9
"""Maximum number of digits of a node-ID; `int` has its own error for thousands of digits."""


def event_as_line(event: NodeEvent, name: str = "") -> str:
    """Return an event of a node as a line."""
    state = "" if event.state in (None, 0) else f" ({STATE_NAMES[event.state]})"
    return f"{event.time:9.3f}  {f'node {event.node_id} {name}'.rstrip()} {event.change.value}{state}"


def event_as_json(event: NodeEvent, name: str = "") -> str:
    """Return an event of a node as a JSON object, with its name if it has one."""
    state = None if event.state is None else STATE_NAMES[event.state]
    named = {"name": name} if name else {}
    return json.dumps(event._asdict() | {"change": event.change.name.lower(), "state": state} | named)


# Periodic messages of a master


def _period(text: str) -> float:
    """Parse the period of messages, in s; raises LocalError."""
    seconds = span_below(LONG_PERIOD)(text)
    if not seconds:  # it would fill the bus
        raise LocalError("the period must be longer than 0")
    return seconds


def _identifier(text: str) -> int:
    """Parse an 11-bit COB-ID; raises LocalError, also for `80`, which would be 0x050 where an index is hexadecimal."""
    if text.isdecimal():
        raise LocalError(f"{text} is decimal or hexadecimal; write 0x{text}")
    number = parse_number(text)
    if number is None or number.relative or not 0 <= number.value <= BASE_IDENTIFIER:
        raise LocalError(f"{text!r} is not an 11-bit identifier")
    if taken := owner(number.value, RESTRICTED):
        raise LocalError(f"{text} is restricted to {taken.whose(number.value)} (CiA 301, 7.3.5)")
    return number.value


Period: TypeAlias = Annotated[float, Option(metavar="TIME", read=_period)]
Count: TypeAlias = Annotated[int | None, Option(metavar="N"), "end after N messages"]
Identifier: TypeAlias = Annotated[int, Option(metavar="ID", read=_identifier)]


def sync(
    *,
    counter: Annotated[int | None, Option(metavar="N")] = None,
    period: Period = 0.1,
    count: Count = None,
    cob_id: Identifier = SYNC_COB_ID,
    no_reconnect: NoReconnect = False,
    bus: BusOptions,
) -> None:
    """Send SYNC messages at a fixed period, until Ctrl-C or --count.

    counter: number the messages from 1 to N (2..240), over and over
    period: time between two messages (100 ms)
    cob_id: identifier (0x080)

    $ sync --period 10ms --count 5 -i socketcan -c can0
    """
    frames = syncs(counter, cob_id)
    with Master(bus.open()) as master:
        produce(master, islice(frames, count), period, bus.guard(master, no_reconnect))


def time(
    *,
    utc: bool = False,
    period: Period = 1.0,
    count: Count = 1,
    cob_id: Identifier = TIME_COB_ID,
    no_reconnect: NoReconnect = False,
    bus: BusOptions,
) -> None:
    """Send the time of this computer as CANopen's TIME message, once or periodically.

    utc: UTC instead of local time
    period: time between two messages (1 s)
    cob_id: identifier (0x100)

    $ time -i socketcan -c can0
    """
    zone = UTC if utc else None
    # TIME_OF_DAY counts days from 1984, without a time zone (CiA 301, 7.1.6.6).
    frames = times(lambda: datetime.now(zone).replace(tzinfo=None), cob_id)
    with Master(bus.open()) as master:
        produce(master, islice(frames, count), period, bus.guard(master, no_reconnect))


REQUESTS = Unit("requests", "requests/s")

NUMBERS = 4
"""Number of parts of an identity: vendor-ID, product code, revision and serial number."""


def _identity(text: str) -> Identity:
    """Parse an identity; raises LocalError."""
    numbers = [parse_number(part) for part in text.split(":")]
    values = [each.value for each in numbers if each and not each.relative and 0 <= each.value < 1 << 32]
    if not len(values) == len(numbers) == NUMBERS:
        raise LocalError(f"{text!r} is not vendor:product:revision:serial, four numbers of 32 bits")
    return Identity(*values)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The new settings of a device; None leaves a setting unchanged.

    node_id: set: 1..127, or 255 for none
    bit_rate: set: 1000, 800, 500, 250, 125, 50, 20 or 10
    store: set: have the device store its new settings
    activate: set: delay before the bit rate changes
    """

    node_id: Annotated[int | None, Option(metavar="N")] = None
    bit_rate: Annotated[int | None, Option(metavar="KBIT/S")] = None
    store: bool = False
    activate: Wait | None = None


def lss(
    action: Literal["find", "set"],
    *,
    identity: Annotated[
        Identity | None, Option(metavar="VENDOR:PRODUCT:REVISION:SERIAL", read=_identity, either="device")
    ] = None,
    alone: Annotated[bool, Option(either="device")] = False,
    settings: Settings,
    timeout: Wait = 0.1,
    library: LibraryFolders = (),
    package: PackagePaths = (),
    bus: BusOptions,
) -> ExitStatus:
    """Find CANopen devices that have no node-ID yet by LSS, and set node-ID and bit rate (CiA 305).

    `find` lists the devices without a node-ID, each with the file of the library that fits it, or prints the node-ID of
    the one with --identity. `set` is for that one, for the only device on the bus (--alone), or else for the first
    without a node-ID. Exit status 1 if there is no such device.

    action: find: list the devices without a node-ID and the library's file for each, or print the node-ID of the one
        of --identity or --alone; set: its node-ID, bit rate, and to store them
    identity: the device with this identity (0x1018); set: by its maker's procedure if a device package has one
    alone: the device is the only one on the bus
    timeout: longest wait for an answer (100 ms)

    $ lss find -i socketcan -c can0
    $ lss find --alone -i socketcan -c can0
    $ lss set --node-id 6 --store -i socketcan -c can0
    $ lss set --bit-rate 250 --store --activate 2s --alone -i socketcan -c can0
    """
    known = Devices(library=library).known_library
    wanted = services.settings(**vars(settings))  # checked before the first frame is sent
    if bool(wanted) is (action == "find"):
        options = "--node-id, --bit-rate, --store and --activate"
        raise LocalError(f"{options} are for `lss set`" if wanted else f"nothing to set: {options} say what")
    if address := action == "set" and identity and Plugins(packages=packages(package)).for_identity(identity).address:
        with Master(bus.open()) as master:
            print(addressed(master, address, identity, **vars(settings)))
        return ExitStatus.FINE
    steps = _find(identity, alone, known) if action == "find" else _set(identity, alone, wanted)
    with Master(bus.open(), timeout) as master:
        if not alone:  # it is the only one, so nobody else has a node-ID
            check_free(master, settings.node_id, identity)
        try:
            with bar(f"lss {action}", unit=REQUESTS, late=True) as progress:
                lines = perform(master, steps, timeout, progress)
        finally:
            # A device left in the configuration state would execute commands for other devices.
            perform(master, services.switch(LssState.WAITING))
    print("\n".join(lines) or "no device without a node-ID answers")
    return ExitStatus.FINE if lines else ExitStatus.FOUND


def _find(identity: Identity | None, alone: bool, library: Library) -> LssSteps[list[str]]:
    if not (identity or alone):
        found = yield from services.find_all()
        files = {each: fit.entry.path.name for each in found if (fit := library.find(each))}
        return [one_line(f"{each}  no node-ID  {files.get(each, '')}").rstrip() for each in found]
    return [(yield from services.inquire(identity, alone))]


def _set(identity: Identity | None, alone: bool, wanted: Sequence[services.LssChange]) -> LssSteps[list[str]]:
    return [(yield from services.set_up(identity, alone, wanted))]
