"""A device's object dictionary as C for CANopenNode 4: `OD.h` and `OD.c`, as its `CO_ODinterface.h` declares them.

Objects and variables have the names of CANopenNode's own editor, so that applications for its files compile with these,
too. CANopenNode's own properties in a file are used (`CO_storageGroup`, `CO_countLabel`, `CO_accessSRDO`,
`CO_stringLengthMin`); for other files, the tables of this module replace them.

The same device always gives the same bytes, which compile without warnings.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.export import c
from eurobot_od.od import objects as od
from eurobot_od.od import standard, values
from eurobot_od.od.description import SIMPLE, DescribedObject, DescribedVariable, ObjectCode
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import Document
from eurobot_od.od.values import DATA_TYPES, DataType

C_TYPES = {
    values.BOOLEAN.code: "bool_t",
    values.REAL32.code: "float32_t",
    values.REAL64.code: "float64_t",
    values.VISIBLE_STRING.code: "char",
    values.UNICODE_STRING.code: "uint16_t",
    **{
        each.code: f"{'int' if each.is_signed else 'uint'}{each.bits}_t"
        for each in DATA_TYPES.values()
        if each.is_integer and each.bits in (8, 16, 32, 64)
    },
}
"""C types by data type; every other type is bytes (CANopenNode, objectDictionary.md, CANopen basic data types)."""

BYTES = "uint8_t"

ROOM_FOR_TEXT = 32
"""Length of a writable text without a given length, in bytes."""

SDO_ACCESS = {"ro": "ODA_SDO_R", "const": "ODA_SDO_R", "wo": "ODA_SDO_W", values.NO_ACCESS: ""}
PDO_ACCESS = {"ro": "ODA_TPDO", "const": "ODA_TPDO", "rwr": "ODA_TPDO", "wo": "ODA_RPDO", "rww": "ODA_RPDO"}
SRDO_ACCESS = {"tx": "ODA_TSRDO", "rx": "ODA_RSRDO", "trx": "ODA_TRSRDO"}

LABELS: Mapping[range, str] = {
    range(0x1000, 0x1001): "NMT",
    range(0x1001, 0x1002): "EM",
    range(0x1005, 0x1006): "SYNC",
    range(0x1006, 0x1007): "SYNC_PROD",
    range(0x1010, 0x1011): "STORAGE",
    range(0x1012, 0x1013): "TIME",
    range(0x1014, 0x1015): "EM_PROD",
    range(0x1016, 0x1017): "HB_CONS",
    range(0x1017, 0x1018): "HB_PROD",
    standard.SDO_SERVERS: "SDO_SRV",
    standard.SDO_CLIENTS: "SDO_CLI",
    range(0x1300, 0x1301): "GFC",
    standard.SRDOS: "SRDO",
    **{values.COMMUNICATION_RECORDS[each]: each.name for each in values.PdoDirection},
}
"""Count labels by index, by which the stack counts its services (CANopenNode, objectDictionary.md, requirements)."""

STACKS_NAMES = {
    0x1010: ("storeParameters",),
    0x1011: ("restoreDefaultParameters",),
    0x1018: ("identity", "highestSub_indexSupported", "vendor_ID", "productCode", "revisionNumber", "serialNumber"),
}
"""Names of objects and sub-indices that CANopenLinux and other ports of the stack use."""

COUNTED = ("NMT", "HB_CONS", "EM", "SDO_SRV", "SDO_CLI", "TIME", "SYNC", "RPDO", "TPDO", "GFC", "SRDO")
SIZED = (0x1016, 0x1003)
ENTERED = (
    *(0x1017, 0x1016, 0x1001, 0x1014, 0x1015, 0x1003, 0x1200, 0x1280, 0x1012, 0x1005, 0x1006, 0x1007, 0x1019),
    *(0x1400, 0x1600, 0x1800, 0x1A00, 0x1300, 0x1301, 0x1381, 0x13FE, 0x13FF),
)
NOT_OF_THE_DICTIONARY = ("LEDS", "LSS_SLV", "LSS_MST", "GTWA", "TRACE")
"""Parts of a configuration for several dictionaries (CO_config_t): counts, sizes, entries, and counts that are 0."""


class CMember(NamedTuple):
    """A variable at a sub-index: its name in the struct, and its description for the stack.

    `room` is the number of elements of its C type, 0 for a single value; `length` its length in an SDO in bytes;
    `value` its initial value, empty for a variable without memory, which the stack or the application serves.
    """

    sub: int
    name: str
    type: str
    room: int
    length: int
    attributes: str
    value: str

    @property
    def shape(self) -> tuple[object, ...]:
        """Properties that all elements of a C array have in common."""
        return self.type, self.room, self.length, self.attributes, bool(self.value)

    @property
    def whole_type(self) -> str:
        """C type with its number of elements, such as `char[5]`."""
        return f"{self.type}{self.size}"

    @property
    def size(self) -> str:
        """Number of elements in a declaration."""
        return f"[{self.room}]" if self.room else ""

    @property
    def first(self) -> str:
        """Suffix for the address of its first element."""
        return "[0]" if self.room else ""


class CObject(NamedTuple):
    """An object: index, name, kind in C (VAR, ARR, REC), storage group, count label, and variables."""

    object_index: int
    name: str
    kind: str
    group: str
    label: str
    variables: Sequence[CMember]

    @property
    def member(self) -> str:
        """Name in the struct of its storage group."""
        return f"x{self.number}_{self.name}"

    @property
    def number(self) -> str:
        """Index in four hexadecimal digits."""
        return f"{self.object_index:04X}"


def object_dictionary(
    dictionary: Dictionary, name: str = "OD", groups: Mapping[int, str] | None = None
) -> dict[str, str]:
    """Return `OD.h` and `OD.c` by name; `groups` are storage groups by index, which override those of the file.

    Raises DictionaryError for a value that does not fit its data type.
    """
    objects = _ObjectReader(dictionary, groups or {}).objects()
    return {f"{name}.h": "\n".join(_header(objects, dictionary, name)), f"{name}.c": "\n".join(_source(objects, name))}


IDENTIFIER = re.compile("[A-Za-z][A-Za-z0-9_]{0,30}")


def storage_groups(pairs: Iterable[tuple[str, str]], name: str) -> dict[int, str]:
    """Parse storage groups by index, and check the prefix of all identifiers; raises LocalError."""
    groups = {}
    for index, group in pairs:
        number = values.parse_number(f"0x{index.lower().removeprefix('0x')}")
        if number is None or number.value not in range(values.FIRST, 0x10000):
            raise LocalError(f"{index}={group}: the index is not in 1000..FFFF")
        groups[number.value] = group
    for each in (name, *groups.values()):
        if not IDENTIFIER.fullmatch(each):
            raise LocalError(f"{each!r} is not a C identifier of up to 31 letters, digits and _")
    return groups


# Reading the file


class _ObjectReader:
    """Reads the objects of a device as C."""

    def __init__(self, dictionary: Dictionary, groups: Mapping[int, str]) -> None:
        self._dictionary = dictionary
        self._groups = {**_commented_groups(dictionary.document), **groups}
        sections = dictionary.device.document.sections.values()
        has_properties = any(key.startswith("co_") for each in sections for key in each.entries)
        # In a file of CANopenNode, a variable without a value has no memory.
        self._is_stacks_own = has_properties or len(self._groups) > len(groups)
        stores = dictionary.members.get(standard.STORE, {})
        self._application = "PERSIST_APP" if {1, 3} & stores.keys() else "RAM"  # all parameters, or the application's

    def objects(self) -> list[CObject]:
        """Return all objects from 0x1000 on, by index."""
        device, members = self._dictionary.device, self._dictionary.members
        found = (device.objects[index] for index in sorted(members) if index >= values.FIRST)
        return [self._object(each, [sub for sub in members[each.index] if sub != values.STRUCTURE]) for each in found]

    def _object(self, each: DescribedObject, subs: Iterable[int]) -> CObject:
        own = STACKS_NAMES.get(each.index, ())
        taken: set[str] = set()
        variables = []
        for sub in sorted(subs):
            described = each.subs[sub]
            name = own[sub + 1] if sub + 1 < len(own) else _member_name(described.name, sub, taken)
            taken.add(name)
            variables.append(self._variable(described, name))
        said = each.place.text
        group = self._groups.get(each.index) or said("co_storagegroup") or self._group(each.index)
        label = said("co_countlabel") or next((LABELS[some] for some in LABELS if each.index in some), "")
        name = own[0] if own else c_name(each.name)
        return CObject(each.index, name, _kind(each, variables), group, label, variables)

    def _group(self, index: int) -> str:
        """Return the storage group of an object without one in the file."""
        is_setting = any((index, sub) in self._dictionary.parameters for sub in self._dictionary.members[index])
        if index in range(values.FIRST, 0x2000):
            return "PERSIST_COMM" if is_setting or index == standard.IDENTITY else "RAM"
        return self._application if is_setting and not self._is_stacks_own else "RAM"

    def _variable(self, described: DescribedVariable, name: str) -> CMember:
        type_ = described.type or values.DOMAIN
        text = described.value_entry.value if described.value_entry else ""
        least = values.parse_number(described.section.text("co_stringlengthmin"))
        room, value = self._value(described, type_, text, least.value if least else 0)
        c_type = C_TYPES.get(type_.code, BYTES)
        is_text = type_ in (values.VISIBLE_STRING, values.UNICODE_STRING)
        length = type_.size or room * (2 if c_type == "uint16_t" else 1)
        attributes = (
            SDO_ACCESS.get(described.access, "ODA_SDO_RW"),
            PDO_ACCESS.get(described.access, "ODA_TRPDO") if described.is_mappable else "",
            SRDO_ACCESS.get(described.section.text("co_accesssrdo"), ""),
            "ODA_MB" if type_.size > 1 and type_.code in C_TYPES else "",
            "ODA_STR" if is_text else "",
        )
        # One more element for the final 0 of a text.
        elements = room + (is_text and bool(value))
        return CMember(
            described.sub, name, c_type, elements, length, " | ".join(filter(None, attributes)) or "0", value
        )

    def _value(self, described: DescribedVariable, type_: DataType, text: str, least: int) -> tuple[int, str]:
        """Return the number of elements, 0 for a single value, and the initial value, empty without memory."""
        is_served = type_ == values.DOMAIN or described.index == standard.ERROR_FIELD or self._is_stacks_own
        if not text and is_served and not least:
            return 0, ""
        if type_.is_integer:
            number = self._number(described, type_)
            if type_.code in C_TYPES:
                return 0, _integer_text(number, type_)
            return type_.size, _bytes_text(number.to_bytes(type_.size, "little", signed=type_.is_signed))
        data = self._data(described, type_, text)
        if type_ in values.REALS:
            return 0, _real_text(type_, data)
        if type_.size:
            return type_.size, _bytes_text(data.ljust(type_.size, b"\0"))
        if not least and not self._is_stacks_own and described.is_writable:
            least = ROOM_FOR_TEXT
        width = 2 if type_ == values.UNICODE_STRING else 1
        room = max(len(data) // width, least, 1)
        return room, _text(data) if type_ == values.VISIBLE_STRING else _bytes_text(data, width)

    def _data(self, described: DescribedVariable, type_: DataType, text: str) -> bytes:
        """Return the bytes in an SDO of a value that is not an integer."""
        if type_ == values.VISIBLE_STRING:  # in the file's encoding, because canopen supports only ASCII
            return text.encode(self._dictionary.document.text_encoding)
        variable = self._dictionary.variable((described.index, described.sub))
        return (od.default_bytes(variable) if variable is not None and text else None) or b""

    def _number(self, described: DescribedVariable, type_: DataType) -> int:
        """Return a number without the node-ID, which the stack adds; raises DictionaryError."""
        number = described.value.value if described.value else 0
        if not type_.low <= number <= type_.high:
            what = f"{described.where}: value {number} is not {type_.allowed}"
            raise DictionaryError(self._dictionary.file, None, what)
        return number


def _commented_groups(document: Document) -> dict[int, str]:
    """Return the storage groups from comments that CANopenNode's editor writes into an EDS, by index."""
    found: dict[int, str] = {}
    index = None
    for line in document.lines:
        if head := re.fullmatch(r"\[([0-9A-F]{4})\]", line.strip(), re.IGNORECASE):
            index = int(head[1], 16)
        elif index is not None and (said := re.fullmatch(r";?StorageLocation=(\w+)", line.strip())):
            found.setdefault(index, said[1])
    return found


