"""Devices made up for the exporters: TPDOs of any fields, with any names, as the text of an EDS."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from eurobot_od.export.description import DescribedField, DescribedMessage, Numeral, described
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import DATA_TYPES, REALS, Limits
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.protocol import Protocol


class Field(NamedTuple):
    """A mapped object: its ParameterName, data type and mapped length in bits."""

    name: str
    type: int
    bits: int


BOOLEAN, INTEGER8, INTEGER16, INTEGER32, INTEGER64 = 0x01, 0x02, 0x03, 0x04, 0x15
UNSIGNED8, UNSIGNED16, UNSIGNED32, UNSIGNED64, REAL32, REAL64 = 0x05, 0x06, 0x07, 0x1B, 0x08, 0x11

ANY_NUMBERS: Mapping[str, Sequence[Field]] = {
    "Flags": [
        Field("On", BOOLEAN, 1),
        Field("Off", BOOLEAN, 1),
        Field("Level", INTEGER8, 5),
        Field("Trim", INTEGER8, 8),
    ],
    "Odd offsets": [
        Field("Three", UNSIGNED8, 3),
        Field("Torque", INTEGER16, 13),
        Field("Speed", INTEGER32, 27),
        Field("Nine", UNSIGNED16, 9),
        Field("Last", INTEGER16, 12),
    ],
    "Wide signed": [Field("Value", INTEGER64, 64)],
    "Wide unsigned": [Field("Value", UNSIGNED64, 64)],
    "Nearly wide": [Field("First", UNSIGNED8, 7), Field("Value", INTEGER64, 57)],
    "Real": [Field("Current", REAL32, 32), Field("Angle", INTEGER32, 32)],
    "Real at an odd offset": [Field("Mode", UNSIGNED8, 5), Field("Current", REAL32, 32), Field("Rest", UNSIGNED32, 27)],
    "Wide real": [Field("Position", REAL64, 64)],
}
"""Signed numbers, REALs, 64 bits, and fields that begin anywhere."""

BAD_NAMES = (
    *("", " ", "int", "class", "None", "true", "BO_", "data", "size", "message", "length", "min", "max", "Über", "1st"),
    *("same", "same", "Same", "SAME", "same_2", "N" * 1000, "N" * 1000 + "x", '"', "\\", "'; DROP", "*/ #error", "/*"),
    *(
        "??/",
        "??=",
        "]]",
        "--",
        "\x01\x02",
        "a\x1b[31m",
        "<b>&amp;</b>",
        "|",
        "`code`",
        "${HOME}",
        "%s",
        "x\x85y",
        "\u202e",
    ),
)
"""What files may call their messages and fields."""


def text(messages: Sequence[tuple[str, Sequence[Field]]]) -> str:
    """Return the EDS of a device that sends the messages, as TPDO 1, 2, ..."""
    return "\n".join(line for number, each in enumerate(messages) for line in _message(number, *each)) + "\n"


def _message(number: int, name: str, fields: Sequence[Field]) -> Iterator[str]:
    communication, mapping, record = 0x1800 + number, 0x1A00 + number, 0x2000 + number
    mapped = [record << 16 | sub << 8 | each.bits for sub, each in enumerate(fields, start=1)]
    yield from _record(communication, name, [("COB-ID", 7, 0x180 + number), ("Transmission type", 5, 254)])
    yield from _record(mapping, "Mapping", [("Entry", 7, entry) for entry in mapped])
    yield from _record(record, "Values", [(each.name, each.type, None) for each in fields])


def _record(index: int, name: str, subs: Sequence[tuple[str, int, int | None]]) -> Iterator[str]:
    yield f"[{index:04X}]\nParameterName={name or 'TPDO'}\nObjectType=9\nSubNumber={len(subs) + 1}"
    yield from _variable(index, 0, "Number", 5, len(subs))
    for sub, (sub_name, code, value) in enumerate(subs, start=1):
        yield from _variable(index, sub, sub_name, code, value)


def _variable(index: int, sub: int, name: str, code: int, value: int | None) -> Iterator[str]:
    yield f"[{index:04X}sub{sub:X}]\nParameterName={name if name.strip() else '.'}\nObjectType=7\nDataType=0x{code:04X}"
    yield "AccessType=ro\nPDOMapping=1"
    if value is not None:
        yield f"DefaultValue=0x{value:X}"


def dictionary(messages: Sequence[tuple[str, Sequence[Field]]], name: str = "made up.eds") -> Dictionary:
    """Return the dictionary of that EDS."""
    return Dictionary.read(text(messages).encode(), Path(name), 5)


def protocol(messages: Sequence[tuple[str, Sequence[Field]]]) -> Protocol:
    """Return the protocol of that EDS."""
    device = dictionary(messages)
    return Protocol([(device, device.pdos)])


def typed(made: Protocol, messages: Sequence[tuple[str, Sequence[Field]]]) -> list[DescribedMessage]:
    """Return the described messages, with the numerals of their data types."""
    return [
        message._replace(
            fields=[
                _with_numeral(field, numeral_of(each.type)) for field, each in zip(message.fields, fields, strict=True)
            ]
        )
        for message, (_, fields) in zip(described(made), messages, strict=True)
    ]


def _with_numeral(field: DescribedField, numeral: Numeral) -> DescribedField:
    half = 1 << (field.width - 1)
    limits = Limits(-half, half - 1) if numeral is Numeral.SIGNED else field.limits
    return field._replace(numeral=numeral, limits=limits)


def numeral_of(code: int) -> Numeral:
    """Return what the bits of a data type are as a number."""
    if DATA_TYPES[code] in REALS:
        return Numeral.REAL
    return Numeral.SIGNED if DATA_TYPES[code].is_signed else Numeral.UNSIGNED


def badly_named() -> list[DescribedMessage]:
    """Return a message of two fields for each bad name; fields, nodes, units and values are called so, too."""
    plain = described(protocol([(f"Number {n}", TWO_FIELDS) for n in range(len(BAD_NAMES))]))
    return [_renamed(message, name) for message, name in zip(plain, BAD_NAMES, strict=True)]


TWO_FIELDS = [Field("One", UNSIGNED8, 8), Field("Other", UNSIGNED8, 1)]


def _renamed(message: DescribedMessage, name: str) -> DescribedMessage:
    named = {0: name, 1: name}
    fields = [each._replace(name=name, unit=name, allowed=name, named=named) for each in message.fields]
    file = Path('* ]] --[[ ".eds')
    return message._replace(name=name, fields=fields, senders=[name, "a"], receivers=[name], text=name, file=file)


def many() -> list[DescribedMessage]:
    """Return as many messages as a device may have PDOs, all of one name."""
    (one,) = described(protocol([("Same", [Field("Same", UNSIGNED16, 11)])]))
    return [one._replace(cob_id=number) for number in range(512)]


def random_data(binding: Binding, number: int) -> list[bytes]:
    """Return random data of a message, the same each time."""
    chance = random.Random(binding.name)
    return [chance.randbytes(binding.layout.length) for _ in range(number)]
