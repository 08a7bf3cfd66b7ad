"""Our generated codec and the PDO variables of stock canopen: the same raw values of the same bits, both ways."""

from __future__ import annotations

import logging
import random
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeAlias

import canopen
import pytest
from canopen.objectdictionary import BOOLEAN, FLOAT_TYPES, UNSIGNED_TYPES, ObjectDictionaryError, ODVariable
from hypothesis import assume, given
from hypothesis import strategies as st

from eurobot_od.errors import DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import DATA_TYPES, MAX_BITS, REALS, PdoDirection
from eurobot_od.pdo.codec import Layout, Slot, reader, writer
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import CODES, DEVICE_TYPE, pdo, variable
from tests.kit import lift
from tests.properties.test_codec import column
from tests.rows import rows

NUMBERS = [each.name for each in DATA_TYPES.values() if each.is_integer or each in REALS]
"""Types that can be mapped into a PDO."""

Field: TypeAlias = tuple[str, int]
"""A made-up variable that is mapped: its type, and how many bits of it."""

ROOT = Path(__file__).parents[2]
NODE_ID = 5
FRAMES = 200
"""Random frames of each PDO."""


class Case(NamedTuple):
    """A PDO as canopen has it, a PdoMap, and as we do: its layout, and the functions that are generated from that."""

    name: str
    stock: Any
    layout: Layout
    read: Callable[[bytes], tuple[int, ...]]
    write: Callable[[tuple[int, ...]], Frame]


def never(what: object) -> Frame:
    """Take what our codec cannot read or write at once, of which there is nothing here."""
    raise AssertionError(what)


def cases_of(dictionary: Dictionary, objects: Any) -> Iterator[Case]:
    """Yield the PDOs of a file that we read as `dictionary`, and canopen as `objects`."""
    node: Any = canopen.Network().add_node(canopen.RemoteNode(NODE_ID, objects))
    for each in dictionary.read_pdos(dictionary.default, refused=lambda _: None):
        pdos = node.rpdo if each.direction is PdoDirection.RPDO else node.tpdo
        stock = pdos[each.number]
        stock.read(from_od=True)
        (binding,) = Protocol([(dictionary, [replace(each, valid=True)])]).bindings
        layout = binding.layout
        columns = [column(layout, field) for field in layout.fields]
        yield Case(
            f"{dictionary.file.parent.name}/{dictionary.file.name} {each.title} {each.name}",
            stock,
            layout,
            reader(layout, columns, tuple, never, None),
            writer(layout, columns, binding.cob_id, never, None),
        )


def cases_in(folder: Path) -> Iterator[Case]:
    """Yield the PDOs of the EDS files in a folder, each read by canopen alone."""
    for file in sorted(folder.rglob("*.eds")):
        yield from cases_of(Dictionary.load(file, NODE_ID), canopen.import_od(str(file), NODE_ID))


def made_cases() -> Iterator[Case]:
    """Yield the PDOs of the files that are made from the lift's table, in CiA 301's order of bits and in the other."""
    with TemporaryDirectory() as folder:
        lift.write(Path(folder))
        yield from cases_in(Path(folder))


def foreign_cases() -> Iterator[Case]:
    """Yield the PDOs of other makers' files that can be read, each as the dictionary has it."""
    for file in sorted([*ROOT.glob("tests/lint/samples/*"), *ROOT.glob("docs/*.eds")]):
        try:
            dictionary = Dictionary.load(file, NODE_ID)
        except DictionaryError:
            continue
        yield from cases_of(dictionary, dictionary.objects)


# What canopen can hold


def is_held(stock: Any) -> bool:
    """Return whether canopen 2.4.1 can read and write every variable of a PDO."""
    return all(type_is_held(v.od.data_type, v.offset, v.length, len(stock.data)) for v in stock.map)


def type_is_held(type_: int, offset: int, bits: int, length: int) -> bool:
    """Return whether canopen can read and write so many bits of a type at an offset in a frame of so many bytes.

    Whole bytes are taken as they are, as many as the type has. Anything else is bits of a number that begins with the
    byte in which they begin; it has to cover them, and to end within the frame. Such a number is not negative, as the
    lowest value would be read as positive and others written over their neighbours, and it has 8, 16, 32 or 64 bits, as
    one of 24 would be written as 32.
    """
    if type_ == BOOLEAN or type_ not in ODVariable.STRUCT_TYPES:
        return type_ == BOOLEAN and bits == 1
    size, (byte, bit) = ODVariable.STRUCT_TYPES[type_].size, divmod(offset, 8)
    if bit == bits % 8 == 0:
        return bits == 8 * size
    return type_ in UNSIGNED_TYPES and size in (1, 2, 4, 8) and bit + bits <= 8 * size and byte + size <= length


# Both ways


def agree_on(case: Case, frames: Iterable[bytes]) -> None:
    """Check that canopen reads frames as we do, and makes the same frames of what we read."""
    for data in frames:
        agree(case, data)