def _kind(each: DescribedObject, variables: Sequence[CMember]) -> str:
    """Return an object's kind in C; a C array needs equal elements from sub-index 1 on."""
    if each.code in SIMPLE:
        return "VAR"
    is_whole = len(variables) > 1 and [v.sub for v in variables] == list(range(len(variables)))
    is_whole = is_whole and len(STACKS_NAMES.get(each.index, ())) < 2  # their variables have names
    is_even = is_whole and variables[0].type == BYTES and all(a.shape == b.shape for a, b in pairwise(variables[1:]))
    return "ARR" if each.code is ObjectCode.ARRAY and is_even and not variables[0].room else "REC"


# Names


def c_name(text: str) -> str:
    """Return the C name of a ParameterName as in CANopenNode's editor: `COB_ID_EMCY` for `COB-ID EMCY`."""
    words = [each for each in re.split(r"\W+", text.replace("-", "_"), flags=re.ASCII) if each]
    name = ""
    for word in words:
        between = "_" if name[-1:].isupper() and word[0].isupper() else ""
        name += between + (word[0].upper() + word[1:] if len(word) > 1 else word)
    if name[:1].isdigit():
        return f"_{name}"
    is_lower = len(name) == 1 or name[1:2].islower()
    return name[:1].lower() + name[1:] if is_lower else name


