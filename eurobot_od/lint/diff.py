"""Compares two object dictionaries by meaning: objects, types, limits, values, identifiers, and mappings bit by bit.

Notation is ignored: number base, order, case, comments, compact or expanded arrays. A variable's value is its
ParameterValue, or else its DefaultValue. Names are compared only on request.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import chain
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import DictionaryError
from eurobot_od.lint.file_rules import bit_rates
from eurobot_od.lint.model import LintedDevice, load
from eurobot_od.od import values
from eurobot_od.od.dcf import following
from eurobot_od.od.description import COMPOSED, DescribedObject, DescribedRecords, DescribedVariable
from eurobot_od.od.document import Document, Entry, read_bytes
from eurobot_od.od.formats import no_objects
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER, RESTORE, STORE
from eurobot_od.od.values import Address, Number
from eurobot_od.sdo.wire import AbortCode, code_and_reason
from eurobot_od.support.texts import one_line

ABSENT = "-"
STATE = (ERROR_REGISTER[0], 0x1002, ERROR_FIELD, STORE, RESTORE)
"""Objects whose value is the state of a running node, not its configuration."""

WHOLE_DEVICE = (-1, -1)
"""Address of a difference that belongs to no object."""


class EdsDifference(NamedTuple):
    """One difference: address (sub-index -1: the whole object), aspect, both texts, and the object's name."""

    where: Address
    aspect: str
    left: str
    right: str
    name: str = ""

    def __str__(self) -> str:
        where = f"{place(self.where)} {self.name}".rstrip()
        return one_line(f"{where}: {self.aspect}: {self.left} -> {self.right}")


def place(address: Address) -> str:
    """Format the address of a difference: `device`, 0x1018, 0x1018 sub 1."""
    index, sub = address
    if address == WHOLE_DEVICE:
        return "device"
    return f"0x{index:04X}" + ("" if sub < 0 else f" sub {sub}")


def read_device(file: str) -> LintedDevice:
    """Read an EDS or DCF for a comparison; raises DictionaryError if it cannot be read or describes nothing."""
    data = read_bytes(file)
    device = load(data, file)
    if not device.objects:
        raise DictionaryError(file, None, no_objects(data))
    return device


def compare(
    left: LintedDevice, right: LintedDevice, node_id: int | None = None, with_names: bool = False
) -> list[EdsDifference]:
    """Compare two devices and return the differences, ordered by index and sub-index."""
    nodes = {each.node_id for each in (left, right)} - {None}
    if len(nodes) == 1:  # for DCFs of two nodes, values with the node-ID stay relative
        node_id = node_id or next(iter(nodes))
    left, right = followed(left, node_id), followed(right, node_id)
    aspects = {**ASPECTS, **NAMES} if with_names else ASPECTS
    compared = chain(_wholes(left, right), _variables(left, right, node_id, aspects), _pdos(left, right, node_id))
    missing = (
        EdsDifference((index, sub), "sub-index", _presence(ours.get(sub)), _presence(theirs.get(sub)))
        for index, ours, theirs in _shared(left, right)
        for sub in ours.keys() ^ theirs.keys()
    )
    return _named(sorted([*(each for each in compared if each.left != each.right), *missing]), left, right)


def followed(device: LintedDevice, node_id: int | None) -> LintedDevice:
    """Return a device for a comparison at `node_id`.

    If the device's own node-ID differs, values made from it become `$NODEID+...`.
    """
    if device.node_id in (None, node_id):
        return device
    sections = dict(device.document.sections)
    for variable, text in following(device, device.node_id or 0):
        name = variable.section.name.lower()
        if name in sections:  # sub-indices of a compact object have no sections
            sections[name] = sections[name].saying(ParameterValue=text)
    return LintedDevice(device.document._replace(sections=sections), device.name)


def _named(found: Iterable[EdsDifference], *devices: LintedDevice) -> list[EdsDifference]:
    """Add the objects' names to differences, from the device whose name says more."""
    return [
        each._replace(
            # `record.entry` says more than the record's name, which may be all that the other file has
            name=max((_name_in(one, each.where) for one in devices), key=lambda name: (name != "", "." in name))
        )
        for each in found
    ]


