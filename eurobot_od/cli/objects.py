"""Commands for the objects of a CANopen node, its configuration and program, and its drive."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.devices import HEARTBEAT_WAIT, Target, left_out, object_names
from eurobot_od.cli.options import Clone, EmcyFiles, Json, Seconds, Wait, give, whole, write_dcf
from eurobot_od.cli.signature import DEVICE_FILES, Option
from eurobot_od.client import configure as configuring
from eurobot_od.client.description import read_identity
from eurobot_od.client.drive402 import Drive402, DriveStatus
from eurobot_od.client.lifeline import GOES_ON, OWN_ID, HeartbeatThread, arm, disarm, free_id
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.motion import AxisAddress
from eurobot_od.client.program import load
from eurobot_od.client.streams import clear_history, read_history
from eurobot_od.errors import LocalError, NoAnswer, NodeRefused, RemoteError, UnknownName
from eurobot_od.od import objects as od
from eurobot_od.od.cia402 import MODE_WORDS, State
from eurobot_od.od.dcf import renumbered
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity, misfit
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import BASE_IDENTIFIER, COB_ID, FIRST, MOST_SUBS, NOT_VALID, label, parse_number
from eurobot_od.od.words import words, written
from eurobot_od.pdo.in_force import made
from eurobot_od.sdo.wire import AbortCode
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.support.progress import OBJECTS, bar, passing
from eurobot_od.support.texts import amount, columns, one_line

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


Object: TypeAlias = Annotated[str, Option(metavar="INDEX[:SUB]", suggest=object_names)]


def read(target: Target, objects: Sequence[Object], *, as_json: Json = False, file: Path | None = None) -> ExitStatus:
    """Read objects of a CANopen node, by number or by the EDS's name, or one object into a file.

    Exit status 1 if the node refuses one.

    objects: such as 0x1017, 0x1018:1, Motion, 'Motion.Maximum speed'
    file: write the bytes of one object to this file, by block transfer

    $ read 5 Motor.Speed --eds motor.eds -i socketcan -c can0
    $ read 5 0x1018 0x1017 -i socketcan -c can0
    """
    _check_sub_index(objects)
    with target.opened() as node:
        found = target.description(node)
        known = found.objects if found else None
        things = [thing for text in objects for thing in od.find(text, known)]
        if file is not None:
            return _read_file(node, things, file)
        readings = list(configuring.read_all(node, things))
    print_readings(readings, as_json)
    return ExitStatus.FOUND if any(each.refusal for each in readings) else ExitStatus.FINE


def _check_sub_index(objects: Sequence[str]) -> None:
    """Check that no sub-index is a word of its own, as other programs take it; raises LocalError."""
    for index, word in pairwise(objects):
        number = parse_number(word)
        if number and number.value < FIRST and od.numbered(index):
            raise LocalError(f"{word} is not an index; write a sub-index after a colon: {index}:{word}")


def _read_file(node: RemoteNode, things: Sequence[ODVariable], file: Path) -> ExitStatus:
    """Write an object's bytes to a file. Raises NodeRefused, NoAnswer, LocalError for several objects, OSError."""
    if len(things) != 1:
        raise LocalError(f"--file takes one object, not {len(things)}")
    thing = things[0]
    with bar(od.label(thing)) as progress:
        content = node.upload_block(od.address_of(thing), thing.qualname, progress)
    write_whole(file, content)
    print(one_line(f"{file}: {amount(len(content), 'byte')} of node {node.node_id}, {od.label(thing)}"))
    return ExitStatus.FINE


def write(target: Target, name: Object, value: str | None = None, *, file: Path | None = None) -> None:
    """Write one object of a CANopen node, by number or by the EDS's name, or a whole file into it.

    A value that the EDS does not allow is refused here. It is a physical one where the object has a unit and factor;
    `raw:215` is the number itself. Without an EDS the node is asked for the object's length first.

    name: such as 0x1017, 0x1016:1, 'Motion.Maximum speed'
    value: number, decimal or 0x..; text; or hexadecimal digits: as the type says
    file: write the bytes of this file, by block transfer

    $ write 5 0x1017 500 -i socketcan -c can0
    $ write 5 "Motor.Target speed" 900 --eds motor.eds -i socketcan -c can0
    """
    _ = target.node_id  # first, as it may be what was left out
    if (value is None) is (file is None):
        name, _, given = name.partition("=")
        example = f", as in write {target.node} {name} {given or 500}"
        raise LocalError(f"what to write: give a value or --file FILE, one of them{example}")
    content = read_whole(file) if file else b""
    with target.opened() as node:
        found = target.description(node)
        thing = od.find_one(name, found.objects if found else None)
        if value is None:
            with bar(od.label(thing)) as progress:
                node.download(od.address_of(thing), content, thing.qualname, progress=progress)
            text = od.shown(thing, content)
        else:
            text = configuring.write_value(node, thing, od.parse(thing, value))
    print(one_line(f"node {node.node_id}: {od.label(thing)} = {text}"))