RESERVED = frozenset(c.WORDS.split())


def _member_name(text: str, sub: int, taken: set[str]) -> str:
    """Return a unique name of a variable in the struct of its record."""
    name = c_name(text) or f"sub{sub:X}"
    if name.lower() in RESERVED:
        name += "_"
    while name in taken:
        name += f"_{sub:X}"
    return name


# Values


def _integer_text(number: int, type_: DataType) -> str:
    if type_ == values.BOOLEAN:
        return "true" if number else "false"
    return c.signed(number, type_.bits) if type_.is_signed else c.unsigned(number, type_.bits)


def _real_text(type_: DataType, data: bytes) -> str:
    number = type_.read(data) if data else 0.0
    suffix = "f" if type_ == values.REAL32 else ""
    divided = {"inf": "1.0", "-inf": "-1.0", "nan": "0.0"}.get(str(number))  # C99 has no literal for these
    return f"({divided}{suffix} / 0.0{suffix})" if divided else f"{number!r}{suffix}"


def _bytes_text(data: bytes, width: int = 1) -> str:
    numbers = (int.from_bytes(data[at : at + width], "little") for at in range(0, len(data), width))
    return f"{{{', '.join(f'0x{each:0{2 * width}X}' for each in numbers) or '0'}}}"


def _text(data: bytes) -> str:
    """Return the literal of a text, with octal escapes, which always have three digits."""
    plain = (chr(each) if each in range(0x20, 0x7F) and each not in b'"\\?' else f"\\{each:03o}" for each in data)
    return f'"{"".join(plain)}"'


