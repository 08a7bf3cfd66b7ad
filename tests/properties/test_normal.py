"""Files made at random, in the many ways editors write them: what they say is known, as the test has made them."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any, NamedTuple

from canopen.objectdictionary import ODArray, ODRecord, ODVariable, eds
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.values import DATA_TYPES, DOMAIN, REALS, UNSIGNED8, Address, DataType, Value

NODE_ID = 5
INTEGERS = [each for each in DATA_TYPES.values() if each.is_integer]
TEXT_TYPES = [DATA_TYPES[0x09], DATA_TYPES[0x0B]]
BYTE_TYPES = [DATA_TYPES[0x0A], DOMAIN]
NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9 _%:=-]{0,20}[A-Za-z0-9]", fullmatch=True)
WORDS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9 .,%:=$-]{0,20}[A-Za-z0-9]", fullmatch=True)


class Written(NamedTuple):
    """A value, and the text that stands for it in the file."""

    value: Value
    text: str


class Said(NamedTuple):
    """What is known of a variable: what canopen should have, and what the file's lines are."""

    name: str
    type: DataType
    access: str
    mappable: bool
    default: Value
    value: Value
    low: Value
    high: Value
    lines: tuple[str, ...]


@st.composite
def numbers(draw: st.DrawFn, type_: DataType) -> Written:
    """A number, in one of the ways in which files write it."""
    value = draw(st.integers(type_.low, type_.high))
    bits = value % (1 << type_.bits)
    forms = [str(value)]
    if value >= 0:
        forms += [f"0x{value:X}", f"0X{value:x}", f"0{value:o}" if value else "0", f"{value}UL", f"0{value:X}h"]
    if type_.is_signed and value < 0:
        forms.append(f"0x{bits:X}")
    if type_.bits == 32 and not type_.is_signed and value >= NODE_ID:
        base = value - NODE_ID
        forms += [f"$NODEID+0x{base:X}", f"$NodeID + {base}", f"0x{base:x}+$NODEID", f"($NODEID+0x{base:X})"]
    return Written(value, draw(st.sampled_from(forms)))


@st.composite
def reals(draw: st.DrawFn, type_: DataType) -> Written:
    value = draw(st.floats(width=32, allow_nan=False, allow_infinity=False))  # a REAL64 can be one of 32 bits
    packed = struct.pack(">f" if type_.bits == 32 else ">d", value)
    return Written(value, draw(st.sampled_from([repr(value), f"{value!r}f", f"0x{packed.hex()}"])))


@st.composite
def written(draw: st.DrawFn, type_: DataType) -> Written:
    if type_ in TEXT_TYPES:
        text = draw(WORDS)
        return Written(text, text)
    if type_ in BYTE_TYPES:
        data = draw(st.binary(min_size=1, max_size=8))
        return Written(data, draw(st.sampled_from([data.hex(), data.hex(" ").upper(), f"0x{data.hex()}"])))
    return draw(reals(type_)) if type_ in REALS else draw(numbers(type_))


@st.composite
def variables(draw: st.DrawFn, fixed_type: DataType | None = None) -> Said:
    """A variable, with keys in any order and letter case."""
    type_ = fixed_type or draw(st.sampled_from([*INTEGERS, *REALS, *TEXT_TYPES, *BYTE_TYPES]))
    name, access = draw(NAMES), draw(st.sampled_from(["ro", "rw", "wo", "rwr", "rww", "const"]))
    mappable = draw(st.booleans())
    default, value = (draw(st.none() | written(type_)) for _ in range(2))
    low = high = None
    if type_.is_integer or type_ in REALS:
        bounds = [draw(st.none() | written(type_)) for _ in range(2)]
        low, high = bounds
    code = draw(st.sampled_from([f"0x{type_.code:04X}", f"{type_.code}", f"0x{type_.code:X}L"]))
    entries = [
        ("ParameterName", name),
        ("DataType", code),
        ("AccessType", draw(st.sampled_from([access, access.upper()]))),
        ("PDOMapping", str(int(mappable))),
        *((key, each.text) for key, each in (("DefaultValue", default), ("ParameterValue", value)) if each),
        *((key, each.text) for key, each in (("LowLimit", low), ("HighLimit", high)) if each),
    ]
    lines = []
    for key, text in draw(st.permutations(entries)):
        spelled = draw(st.sampled_from([key, key.upper(), key.lower()]))
        blank, comment = draw(st.sampled_from(["", " "])), draw(st.sampled_from(["", "", " ; why", "\t;"]))
        lines.append(f"{spelled}{blank}={blank}{text}{comment}")
        lines += draw(st.sampled_from([[], [], ["; a comment"], ["# another"], [f"{key}=twice"]]))
    said = [None if each is None else each.value for each in (default, value, low, high)]
    return Said(name, type_, access, mappable, said[0], said[1], said[2], said[3], tuple(lines))