def _name_in(device: LintedDevice, address: Address) -> str:
    index, sub = address
    whole = device.objects.get(index)
    variable = whole.variable(sub) if whole and sub >= 0 else None
    if whole is None or variable is None or whole.code not in COMPOSED:
        return whole.name if whole else ""
    return f"{whole.name}.{variable.name}"


def _wholes(one: LintedDevice, other: LintedDevice) -> Iterator[EdsDifference]:
    """Compare the bit rates of both devices and the object codes of all objects."""
    rates = (", ".join(map(str, sorted(bit_rates(each)))) or "none" for each in (one, other))
    yield EdsDifference(WHOLE_DEVICE, "bit rates", *rates)
    # An object that only one of them has is reported once, without its sub-indices.
    for index in one.objects.keys() | other.objects.keys():
        objects = (each.objects.get(index) for each in (one, other))
        yield EdsDifference((index, -1), "object", *map(_code, objects))


def _code(whole: DescribedObject | None) -> str:
    if whole is None:
        return ABSENT
    return whole.code.name if whole.code else "unknown"


def variables(device: LintedDevice) -> dict[Address, DescribedVariable]:
    """Return all variables of a device by address, with compact arrays expanded."""
    return {(each.index, each.sub): each for whole in device.objects.values() for each in whole.variables()}


def _shared(one: LintedDevice, other: LintedDevice) -> Iterator[tuple[int, Members, Members]]:
    """Yield the sub-indices of the objects that both have; one object at a time, as a file may describe millions."""
    for index in one.objects.keys() & other.objects.keys():
        left, right = ({each.sub: each for each in device.objects[index].variables()} for device in (one, other))
        yield index, left, right


def _presence(variable: DescribedVariable | None) -> str:
    return "there" if variable else ABSENT


Members: TypeAlias = dict[int, DescribedVariable]
"""The variables of an object by sub-index."""

Aspect = Callable[[DescribedVariable, int | None], str]
"""Formats one aspect of a variable for a node-ID; without one, values with the node-ID stay relative."""


def _variables(
    one: LintedDevice, other: LintedDevice, node_id: int | None, aspects: Mapping[str, Aspect]
) -> Iterator[EdsDifference]:
    for index, left, right in _shared(one, other):
        for sub in left.keys() & right.keys():
            for name, aspect in aspects.items():
                texts = aspect(left[sub], node_id), aspect(right[sub], node_id)
                if texts[0] != texts[1]:
                    yield EdsDifference((index, sub), name, *_as_written(name, texts, left[sub], right[sub]))


ENTRIES: Mapping[str, Callable[[DescribedVariable], Entry | None]] = {
    "value": lambda each: each.value_entry,
    "low limit": lambda each: each.section.entries.get("lowlimit"),
    "high limit": lambda each: each.section.entries.get("highlimit"),
}
"""Entry of the number that is compared, by aspect."""


def _as_written(aspect: str, texts: tuple[str, str], *variables: DescribedVariable) -> Iterator[str]:
    """Yield both texts, with whole numbers in hexadecimal if one of the files writes them so."""
    entries = [ENTRIES[aspect](each) for each in variables] if aspect in ENTRIES else []
    # Numbers were compared in decimal; a COB-ID or a mapping is easier to recognise in hexadecimal.
    is_hexadecimal = any(each and each.value.lstrip().lower().startswith("0x") for each in entries)
    digits = 2 * max((each.type.size for each in variables if each.type), default=0) if is_hexadecimal else 0
    for text in texts:
        yield f"0x{int(text):0{digits}X}" if is_hexadecimal and text.isdecimal() else text