# The files

BANNER = "/* {} */"


def _banner(text: str) -> list[str]:
    return ["", BANNER.format(text)]


def _header(objects: Sequence[CObject], dictionary: Dictionary, name: str) -> Iterator[str]:
    about = dictionary.device.document
    maker, product = (about.text("deviceinfo", key) for key in ("vendorname", "productname"))
    yield f"/* Object dictionary for CANopenNode 4, made from {c.comment(dictionary.file.name)} by"
    yield f" * `canopen-workbench export canopennode`; do not edit. {c.comment(f'{maker} {product}'.strip())} */"
    yield f"#ifndef {name}_H"
    yield f"#define {name}_H"
    yield from _banner("How many objects of each kind there are")
    labels = [each.label for each in objects if each.label]
    yield from (f"#define {name}_CNT_{each} {labels.count(each)}" for each in dict.fromkeys(labels))
    yield from _banner("Elements of arrays")
    yield from (f"#define {_size_macro(each, name)} {_last_sub(each)}" for each in objects if _is_sized(each))
    yield from _banner("Values by storage group")
    for group in _groups(objects):
        yield "typedef struct {"
        yield from (line for each in objects if each.group == group for line in _declaration(each, name))
        yield f"}} {name}_{group}_t;"
        yield ""
    for group in [*_groups(objects), "OD"]:
        yield f"#ifndef {name}_ATTR_{group}"
        yield f"#define {name}_ATTR_{group}"
        yield "#endif"
        type_, variable = ("OD_t", f"*{name}") if group == "OD" else (f"{name}_{group}_t", f"{name}_{group}")
        yield f"extern {name}_ATTR_{group} {type_} {variable};"
        yield ""
    yield BANNER.format("Entries by index, and by index and name")
    for text in ("{0.number}", "{0.number}_{0.name}"):
        for at, each in enumerate(objects):
            yield f"#define {name}_ENTRY_H{text.format(each)} &{name}->list[{at}]"
    yield from _configuration(objects, name)
    yield ""
    yield "#endif"
    yield ""


