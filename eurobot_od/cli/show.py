"""`show` prints the messages as the EDS files map them, one message's bits as a picture, or the devices' objects.

Everything comes from the loaded EDS files and the message types.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from string import ascii_letters
from typing import TYPE_CHECKING, Annotated, Any

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.devices import Devices, completeness, object_names
from eurobot_od.cli.options import Json, give
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError, UnknownIdentifier, UnknownName
from eurobot_od.od import objects as od
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import label, parse_number
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import plain_name
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.texts import columns, one_line

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


def show(
    message: str | None = None,
    *,
    objects: Annotated[str | None, Option(metavar="NAME", bare="", suggest=object_names)] = None,
    as_json: Json = False,
    devices: Devices,
) -> ExitStatus:
    """Show the messages as the EDS files map them, one message's bits as a picture, or the objects of the devices.

    Exit status 1 if a file has objects that are left out.

    message: name or identifier of a message, such as 'Goto XY' (default: all)
    objects: list the devices' objects, or those of a device, a name or an index, such as Motor or 0x1018

    $ show --eds 5=motor.eds
    $ show --objects Motor --eds 5=motor.eds
    """
    if message and Path(message).is_file():
        raise LocalError(f"{message} is a file, not a message: name it by --eds")
    if message and objects is not None:
        raise LocalError("either a message or --objects, not both")
    devices.check_named()
    known = devices.load_and_complain()
    if objects is not None:
        _show_objects(known, objects, as_json)
        return completeness(known)
    protocol = devices.protocol(known)
    chosen = [_binding(protocol, message, known)] if message else protocol.bindings
    give(as_json, map(as_data, chosen), map(one_line, picture(chosen[0]) if message else table(chosen)))
    return completeness(known)


def _binding(protocol: Protocol, message: str, known: Sequence[Dictionary]) -> Binding:
    """Return a message's binding by its name or COB-ID; raises UnknownName, LocalError."""
    if message in (each.name for each in known) and plain_name(message) not in map(plain_name, protocol.names()):
        raise LocalError(f"{message} is a device, not a message: show --objects {message} lists its objects")
    number = parse_number(message)
    try:
        return protocol.binding(message) if number is None else protocol.binding_of(number.value)
    except UnknownIdentifier as error:  # of the command line, not of a bus
        raise LocalError(f"{error}; `show` lists all") from None


# Objects


def _show_objects(dictionaries: Sequence[Dictionary], name: str, as_json: bool) -> None:
    """Print the objects of devices, or those with a name; raises UnknownName if no device has it."""
    chosen = {each.name: _chosen(each, name) for each in dictionaries}
    if not any(chosen.values()):
        raise UnknownName("device or object", name, chosen)
    data = {device: map(object_as_data, found) for device, found in chosen.items()}
    give(as_json, data, map(one_line, _object_lines(chosen)))


def _object_lines(chosen: Mapping[str, Sequence[ODVariable]]) -> Iterator[str]:
    for device, found in chosen.items():
        if found:
            yield from [f"{device}:"] * (len(chosen) > 1)
            yield from columns([OBJECT_HEAD, *map(object_row, found)])


def _chosen(dictionary: Dictionary, name: str) -> list[ODVariable]:
    if name in ("", dictionary.name):
        return list(od.all_objects(dictionary.objects))
    try:
        return [each for each in od.find(name, dictionary.objects) if od.is_described(each)]
    except LocalError:  # another device may have it
        return []


OBJECT_HEAD = ("object", "name", "type", "access", "PDO", "value", "allowed")


def object_row(thing: ODVariable) -> tuple[str, ...]:
    """Return the row of one object, with its ParameterValue, otherwise its default.

    Allowed values include values with names: `0..65534 mm, 65535 unknown`.
    """
    value = od.default_of(thing)
    range_ = getattr(thing, "plain", None) or od.limits(thing)
    is_limited = hasattr(thing, "plain") or (thing.min, thing.max) != (None, None)
    allowed = od.allowed_range(thing, range_) if range_ and is_limited else ""
    codes = [f"{number} {name}" for number, name in thing.value_descriptions.items()]
    mappable = "yes" if thing.pdo_mappable else ""
    shown = "" if value is None else od.measured(thing, value)
    place = label(od.address_of(thing))
    return (
        place,
        thing.qualname,
        od.data_type(thing).name,
        thing.access_type,
        mappable,
        shown,
        ", ".join(filter(None, [allowed, *codes])),
    )


def object_as_data(thing: ODVariable) -> dict[str, Any]:
    """Return one object as plain data; bytes are hexadecimal digits."""
    value = od.default_of(thing)
    range_ = od.limits(thing)
    limits = None
    if range_:
        limits = [each if isfinite(each) else None for each in range_]
    return {
        "index": thing.index,
        "subindex": thing.subindex,
        "name": thing.qualname,
        "type": od.data_type(thing).name,
        "access": thing.access_type,
        "pdo_mapping": thing.pdo_mappable,
        **od.as_data(thing, value),
        "limits": limits,
    }


