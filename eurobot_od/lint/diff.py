"""Compares two object dictionaries by what they mean: objects, types, limits, values, mappings as bits, identifiers.

Rule of this file: how something is written never counts (number base, order, upper and lower case, comments, compact or
written out); a file's value is its ParameterValue or else its DefaultValue; names count only if that is asked for.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.lint.file_rules import bit_rates
from eurobot_od.lint.model import LintedDevice, LintedPdo, load
from eurobot_od.od import values
from eurobot_od.od.description import COMPOSED, DescribedObject, DescribedVariable
from eurobot_od.od.document import Document, Entry, Section, read_bytes
from eurobot_od.od.values import Address, DataType, Number

ABSENT = "-"
STATE = (0x1001, 0x1002, 0x1003, 0x1010, 0x1011)
"""Objects whose value in a running node says how it is, not how it is configured."""
NO_OBJECT, NO_SUB_INDEX = 0x06020000, 0x06090011
"""SDO abort codes for what is not there (CiA 301, Table 22)."""

NO_DATA = 0x08000024
"""SDO abort code for an object that is there and has nothing to tell, such as an error field without errors."""


WHOLE_DEVICE = (-1, -1)
"""Where a difference is that belongs to no object."""


class Difference(NamedTuple):
    """One difference: where (a sub-index below 0: in the whole object), in what, and the two texts."""

    where: Address
    aspect: str
    left: str
    right: str

    def __str__(self) -> str:
        return f"{place(self.where)}: {self.aspect}: {self.left} -> {self.right}"


def place(address: Address) -> str:
    """Write where a difference is: `device`, 0x1018, 0x1018 sub 1."""
    index, sub = address
    if address == WHOLE_DEVICE:
        return "device"
    return f"0x{index:04X}" + ("" if sub < 0 else f" sub {sub}")


class Side(NamedTuple):
    """One of the two: the device, and the node-ID its values are meant for (None: they stay relative)."""

    device: LintedDevice
    node_id: int | None


def read_device(file: str) -> LintedDevice:
    """Read an EDS or DCF for a comparison; raises DictionaryError if it cannot be read or describes nothing."""
    device = load(read_bytes(file), file)
    if not device.objects:
        raise DictionaryError(file, None, "not an EDS: it describes no object")
    return device


def compare(
    left: LintedDevice, right: LintedDevice, node_id: int | None = None, with_names: bool = False
) -> list[Difference]:
    """Compare two devices, for a node-ID if one is given or one of them is a DCF; ordered by index and sub-index."""
    common = node_id or left.node_id or right.node_id
    one, other = Side(left, common), Side(right, common)
    aspects = {**ASPECTS, **NAMES} if with_names else ASPECTS
    found = [*_device(one, other), *_objects(one, other), *_variables(one, other, aspects), *_pdos(one, other)]
    return sorted(found)


def _device(one: Side, other: Side) -> Iterator[Difference]:
    rates = [", ".join(map(str, sorted(bit_rates(side.device)))) or "none" for side in (one, other)]
    if rates[0] != rates[1]:
        yield Difference(WHOLE_DEVICE, "bit rates", *rates)


def _objects(one: Side, other: Side) -> Iterator[Difference]:
    objects = one.device.objects, other.device.objects
    for index in objects[0].keys() | objects[1].keys():
        kinds = [_kind(each.get(index)) for each in objects]
        if kinds[0] != kinds[1]:
            yield Difference((index, -1), "object", *kinds)


def _kind(each: DescribedObject | None) -> str:
    if each is None:
        return ABSENT
    return each.code.name if each.code else "unknown"


def variables(device: LintedDevice) -> dict[Address, DescribedVariable]:
    """Return all variables of a device, compact ones written out."""
    return {(each.index, each.sub): each for whole in device.objects.values() for each in whole.variables()}


Aspect = Callable[[DescribedVariable, int | None], str]


def _variables(one: Side, other: Side, aspects: Mapping[str, Aspect]) -> Iterator[Difference]:
    sides = variables(one.device), variables(other.device)
    in_both = one.device.objects.keys() & other.device.objects.keys()
    for address in sides[0].keys() | sides[1].keys():
        left, right = (each.get(address) for each in sides)
        if left and right:
            yield from _both(address, left, right, one.node_id, aspects)
        elif address[0] in in_both:  # else the whole object is said to be missing
            yield Difference(address, "sub-index", _name(left), _name(right))


def _name(variable: DescribedVariable | None) -> str:
    return (variable.name or "there") if variable else ABSENT


def _both(
    address: Address,
    left: DescribedVariable,
    right: DescribedVariable,
    node_id: int | None,
    aspects: Mapping[str, Aspect],
) -> Iterator[Difference]:
    for name, aspect in aspects.items():
        texts = aspect(left, node_id), aspect(right, node_id)
        if texts[0] != texts[1]:
            yield Difference(address, name, *texts)


def _type(variable: DescribedVariable, _: int | None) -> str:
    return variable.type.name if variable.type else variable.section.text("datatype").lower() or ABSENT


def _access(variable: DescribedVariable, _: int | None) -> str:
    return variable.access or ABSENT


def _mappable(variable: DescribedVariable, _: int | None) -> str:
    return "yes" if variable.is_mappable else "no"


def _limit_of(key: str) -> Aspect:
    """Make the aspect of a limit; without one it is the type's."""

    def limit(variable: DescribedVariable, node_id: int | None) -> str:
        number = variable.number(key)
        if number is None and variable.type and variable.type.is_integer:
            number = Number(variable.type.low if key == "lowlimit" else variable.type.high)
        return _number(number, node_id) if number else ABSENT

    return limit


