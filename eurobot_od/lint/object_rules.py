"""Rules about objects: their keys, sub-indices and values (CiA 306), and what CiA 301 says of single objects.

What CiA 301 says of an object's type, access or value is data in a table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from eurobot_od.lint.file_rules import Check, granularity
from eurobot_od.lint.findings import Problem, Problems, Rule
from eurobot_od.lint.model import LIMITS, VALUES, GivenValue, LintedDevice
from eurobot_od.od.description import COMPOSED, DescribedObject, DescribedVariable, ObjectCode, parse_section_name
from eurobot_od.od.document import Entry, Section
from eurobot_od.od.values import (
    ACCESS_TYPES,
    COMMUNICATION_RECORDS,
    DATA_TYPES,
    DOMAIN,
    EMCY_BASE,
    EXTENDED,
    MAPPING_RECORDS,
    NODE_ID,
    NODE_IDS,
    NOT_VALID,
    OCTET_STRING,
    REALS,
    SDO_REQUEST_BASE,
    SDO_RESPONSE_BASE,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    VISIBLE_STRING,
    DataType,
    Number,
    parse_number,
)

# Objects and their keys

CODES = frozenset(each.value for each in ObjectCode)
COMPLEX_TYPES = (range(0x20, 0x26), range(0x40, 0x260))
"""Data types of whole records (CiA 301: standard ones; manufacturer's and device profiles')."""
SUB_KEYS = ("subnumber", "compactsubobj")
VALUE_KEYS = ("datatype", "accesstype", "defaultvalue", "pdomapping", "lowlimit", "highlimit", "parametervalue")


def without_name(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects and sub-indices without ParameterName."""
    for name, section in device.object_sections:
        if not name.list and not section.text("parametername"):
            yield Problem(section.at("parametername"), f"[{section.name}] has no ParameterName")


def unknown_kind(device: LintedDevice) -> Iterator[Problem]:
    """Yield object types that do not exist."""
    for section, entry in device.entries("objecttype"):
        number = parse_number(entry.value)
        if entry.value and (number is None or number.value not in CODES):
            yield Problem(entry, f"ObjectType {entry.value[:20]} of [{section.name}] is none of 0, 2, 5, 6, 7, 8, 9")


def _simple(device: LintedDevice) -> Iterator[DescribedVariable]:
    """Give the variables that have a value of their own: VARs, sub-indices and compact templates."""
    return (each for each in device.variables if not each.section.text("objecttype").endswith("2"))


def without_type(device: LintedDevice) -> Iterator[Problem]:
    """Yield variables without DataType."""
    for each in _simple(device):
        if not each.section.text("datatype"):
            yield Problem(each.section.at("datatype"), f"[{each.section.name}] has no DataType")


def unknown_type(device: LintedDevice) -> Iterator[Problem]:
    """Yield data types that do not exist."""
    for section, entry in device.entries("datatype"):
        number = parse_number(entry.value)
        known = number and (number.value in DATA_TYPES or any(number.value in each for each in COMPLEX_TYPES))
        if entry.value and not known:
            yield Problem(entry, f"DataType {entry.value[:20]} of [{section.name}] is none that CiA 301 has")


def without_access(device: LintedDevice) -> Iterator[Problem]:
    """Yield variables without AccessType."""
    for each in _simple(device):
        if not each.access:
            yield Problem(each.section.at("accesstype"), f"[{each.section.name}] has no AccessType")


def unknown_access(device: LintedDevice) -> Iterator[Problem]:
    """Yield access types that do not exist."""
    for section, entry in device.entries("accesstype"):
        if entry.value and entry.value.lower() not in ACCESS_TYPES:
            text = f"AccessType {entry.value[:20]} of [{section.name}] is none of {', '.join(ACCESS_TYPES)}"
            yield Problem(entry, text)


def _composed(device: LintedDevice) -> Iterator[tuple[DescribedObject, Section]]:
    """Give arrays and records with their sections."""
    return ((o, o.section) for o in device.objects.values() if o.section and o.code in COMPOSED)


def orphans(device: LintedDevice) -> Iterator[Problem]:
    """Yield sub-indices and lists of an object that has no section."""
    for each in device.objects.values():
        if each.section is None:
            yield Problem(each.place, f"[{each.place.name}] has no object [{each.index:04X}]")


def sub_keys_on_variable(device: LintedDevice) -> Iterator[Problem]:
    """Yield keys about sub-indices in a VAR."""
    for key in SUB_KEYS:
        for section, entry in device.entries(key):
            kind = _object_of(device, section).code
            number = parse_number(entry.value)
            if kind in (ObjectCode.VAR, ObjectCode.DOMAIN) and entry.value and number != Number(0):
                yield Problem(entry, f"{entry.key} does not belong to [{section.name}], which has no sub-indices")


def _object_of(device: LintedDevice, section: Section) -> DescribedObject:
    """Return the object a section describes; a sub-index counts as an object of its own."""
    name = parse_section_name(section.name.strip())
    whole = device.objects[name.object_index] if name and name.sub < 0 else None
    return whole or DescribedObject(0, section, {}, {})


