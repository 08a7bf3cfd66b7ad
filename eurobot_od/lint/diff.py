"""Compares two object dictionaries by meaning: objects, types, limits, values, identifiers, and mappings bit by bit.

Notation does not count: number base, order, case, comments, compact or written out. A file's value is its
ParameterValue, or else its DefaultValue. Names count only on request.
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
from eurobot_od.od.description import COMPOSED, DescribedRecords, DescribedVariable
from eurobot_od.od.document import Document, Entry, read_bytes
from eurobot_od.od.formats import no_objects
from eurobot_od.od.renumbering import following
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER, RESTORE, STORE
from eurobot_od.od.values import Address, Number
from eurobot_od.sdo.wire import AbortCode, code_and_reason
from eurobot_od.support.texts import one_line

ABSENT = "-"
STATE = (ERROR_REGISTER[0], 0x1002, ERROR_FIELD, STORE, RESTORE)
"""Objects whose value is a running node's state, not its configuration."""

WHOLE_DEVICE = (-1, -1)
"""Address of a difference that belongs to no object."""


class EdsDifference(NamedTuple):
    """One difference: where (a sub-index below 0: in the whole object), in what, the two texts, the object's name."""

    where: Address
    aspect: str
    left: str
    right: str
    name: str = ""

    def __str__(self) -> str:
        where = f"{place(self.where)} {self.name}".rstrip()
        return one_line(f"{where}: {self.aspect}: {self.left} -> {self.right}")


def place(address: Address) -> str:
    """Write where a difference is: `device`, 0x1018, 0x1018 sub 1."""
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
    """Compare two devices, for a node-ID if one is given or one of them is a DCF; ordered by index and sub-index."""
    nodes = {each.node_id for each in (left, right)} - {None}
    if len(nodes) == 1:  # of DCFs of two nodes, what follows the node-ID stays relative
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
    """Return a device for a comparison at a node-ID: if it has another one, its values that follow that say so."""
    if device.node_id in (None, node_id):
        return device
    sections = dict(device.document.sections)
    for variable, text in following(device, device.node_id or 0):
        name = variable.section.name.lower()
        if name in sections:  # sub-indices of a compact object have none of their own
            sections[name] = sections[name].saying(ParameterValue=text)
    return LintedDevice(device.document._replace(sections=sections), device.name)


