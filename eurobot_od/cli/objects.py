"""Commands on the objects of a CANopen node: `read`, `write`, `dump`, `export-dcf` and `emcy`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli import output as files
from eurobot_od.cli.options import left_out
from eurobot_od.cli.remote import TARGET, Target, print_readings
from eurobot_od.cli.table import JSON, CommandRow, option, with_emcy
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.objects import address_of, encode, find, find_one, is_described, label, parse, shown
from eurobot_od.od.profiles.words import written
from eurobot_od.support.files import write_whole
from eurobot_od.support.progress import bar, passing
from eurobot_od.support.texts import amount, columns, one_line

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

    from eurobot_od.client.emergencies import History
    from eurobot_od.client.master import RemoteNode
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.pdos import Pdo


def read(target: Target, objects: Sequence[str], as_json: bool, file: Path | None) -> ExitStatus:
    """Read objects of a CANopen node, by number or by the EDS's name, or one object into a file.

    Exit status 1 if the node refuses one.
    """
    from eurobot_od.client.reading import read_all

    with target.opened() as node:
        found = target.description(node)
        known = found.dictionary.objects if found else None
        things = [thing for text in objects for thing in find(text, known)]
        if file is not None:
            return _read_file(node, things, file)
        readings = list(read_all(node, things))
    print_readings(readings, as_json)
    return ExitStatus.FOUND if any(each.refusal for each in readings) else ExitStatus.FINE


def _read_file(node: RemoteNode, things: Sequence[ODVariable], file: Path) -> ExitStatus:
    """Write an object's bytes to a file. Raises NodeRefused, NoAnswer, LocalError for several objects, OSError."""
    if len(things) != 1:
        raise LocalError(f"--file takes one object, not {len(things)}")
    thing = things[0]
    with bar(label(thing)) as progress:
        content = node.upload_block(address_of(thing), thing.qualname, progress)
    write_whole(file, content)
    print(one_line(f"{file}: {amount(len(content), 'byte')} of node {node.node_id}, {label(thing)}"))
    return ExitStatus.FINE


def write(target: Target, name: str, value: str | None, file: Path | None) -> None:
    """Write one object of a CANopen node, by number or by the EDS's name, or a whole file into it.

    A value that the EDS does not allow is refused here. Without an EDS the node is asked for the object's length first.
    """
    if (value is None) is (file is None):
        raise LocalError("what to write: give a value or --file FILE, one of them")
    content = file.read_bytes() if file else b""
    with target.opened() as node:
        found = target.description(node)
        thing = find_one(name, found.dictionary.objects if found else None)
        if value is None:
            with bar(label(thing)) as progress:
                node.download(address_of(thing), content, thing.qualname, progress=progress)
            text = shown(thing, content)
        else:
            number = parse(thing, value)
            # Without an EDS nothing gives the type; a device refuses another length than its own (0607 0010).
            size = len(node.upload(address_of(thing))) if not is_described(thing) else 0
            node.download(address_of(thing), encode(thing, number, size), thing.qualname)
            text = written(thing, number)
    print(one_line(f"node {node.node_id}: {label(thing)} = {text}"))


def dump(target: Target, as_json: bool) -> None:
    """Print all readable objects of a CANopen node with their values.

    An object that the node refuses is listed with the reason.
    """
    from eurobot_od.client.reading import read_all, readable

    with target.opened() as node:
        dictionary = target.needed_description(node).dictionary
        with passing(f"node {node.node_id}", readable(dictionary)) as things:
            readings = list(read_all(node, things))
    print_readings(readings, as_json)