def value_keys_on_record(device: LintedDevice) -> Iterator[Problem]:
    """Yield keys about a value in an array or a record."""
    for each, section in _composed(device):
        for key in VALUE_KEYS if not each.compact else ():
            entry = section.entries.get(key)
            if entry and entry.value and (key != "pdomapping" or entry.value != "0"):
                yield Problem(
                    entry, f"{entry.key} does not belong to [{section.name}], whose values are its sub-indices"
                )


def subs_of_variable(device: LintedDevice) -> Iterator[Problem]:
    """Yield VARs that have sections for sub-indices."""
    for each in device.objects.values():
        sub = next((s for s in each.subs.values() if s.section is not each.section), None)
        if sub and each.code in (ObjectCode.VAR, ObjectCode.DOMAIN):
            yield Problem(sub.section, f"[{sub.section.name}] is a sub-index, but 0x{each.index:04X} is a VAR")


def without_sub_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield arrays and records that do not say how many sub-indices they have."""
    for each, section in _composed(device):
        if not section.text("subnumber") and not each.compact:
            yield Problem(section.at("subnumber"), f"[{section.name}] has no SubNumber")


def wrong_sub_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield a SubNumber that is not the number of sub-indices."""
    for each, section in _composed(device):
        said, real = parse_number(section.text("subnumber")), sum(sub != 0xFF for sub in each.subs)
        if said and said.value != real and not each.compact:
            yield Problem(
                section.at("subnumber"), f"SubNumber is {said.value}, but 0x{each.index:04X} has {real} sub-indices"
            )


def without_sub_0(device: LintedDevice) -> Iterator[Problem]:
    """Yield arrays and records without sub-index 0."""
    for each, section in _composed(device):
        if 0 not in each.subs and each.subs and not each.compact:
            yield Problem(section, f"0x{each.index:04X} has no sub-index 0")


def type_of_sub_0(device: LintedDevice) -> Iterator[Problem]:
    """Yield sub-indices 0 that are no UNSIGNED8."""
    for each, _ in _composed(device):
        zero = each.subs.get(0)
        if zero and zero.type not in (UNSIGNED8, None):
            yield Problem(zero.section.at("datatype"), f"[{zero.section.name}] is no UNSIGNED8")


def highest_sub(device: LintedDevice) -> Iterator[Problem]:
    """Yield constant sub-indices 0 whose value is not the highest sub-index; a writable one is a number of its own."""
    mappings = {index for indices in MAPPING_RECORDS.values() for index in indices}  # there sub 0 counts what is mapped
    for each, _ in _composed(device):
        zero, highest = each.subs.get(0), max((sub for sub in each.subs if sub != 0xFF), default=0)
        value = zero.value if zero and not zero.is_writable and each.index != 0x1003 else None
        if zero and value and highest and each.index not in mappings and value.value != highest:
            at = zero.place
            yield Problem(at, f"[{zero.section.name}] is {value.value}, but the highest sub-index is {highest}")


def mixed_array(device: LintedDevice) -> Iterator[Problem]:
    """Yield sub-indices of an array whose type is not that of sub-index 1."""
    for each, _ in _composed(device):
        types = {sub: v.section.text("datatype") for sub, v in each.subs.items() if 0 < sub < 0xFF}
        wrong = next(
            (sub for sub, text in types.items() if parse_number(text) != parse_number(types.get(1, text))), None
        )
        if wrong and each.code is ObjectCode.ARRAY:
            at = each.subs[wrong].section.at("datatype")
            yield Problem(at, f"sub {wrong} of array 0x{each.index:04X} has another type than sub 1")


def same_names(device: LintedDevice) -> Iterator[Problem]:
    """Yield sub-indices that are named like another one of the same object."""
    for each, _ in _composed(device):
        first: dict[str, DescribedVariable] = {}
        for sub in each.subs.values():
            if sub.name and first.setdefault(sub.name, sub) is not sub:
                text = f"sub {sub.sub} of 0x{each.index:04X} is named like sub {first[sub.name].sub}"
                yield Problem(sub.section.at("parametername"), text)


