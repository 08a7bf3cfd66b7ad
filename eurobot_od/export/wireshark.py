"""The messages as a dissector for Wireshark and tshark from 3.4 on, in Lua: names, fields, units, named values.

The file is a table of the messages, followed by `wireshark.lua`, which reads it. It handles only the network's
identifiers, and leaves other frames to other dissectors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from eurobot_od.export.description import (
    DescribedField,
    DescribedMessage,
    Identifiers,
    Numeral,
    described,
    printable,
    printable_name,
)
from eurobot_od.pdo.protocol import Protocol

READER = Path(__file__).with_name("wireshark.lua")

WORDS = "can canopen length"
"""Names in display filters that are reserved for other protocols."""

SHORTEST = 2
"""Shortest filter name of a protocol (tshark 4.0 fails with "Dissector bug" for one letter)."""

FIELD_TYPES = {Numeral.UNSIGNED: {bits: f"uint{bits}" for bits in (8, 16, 24, 32, 64)}}
FIELD_TYPES[Numeral.SIGNED] = {bits: f"int{bits}" for bits in (8, 16, 24, 32, 64)}
FIELD_TYPES[Numeral.REAL] = {32: "float", 64: "double"}
"""Wireshark's field types by numeral and bits."""

MOST_EXACT = 1 << 53
"""Lua rounds larger numbers, so that such limits are omitted."""


def lua_text(protocol: Protocol, name: str) -> str:
    """Return the dissector of a protocol; its filters begin with `name`. Raises LocalError without messages."""
    return text_of(described(protocol), name)


def text_of(messages: Iterable[DescribedMessage], name: str) -> str:
    """Return the dissector of messages."""
    return "\n".join([*_table(list(messages), filter_name(name)), READER.read_text(encoding="ascii")])


def filter_name(name: str) -> str:
    """Return the prefix of the display filters of a network."""
    short = Identifiers(WORDS).new(name).lower()
    return short if len(short) >= SHORTEST else f"{short}_bus"


def _table(messages: list[DescribedMessage], short: str) -> Iterator[str]:
    files = ", ".join(dict.fromkeys(each.file.name for each in messages))
    yield f"-- Messages of {printable(files)}, made by `eurobot-od export wireshark`; do not edit."
    yield "-- Put it into the folder of the personal Lua plugins (Help, About Wireshark, Folders), or say"
    yield "-- `tshark -X lua_script:FILE`. Add `-d can.subdissector,canopen` for all other frames of CANopen."
    yield ""
    yield f"local SHORT_NAME = {_quoted(short)}"
    yield f"local network = Proto(SHORT_NAME, {_quoted(f'CANopen messages of {files}')})"
    yield "local MESSAGES = {}"
    of_messages = Identifiers(WORDS)
    for each in messages:
        yield ""
        yield from _message(each, f"{short}.{of_messages.new(each.name).lower()}")
    yield ""


def _message(message: DescribedMessage, filters: str) -> Iterator[str]:
    expected = " or ".join(map(str, sorted({message.shortest, message.length})))
    yield f"MESSAGES[0x{message.cob_id:03X}] = {{"
    yield f"    name = {_quoted(printable_name(message.name))}, path = {_quoted(message.path)},"
    yield f"    length = {message.length}, shortest = {message.shortest}, expected = {_quoted(expected)},"
    yield "    fields = {"
    of_fields = Identifiers()
    for field in message.fields:
        yield from _field(field, f"{filters}.{of_fields.new(field.name).lower()}")
    yield "    },"
    yield "}"


def _field(field: DescribedField, filters: str) -> Iterator[str]:
    types = FIELD_TYPES[field.numeral]
    kind = types[next(bits for bits in types if bits >= field.width)]  # there is no type of, for example, 12 bits
    first, last = min(field.places) // 8, max(field.places) // 8
    names = "{" + ", ".join(f"[{raw}] = {_quoted(printable_name(name))}" for raw, name in field.named.items()) + "}"
    given = f", base.DEC, {names}" if field.named else ""
    yield "        {"
    yield f"            proto = ProtoField.{kind}({_quoted(filters)}, {_quoted(printable_name(field.name))}{given}),"
    yield f"            name = {_quoted(printable_name(field.name))}, unit = {_quoted(_unit(field.unit))},"
    yield f"            names = {names},"
    yield f"            numeral = {_quoted(field.numeral.value)}, width = {field.width}, first = {first},"
    yield f"            bytes = {last - first + 1},"
    if field.numeral is not Numeral.REAL and max(map(abs, field.limits)) < MOST_EXACT:
        yield f"            low = {field.limits.low}, high = {field.limits.high},"
    if field.default is not None:
        # In two halves, because numbers in Wireshark's Lua 5.2 are doubles, exact up to 53 bits.
        yield f"            default = {{{field.default % (1 << 32)}, {field.default >> 32}}},"
    listed = ", ".join(f"{{{at // 8}, {at % 8}, {shift}, {bits}}}" for shift, at, bits in field.chunks)
    yield f"            chunks = {{{listed}}}, -- byte, bit, bit of the value, bits"
    yield "        },"


def _unit(unit: str) -> str:
    """Return a unit for use after a raw value, such as `x 0.01 kg` in `1250 x 0.01 kg`."""
    return f"x {unit}" if unit[:1].isdigit() else unit


def _quoted(text: str) -> str:
    return '"' + printable(text).replace("\\", "\\\\").replace('"', '\\"') + '"'