def _limit_of(key: str) -> Aspect:
    """Return the aspect of a limit; an omitted limit is that of the data type."""

    def limit(variable: DescribedVariable, node_id: int | None) -> str:
        number = variable.number(key)
        # Writing the type's own limits is the same as omitting them.
        if number is None and variable.type and variable.type.is_integer:
            number = Number(variable.type.low if key == "lowlimit" else variable.type.high)
        return _number(number, node_id) if number else ABSENT

    return limit


def _number(number: Number, node_id: int | None) -> str:
    return f"{values.NODE_ID}+{number.value}" if number.relative and node_id is None else str(number.at(node_id or 0))


def _value(variable: DescribedVariable, node_id: int | None) -> str:
    """Format a variable's value; PDO mappings and COB-IDs are left to `_pdos`, which compares their meaning."""
    text = variable.value_entry.value if variable.value_entry else ""
    # Different mapping entries may carry the same bits.
    is_cob_id = variable.sub == values.COB_ID and variable.index in values.COMMUNICATIONS
    if not text or variable.index in values.MAPPINGS or is_cob_id:
        return "" if text else ABSENT
    if variable.value and (variable.type is None or variable.type.is_integer):
        return _number(variable.value, node_id)
    if variable.type is values.OCTET_STRING:
        return text.replace(" ", "").lower()
    if variable.type in values.REALS:
        with suppress(ValueError, OverflowError):
            # As the type stores it: a node returns 0.10000000149 for 0.1.
            return repr(variable.type.read(variable.type.write(float(text))))
    return text


def _type(variable: DescribedVariable) -> str:
    """Return the name of a basic data type, or the number of any other."""
    if variable.type:
        return variable.type.name
    number = variable.number("datatype")
    return f"0x{number.value:04X}" if number else variable.section.text("datatype").lower() or ABSENT


_UNDIRECTED = {"rwr": "rw", "rww": "rw"}
"""Access types with a PDO direction, and the equivalent for an object that is not mappable."""


def _access(variable: DescribedVariable) -> str:
    if variable.is_mappable:
        return variable.access or ABSENT
    return _UNDIRECTED.get(variable.access, variable.access) or ABSENT


ASPECTS: Mapping[str, Aspect] = {
    "type": lambda each, _: _type(each),
    "access": lambda each, _: _access(each),
    "low limit": _limit_of("lowlimit"),
    "high limit": _limit_of("highlimit"),
    "value": _value,
    "mappable": lambda each, _: "yes" if each.is_mappable else "no",
}
NAMES: Mapping[str, Aspect] = {"name": lambda each, _: each.name or ABSENT}


def _pdos(one: LintedDevice, other: LintedDevice, node_id: int | None) -> Iterator[EdsDifference]:
    """Compare the PDOs that both have."""
    left, right = ({each.index: each for each in device.pdos} for device in (one, other))
    for index in left.keys() & right.keys():
        pdo = left[index]
        pdos = (left[index], right[index])
        yield EdsDifference((index, values.COB_ID), f"{pdo.title} COB-ID", *(cob_id(each, node_id) for each in pdos))
        yield EdsDifference((pdo.mapping_index, -1), f"{pdo.title} mapping", *map(mapping, pdos))


def cob_id(pdo: DescribedRecords, node_id: int | None) -> str:
    """Format a PDO's COB-ID: identifier and set upper bits."""
    number = pdo.value(1)
    if number is None:
        return ABSENT
    value = number.at(node_id or 0)
    is_relative = number.relative and node_id is None
    identifier = values.identifier(value) & ~values.EXTENDED
    bits = {"not valid": value & values.NOT_VALID, "29 bits": value & values.EXTENDED, "no RTR": value & values.NO_RTR}
    first = f"{values.NODE_ID}+0x{identifier:03X}" if is_relative else f"0x{identifier:03X}"
    return ", ".join([first, *(name for name, bit in bits.items() if bit)])


def mapping(pdo: DescribedRecords) -> str:
    """Format a PDO's mapping as bit ranges, each with its object."""
    if pdo.amount is None:
        return ABSENT
    if pdo.is_multiplexed:
        return f"multiplexed ({pdo.amount.value})"
    start = 0
    parts = []
    for each, _ in pdo.mapped():
        parts.append(f"{start}..{start + each.bits - 1} {each.where}")
        start += each.bits
    return "; ".join(parts) or "no data"