OBJECT_RULES = (
    Rule("E401", "An object and a sub-index have a ParameterName.", "CiA 306, object description", without_name),
    Rule("E402", "ObjectType is 0, 2, 5, 6, 7, 8 or 9.", "CiA 301, object codes", unknown_kind),
    Rule("E403", "A variable has a DataType.", "CiA 306, object description", without_type),
    Rule("E404", "DataType is one that CiA 301 has.", "CiA 301, data types", unknown_type),
    Rule("E405", "A variable has an AccessType.", "CiA 306, object description", without_access),
    Rule("E406", "AccessType is ro, wo, rw, rwr, rww or const.", "CiA 306, object description", unknown_access),
    Rule("E407", "A sub-index belongs to an object with a section.", "CiA 306, object description", orphans),
    Rule("E408", "A VAR has no SubNumber and no CompactSubObj.", "CiA 306, object description", sub_keys_on_variable),
    Rule("E409", "An array or record has no value of its own.", "CiA 306, object description", value_keys_on_record),
    Rule("E410", "A VAR has no sections for sub-indices.", "CiA 306, object description", subs_of_variable),
    Rule("E411", "An array or record has SubNumber or CompactSubObj.", "CiA 306, object description",
         without_sub_number),
    Rule("E412", "SubNumber is the number of sub-indices, without 0xFF.", "CiA 306, object description",
         wrong_sub_number),
    Rule("E413", "An array or record has sub-index 0.", "CiA 301, sub-index 0", without_sub_0),
    Rule("E414", "Sub-index 0 is an UNSIGNED8.", "CiA 301, sub-index 0", type_of_sub_0),
    Rule("E415", "A constant sub-index 0 is the highest sub-index.", "CiA 301, sub-index 0", highest_sub),
    Rule("W416", "The sub-indices of an array have one type.", "CiA 301, object codes", mixed_array),
    Rule("I417", "The sub-indices of an object have different names.",
         "custom; tools that look up by name find one only", same_names),
)  # fmt: skip

# CompactSubObj


def _compact(device: LintedDevice) -> Iterator[tuple[DescribedObject, Section]]:
    return ((o, o.section) for o in device.objects.values() if o.section and o.section.text("compactsubobj"))


def compact_kind(device: LintedDevice) -> Iterator[Problem]:
    """Yield compact descriptions of something else than an array."""
    for each, section in _compact(device):
        if each.compact and each.code not in (ObjectCode.ARRAY, ObjectCode.VAR, ObjectCode.DOMAIN, None):
            yield Problem(section.at("objecttype"), f"[{section.name}] has CompactSubObj, but is no array")


def compact_count(device: LintedDevice) -> Iterator[Problem]:
    """Yield counts of compact sub-indices outside 0 to 254."""
    for _, section in _compact(device):
        number = parse_number(section.text("compactsubobj"))
        if number is None or not 0 <= number.value <= 254:
            yield Problem(section.at("compactsubobj"), f"CompactSubObj of [{section.name}] is no number from 0 to 254")


def compact_and_sub_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects described both ways."""
    for each, section in _compact(device):
        number = parse_number(section.text("subnumber"))
        if each.compact and number and number.value:
            yield Problem(section.at("subnumber"), f"[{section.name}] has both SubNumber and CompactSubObj")


def entry_lists(device: LintedDevice) -> Iterator[Problem]:
    """Yield [xxxxName] and [xxxxValue] whose NrOfEntries is not the number of their entries."""
    for name, section in device.object_sections:
        if name.list:
            said, real = parse_number(section.text("nrofentries")), len(section.entries.keys() - {"nrofentries"})
            if said is None or said.value != real:
                yield Problem(
                    section.at("nrofentries"), f"NrOfEntries is not {real}, the number of entries of [{section.name}]"
                )


def entry_list_keys(device: LintedDevice) -> Iterator[Problem]:
    """Yield entries of [xxxxName] and [xxxxValue] for sub-indices that are not there."""
    for name, section in device.object_sections:
        highest = device.objects[name.object_index].compact if name.list else 0
        for key, entry in section.entries.items() if name.list else ():
            if key != "nrofentries" and not (key.isdecimal() and len(key) < 4 and 1 <= int(key) <= highest):
                yield Problem(entry, f"{entry.key[:20]} is no sub-index from 1 to {highest}")


COMPACT_RULES = (
    Rule("W420", "CompactSubObj describes arrays.",
         "CiA 306, CompactSubObj; public: dcf-tools takes it for records too, so only a warning", compact_kind),
    Rule("E421", "CompactSubObj is a number from 0 to 254.", "CiA 306, CompactSubObj", compact_count),
    Rule("E422", "An object has SubNumber or CompactSubObj, not both.", "CiA 306, CompactSubObj",
         compact_and_sub_number),
    Rule("E423", "NrOfEntries is the number of entries of [xxxxName] and [xxxxValue].", "CiA 306, CompactSubObj",
         entry_lists),
    Rule("E424", "[xxxxName] and [xxxxValue] name sub-indices of a compact object.", "CiA 306, CompactSubObj",
         entry_list_keys),
)  # fmt: skip

# Values

BOTH = (Number(0), Number(1))
NUMERIC_KEYS = ("subnumber", "objflags", "pdomapping", "objecttype", "datatype", "compactsubobj")


def no_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield entries that have to be numbers and are not."""
    numeric = (entry for key in NUMERIC_KEYS[:3] for _, entry in device.entries(key) if entry.value)
    malformed = [e for e in numeric if parse_number(e.value) is None]
    malformed += [each.entry for each in device.integers if each.number is None]
    for entry in malformed:
        if not is_wrong_octal(entry.value) and NODE_ID not in entry.value.upper():
            yield Problem(entry, f"{entry.key} {entry.value[:40]} is no number")