# Messages


def as_data(binding: Binding) -> dict[str, Any]:
    """Return a message as plain data: COB-ID, nodes, and its fields with width, unit, limits and bits."""
    # `allowed` is text, as kinds of fields differ in what they allow.
    fields = {
        field: {
            "bits": binding.layout.widths[field],
            "unit": binding.kinds[field].unit,
            "allowed": binding.kinds[field].allowed(binding.limits[field]),
            "frame_bits": binding.layout.places(field),
        }
        for field in mapped(binding)
    }
    return {
        "name": binding.name,
        "cob_id": binding.cob_id,
        "senders": binding.senders,
        "receivers": binding.receivers,
        "length": binding.layout.length,
        "fields": fields,
    }


def mapped(binding: Binding) -> list[str]:
    """Return the fields that the loaded EDS files map, in the order of the message type."""
    return [field for field in binding.kinds if field in binding.limits]


def table(bindings: Iterable[Binding]) -> Iterator[str]:
    """Yield the lines of the table of all messages, most urgent first."""
    yield f"{'COB-ID':<7} {'message':<30} {'from':<18} {'to':<18} {'bytes':>5}  fields (bits)"
    for each in bindings:
        senders, receivers = ", ".join(each.senders), ", ".join(each.receivers)
        fields = ", ".join(f"{name} {each.layout.widths[name]}" for name in mapped(each))
        line = f"0x{each.cob_id:03X}   {each.name:<30} {senders:<18} {receivers:<18} {each.layout.length:>5}  {fields}"
        yield line.rstrip()


# One message

GREEK = "αβγδεζηθικλμ"
"""Further letters for a PDO with more than 52 fields."""


def picture(binding: Binding) -> Iterator[str]:
    """Yield the lines about one message: its nodes, its bits, and the meaning of its fields."""
    layout = binding.layout
    symbols = _symbols(mapped(binding))
    cells = {
        place: f"{symbol}{bit}" for field, symbol in symbols.items() for bit, place in enumerate(layout.places(field))
    }
    yield f"{binding.name}  COB-ID 0x{binding.cob_id:03X}  {_lengths(binding)}"
    yield f"{', '.join(binding.senders)} -> {', '.join(binding.receivers)}"
    yield from textwrap.wrap(" ".join((binding.type.__doc__ or "").split()), 100)
    if layout.length:
        yield ""
        yield from _bytes(layout.length, cells)
        yield ""
    for field, symbol in symbols.items():
        width = layout.widths[field]
        allowed = binding.kinds[field].allowed(binding.limits[field])
        bits = f"{symbol}{width - 1}..{symbol}0" if width > 1 else f"{symbol}0"
        yield f"{bits:<9} {field:<17} {width:>2} bit  {allowed}"
    if len(cells) < 8 * layout.length:
        yield ".".ljust(9) + " unused"


def _lengths(binding: Binding) -> str:
    """Return the number of bytes of a frame as text, and that without optional fields."""
    if binding.layout.length == 0:
        return "no data"
    text = f"{binding.layout.length} byte{'s' if binding.layout.length > 1 else ''}"
    if len(binding.lengths) == 1:
        return text
    *others, last = binding.optional
    return f"{text}, {binding.lengths[0]} without {' and '.join(filter(None, [', '.join(others), last]))}"


def _symbols(fields: Iterable[str]) -> dict[str, str]:
    """Return a different letter for each field, if possible its first; a PDO has up to 64 fields."""
    taken: dict[str, str] = {}
    for field in fields:
        letters = [letter for letter in field if letter.isalpha()]
        # 52 Latin and 12 Greek letters, as a PDO has at most 64 fields of one bit.
        candidates = [letters[0].upper(), *letters, *ascii_letters, *GREEK]
        taken[field] = next(letter for letter in candidates if letter not in taken.values())
    return taken


def _bytes(length: int, cells: Mapping[int, str]) -> Iterator[str]:
    """Yield the drawing of a frame as it is sent: one line per byte, bit 7 first.

    A cell has a field's letter and the bit of its value; its key is 8 times the byte plus the bit in it.
    """
    edge = "        +" + "------+" * 8
    yield " " * 9 + "  ".join(f"bit {bit}" for bit in range(7, -1, -1))
    yield edge
    for byte in range(length):
        row = (f" {cells.get(8 * byte + bit, '.'):<5}" for bit in range(7, -1, -1))
        yield f"byte {byte}  |" + "|".join(row) + "|"
        yield edge