def _named(found: Iterable[EdsDifference], *devices: LintedDevice) -> list[EdsDifference]:
    """Return differences with the names of their objects, from the first device that has what they are in."""
    return [
        each._replace(
            # a name with its record's tells more than the record's alone, which is all that the other file may have
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
    """Compare the bit rates of both devices, and the kinds of their objects."""
    rates = (", ".join(map(str, sorted(bit_rates(each)))) or "none" for each in (one, other))
    yield EdsDifference(WHOLE_DEVICE, "bit rates", *rates)
    # What only one of them has is reported here, once; its sub-indices would repeat it.
    for index in one.objects.keys() | other.objects.keys():
        objects = (each.objects.get(index) for each in (one, other))
        kinds = (ABSENT if each is None else each.code.name if each.code else "unknown" for each in objects)
        yield EdsDifference((index, -1), "object", *kinds)


def variables(device: LintedDevice) -> dict[Address, DescribedVariable]:
    """Return all variables of a device, compact ones written out."""
    return {(each.index, each.sub): each for whole in device.objects.values() for each in whole.variables()}


def _shared(one: LintedDevice, other: LintedDevice) -> Iterator[tuple[int, Members, Members]]:
    """Yield the objects that both have, one at a time: a small file may describe millions of sub-indices."""
    for index in one.objects.keys() & other.objects.keys():
        left, right = ({each.sub: each for each in device.objects[index].variables()} for device in (one, other))
        yield index, left, right


def _presence(variable: DescribedVariable | None) -> str:
    return "there" if variable else ABSENT


Members: TypeAlias = dict[int, DescribedVariable]
"""The variables of an object by sub-index."""

Aspect = Callable[[DescribedVariable, int | None], str]
"""Writes one aspect of a variable, for a node-ID; without one, what depends on it stays relative."""


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
"""The entry that holds the number of an aspect."""


def _as_written(aspect: str, texts: tuple[str, str], *variables: DescribedVariable) -> Iterator[str]:
    """Yield two texts, whole numbers in hexadecimal if one of the files writes it so."""
    entries = [ENTRIES[aspect](each) for each in variables] if aspect in ENTRIES else []
    # Numbers were compared in decimal digits; a COB-ID or a mapping is recognised in hexadecimal ones only.
    is_hexadecimal = any(each and each.value.lstrip().lower().startswith("0x") for each in entries)
    digits = 2 * max((each.type.size for each in variables if each.type), default=0) if is_hexadecimal else 0
    for text in texts:
        yield f"0x{int(text):0{digits}X}" if is_hexadecimal and text.isdecimal() else text


def _limit_of(key: str) -> Aspect:
    """Make the aspect of a limit; without one it is the type's."""

    def limit(variable: DescribedVariable, node_id: int | None) -> str:
        number = variable.number(key)
        # A file that writes the type's own limits says no more than one that leaves them out.
        if number is None and variable.type and variable.type.is_integer:
            number = Number(variable.type.low if key == "lowlimit" else variable.type.high)
        return _number(number, node_id) if number else ABSENT

    return limit


def _number(number: Number, node_id: int | None) -> str:
    return f"{values.NODE_ID}+{number.value}" if number.relative and node_id is None else str(number.at(node_id or 0))


def _value(variable: DescribedVariable, node_id: int | None) -> str:
    """Write a variable's value, but not of PDO mappings and COB-IDs, which are compared as bits and identifiers."""
    text = variable.value_entry.value if variable.value_entry else ""
    # `_pdos` compares these by what they mean: two mappings may carry the same bits in other words.
    is_cob_id = variable.sub == values.COB_ID and variable.index in values.COMMUNICATIONS
    if not text or variable.index in values.MAPPINGS or is_cob_id:
        return "" if text else ABSENT
    if variable.value and (variable.type is None or variable.type.is_integer):
        return _number(variable.value, node_id)
    if variable.type is values.OCTET_STRING:
        return text.replace(" ", "").lower()
    if variable.type in values.REALS:
        with suppress(ValueError, OverflowError):
            # as the type holds it: a node gives 0.1 back as 0.10000000149
            return repr(variable.type.read(variable.type.write(float(text))))
    return text


def _type(variable: DescribedVariable) -> str:
    """Write a variable's type: the name of a basic one, the number of any other."""
    if variable.type:
        return variable.type.name
    number = variable.number("datatype")
    return f"0x{number.value:04X}" if number else variable.section.text("datatype").lower() or ABSENT


_UNDIRECTED = {"rwr": "rw", "rww": "rw"}
"""Access types that say in which direction an object goes in PDOs, and what they say of one that goes in none."""

ASPECTS: Mapping[str, Aspect] = {
    "type": lambda each, _: _type(each),
    "access": lambda each, _: (
        (each.access if each.is_mappable else _UNDIRECTED.get(each.access, each.access)) or ABSENT
    ),
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
        pdo, pdos = left[index], (left[index], right[index])
        yield EdsDifference((index, values.COB_ID), f"{pdo.title} COB-ID", *(cob_id(each, node_id) for each in pdos))
        yield EdsDifference((pdo.mapping_index, -1), f"{pdo.title} mapping", *map(mapping, pdos))


def cob_id(pdo: DescribedRecords, node_id: int | None) -> str:
    """Write a PDO's COB-ID: identifier, and what its upper bits mean."""
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
    """Write a PDO's mapping as bits: which of them are which object."""
    if pdo.amount is None:
        return ABSENT
    if pdo.is_multiplexed:
        return f"multiplexed ({pdo.amount.value})"
    start, parts = 0, []
    for each, _ in pdo.mapped():
        parts.append(f"{start}..{start + each.bits - 1} {each.where}")
        start += each.bits
    return "; ".join(parts) or "no data"


# A live node


def readable(device: LintedDevice) -> list[Address]:
    """Return the variables that can be read from a node and compared, in order."""
    found = variables(device).items()
    return sorted(address for address, each in found if each.access != "wo" and each.type is not values.DOMAIN)


Answers: TypeAlias = Mapping[Address, bytes | int]
"""What a node answers when its objects are read: an object's bytes, or the abort code."""


def compare_live(
    device: LintedDevice, answers: Answers, node_id: int, process_data: Container[Address] = frozenset()
) -> list[EdsDifference]:
    """Compare a file with a node's answers to SDO reads; process data and states only have to be there.

    A DCF describes one device: an object that it gives no value
    need not be there, and one that cannot be written need not have its default.
    """
    device = followed(device, node_id)
    known = variables(device)
    if device.node_id is not None:
        # Where the DCF has no value, an abort is not a difference, and what cannot be written need not be the default.
        said = {each for each in answers if known[each].section.text("parametervalue")}
        given = {each for each, answer in answers.items() if isinstance(answer, bytes) and known[each].is_writable}
        answers = {address: answer for address, answer in answers.items() if address in said | given}
    missing = [each for address, answer in answers.items() for each in _unread(known[address], address, answer)]
    # The answers as a file of their own: so a live node is compared by the same rules as two files.
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
    """Return the device with the values that were read, where the file has some to compare them with."""
    sections = dict(device.document.sections)
    for (index, sub), variable in variables(device).items():
        text = _read_text(variable, answers.get((index, sub)), device.document.text_encoding)
        # What can be mapped and not be written is measured; a setting is one although it can be mapped.
        is_measured = variable.is_mappable and not variable.is_writable
        is_configured = not is_measured and index not in STATE and (index, sub) not in process_data
        if text is not None and is_configured and variable.value_entry is not None:
            whole, section = device.objects[index], variable.section
            entry = Entry("ParameterValue", text, section.line, section.column)
            # a compact object is described by one section: what was read needs one for each sub-index
            name = f"{index:04X}sub{sub:X}" if whole.compact or whole.code in COMPOSED else f"{index:04X}"
            sections[name.lower()] = section._replace(name=name, entries={**section.entries, "parametervalue": entry})
    return LintedDevice(Document(sections), device.name)


def _read_text(variable: DescribedVariable, answer: bytes | int | None, encoding: str) -> str | None:
    """Write what was read as a file in this encoding would; None if nothing was."""
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