def agree(case: Case, data: bytes) -> None:
    """Check it for one frame."""
    layout, stock = case.layout, case.stock
    ours = case.read(data)
    values = [carried(slot, layout, dict(zip(layout.fields, ours))) for slot in layout.slots]
    places = range(len(stock.map))

    stock.on_message(stock.cob_id, bytearray(data), 0.0)
    assert [stock_value(stock.map[place]) if layout.slots[place].field else 0 for place in places] == values

    stock.data = bytearray(((1 << layout.bits) - 1).to_bytes(layout.length, "little"))
    for place in random.Random(data).sample(places, len(places)):
        set_stock_value(stock.map[place], values[place])
    assert bytes(stock.data) == case.write(ours).data


def carried(slot: Slot, layout: Layout, values: dict[str, int]) -> int:
    """Return what a slot carries: all of its field, a slice of it, or 0 as padding does."""
    if slot.field is None:
        return 0
    value = values[slot.field]
    return value if slot.bits == layout.widths[slot.field] else value >> slot.shift & (1 << slot.bits) - 1


def stock_value(variable: Any) -> int:
    """Return canopen's raw value of a variable; of a REAL its bits, which are our raw value."""
    value: int = int.from_bytes(variable.data, "little") if variable.od.data_type in FLOAT_TYPES else variable.raw
    return value


def set_stock_value(variable: Any, value: int) -> None:
    """Write a raw value with canopen, of a REAL its bits."""
    if variable.od.data_type in FLOAT_TYPES:
        variable.data = value.to_bytes(len(variable.od) // 8, "little")
    else:
        variable.raw = value


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Silence canopen's log, which has a line for every random value that is over a limit."""
    logging.disable(logging.WARNING)
    yield
    logging.disable(logging.NOTSET)


def frames(case: Case) -> Iterator[bytes]:
    """Yield all bits unset, all set, and random ones."""
    length, chance = case.layout.length, random.Random(case.name)
    yield from (bytes(length), b"\xff" * length)
    yield from (chance.randbytes(length) for _ in range(FRAMES if length else 0))


def test_there_are_pdos_to_compare() -> None:
    assert {case.name.split()[0] for case in foreign_cases() if is_held(case.stock)} >= {
        "samples/clean.eds",
        "samples/configured.dcf",
        "docs/motor.eds",
    }


def comparable() -> Iterator[Case]:
    """Yield the PDOs of all files that canopen can hold; those that we make all are."""
    yield from made_cases()
    yield from (case for case in foreign_cases() if is_held(case.stock))


@rows("case", comparable())
def test_a_pdo_of_a_file_is_the_same_bits(case: Case) -> None:
    agree_on(case, frames(case))


# Made up


def made_up(fields: list[Field]) -> Case:
    """Return the PDO of a device that maps these fields."""
    entries = [f"0x{0x2000 + number:04X}00{bits:02X}" for number, (_, bits) in enumerate(fields)]
    variables = [
        variable(f"{0x2000 + number:04X}", f"Field {number}", type_) for number, (type_, _) in enumerate(fields)
    ]
    text = DEVICE_TYPE + "".join(variables) + pdo(0x1800, *entries, cob_id="0x185", settings={2: "1"})
    dictionary = Dictionary.read(text.encode("ascii"), Path("made_up.eds"), NODE_ID)
    (case,) = cases_of(dictionary, dictionary.objects)
    return case


@st.composite
def held_fields(draw: st.DrawFn) -> list[Field]:
    """Fields of any width one behind the other, each of a type that canopen can hold there."""
    fields: list[Field] = []
    widths = draw(st.lists(st.integers(1, MAX_BITS), min_size=1, max_size=8))
    while sum(widths) > MAX_BITS:
        widths.pop()
    length = (sum(widths) + 7) // 8
    for number, bits in enumerate(widths):
        offset = sum(widths[:number])
        types = [each for each in NUMBERS if type_is_held(CODES[each], offset, bits, length)]
        assume(types)
        fields.append((draw(st.sampled_from(types)), bits))
    return fields


@given(held_fields().filter(bool), st.data())
def test_any_pdo_that_canopen_can_hold_is_the_same_bits(fields: list[Field], draws: st.DataObject) -> None:
    case = made_up(fields)
    assert is_held(case.stock)
    length = case.layout.length
    agree_on(case, draws.draw(st.lists(st.binary(min_size=length, max_size=length), min_size=1)))


NOT_HELD: dict[str, list[Field]] = {
    "a type that does not cover the bits": [("UNSIGNED32", 32), ("UNSIGNED8", 2), ("UNSIGNED8", 8)],
    "a type that goes past the frame's end": [("UNSIGNED32", 12)],
    "whole bytes of a longer type": [("UNSIGNED16", 8), ("UNSIGNED8", 8)],
    "negative bits of a byte": [("INTEGER8", 4), ("UNSIGNED8", 4)],
    "bits of 24": [("UNSIGNED24", 20), ("UNSIGNED8", 4), ("UNSIGNED8", 8)],
    "a BOOLEAN of 8 bits": [("BOOLEAN", 8)],
}


@pytest.mark.parametrize("fields", NOT_HELD.values(), ids=list(NOT_HELD))
def test_fields_that_stock_canopen_cannot_hold_differ(fields: list[Field]) -> None:
    case = made_up(fields)
    assert not is_held(case.stock)
    with pytest.raises((AssertionError, struct.error, ObjectDictionaryError)):
        agree_on(case, frames(case))