def _number(number: Number, node_id: int | None) -> str:
    if number.relative and node_id is None:
        return f"{values.NODE_ID}+{number.value}"
    return str(number.at(node_id or 0))


def _value(variable: DescribedVariable, node_id: int | None) -> str:
    """Say a variable's value; those of mappings and COB-IDs of PDOs are said as bits and identifiers."""
    text = variable.value_entry.value if variable.value_entry else ""
    if _is_told_by_pdo(variable) or not text:
        return ABSENT if not text else ""
    if variable.value and (variable.type is None or variable.type.is_integer):
        return _number(variable.value, node_id)
    if variable.type is values.OCTET_STRING:
        return text.replace(" ", "").lower()
    return _real(text, variable.type) if variable.type and variable.type in values.REALS else text


def _real(text: str, type_: DataType) -> str:
    """Write a REAL's decimal text as the number its type holds."""
    try:
        number = type_.read(struct.pack("<f" if type_ is values.REAL32 else "<d", float(text)))
    except (ValueError, OverflowError):
        return text
    return repr(number)


def _is_told_by_pdo(variable: DescribedVariable) -> bool:
    is_mapping = any(variable.index in indices for indices in values.MAPPING_RECORDS.values())
    return is_mapping or (
        variable.sub == 1 and any(variable.index in each for each in values.COMMUNICATION_RECORDS.values())
    )


ASPECTS: dict[str, Aspect] = {
    "type": _type,
    "access": _access,
    "low limit": _limit_of("lowlimit"),
    "high limit": _limit_of("highlimit"),
    "value": _value,
    "mappable": _mappable,
}
NAMES: dict[str, Aspect] = {"name": lambda variable, _: variable.name or ABSENT}


def _pdos(one: Side, other: Side) -> Iterator[Difference]:
    """Compare the PDOs that both have."""
    pairs = [{(each.direction, each.number): each for each in side.device.pdos} for side in (one, other)]
    for key in pairs[0].keys() & pairs[1].keys():
        left, right = pairs[0][key], pairs[1][key]
        for aspect, tell, index, sub in (
            ("COB-ID", cob_id, key[0].value + key[1] - 1, 1),
            ("mapping", mapping, key[0].value + values.MAPPING_OFFSET + key[1] - 1, -1),
        ):
            texts = tell(left, one.node_id), tell(right, other.node_id)
            if texts[0] != texts[1]:
                yield Difference((index, sub), f"{left.name} {aspect}", *texts)