def _groups(objects: Iterable[CObject]) -> list[str]:
    """Return the storage groups with memory, in the order of their first objects."""
    return list(dict.fromkeys(each.group for each in objects if any(v.value for v in each.variables)))


def _is_sized(each: CObject) -> bool:
    return each.kind == "ARR" or each.object_index in SIZED


def _last_sub(each: CObject) -> int:
    return max(variable.sub for variable in each.variables)


def _size_macro(each: CObject, name: str) -> str:
    return f"{name}_CNT_ARR_{each.number}"


def _declaration(each: CObject, name: str) -> Iterator[str]:
    """Yield the members of an object in the struct of its storage group."""
    stored = [variable for variable in each.variables if variable.value]
    if each.kind == "VAR":
        yield from (f"    {v.type} {each.member}{v.size};" for v in stored)
    elif each.kind == "ARR":
        zero, first = each.variables[:2]
        if zero.value:
            yield f"    {zero.type} {each.member}_sub0;"
        if first.value:
            yield f"    {first.type} {each.member}[{_size_macro(each, name)}]{first.size};"
    elif stored:
        yield "    struct {"
        yield from (f"        {v.type} {v.name}{v.size};" for v in stored)
        yield f"    }} {each.member};"


def _configuration(objects: Sequence[CObject], name: str) -> Iterator[str]:
    """Yield the macro for a program with several object dictionaries (CO_MULTIPLE_OD)."""
    labels, indices = {each.label for each in objects}, {each.object_index for each in objects}
    counts = [(f"CNT_{each}", f"{name}_CNT_{each}" if each in labels else "0") for each in COUNTED]
    sizes = [(f"CNT_ARR_{i:04X}", f"{name}_CNT_ARR_{i:04X}" if i in indices else "0") for i in SIZED]
    entries = [(f"ENTRY_H{i:04X}", f"{name}_ENTRY_H{i:04X}" if i in indices else "NULL") for i in ENTERED]
    yield from _banner("For a program with several object dictionaries")
    yield "#ifdef CO_MULTIPLE_OD"
    yield f"#define {name}_INIT_CONFIG(config) {{ \\"
    for key, value in (*counts, *sizes, *entries, *((f"CNT_{each}", "0") for each in NOT_OF_THE_DICTIONARY)):
        yield f"    (config).{key} = {value}; \\"
    yield "}"
    yield "#endif"