def is_wrong_octal(text: str) -> bool:
    """Whether a text is a number with a leading zero, hence octal, that has an 8 or a 9."""
    digits = text.removeprefix("-")
    return digits[:1] == "0" and digits.isdecimal() and len(digits) > 1 and bool(set(digits) & {"8", "9"})


def _octals(device: LintedDevice) -> Iterator[Entry]:
    """Give the entries whose value starts with a 0 and a further digit."""
    entries = [entry for key in NUMERIC_KEYS for _, entry in device.entries(key)]
    for entry in entries + [each.entry for each in device.integers]:
        if entry.value[:1] in "0-" and entry.value.removeprefix("-")[1:].strip("0").isdecimal():
            yield entry


def wrong_octal(device: LintedDevice) -> Iterator[Problem]:
    """Yield octal numbers with an 8 or a 9."""
    for entry in _octals(device):
        if is_wrong_octal(entry.value):
            yield Problem(entry, f"{entry.key} {entry.value[:40]} is octal (it starts with 0), but has an 8 or a 9")


def octal(device: LintedDevice) -> Iterator[Problem]:
    """Yield octal numbers."""
    for entry in _octals(device):
        number = parse_number(entry.value)
        if number and entry.value.removeprefix("-").startswith("0"):
            yield Problem(entry, f"{entry.key} {entry.value[:40]} is octal, that is {number.value}; is that meant?")


def misplaced_node_id(device: LintedDevice) -> Iterator[Problem]:
    """Yield values with $NODEID that are not `$NODEID` or `$NODEID+number`."""
    for each in device.integers:
        if each.number is None and NODE_ID in each.entry.value.upper():
            yield Problem(
                each.entry,
                f"{each.entry.value[:40]} is not $NODEID+number: $NODEID stands first, nothing but + follows",
            )


def node_id_in_text(device: LintedDevice) -> Iterator[Problem]:
    """Yield $NODEID in values that are no integers."""
    for each in device.others:
        if each.type and NODE_ID in each.entry.value.upper():
            yield Problem(each.entry, f"$NODEID in a {each.type.name}, where it means nothing")


def _extremes(device: LintedDevice, number: Number) -> tuple[int, int]:
    """Return the lowest and highest value a number has, for the node-IDs there can be."""
    return number.at(device.node_ids[0]), number.at(device.node_ids[-1])


def outside_type_of(keys: tuple[str, ...]) -> Check:
    """Make the rule that limits, or values, fit into the variable's type."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        for each in device.integers:
            if (
                each.key in keys
                and each.number
                and each.type
                and not each.type.low <= each.number.value <= each.type.high - _reach(device, each)
            ):
                text = f"{each.entry.key}={each.entry.value[:40]} of {each.variable.where} is outside {each.type.name}"
                yield Problem(each.entry, text)

    return check


def _reach(device: LintedDevice, value: GivenValue) -> int:
    """Return what the node-ID adds to a value at most."""
    return device.node_ids[-1] if value.number and value.number.relative else 0


def crossed_limits(device: LintedDevice) -> Iterator[Problem]:
    """Yield a LowLimit above its HighLimit."""
    for section, entry in device.entries("lowlimit"):
        low, high = parse_number(entry.value), parse_number(section.text("highlimit"))
        if low and high and low.at(device.node_ids[0]) > high.at(device.node_ids[0]):
            yield Problem(
                entry,
                f"LowLimit {entry.value[:20]} of [{section.name}] is above HighLimit {section.text('highlimit')[:20]}",
            )


def outside_limits_of(key: str) -> Check:
    """Make the rule that a value is inside its limits."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        for each in (value for value in device.integers if value.key == key):
            low, high = (each.variable.number(limit) for limit in LIMITS)
            lowest, highest = _extremes(device, each.number) if each.number else (0, 0)
            if (low and lowest < low.at(device.node_ids[0])) or (high and highest > high.at(device.node_ids[-1])):
                text = f"{each.entry.key}={each.entry.value[:40]} of {each.variable.where} is outside its limits"
                yield Problem(each.entry, text)

    return check


def limits_without_meaning(device: LintedDevice) -> Iterator[Problem]:
    """Yield limits of a variable that is no number."""
    for each in (value for value in device.others if value.key in LIMITS):
        if each.type and each.type not in REALS:
            yield Problem(
                each.entry, f"{each.entry.key} of {each.variable.where}, a {each.type.name}, which has no order"
            )


def real_form(text: str) -> str:
    """Say how a REAL is written: `decimal`, `bits` (0x and hexadecimal digits), or the empty text if it is neither."""
    if text[:2].lower() == "0x":
        return "bits" if parse_number(text) else ""
    try:
        float(text)
    except ValueError:
        return ""
    return "decimal"