class File(NamedTuple):
    """A file's bytes, and its variables by address."""

    data: bytes
    variables: dict[Address, Said]


@st.composite
def files(draw: st.DrawFn) -> File:
    known: dict[Address, Said] = {}
    sections: list[list[str]] = []
    for index in sorted(draw(st.sets(st.integers(0x1000, 0x9FFF), min_size=1, max_size=4))):
        head = draw(st.sampled_from([f"{index:04X}", f"{index:04x}", f"0x{index:04X}"]))
        if draw(st.booleans()):
            known[index, 0] = draw(variables())
            sections.append([f"[{head}]", *known[index, 0].lines])
            continue
        kind, subs = draw(st.sampled_from(["8", "0x9"])), sorted(draw(st.sets(st.integers(1, 254), max_size=3)))
        count = draw(st.sampled_from([len(subs) + 1, 77]))
        sections.append([f"[{head}]", f"ParameterName=Record {index}", f"ObjectType={kind}", f"SubNumber={count}"])
        for sub in [0, *subs]:
            known[index, sub] = draw(variables(UNSIGNED8 if sub == 0 else None))
            text = draw(
                st.sampled_from([f"{index:04X}sub{sub:X}", f"{index:04x}SUB{sub:x}", f"{index:04X} sub{sub:02X}"])
            )
            sections.append([f"[{text}]", *known[index, sub].lines])
    lists = [["[MandatoryObjects]", "SupportedObjects=0"], ["[Comments]", "Lines=5", "Line1=x"], []]
    text = "\n\n".join("\n".join(each) for each in [draw(st.sampled_from(lists)), *sections])
    text = text.replace("\n", draw(st.sampled_from(["\n", "\r\n"]))) + "\n"
    return File(text.encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))), known)


def members(entry: ODVariable | ODArray | ODRecord) -> dict[int, Any]:
    return getattr(entry, "subindices", {0: entry})


def what_canopen_has(objects: Any) -> dict[Address, tuple[object, ...]]:
    return {
        (index, sub): (each.name, each.data_type, each.access_type, each.pdo_mappable, each.default, each.value)
        for index, entry in objects.indices.items()
        if index >= 0x1000
        for sub, each in members(entry).items()
    }


def what_was_said(file: File) -> dict[Address, tuple[object, ...]]:
    return {
        address: (each.name, each.type.code, each.access, each.mappable, each.default, each.value)
        for address, each in file.variables.items()
    }


@given(files())
def test_canopen_alone_reads_the_normal_form_as_it_was_meant(file: File) -> None:
    text = in_normal_form(file.data)[0].decode().replace("\r\n", "\n")
    objects = eds.import_eds(io.StringIO(text), NODE_ID)  # type: ignore[no-untyped-call]
    assert what_canopen_has(objects) == what_was_said(file)


@given(files())
def test_a_file_is_loaded_with_its_limits(file: File) -> None:
    objects = Dictionary.read(file.data, Path("a.eds"), NODE_ID).objects
    assert what_canopen_has(objects) == what_was_said(file)
    for (index, sub), said in file.variables.items():
        each = members(objects.indices[index])[sub]
        assert (each.min, each.max) == (said.low, said.high)


@given(files())
def test_the_normal_form_is_its_own(file: File) -> None:
    data, _ = in_normal_form(file.data)
    assert in_normal_form(data) == (data, [])