def _source(objects: Sequence[CObject], name: str) -> Iterator[str]:
    yield f"/* Object dictionary for CANopenNode 4; see {name}.h. */"
    yield "#define OD_DEFINITION"
    yield '#include "301/CO_ODinterface.h"'
    yield f'#include "{name}.h"'
    yield ""
    yield "#if CO_VERSION_MAJOR < 4"
    yield "#error This object dictionary is for CANopenNode 4 and later."
    yield "#endif"
    yield from _banner("Values by storage group")
    for group in _groups(objects):
        yield f"{name}_ATTR_{group} {name}_{group}_t {name}_{group} = {{"
        yield from (line for each in objects if each.group == group for line in _initial(each))
        yield "};"
        yield ""
    yield BANNER.format("What the stack knows of each object")
    kinds = {"VAR": "var", "ARR": "array", "REC": "record"}
    yield "typedef struct {"
    for each in objects:
        size = f"[{len(each.variables)}]" if each.kind == "REC" else ""
        yield f"    OD_obj_{kinds[each.kind]}_t o_{each.number}_{each.name}{size};"
    yield f"}} {name}Objs_t;"
    yield ""
    yield f"static CO_PROGMEM {name}Objs_t {name}Objs = {{"
    yield from (line for each in objects for line in _known(each, name))
    yield "};"
    yield from _banner("The object dictionary")
    yield f"static {name}_ATTR_OD OD_entry_t {name}List[] = {{"
    for each in objects:
        number = f"0x{each.number}, 0x{len(each.variables):02X}"
        pointer = f"&{name}Objs.o_{each.number}_{each.name}"
        yield f"    {{{number}, ODT_{each.kind}, {pointer}, NULL}},"
    yield "    {0x0000, 0x00, 0, NULL, NULL}"
    yield "};"
    yield ""
    yield f"static OD_t _{name} = {{(sizeof({name}List) / sizeof({name}List[0])) - 1, &{name}List[0]}};"
    yield ""
    yield f"OD_t *{name} = &_{name};"
    yield ""


def _initial(each: CObject) -> Iterator[str]:
    """Yield the initial values of an object's members."""
    stored = [variable for variable in each.variables if variable.value]
    if each.kind == "VAR":
        yield from (f"    .{each.member} = {v.value}," for v in stored)
    elif each.kind == "ARR":
        if each.variables[0].value:
            yield f"    .{each.member}_sub0 = {each.variables[0].value},"
        if each.variables[1].value:
            yield f"    .{each.member} = {{{', '.join(v.value for v in each.variables[1:])}}},"
    elif stored:
        yield f"    .{each.member} = {{"
        yield from (f"        .{v.name} = {v.value}," for v in stored)
        yield "    },"


def _known(each: CObject, name: str) -> Iterator[str]:
    """Yield the stack's description of an object: addresses, attributes and lengths of its variables."""
    place = f"&{name}_{each.group}.{each.member}"
    head = f"    .o_{each.number}_{each.name} = {{"
    if each.kind == "VAR":
        (only,) = each.variables
        at = f"{place}{only.first}" if only.value else "NULL"
        yield f"{head}.dataOrig = {at}, .attribute = {only.attributes}, .dataLength = {only.length}}},"
    elif each.kind == "ARR":
        zero, first = each.variables[:2]
        at = f"{place}_sub0" if zero.value else "NULL"
        elements = f"{place}[0]{first.first}" if first.value else "NULL"
        yield f"{head}.dataOrig0 = {at}, .dataOrig = {elements},"
        yield f"        .attribute0 = {zero.attributes}, .attribute = {first.attributes},"
        yield f"        .dataElementLength = {first.length}, .dataElementSizeof = sizeof({first.whole_type})}},"
    else:
        yield head
        for v in each.variables:
            at = f"{place}.{v.name}{v.first}" if v.value else "NULL"
            described = f".subIndex = {v.sub}, .attribute = {v.attributes}, .dataLength = {v.length}"
            yield f"        {{.dataOrig = {at}, {described}}},"
        yield "    },"