def malformed_real(device: LintedDevice) -> Iterator[Problem]:
    """Yield REAL values that are neither decimal nor a bit pattern."""
    for each in device.others:
        if (
            each.type
            and each.type in REALS
            and not real_form(each.entry.value)
            and NODE_ID not in each.entry.value.upper()
        ):
            yield Problem(each.entry, f"{each.entry.value[:40]} is no {each.type.name}")


def ambiguous_real(device: LintedDevice) -> Iterator[Problem]:
    """Yield REAL values that tools read in different ways; 0 is the same in all of them."""
    for each in device.others:
        if each.type and each.type in REALS and real_form(each.entry.value) and each.number != Number(0):
            text = (
                f"{each.entry.key} {each.entry.value[:40]} is a {each.type.name}: some tools read decimals, others bits"
            )
            yield Problem(each.entry, text)


def odd_octets(device: LintedDevice) -> Iterator[Problem]:
    """Yield OCTET_STRING values that are no bytes in hexadecimal."""
    for each in (value for value in device.others if value.key in VALUES):
        text = each.entry.value.replace(" ", "")
        if each.type is OCTET_STRING and (len(text) % 2 or text.strip("0123456789abcdefABCDEF")):
            yield Problem(
                each.entry, f"{each.entry.value[:40]} is no OCTET_STRING, bytes as two hexadecimal digits each"
            )


def pdo_mapping_flag(device: LintedDevice) -> Iterator[Problem]:
    """Yield a PDOMapping other than 0 and 1."""
    for section, entry in device.entries("pdomapping"):
        number = parse_number(entry.value)
        if number and number not in BOTH:
            yield Problem(entry, f"PDOMapping of [{section.name}] is {entry.value[:20]}, not 0 or 1")


def object_flags(device: LintedDevice) -> Iterator[Problem]:
    """Yield ObjFlags with bits that mean nothing."""
    for section, entry in device.entries("objflags"):
        number = parse_number(entry.value)
        if number and (number.value < 0 or number.value & ~3):
            yield Problem(
                entry, f"ObjFlags of [{section.name}] is {entry.value[:20]}; only bits 0 and 1 mean something"
            )


def constant_without_value(device: LintedDevice) -> Iterator[Problem]:
    """Yield constants without a value."""
    for each in device.variables:
        if each.access == "const" and not (each.value_entry and each.value_entry.value):
            yield Problem(each.section.at("defaultvalue"), f"{each.where} is const, but has no value")


def mappable_rw(device: LintedDevice) -> Iterator[Problem]:
    """Yield mappable variables whose access does not say into which PDOs they may be mapped."""
    for each in device.variables:
        if each.access == "rw" and each.is_mappable:
            yield Problem(
                each.section.at("accesstype"),
                f"{each.where} is mappable and rw; rwr (TPDO) or rww (RPDO) says where to",
            )


def mappable_text(device: LintedDevice) -> Iterator[Problem]:
    """Yield mappable variables of a type that fits into no PDO."""
    for each in device.variables:
        if each.is_mappable and each.type and each.type.bits == 0:
            yield Problem(
                each.section.at("pdomapping"), f"{each.where}, a {each.type.name}, is mappable, but has no fixed length"
            )


def mappable_without_pdo(device: LintedDevice) -> Iterator[Problem]:
    """Yield the first variable that may be mapped in a device without a PDO."""
    first = next((each for each in device.variables if each.is_mappable), None)
    if first and not device.pdos:
        yield Problem(first.section.at("pdomapping"), f"{first.where} is mappable, but the device has no PDO")


def finer_than_granularity(device: LintedDevice) -> Iterator[Problem]:
    """Yield mappable BOOLEANs in a device that maps no single bits."""
    bits = granularity(device) or 0
    for each in device.variables:
        if each.is_mappable and each.type and 0 < each.type.bits < bits:
            text = f"{each.where} has {each.type.bits} bits and is mappable, but the granularity is {bits}"
            yield Problem(each.section.at("pdomapping"), text)