def dump(
    target: Target,
    *,
    output: Annotated[Path | None, Option("-o", metavar="FILE", either="form", is_output=True)] = None,
    as_json: Annotated[Json, Option(either="form")] = False,
) -> ExitStatus:
    """Print all readable objects of a CANopen node with their values, or write the node's DCF.

    An object that the node refuses is listed with the reason. The DCF is the EDS with the values that the parameters
    have now. What no line of it can hold, and every DOMAIN, is written to files beside it, which `configure` reads
    back. Exit status 1 if the node refuses parameters, which are left out.

    output: DCF to write

    $ dump 5 --eds motor.eds -i socketcan -c can0
    $ dump 5 --json --eds motor.eds -i socketcan -c can0
    $ dump 5 --eds motor.eds -o motor.dcf -i socketcan -c can0
    """
    with target.opened() as node:
        dictionary = target.needed_description(node)
        if output:
            return _write_dcf_of(node, dictionary, output, target.bus.bitrate or BITRATE)
        with passing(f"node {node.node_id}", configuring.readable(dictionary)) as things:
            readings = list(configuring.read_all(node, things))
    print_readings(readings, as_json)
    return ExitStatus.FINE


def _write_dcf_of(node: RemoteNode, dictionary: Dictionary, output: Path, bit_rate: int) -> ExitStatus:
    if output.suffix.lower() not in ("", ".dcf", ".eds"):
        raise LocalError(f"{output} would be a DCF: write {output.with_suffix('.dcf')}")
    if misfit(dictionary, read_identity(node)):  # in what has been reported with the file
        raise LocalError(f"{output} is not written: {dictionary.file} is not its file")
    with bar(f"node {node.node_id}", unit=OBJECTS, late=True) as draw:
        found = configuring.dcf_of_node(node, dictionary, bit_rate // 1000, output.stem, draw)
    write_dcf(output, found.dcf)
    complain_of_process_data(found.process_data)
    for thing, _, reason in found.left_out:
        complain(f"left out {od.label(thing)}: {reason}")
    return ExitStatus.FOUND if found.left_out else ExitStatus.FINE


def pdo(
    target: Target,
    action: Literal["map", "enable", "disable"] | None = None,
    name: Annotated[str | None, Option(metavar="PDO")] = None,
    objects: Annotated[Sequence[Object], Option(metavar="OBJECT")] = (),
    *,
    as_json: Json = False,
) -> None:
    """List the PDOs that a CANopen node has now: identifier, on or off, type and mapping; or change one.

    `map TPDO2 Motion.Speed ...` switches the PDO off, maps the objects in their order, switches it on if it was, and
    reads back (CiA 301, 7.5.2.36 and 7.5.2.38). Without an EDS objects have the names of CiA 301, 401 and 402, or none.

    action: map other objects into a PDO, or switch it on or off (default: list all PDOs)
    name: such as TPDO2
    objects: what to map, in its order: names or INDEX:SUB

    $ pdo 5 --eds motor.eds -i socketcan -c can0
    $ pdo 5 map TPDO1 Motor.Speed --eds motor.eds -i socketcan -c can0
    $ pdo 5 enable TPDO1 --eds motor.eds -i socketcan -c can0
    """
    if action and (not name or bool(objects) is not (action == "map")):
        form = "map TPDO1 OBJECT..." if action == "map" else f"{action} TPDO1"
        raise LocalError(f"{action} which PDO, and what? Write `{form}`; `pdo {target.node}` lists the PDOs")
    with target.opened() as node:
        dictionary = target.needed_description(node) if action else target.description(node)
        found = _pdos_without_file(node) if dictionary is None else _present_pdos(node, dictionary)
        if action and name and dictionary:
            known = {each.key: each for each in found}
            chosen = known.get(name.upper().replace(" ", ""))
            if chosen is None:
                raise UnknownName("PDO", name, known)
            mapped = [od.find_one(each, dictionary.objects) for each in objects]
            settings = {} if mapped else {COB_ID: _switched(node, chosen, on=action == "enable")}
            configuring.map_objects(node, dictionary, chosen, mapped or None, settings)
            found = [each for each in _present_pdos(node, dictionary) if each.index == chosen.index]
            if action == "map" and not chosen.valid:
                complain(f"{chosen.title} stays off; `pdo {node.node_id} enable {chosen.key}` switches it on")
    give(as_json, map(_pdo_as_data, found), columns(map(_pdo_row, found)))


def _switched(node: RemoteNode, pdo: Pdo, *, on: bool) -> int:
    """Return the COB-ID that switches a PDO on or off; raises LocalError if it has no identifier."""
    number = int.from_bytes(node.upload((pdo.index, COB_ID)), "little")
    if on and not number & BASE_IDENTIFIER:
        raise LocalError(f"{pdo.title} has no identifier; write 0x{pdo.index:04X}:1 with one")
    return number & ~NOT_VALID if on else number | NOT_VALID


def _present_pdos(node: RemoteNode, dictionary: Dictionary) -> list[Pdo]:
    """Return a node's current PDOs; reports those with an invalid mapping."""
    return _pdos([dictionary.configured(configuring.pdo_parameters(node, dictionary))])


def _pdos_without_file(node: RemoteNode) -> list[Pdo]:
    """Return the PDOs of a node without a file; raises LocalError if it has none."""
    with passing(f"node {node.node_id}", configuring.PDO_RECORDS) as records:
        found = made(node.node_id, configuring.all_pdo_parameters(node, records))
    if not found:
        raise LocalError(f"node {node.node_id} has no PDO, and no EDS has its identity: name one by --eds")
    return _pdos(found)


def _pdos(present: Iterable[Dictionary]) -> list[Pdo]:
    with left_out() as refused:
        return [pdo for each in present for pdo in each.read_pdos(each.default, refused)]


def _pdo_row(each: Pdo) -> tuple[str, ...]:
    """Return the row of one PDO."""
    mapped = ", ".join(f"{one.variable.qualname} {one.bits}" for one in each.mapping)
    state = "on" if each.valid else "off"
    timing = f"type {each.transmission_type}" + (f", every {each.event_timer} ms" if each.event_timer else "")
    return each.title, f"0x{each.cob_id:03X}", state, timing, mapped or "(nothing mapped)"


def _pdo_as_data(each: Pdo) -> dict[str, Any]:
    """Return one PDO as plain data."""
    mapping = [
        {"index": one.address[0], "subindex": one.address[1], "name": one.variable.qualname, "bits": one.bits}
        for one in each.mapping
    ]
    settings = {"type": each.transmission_type, "inhibit_time": each.inhibit_time, "event_timer": each.event_timer}
    return {"pdo": each.title, "cob_id": each.cob_id, "valid": each.valid, **settings, "mapping": mapping}


def emcy(target: Target, *, clear: bool = False, as_json: Json = False, emcy: EmcyFiles = ()) -> ExitStatus:
    """Print the errors that a CANopen node remembers, newest first, or clear them (0x1001, 0x1003).

    Exit status 1 if the node is in an error state now.

    clear: empty the error history

    $ emcy 5 -i socketcan -c can0
    $ emcy 5 --clear -i socketcan -c can0
    """
    with target.opened() as node:
        described = target.known_description(node)
        if clear:
            clear_history(node)
        found = read_history(node)
    words = target.devices.errors(emcy, described).of(node.node_id)
    history = ({**each._asdict(), "text": words(each.code)} for each in found.entries)
    data = {"register": found.register, "history": history}
    give(as_json, data, found.lines(node.node_id, words))
    return ExitStatus.FOUND if found.register else ExitStatus.FINE


# Printing


def print_readings(readings: Iterable[configuring.ObjectReading], as_json: bool) -> None:
    """Print objects with their values, or why there is none."""
    rows = (
        (label(od.address_of(thing)), thing.qualname, f"({refusal})" if refusal else written(thing, value))
        for thing, value, refusal in readings
    )
    give(as_json, map(_as_data, readings), columns(rows))


def _as_data(reading: configuring.ObjectReading) -> dict[str, Any]:
    """Return a reading as plain data; bytes are hexadecimal digits."""
    thing, value, refusal = reading
    type_name = od.data_type(thing).name if od.is_described(thing) else ""
    data = {"index": thing.index, "subindex": thing.subindex, "name": thing.qualname, "type": type_name}
    if refusal:
        return {**data, "refused": refusal}
    said = {"words": said} if (said := words(thing, value)) else {}
    return {**data, **od.as_data(thing, value), **said}


def configure(
    target: Target,
    file: Annotated[str, Option(metavar="FILE.dcf", is_file=True)],
    *,
    dry_run: bool = False,
    only: Sequence[configuring.DictionaryArea] = tuple(configuring.DictionaryArea),
    no_store: bool = False,
    no_reset: bool = False,
    clone: Clone,
) -> ExitStatus:
    """Configure a CANopen node from a DCF: write what differs, read it back, store it, reset the node, verify.

    The DCF may be that of another node of the same kind: what follows the node-ID moves along. Exit status 1 if the
    node differs from the file and --dry-run leaves it so.

    file: the DCF of this device, or of another node of its kind
    dry_run: print what differs and write nothing
    only: only these objects; repeatable
    no_store: do not have the node store it: it is lost at a reset
    no_reset: do not reset the node to verify what it has stored

    $ configure 5 motor.dcf --eds motor.eds -i socketcan -c can0
    $ configure 5 motor.dcf --dry-run -i socketcan -c can0
    $ configure 6 motor.dcf --move-cob-ids -i socketcan -c can0
    """
    # not the network's file, as the DCF is for one device
    dictionary = renumbered(Dictionary.load(file, target.node_id), target.node_id, clone.chosen)
    with left_out() as refused:  # the file is checked before a bus is opened
        configuring.check_file(dictionary, target.node_id, by_default=refused)
    complain_of_process_data([each for each in configuring.process_data(dictionary) if od.value_text(each)])
    with target.opened() as node:
        node.master.follow(dictionary)
        plan = configuring.difference(node, dictionary, only)
        print(
            plan.heading, *columns((od.label(each.thing), " -> ".join(each.texts)) for each in plan.changes), sep="\n"
        )
        if plan.cannot_be_marked:
            complain("0x1020 is read only in the file: the node is not told when it was configured")
        if dry_run or not plan.changes:
            return ExitStatus.FOUND if plan.changes else ExitStatus.FINE
        node.state(HEARTBEAT_WAIT)  # before the reset, as `apply` restores the last state
        outcome = configuring.apply(node, plan, datetime.now(), stores=not no_store, resets=not no_reset)
    print(outcome.text(node.node_id, was_to_store=not no_store))
    return ExitStatus.FINE


def complain_of_process_data(things: Sequence[ODVariable]) -> None:
    """Report the objects that are left out of a configuration because they are process data."""
    if things:
        named = (f"0x{each.index:04X} {each.qualname.removesuffix(f'.{each.name}')}" for each in things)
        complain(f"left out as process data: {', '.join(dict.fromkeys(named))}")


def store(target: Target) -> None:
    """Store a CANopen node's parameters, so that they survive a reset (0x1010).

    $ store 2 -i socketcan -c can0
    """
    with target.opened() as node:
        target.known_description(node)  # its file may have other SDO COB-IDs
        try:
            configuring.store(node)
        except NodeRefused as refused:
            if refused.code != AbortCode.NO_OBJECT:
                raise
            raise RemoteError(f"node {node.node_id} cannot store parameters: it has no 0x1010") from None
    print(f"node {node.node_id} has stored all parameters")


def restore(target: Target, *, reset: bool = False) -> None:
    """Restore the defaults of a CANopen node's parameters, from its next reset on (0x1011).

    reset: reset the node, so that they take effect

    $ restore 2 -i socketcan -c can0
    $ restore 2 --reset -i socketcan -c can0
    """
    with target.opened() as node:
        described = target.known_description(node)
        restored = described.restored_node_id if described else None
        if restored is not None:
            complain(f"the node-ID of node {node.node_id} is a setting, too: from its next reset on it is {restored}")
        if reset:
            configuring.restore_and_reset(node, restored)
        else:
            configuring.restore(node)
    when = "has" if reset else "will have, from its next reset on,"
    print(f"node {node.node_id} {when} the defaults of all parameters")


def program(
    target: Target,
    file: Annotated[Path, Option(metavar="FILE")],
    *,
    number: Annotated[int, Option("--program", metavar="N", read=whole(1, MOST_SUBS))] = 1,
    no_crc: bool = False,
    force: bool = False,
) -> None:
    """Download a program into a CANopen node, verify and start it (0x1F50, 0x1F51, 0x1F56, 0x1F57).

    Nothing is stopped before the node was looked at: whether it has a place for the program, and is the device of
    --eds. If a step fails, one line says why, in which state the node is, and how to go on.

    file: the program, as the node's maker delivers it
    number: number of the program in the node, its sub-index (1)
    no_crc: do not compare 0x1F56 with the file: in this device it is not a CRC
    force: also a file that is a device's, or no program by the device's package

    $ program 5 firmware.bin -i socketcan -c can0
    """
    _ = target.node_id  # first, as node and file may be in the wrong order
    content = read_whole(file)
    if not content:
        raise LocalError(f"{file}: the file is empty")
    if not force and file.name.lower().endswith(DEVICE_FILES):
        raise LocalError(f"{file} is a device's file, no program; --force downloads it all the same")
    with target.opened() as node, bar(f"node {node.node_id}: {file.name}") as progress:
        described = target.known_description(node)
        identity = Identity.of(described) if described else read_identity(node)
        procedure = target.devices.plugins.procedure(identity, content, force)
        loaded = load(node, content, number, not no_crc, progress, described, procedure)
    print(f"node {node.node_id}: program {number}: {loaded.text}")


# A drive of CiA 402

LOOK, CHECK = 0.5, 0.1
"""Time between two lines of `jog`, and between two looks at whether the drive still obeys, in s."""

HEARD_FOR = 0.2
"""Time to listen for another node with our node-ID, in s."""


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """How a drive moves, in raw numbers; None keeps its setting.

    velocity: move: profile velocity (default: as it is set)
    relative: move: by a distance instead of to a position
    method: home: homing method (default: as it is set)
    within: longest wait for a motion (60 s)
    span: jog: halt after this time
    """

    velocity: Annotated[int | None, Option(metavar="V")] = None
    relative: bool = False
    method: Annotated[int | None, Option(metavar="N")] = None
    within: Wait = 60.0
    span: Annotated[Seconds | None, Option("--for")] = None

    def check(self, action: str) -> None:
        """Check that no option belongs to another action; raises LocalError."""
        for name, owner in {"velocity": "move", "relative": "move", "method": "home", "span": "jog"}.items():
            given = getattr(self, name)
            # A velocity or method of 0 is given; None, or a switch that is off, is not.
            if given is not None and given is not False and action != owner:
                raise LocalError(f"--{'for' if name == 'span' else name} is for `drive {owner}`")


def _jog(drive: Drive402, velocity: int, asked: MotionOptions) -> None:
    """Turn until Ctrl-C or the end of the time, and halt; print the drive's status meanwhile.

    Raises DriveError when the drive does not turn as it was told to any more.
    """
    end, shown = inf if asked.span is None else time.monotonic() + asked.span, -inf
    try:
        drive.velocity = velocity
        while (now := time.monotonic()) < end:
            drive.check_turning(velocity)
            if now >= shown + LOOK:
                print(one_line(drive_as_text(drive.status)), flush=True)
                shown = now
            time.sleep(max(0.0, min(CHECK, end - time.monotonic())))
    finally:
        drive.halt()
    if (state := drive.state) is not State.ENABLED:
        said = state.words if state else "no state"
        complain(f"the halt has left the drive in {said}: it did not stand within 0.5 s, so that a quick stop followed")


def _move(drive: Drive402, position: int, asked: MotionOptions) -> None:
    drive.move_to(position, asked.velocity, relative=asked.relative, within=asked.within)


ACTIONS: Mapping[str, Callable[[Drive402, int, MotionOptions], object]] = {
    "status": lambda *_: None,
    "enable": lambda drive, *_: drive.enable(),
    "disable": lambda drive, *_: drive.disable(),
    "home": lambda drive, _, asked: drive.home(asked.method, asked.within),
    "move": _move,
    "jog": _jog,
    "stop": lambda drive, *_: drive.quick_stop(),
    "reset": lambda drive, *_: drive.fault_reset(),
}
"""Functions of the actions."""

WATCHED = ("home", "move", "jog")
"""Actions during which the drive monitors this program's heartbeat."""

MOVING = {"move": "a position", "jog": "a velocity"}
"""Actions that need a value, and what it is."""


def drive(
    target: Target,
    action: Annotated[str, Option(choices=ACTIONS.keys())],
    value: int | None = None,
    *,
    motion: MotionOptions,
    axis: Annotated[int, Option(metavar="N", read=whole(1, 8, what="an axis"))] = 1,
    own_id: Annotated[int, Option(metavar="N", read=whole(1, 127, what="a node-ID"))] = OWN_ID,
    as_json: Json = False,
) -> None:
    """Enable, home and move a drive of CiA 402 over SDO, and print how it is then.

    `home`, `move` and `jog` enable a drive that is not, and leave it enabled. `stop` is a quick stop: by 0x605A the
    drive is then disabled, as by default, or stays in Quick stop active, with torque.

    Every motion ends with a halt that is repeated until the drive stands, also at Ctrl-C and SIGTERM. While it moves it
    watches this program's heartbeat (0x1016, 0x6007), and makes a quick stop when that is lost; one that cannot is
    warned of. Enabling begins at rest.

    Raises DriveError, NodeRefused, NoAnswer, BusError.

    action: what the drive is to do; Ctrl-C stops a motion
    value: move: the position; jog: the velocity; raw numbers, as the drive's objects hold them, whatever unit `read`
        prints and `write` takes
    axis: axis (1)
    own_id: node-ID of our heartbeat (127, or the next lower one that is not heard)

    $ drive 5 status -i socketcan -c can1
    $ drive 5 move 4000 --velocity 500 -i socketcan -c can1
    """
    if (value is None) is (action in MOVING):
        raise LocalError(f"drive {action} needs {MOVING[action]}" if action in MOVING else f"{action} takes no value")
    motion.check(action)
    with target.opened() as node:
        described = target.known_description(node)
        found = Drive402(node, described, axis)
        # What takes the torque away is not delayed by a question.
        before = None if action in ("stop", "disable") else Drive402(node, described, axis).status
        with _watched(found, node, axis, own_id) if action in WATCHED else nullcontext():
            ACTIONS[action](found, value or 0, motion)
        status = found.status
    if before and action in WATCHED and before.state is not State.ENABLED and status.state is State.ENABLED:
        stays = f"it stays so; `drive {node.node_id} disable` ends that"
        complain(f"node {node.node_id} was not enabled: `{action}` has enabled it, and {stays}")
    line = one_line(f"node {node.node_id}: {drive_as_text(status)}")
    give(as_json, drive_as_data(status), [line], indent=None)


@contextmanager
def _watched(drive: Drive402, node: RemoteNode, axis: int, wanted: int) -> Iterator[None]:
    """Make a drive monitor our heartbeat while it moves; signals that end programs act like Ctrl-C."""
    for name in ("SIGTERM", "SIGHUP"):  # a closed terminal sends SIGHUP
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    master = node.master
    master.pump(HEARD_FOR)
    own = free_id(master.states, wanted)
    # The timeout allows for repeated requests, as only a program that hangs is dead.
    with HeartbeatThread(master, own, 1.0 + 2 * master.answer_wait) as beats:
        drive.kick = beats.kick
        line = arm(node, [AxisAddress(node.node_id, axis).offset], own)
        if line.lacks:
            complain(f"node {node.node_id}: {GOES_ON}: {line.lacks}")
        if line.left:
            complain(f"node {node.node_id}: {line.left}")
        try:
            yield
        except BaseException:
            # If the drive is not known to stand, this raises; the drive still monitors us, and stops when we end.
            drive.halt()
            with suppress(NoAnswer):  # the earlier error is the one to report
                disarm(node, line)
            raise
        disarm(node, line)


def drive_as_data(status: DriveStatus) -> dict[str, Any]:
    """Return a drive's status as plain data."""
    state = status.state.words if status.state else None
    return {**status._asdict(), "state": state, "mode": MODE_WORDS.get(status.mode, f"mode {status.mode}")}


def drive_as_text(status: DriveStatus) -> str:
    """Return a drive's status as one line."""
    data = drive_as_data(status)
    fault = f", error code 0x{status.error_code:04X}" if status.error_code else ""
    place = f"position {status.position}, velocity {status.velocity}"
    limit = f", {status.limit}" if status.limit else ""
    word = f"statusword 0x{status.statusword:04X}"
    return f"{data['state'] or 'no state'}{fault}, {data['mode']}, {place}{limit} ({word})"
