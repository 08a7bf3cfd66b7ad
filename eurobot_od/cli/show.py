"""Show the messages as the EDS files map them, or one message's bits as a picture.

What is printed comes from the loaded EDS files and the message types, from nothing else.
"""

from __future__ import annotations

import argparse
import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from string import ascii_letters
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import options as shared
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.pdo.binding import Binding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("message", nargs="?", help="name of a message, such as 'Goto XY' (default: all)")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    shared.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Print the table of all messages, or one message."""
    protocol = shared.Devices.of(arguments).protocol()
    chosen = [protocol.binding(arguments.message)] if arguments.message else protocol.bindings
    if arguments.json:
        print(json.dumps([as_data(each) for each in chosen], indent=2))
    elif arguments.message:
        print("\n".join(map(one_line, picture(chosen[0]))))
    else:
        print("\n".join(map(one_line, table(chosen))))


def as_data(binding: Binding) -> dict[str, Any]:
    """Return a message as plain data: identifier, who has it, and its fields with width, unit, limits and bits."""
    # `allowed` is in words, as kinds differ in what they allow; the bits are numbers for programs.
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

GREEK = "αβγδεζηθικλμ"  # letters after those of the alphabet
"""Letters for a PDO that maps more fields than the alphabet has letters, small and large."""


def picture(binding: Binding) -> Iterator[str]:
    """Yield the lines that describe one message: who, which bits where, and what each field means."""
    layout, symbols = binding.layout, _symbols(mapped(binding))
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
        width, allowed = layout.widths[field], binding.kinds[field].allowed(binding.limits[field])
        bits = f"{symbol}{width - 1}..{symbol}0" if width > 1 else f"{symbol}0"
        yield f"{bits:<9} {field:<17} {width:>2} bit  {allowed}"
    if len(cells) < 8 * layout.length:
        yield ".".ljust(9) + " unused"


def _lengths(binding: Binding) -> str:
    """Say how many bytes a frame has, and how many without the fields that may be left out."""
    if binding.layout.length == 0:
        return "no data"
    text = f"{binding.layout.length} byte{'s' * (binding.layout.length > 1)}"
    if len(binding.lengths) == 1:
        return text
    *others, last = binding.optional
    return f"{text}, {binding.lengths[0]} without {' and '.join(filter(None, [', '.join(others), last]))}"


def _symbols(fields: Iterable[str]) -> dict[str, str]:
    """Give each field a letter of its own, if possible its first; a PDO has up to 64 fields."""
    taken: dict[str, str] = {}
    for field in fields:
        letters = [letter for letter in field if letter.isalpha()]
        # 12 more than the alphabet's 52: 64 fields of one bit are the most that a PDO can have.
        candidates = [letters[0].upper(), *letters, *ascii_letters, *GREEK]
        taken[field] = next(letter for letter in candidates if letter not in taken.values())
    return taken


def _bytes(length: int, cells: Mapping[int, str]) -> Iterator[str]:
    """Draw the frame as it is sent: a line a byte, bit 7 first.

    A cell is a field's letter and the bit of its value; cells go by 8 times the byte plus the bit in it.
    """
    edge = "        +" + "------+" * 8
    yield " " * 9 + "  ".join(f"bit {bit}" for bit in range(7, -1, -1))
    yield edge
    for byte in range(length):
        row = (f" {cells.get(8 * byte + bit, '.'):<5}" for bit in range(7, -1, -1))
        yield f"byte {byte}  |" + "|".join(row) + "|"
        yield edge