VALUE_RULES = (
    Rule("E430", "A number is decimal, 0x hexadecimal or 0 octal.", "CiA 306, numbers", no_number),
    Rule("E431", "A number with a leading zero is octal.", "CiA 306, numbers", wrong_octal),
    Rule("W432", "Numbers are not octal unless that is meant.", "CiA 306, numbers", octal),
    Rule("E433", "A value with the node-ID is $NODEID or $NODEID+number.", "CiA 306, $NODEID", misplaced_node_id),
    Rule("E434", "$NODEID is in integers only.", "CiA 306, $NODEID", node_id_in_text),
    Rule("E435", "DefaultValue and ParameterValue fit the type, for every node-ID.", "CiA 301, data types",
         outside_type_of(VALUES)),
    Rule("E436", "LowLimit and HighLimit fit the type.", "CiA 301, data types", outside_type_of(LIMITS)),
    Rule("E437", "LowLimit is not above HighLimit.", "CiA 306, object description", crossed_limits),
    Rule("E438", "DefaultValue is inside the limits.", "CiA 306, object description",
         outside_limits_of("defaultvalue")),
    Rule("E439", "ParameterValue is inside the limits.", "CiA 306, DCF", outside_limits_of("parametervalue")),
    Rule("W440", "Only numbers have limits.", "CiA 306, object description", limits_without_meaning),
    Rule("E441", "A REAL is a decimal number or a bit pattern.", "CiA 306, numbers", malformed_real),
    Rule("W442", "A REAL has no value but 0.", "public: dcf-tools reads bit patterns, canopen decimal numbers",
         ambiguous_real),
    Rule("W443", "An OCTET_STRING is written in hexadecimal.",
         "public: dcf-tools and canopen both read it so", odd_octets),
    Rule("E444", "PDOMapping is 0 or 1.", "CiA 306, object description", pdo_mapping_flag),
    Rule("E445", "ObjFlags has bits 0 and 1 only.", "CiA 306, ObjFlags", object_flags),
    Rule("W446", "A constant has a value.", "CiA 306, object description", constant_without_value),
    Rule("W447", "A mappable variable is rwr or rww, not rw.", "CiA 306, object description", mappable_rw),
    Rule("W448", "A mappable variable has a fixed length.", "CiA 301, PDO mapping", mappable_text),
    Rule("I449", "A device with mappable variables has a PDO.", "CiA 301, PDO mapping", mappable_without_pdo),
    Rule("W450", "No mappable variable is shorter than the granularity.", "CiA 306, [DeviceInfo]",
         finer_than_granularity),
)  # fmt: skip

# What CiA 301 and 302 say of single objects

READ_ONLY, ANY = ("ro", "const"), ("rw", "ro", "const", "wo")


class Known(NamedTuple):
    """What the standard says of the variables at some indices and sub-indices."""

    indices: range
    subs: range
    type: DataType
    access: tuple[str, ...] = ()


def _at(index: int, sub: int = 0) -> tuple[range, range]:
    return range(index, index + 1), range(sub, sub + 1)


DATA_SUBS = range(1, 255)
KNOWN = (
    Known(*_at(0x1000), UNSIGNED32, READ_ONLY),
    Known(*_at(0x1001), UNSIGNED8, READ_ONLY),
    Known(*_at(0x1002), UNSIGNED32, READ_ONLY),
    Known(range(0x1003, 0x1004), DATA_SUBS, UNSIGNED32, READ_ONLY),
    Known(*_at(0x1005), UNSIGNED32),
    Known(*_at(0x1006), UNSIGNED32),
    Known(*_at(0x1007), UNSIGNED32),
    Known(*_at(0x1008), VISIBLE_STRING, READ_ONLY),
    Known(*_at(0x1009), VISIBLE_STRING, READ_ONLY),
    Known(*_at(0x100A), VISIBLE_STRING, READ_ONLY),
    Known(*_at(0x100C), UNSIGNED16),
    Known(*_at(0x100D), UNSIGNED8),
    Known(range(0x1010, 0x1012), DATA_SUBS, UNSIGNED32),
    Known(*_at(0x1012), UNSIGNED32),
    Known(*_at(0x1014), UNSIGNED32),
    Known(*_at(0x1015), UNSIGNED16),
    Known(range(0x1016, 0x1017), DATA_SUBS, UNSIGNED32),
    Known(*_at(0x1017), UNSIGNED16),
    Known(range(0x1018, 0x1019), range(1, 5), UNSIGNED32, READ_ONLY),
    Known(*_at(0x1019), UNSIGNED8),
    Known(range(0x1020, 0x1021), range(1, 3), UNSIGNED32),
    Known(*_at(0x1021), DOMAIN, READ_ONLY),
    Known(range(0x1029, 0x102A), DATA_SUBS, UNSIGNED8),
    Known(range(0x1200, 0x1300), range(1, 3), UNSIGNED32),
    *(
        Known(indices, range(sub, sub + 1), type_)
        for indices in COMMUNICATION_RECORDS.values()
        for sub, type_ in zip(range(1, 7), (UNSIGNED32, UNSIGNED8, UNSIGNED16, UNSIGNED8, UNSIGNED16, UNSIGNED8))
    ),
    *(Known(indices, DATA_SUBS, UNSIGNED32) for indices in MAPPING_RECORDS.values()),
    Known(*_at(0x1F80), UNSIGNED32),
)


def _known(device: LintedDevice) -> Iterator[tuple[DescribedVariable, Known]]:
    """Give every variable of the communication profile that the standard says something about."""
    for each in KNOWN:
        for index in each.indices if len(each.indices) == 1 else _within(device, each.indices):
            found = device.objects.get(index)
            for sub, variable in found.subs.items() if found else ():
                if sub in each.subs:
                    yield variable, each


def _within(device: LintedDevice, indices: range) -> Iterator[int]:
    return (index for index in device.objects if index in indices)