def export_dcf(target: Target, output: Path | None) -> ExitStatus:
    """Write the DCF of a live CANopen node: its EDS with the values that its parameters have now.

    What no line of a DCF can hold, and every DOMAIN, is written to files beside it, which `configure` reads back. Exit
    status 1 if the node refuses objects of its EDS, which are left out.
    """
    from eurobot_od.bus.live import BITRATE
    from eurobot_od.client.reading import dcf_of_node, parameters

    with target.opened() as node:
        dictionary = target.needed_description(node).dictionary
        stem = output.stem if output else dictionary.name
        with passing(f"node {node.node_id}", parameters(dictionary)) as things:
            dcf, left_out = dcf_of_node(node, dictionary, (target.bit_rate or BITRATE) // 1000, stem, things)
    files.write_dcf(output, dcf)
    for thing, _, reason in left_out:
        complain(f"left out {label(thing)}: {reason}")
    return ExitStatus.FOUND if left_out else ExitStatus.FINE


def pdo(target: Target, action: str | None, name: str | None, objects: Sequence[str], as_json: bool) -> None:
    """List the PDOs that a CANopen node has now: identifier, on or off, type and mapping; or map objects into one.

    `map TPDO2 Motion.Speed ...` switches the PDO off, maps the objects in their order, switches it on if it was, and
    reads back (CiA 301, 7.5.2.36 and 7.5.2.38).
    """
    from eurobot_od.client.pdo_mapping import map_objects

    with target.opened() as node:
        dictionary = target.needed_description(node).dictionary
        found = _present_pdos(node, dictionary)
        if action:
            known = {each.key: each for each in found}
            if not (name and objects):
                raise LocalError(
                    f"map into which PDO, and what? Write `map TPDO1 OBJECT...`; known: {', '.join(known)}"
                )
            chosen = known.get(name.upper().replace(" ", ""))
            if chosen is None:
                raise UnknownName("PDO", name, known)
            map_objects(node, dictionary, chosen, [find_one(each, dictionary.objects) for each in objects])
            found = [each for each in _present_pdos(node, dictionary) if each.index == chosen.index]
    if as_json:
        print(json.dumps([pdo_as_data(each) for each in found], indent=2))
    else:
        print(*columns(map(pdo_row, found)), sep="\n")


def _present_pdos(node: RemoteNode, dictionary: Dictionary) -> list[Pdo]:
    """Return a node's PDOs as they are set now; complains of those whose mapping does not hold."""
    from eurobot_od.client.remote_pdos import pdo_parameters

    present = dictionary.configured(pdo_parameters(node, dictionary))
    with left_out() as refused:
        return list(present.read_pdos(present.default, refused))


def pdo_row(each: Pdo) -> tuple[str, ...]:
    """Return the line of one PDO."""
    mapped = ", ".join(f"{one.variable.qualname} {one.bits}" for one in each.mapping)
    state = "on" if each.valid else "off"
    timing = f"type {each.transmission_type}" + (f", every {each.event_timer} ms" if each.event_timer else "")
    return each.title, f"0x{each.cob_id:03X}", state, timing, mapped or "(nothing mapped)"


def pdo_as_data(each: Pdo) -> dict[str, Any]:
    """Return one PDO as plain data."""
    mapping = [
        {"index": one.address[0], "subindex": one.address[1], "name": one.variable.qualname, "bits": one.bits}
        for one in each.mapping
    ]
    settings = {"type": each.transmission_type, "inhibit_time": each.inhibit_time, "event_timer": each.event_timer}
    return {"pdo": each.title, "cob_id": each.cob_id, "valid": each.valid, **settings, "mapping": mapping}


def emcy(target: Target, clear: bool, as_json: bool) -> ExitStatus:
    """Print the errors that a CANopen node remembers, newest first, or clear them (0x1001, 0x1003).

    Exit status 1 if the node is in an error state now.
    """
    from eurobot_od.client.emergencies import clear_history, read_history

    with target.opened() as node:
        target.named_description(node)  # its file may say another SDO server
        if clear:
            clear_history(node)
        found = read_history(node)
    words = target.devices.errors().of(node.node_id)
    if as_json:
        print(json.dumps(errors_as_data(found, words), indent=2))
    else:
        print(*errors_as_text(found, node.node_id, words), sep="\n")
    return ExitStatus.FOUND if found.register else ExitStatus.FINE


def errors_as_data(found: History, words: Callable[[int], str]) -> dict[str, Any]:
    """Return a history as plain data; `words` gives those for a code."""
    history = [each._asdict() | {"text": words(each.code)} for each in found.entries]
    return {"register": found.register, "history": history}


def errors_as_text(found: History, node_id: int, words: Callable[[int], str]) -> list[str]:
    """Return a history as lines."""
    register = ", ".join(found.register_bits) or "no error"
    rows = [
        (f"0x{each.code:04X}", words(each.code), f"0x{each.info:04X}" if each.info else "") for each in found.entries
    ]
    head = f"node {node_id}: {register} (error register 0x{found.register:02X})"
    return [head, *(columns(rows) if rows else ["no error remembered"])]


COMMANDS = {
    "read": CommandRow(
        read,
        TARGET,
        option(
            "objects", nargs="+", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1018:1, Motion, 'Motion.Maximum speed'"
        ),
        JSON,
        option("--file", type=Path, help="write the bytes of one object to this file, by block transfer"),
    ),
    "write": CommandRow(
        write,
        TARGET,
        option("name", metavar="INDEX[:SUB]", help="such as 0x1017, 0x1016:1, 'Motion.Maximum speed'"),
        option("value", nargs="?", help="number, decimal or 0x..; text; or hexadecimal digits: as the type says"),
        option("--file", type=Path, help="write the bytes of this file, by block transfer"),
    ),
    "dump": CommandRow(dump, TARGET, JSON),
    "pdo": CommandRow(
        pdo,
        TARGET,
        option("action", nargs="?", choices=("map",), help="map other objects into a PDO (default: list all PDOs)"),
        option("name", nargs="?", metavar="PDO", help="such as TPDO2"),
        option("objects", nargs="*", metavar="OBJECT", help="what to map, in its order: names or INDEX:SUB"),
        JSON,
    ),
    "export-dcf": CommandRow(export_dcf, TARGET, files.OUTPUT),
    "emcy": CommandRow(
        emcy, with_emcy(TARGET), option("--clear", action="store_true", help="empty the error history"), JSON
    ),
}