def cob_id(pdo: LintedPdo, node_id: int | None) -> str:
    """Say a PDO's COB-ID: identifier, and what its upper bits mean."""
    number = pdo.value(1)
    if number is None:
        return ABSENT
    value = number.at(node_id or 0)
    is_relative = number.relative and node_id is None
    identifier = value & (0x1FFFFFFF if value & values.EXTENDED else values.BASE_IDENTIFIER)
    bits = {"not valid": value & values.NOT_VALID, "29 bits": value & values.EXTENDED, "no RTR": value & values.NO_RTR}
    first = f"{values.NODE_ID}+0x{identifier:03X}" if is_relative else f"0x{identifier:03X}"
    return ", ".join([first, *(name for name, bit in bits.items() if bit)])


def mapping(pdo: LintedPdo, _: int | None) -> str:
    """Say a PDO's mapping as bits: which of them are which object."""
    if pdo.amount is None:
        return ABSENT
    if pdo.is_multiplexed:
        return f"multiplexed ({pdo.amount.value})"
    start, parts = 0, []
    for each in pdo.mapped():
        parts.append(f"{start}..{start + each.bits - 1} {each.where}")
        start += each.bits
    return "; ".join(parts) or "no data"


# A live node

Reading = bytes | int
"""What an SDO read gave: the bytes, or the abort code."""


def readable(device: LintedDevice) -> list[Address]:
    """Return the variables that can be read from a node and compared, in order."""
    found = variables(device).items()
    return sorted(address for address, each in found if each.access != "wo" and each.type is not values.DOMAIN)


def compare_live(device: LintedDevice, readings: Mapping[Address, Reading], node_id: int) -> list[Difference]:
    """Compare a file with what a node answered to SDO reads of it; process data and states are only looked for."""
    known = variables(device)
    said = [each for address, reading in readings.items() for each in _unread(known[address], address, reading)]
    found = compare(device, _overlaid(device, readings), node_id)
    return sorted(said + found)


def _unread(variable: DescribedVariable, address: Address, reading: Reading) -> Iterator[Difference]:
    """Yield what a node has not, does not give, or gives in another length."""
    if reading == NO_DATA:
        return
    if isinstance(reading, int):
        is_missing = reading in (NO_OBJECT, NO_SUB_INDEX)
        yield Difference(address, "on the node", _name(variable), ABSENT if is_missing else f"abort 0x{reading:08X}")
    elif variable.type and variable.type.bits and len(reading) != variable.type.size:
        yield Difference(address, "bytes", str(variable.type.size), str(len(reading)))


def _overlaid(device: LintedDevice, readings: Mapping[Address, Reading]) -> LintedDevice:
    """Return the device with the values that were read, where the file has some to compare them with."""
    sections = dict(device.document.sections)
    for address, variable in variables(device).items():
        text = _read_text(variable, readings.get(address))
        if text is not None and _is_comparable(variable):
            section = _with_value(variable.section, text, _section_name(device, address))
            sections[section.name.lower()] = section
    return LintedDevice(Document(sections, []), device.name)


def _section_name(device: LintedDevice, address: Address) -> str:
    """Return the name of a variable's section; one of a compact object gets one of its own."""
    index, sub = address
    has_subs = device.objects[index].compact or device.objects[index].code in COMPOSED
    return f"{index:04X}sub{sub:X}" if has_subs else f"{index:04X}"


def _is_comparable(variable: DescribedVariable) -> bool:
    return not variable.is_mappable and variable.index not in STATE and variable.value_entry is not None


def _with_value(section: Section, text: str, name: str) -> Section:
    entry = Entry("ParameterValue", text, section.line, section.column)
    return section._replace(name=name, entries={**section.entries, "parametervalue": entry})


def _read_text(variable: DescribedVariable, reading: Reading | None) -> str | None:
    """Write what was read as a file would; None if nothing was."""
    if not isinstance(reading, bytes) or variable.type is None:
        return None
    if variable.type.is_integer:
        return str(int.from_bytes(reading, "little", signed=variable.type.is_signed))
    if variable.type in values.REALS and len(reading) == variable.type.size:
        return repr(variable.type.read(reading))
    if variable.type is values.OCTET_STRING:
        return reading.hex()
    return reading.rstrip(b"\0").decode("latin-1")