def known_types(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects of the communication profile with another type than the standard's."""
    for variable, known in _known(device):
        if variable.section.text("datatype") and variable.type != known.type:
            at = variable.section.at("datatype")
            yield Problem(
                at,
                f"{variable.where} has type {variable.section.text('datatype')[:20]}, CiA 301 says {known.type.name}",
            )


def known_access(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects that can be written, but are read-only in the standard."""
    for variable, known in _known(device):
        if known.access and variable.access in ACCESS_TYPES and variable.access not in known.access:
            at = variable.section.at("accesstype")
            yield Problem(at, f"{variable.where} is {variable.access}, CiA 301 says {' or '.join(known.access)}")


def mappable_communication(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects of the communication profile that are mappable; only 0x1001 and 0x1002 may be."""
    for variable, _ in _known(device):
        if variable.is_mappable and variable.index not in (0x1001, 0x1002):
            yield Problem(
                variable.section.at("pdomapping"), f"{variable.where} is mappable, but configures communication"
            )


def value_of(index: int, subs: range, fits: Callable[[int], bool], sentence: str) -> Check:
    """Make the rule that the values of an object's sub-indices are such and such, for every node-ID."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        found = device.objects.get(index)
        for sub, variable in found.subs.items() if found else ():
            at, value = variable.value_entry, variable.value
            if sub in subs and at and value and not all(fits(value.at(n)) for n in device.node_ids):
                yield Problem(at, f"{variable.where} is {at.value[:40]}; {sentence}")

    return check


def is_cob_id(value: int) -> bool:
    """Whether a COB-ID of SYNC, TIME or EMCY has none of the bits that have to be 0 in a base frame."""
    return 0 <= value <= UNSIGNED32.high and (bool(value & EXTENDED) or not value & 0x1FFFF800)


def heartbeats(device: LintedDevice) -> list[tuple[DescribedVariable, int, int]]:
    """Return what the device listens to: the variable of 0x1016, the node-ID and the time in ms."""
    found = device.objects.get(0x1016)
    values = ((each, each.value) for sub, each in found.subs.items() if sub) if found else ()
    return [(each, v.value >> 16 & 0xFF, v.value & 0xFFFF) for each, v in values if v and v.value & 0xFFFF]


def double_heartbeats(device: LintedDevice) -> Iterator[Problem]:
    """Yield nodes whose heartbeat is consumed twice."""
    first: dict[int, DescribedVariable] = {}
    for variable, node_id, _ in heartbeats(device):
        if node_id and first.setdefault(node_id, variable) is not variable:
            at = variable.place
            yield Problem(at, f"{variable.where} waits for node {node_id}, as sub {first[node_id].sub} does")


def no_error_control(device: LintedDevice) -> Iterator[Problem]:
    """Yield devices with neither heartbeat nor node guarding."""
    if device.objects and not {0x1017, 0x100C} & device.objects.keys():
        at = next(iter(device.objects.values())).place
        yield Problem(at, "neither heartbeat (0x1017) nor node guarding (0x100C): nobody can see this device fail")


def both_error_controls(device: LintedDevice) -> Iterator[Problem]:
    """Yield devices where heartbeat and node guarding are both on."""
    values = [device.value(index) for index in (0x1017, 0x100C, 0x100D)]
    variable = device.variable(0x1017)
    if variable and all(each and each.value for each in values):
        at = variable.place
        yield Problem(at, "heartbeat and node guarding are both on; a device uses one of them")


def needs_of(index: int, needed: int, why: str) -> Check:
    """Make the rule that an object needs another one."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        found = device.objects.get(index)
        if found and needed not in device.objects:
            yield Problem(found.place, f"0x{index:04X} without 0x{needed:04X}: {why}")

    return check


def first_server(device: LintedDevice) -> Iterator[Problem]:
    """Yield a first SDO server with other identifiers than the fixed ones."""
    for sub, base in ((1, SDO_REQUEST_BASE), (2, SDO_RESPONSE_BASE)):
        variable = device.variable(0x1200, sub)
        at, value = (variable.value_entry, variable.value) if variable else (None, None)
        fixed = value and all(value.at(n) == base + n for n in device.node_ids)
        if variable and at and value and not fixed:
            yield Problem(at, f"{variable.where} is {at.value[:40]}; the first SDO server has $NODEID+0x{base:X}")


def profile_objects(device: LintedDevice) -> Problems:
    """Yield objects of a device profile in a device that claims none."""
    type_ = device.value(0x1000)
    first = next((each for index, each in device.objects.items() if 0x6000 <= index < 0xA000), None)
    if first and type_ and type_.value & 0xFFFF == 0:
        yield Problem(
            first.place, f"0x{first.index:04X} belongs to a device profile, but 0x1000 says the device has none"
        )


ALL_SUBS = range(255)
LAST_MILLISECOND = 86_399_999

KNOWN_RULES = (
    Rule("E501", "Objects of the communication profile have the standard's type.", "CiA 301, each object", known_types),
    Rule("E502", "Objects that the standard makes read-only are ro or const.", "CiA 301, each object", known_access),
    Rule("W503", "What configures communication is not mappable.", "CiA 301, each object", mappable_communication),
    Rule("E504", "COB-ID SYNC has no bits but 30, 29 and the identifier.", "CiA 301, object 0x1005",
         value_of(0x1005, ALL_SUBS, is_cob_id, "bits 11 to 28 are 0 for a base frame")),
    Rule("E505", "COB-ID TIME has no bits but 31, 30, 29 and the identifier.", "CiA 301, object 0x1012",
         value_of(0x1012, ALL_SUBS, is_cob_id, "bits 11 to 28 are 0 for a base frame")),
    Rule("E506", "COB-ID EMCY has no bits but 31, 29 and the identifier.", "CiA 301, object 0x1014",
         value_of(0x1014, ALL_SUBS, lambda v: is_cob_id(v) and not v & 1 << 30,
                  "bits 11 to 28 are 0 for a base frame, bit 30 always")),
    Rule("W507", "COB-ID EMCY is $NODEID+0x80 by default, if it is valid.", "CiA 301, object 0x1014",
         value_of(0x1014, ALL_SUBS, lambda v: bool(v & NOT_VALID) or v - EMCY_BASE in NODE_IDS,
                  "the default is $NODEID+0x80")),
    Rule("E508", "A consumer heartbeat time has a node-ID from 0 to 127 in bits 16 to 23, and bits 24 to 31 are 0.",
         "CiA 301, object 0x1016",
         value_of(0x1016, DATA_SUBS, lambda v: 0 <= v < 0x800000, "bits 16 to 23 are a node-ID up to 127")),
    Rule("E509", "A node's heartbeat is consumed once.", "CiA 301, object 0x1016", double_heartbeats),
    Rule("W510", "A device has heartbeat or node guarding.", "CiA 301, error control", no_error_control),
    Rule("W511", "A device uses heartbeat or node guarding.", "CiA 301, error control", both_error_controls),
    Rule("E512", "The communication cycle period has a SYNC.", "CiA 301, object 0x1006",
         needs_of(0x1006, 0x1005, "a period of a SYNC that is not there")),
    Rule("E513", "The synchronous window has a SYNC.", "CiA 301, object 0x1007",
         needs_of(0x1007, 0x1005, "a window after a SYNC that is not there")),
    Rule("E514", "Life time factor and guard time are there together.", "CiA 301, objects 0x100C and 0x100D",
         needs_of(0x100D, 0x100C, "a factor of a guard time that is not there")),
    Rule("E515", "The first SDO server has the fixed identifiers.", "CiA 301, object 0x1200", first_server),
    Rule("E516", "The identity object has 1 to 4 entries.", "CiA 301, object 0x1018",
         value_of(0x1018, range(1), lambda v: 1 <= v <= 4, "1 to 4 entries")),
    Rule("E517", "The SYNC counter overflow is 0 or 2 to 240.",
         "CiA 301, object 0x1019; public: CANopenEditor, minimal_project.xdd",
         value_of(0x1019, ALL_SUBS, lambda v: v == 0 or 2 <= v <= 240, "1 and 241 to 255 are reserved")),
    Rule("E518", "An error behaviour is 0, 1 or 2, or the manufacturer's from 0x80 on.",
         "CiA 301, object 0x1029; public: CANopenEditor, minimal_project.xdd",
         value_of(0x1029, DATA_SUBS, lambda v: v <= 2 or v >= 0x80, "0 pre-operational, 1 nothing, 2 stopped")),
    Rule("W519", "0x1010 says by bits 0 and 1 how the device stores; the signature is what is written.",
         "CiA 301, object 0x1010", value_of(0x1010, DATA_SUBS, lambda v: v <= 3, "only bits 0 and 1 mean something")),
    Rule("W520", "0x1011 says by bit 0 whether the device restores; the signature is what is written.",
         "CiA 301, object 0x1011", value_of(0x1011, DATA_SUBS, lambda v: v <= 1, "only bit 0 means something")),
    Rule("W521", "The configuration time is in milliseconds since midnight.", "CiA 301, object 0x1020",
         value_of(0x1020, range(2, 3), lambda v: v <= LAST_MILLISECOND, "a day has 86 400 000 ms")),
    Rule("W522", "NMT startup uses bits 0 to 6.",
         "CiA 302-2, object 0x1F80; public: Lely CANopen, nmt.c, uses bits 0 to 6 so",
         value_of(0x1F80, ALL_SUBS, lambda v: not v & ~0x7F, "bits from 7 on are reserved")),
    Rule("W523", "NMT startup says reset all or stop all for a lost mandatory node, not both.",
         "CiA 302-2, object 0x1F80; public: Lely CANopen, nmt.c, looks at bit 6 before bit 4",
         value_of(0x1F80, ALL_SUBS, lambda v: v & 0x50 != 0x50, "bits 4 (reset all) and 6 (stop all) contradict")),
    Rule("I524", "A device with objects of a device profile says which.", "CiA 301, object 0x1000", profile_objects),
)  # fmt: skip

RULES = OBJECT_RULES + COMPACT_RULES + VALUE_RULES + KNOWN_RULES