# A live node


def readable(device: LintedDevice) -> list[Address]:
    """Return the addresses of variables that can be read from a node and compared, in order."""
    found = variables(device).items()
    return sorted(address for address, each in found if each.access != "wo" and each.type is not values.DOMAIN)


Answers: TypeAlias = Mapping[Address, bytes | int]
"""A node's answers to SDO reads by address: the data, or the abort code."""


def compare_live(
    device: LintedDevice, answers: Answers, node_id: int, process_data: Container[Address] = frozenset()
) -> list[EdsDifference]:
    """Compare a file with a node's answers to SDO reads.

    Objects in `process_data`, measured values and states only have to exist. For a DCF, an object without
    ParameterValue may be missing, and one that cannot be written may differ from its default.
    """
    device = followed(device, node_id)
    known = variables(device)
    if device.node_id is not None:
        said = {each for each in answers if known[each].section.text("parametervalue")}
        given = {each for each, answer in answers.items() if isinstance(answer, bytes) and known[each].is_writable}
        answers = {address: answer for address, answer in answers.items() if address in said | given}
    missing = [each for address, answer in answers.items() for each in _unread(known[address], address, answer)]
    # As the answers become a second device, a node is compared by the same rules as two files.
    return sorted([*_named(missing, device), *compare(device, _overlaid(device, answers, process_data), node_id)])


def _unread(variable: DescribedVariable, address: Address, answer: bytes | int) -> Iterator[EdsDifference]:
    """Yield a difference for an object that a node does not have, does not give, or gives in another length."""
    if answer == AbortCode.NO_DATA:  # the object is there but empty, such as an error field without errors
        return
    if isinstance(answer, int):
        is_missing = answer in (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX)
        answered = ABSENT if is_missing else f"abort {code_and_reason(answer)}"
        yield EdsDifference(address, "on the node", _presence(variable), answered)
    elif variable.type and variable.type.bits and len(answer) != variable.type.size:
        yield EdsDifference(address, "bytes", str(variable.type.size), str(len(answer)))


def _overlaid(device: LintedDevice, answers: Answers, process_data: Container[Address]) -> LintedDevice:
    """Return the device with the values that were read, for variables with a value in the file."""
    sections = dict(device.document.sections)
    for (index, sub), variable in variables(device).items():
        text = _read_text(variable, answers.get((index, sub)), device.document.text_encoding)
        # A mappable variable that cannot be written is measured.
        is_measured = variable.is_mappable and not variable.is_writable
        is_configured = not is_measured and index not in STATE and (index, sub) not in process_data
        if text is not None and is_configured and variable.value_entry is not None:
            whole = device.objects[index]
            section = variable.section
            entry = Entry("ParameterValue", text, section.line, section.column)
            # A compact object has one section; values that were read need one for each sub-index.
            name = f"{index:04X}sub{sub:X}" if whole.compact or whole.code in COMPOSED else f"{index:04X}"
            sections[name.lower()] = section._replace(name=name, entries={**section.entries, "parametervalue": entry})
    return LintedDevice(Document(sections), device.name)


def _read_text(variable: DescribedVariable, answer: bytes | int | None, encoding: str) -> str | None:
    """Format an answer as a file in this encoding would write the value; None if there is none."""
    if not isinstance(answer, bytes) or variable.type is None:  # `_unread` reports an abort
        return None
    if variable.type.is_integer:
        return str(int.from_bytes(answer, "little", signed=variable.type.is_signed))
    if variable.type in values.REALS and len(answer) == variable.type.size:
        return repr(variable.type.read(answer))
    if variable.type is values.OCTET_STRING:
        return answer.hex()
    kind = "utf-16-le" if variable.type is values.UNICODE_STRING else encoding
    return answer.decode(kind, "backslashreplace").rstrip("\0")
