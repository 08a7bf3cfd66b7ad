"""Rules about objects: keys, sub-indices and values (CiA 306), and requirements of CiA 301 for single objects.

The type, access and value that CiA 301 requires of an object are data in a table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eurobot_od.lint.file_rules import Check, granularity, missing_of
from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import LintedDevice
from eurobot_od.od import description, values
from eurobot_od.od.description import COMPOSED, SIMPLE, DescribedObject, DescribedVariable, ObjectCode
from eurobot_od.od.document import LIMITS, OF_VARIABLE, VALUES, Entry, Section
from eurobot_od.od.formats import decimal_subs
from eurobot_od.od.standard import DATA_SUBS, KNOWN, Known
from eurobot_od.od.values import UNSIGNED8, UNSIGNED32, Number, is_standard_number, parse_number

RULES = Rules()

# Objects and their keys

COMPLEX_TYPES = (range(0x20, 0x26), range(0x40, 0x260))
"""Data types of whole records (CiA 301: the standard's; manufacturers' and device profiles')."""


def _simple(device: LintedDevice) -> Iterator[Section]:
    """Yield the sections of variables with a value: VARs, sub-indices and compact templates."""
    # DataType and AccessType may be omitted for a DOMAIN (`2` or `0x2`).
    return (each.section for each in device.variables if not each.section.text("objecttype").endswith("2"))


@RULES.rule("W453", "CiA 301, DEFTYPE and DEFSTRUCT")
def undefined_type(device: LintedDevice) -> Violations:
    """A manufacturer's or a profile's DataType of a variable is defined in the file."""
    for section, entry in device.entries["datatype"]:
        number = parse_number(entry.value)
        # CiA 301 itself defines those below 0x40 (PDO, SDO parameter, identity and so on).
        is_there = number and (number.value in device.objects or f"{number.value:x}sub1" in device.document.sections)
        if number and number.value in COMPLEX_TYPES[1] and not is_there:
            yield entry, f"DataType {entry.value[:20]} of [{section.name}] is defined nowhere; it is taken as bytes"


def _composed(device: LintedDevice) -> Iterator[tuple[DescribedObject, Section]]:
    """Yield arrays and records with their sections."""
    return ((o, o.section) for o in device.objects.values() if o.section and o.code in COMPOSED)


def entry_of(key: str, fits: Callable[[str, Number | None], bool], sentence: str) -> Check:
    """Return the check that the text of a key, in any object, and its number are valid."""

    def check(device: LintedDevice) -> Violations:
        for section, entry in device.entries[key]:
            if entry.value and not fits(entry.value, parse_number(entry.value)):
                yield entry, sentence.format(entry.value[:20], section.name)

    return check


DESCRIPTION, LACKS = "CiA 306, object description", "[{name}] has no {key}"
CODES = {each.value for each in ObjectCode}
NO_ACCESS = values.NO_ACCESS_IN_EDS
TYPES = (values.DATA_TYPES, *COMPLEX_TYPES)

RULES += (
    Rule("E401", "An object and a sub-index have a ParameterName.", DESCRIPTION,
         missing_of(lambda device: (each for name, each in device.object_sections if not name.list), "ParameterName",
                    sentence=LACKS)),
    Rule("E402", "ObjectType is 0, 2, 5, 6, 7, 8 or 9.", "CiA 301, object codes",
         entry_of("objecttype", lambda _, number: number is not None and number.value in CODES,
                  "ObjectType {} of [{}] is not one of 0, 2, 5, 6, 7, 8, 9")),
    Rule("E403", "A variable has a DataType.", DESCRIPTION, missing_of(_simple, "DataType", sentence=LACKS)),
    Rule("E404", "DataType is one of CiA 301.", "CiA 301, data types",
         entry_of("datatype", lambda _, number: number is not None and any(number.value in each for each in TYPES),
                  "DataType {} of [{}] is not a type of CiA 301")),
    Rule("E405", "A variable has an AccessType.", DESCRIPTION, missing_of(_simple, "AccessType", sentence=LACKS)),
    Rule("E406", "AccessType is ro, wo, rw, rwr, rww or const.", DESCRIPTION,
         entry_of("accesstype", lambda text, _: text.lower() in values.ACCESS_TYPES or text.upper() == NO_ACCESS,
                  f"AccessType {{}} of [{{}}] is not one of {', '.join(values.ACCESS_TYPES)}")),
    Rule("W454", "AccessType is not UNKNOWN, which CANopenEditor writes for an object without SDO access.",
         "public: canopen takes it for one that an SDO may write",
         entry_of("accesstype", lambda text, _: text.upper() != NO_ACCESS,
                  "AccessType {} of [{}] is read as no SDO access; other tools may write the object")),
    Rule("E411", "An array or record has SubNumber or CompactSubObj.", DESCRIPTION,
         missing_of(lambda device: (section for each, section in _composed(device) if not each.compact), "SubNumber",
                    sentence=LACKS)),
    Rule("E444", "PDOMapping is 0 or 1.", DESCRIPTION,
         entry_of("pdomapping", lambda _, number: number in (None, Number(0), Number(1)),
                  "PDOMapping of [{1}] is {0}, not 0 or 1")),
    Rule("E445", "ObjFlags has bits 0 and 1 only.", "CiA 306, ObjFlags",
         entry_of("objflags", lambda _, number: number is None or number.value in range(4),
                  "ObjFlags of [{1}] is {0}; only bits 0 and 1 mean something")),
)  # fmt: skip


@RULES.rule("E407", "CiA 306, object description")
def orphans(device: LintedDevice) -> Violations:
    """A sub-index belongs to an object with a section."""
    for each in device.objects.values():
        if each.section is None:
            yield each.place, f"[{each.place.name}] has no object [{each.index:04X}]"


@RULES.rule("E408", "CiA 306, object description")
def sub_keys_on_variable(device: LintedDevice) -> Violations:
    """A VAR has no SubNumber and no CompactSubObj."""
    for section, entry in device.entries["subnumber"] + device.entries["compactsubobj"]:
        name = description.parse_section_name(section.name.strip())
        whole = device.objects[name.object_index] if name and name.sub < 0 else None
        code = (whole or DescribedObject(0, section, {}, {})).code  # a sub-index is checked like a VAR
        # `SubNumber=0` is the same as none.
        if code in SIMPLE and entry.value and parse_number(entry.value) != Number(0):
            kind = "a VAR or DOMAIN; with sub-indices it is an ARRAY or a RECORD" if whole else "a sub-index"
            yield entry, f"{entry.key} does not belong to [{section.name}], {kind}"


@RULES.rule("E409", "CiA 306, object description")
def value_keys_on_record(device: LintedDevice) -> Violations:
    """An array or record has no value of its own."""
    for each, section in _composed(device):
        if each.compact:
            continue
        for key in OF_VARIABLE:
            entry = section.entries.get(key)
            # An empty value or PDOMapping=0 cannot contradict the sub-indices.
            if entry and entry.value and (key != "pdomapping" or entry.value != "0"):
                yield entry, f"{entry.key} does not belong to [{section.name}], whose values are its sub-indices"


@RULES.rule("E410", "CiA 306, object description")
def subs_of_variable(device: LintedDevice) -> Violations:
    """A VAR has no sections for sub-indices."""
    for each in device.objects.values():
        sub = next((s for s in each.subs.values() if s.section is not each.section), None)
        if sub and each.code in SIMPLE:
            yield sub.section, f"[{sub.section.name}] is a sub-index, but 0x{each.index:04X} is a VAR"


@RULES.rule("E412", "CiA 306, object description")
def wrong_sub_number(device: LintedDevice) -> Violations:
    """SubNumber is the number of sub-indices, without 0xFF."""
    for each, section in _composed(device):
        # 0xFF describes the object's structure and is not a sub-index of data (CiA 301, 7.4.9).
        declared = parse_number(section.text("subnumber"))
        real = sum(sub != 0xFF for sub in each.subs)
        if declared and declared.value != real and not each.compact:
            what = f"SubNumber is {declared.value}, but 0x{each.index:04X} has {real} sub-indices"
            yield section.at("subnumber"), what


@RULES.rule("E413", "CiA 301, sub-index 0")
def without_sub_0(device: LintedDevice) -> Violations:
    """An array or record has sub-index 0."""
    for each, section in _composed(device):
        if 0 not in each.subs and each.subs and not each.compact:
            yield section, f"0x{each.index:04X} has no sub-index 0"


@RULES.rule("E414", "CiA 301, sub-index 0")
def type_of_sub_0(device: LintedDevice) -> Violations:
    """Sub-index 0 is an UNSIGNED8."""
    for each, _ in _composed(device):
        zero = each.subs.get(0)
        if zero and zero.type not in (UNSIGNED8, None):
            yield zero.section.at("datatype"), f"[{zero.section.name}] is not an UNSIGNED8"


@RULES.rule("E415", "CiA 301, sub-index 0")
def highest_sub(device: LintedDevice) -> Violations:
    """A constant sub-index 0 is the highest sub-index."""
    # Sub-index 0 of 0x1003 is the number of errors, of a mapping the number of mapped objects.
    counting = [range(0x1003, 0x1004), *values.MAPPING_RECORDS.values()]
    in_decimal = {name[:4] for name in decimal_subs(device.document)}  # W121 reports these
    for each, _ in _composed(device):
        if f"{each.index:04x}" in in_decimal:
            continue
        zero = each.subs.get(0)
        highest = max((sub for sub in each.subs if sub != 0xFF), default=0)
        value = zero.value if zero and not zero.is_writable else None  # a writable one is the number of entries in use
        if zero and value and highest and value.value != highest and not any(each.index in i for i in counting):
            yield zero.place, f"[{zero.section.name}] is {value.value}, but the highest sub-index is {highest}"


@RULES.rule("W416", "CiA 301, object codes")
def mixed_array(device: LintedDevice) -> Violations:
    """The sub-indices of an array have one type."""
    for each, _ in _composed(device):
        types = {sub: v.number("datatype") for sub, v in each.subs.items() if 0 < sub < 0xFF}
        wrong = next((sub for sub, type_ in types.items() if type_ != types.get(1, type_)), None)
        if wrong and each.code is ObjectCode.ARRAY:
            at = each.subs[wrong].section.at("datatype")
            yield at, f"sub {wrong} of array 0x{each.index:04X} has another type than sub 1"


@RULES.rule("I417", "custom; tools that look up by name find only one")
def same_names(device: LintedDevice) -> Violations:
    """The sub-indices of an object have different names."""
    for each, _ in _composed(device):
        first: dict[str, DescribedVariable] = {}
        for sub in each.subs.values():
            if sub.name and first.setdefault(sub.name, sub) is not sub:
                text = f"sub {sub.sub} of 0x{each.index:04X} is named like sub {first[sub.name].sub}"
                yield sub.section.at("parametername"), text


# CompactSubObj


def _compact(device: LintedDevice) -> Iterator[tuple[DescribedObject, Section]]:
    return ((o, o.section) for o in device.objects.values() if o.section and o.section.text("compactsubobj"))


@RULES.rule("W420", "CiA 306, CompactSubObj; public: dcf-tools takes it for records too, so only a warning")
def compact_kind(device: LintedDevice) -> Violations:
    """CompactSubObj describes arrays."""
    for each, section in _compact(device):
        if each.compact and each.code not in (ObjectCode.ARRAY, *SIMPLE, None):
            yield section.at("objecttype"), f"[{section.name}] has CompactSubObj, but is not an array"


@RULES.rule("E421", "CiA 306, CompactSubObj")
def compact_count(device: LintedDevice) -> Violations:
    """CompactSubObj is a number from 0 to 254."""
    for _, section in _compact(device):
        number = parse_number(section.text("compactsubobj"))
        if number is None or not 0 <= number.value <= 254:
            yield section.at("compactsubobj"), f"CompactSubObj of [{section.name}] is not a number from 0 to 254"


@RULES.rule("E422", "CiA 306, CompactSubObj")
def compact_and_sub_number(device: LintedDevice) -> Violations:
    """An object has SubNumber or CompactSubObj, not both."""
    for each, section in _compact(device):
        number = parse_number(section.text("subnumber"))
        if each.compact and number and number.value:
            yield section.at("subnumber"), f"[{section.name}] has both SubNumber and CompactSubObj"


@RULES.rule("E423", "CiA 306, CompactSubObj")
def entry_lists(device: LintedDevice) -> Violations:
    """NrOfEntries is the number of entries of [xxxxName] and [xxxxValue]."""
    for name, section in device.object_sections:
        if name.list:
            declared = parse_number(section.text("nrofentries"))
            real = len(section.entries.keys() - {"nrofentries"})
            if declared is None or declared.value != real:
                yield section.at("nrofentries"), f"NrOfEntries is not {real}, the number of entries of [{section.name}]"


@RULES.rule("E424", "CiA 306, CompactSubObj")
def entry_list_keys(device: LintedDevice) -> Violations:
    """[xxxxName] and [xxxxValue] name sub-indices of a compact object."""
    for name, section in device.object_sections:
        if not name.list:
            continue
        highest = device.objects[name.object_index].compact
        for key, entry in section.entries.items():
            # The length is checked first, because `int` raises for thousands of digits.
            if key != "nrofentries" and not (key.isdecimal() and len(key) < 4 and 1 <= int(key) <= highest):
                yield entry, f"{entry.key[:20]} is not a sub-index from 1 to {highest}"


# Values

NUMERIC_KEYS = ("subnumber", "objflags", "pdomapping", "objecttype", "datatype", "compactsubobj")


@RULES.rule("E430", "CiA 306, numbers")
def no_number(device: LintedDevice) -> Violations:
    """A number is decimal, 0x hexadecimal or 0 octal."""
    numeric = (entry for key in NUMERIC_KEYS[:3] for _, entry in device.entries[key] if entry.value)
    malformed = [e for e in numeric if not is_standard_number(e.value)]
    malformed += [each.entry for each in device.integers if not is_standard_number(each.entry.value)]
    for entry in malformed:
        # E431 and E433 report these two
        if not is_wrong_octal(entry.value) and values.NODE_ID not in entry.value.upper():
            yield entry, f"{entry.key} {entry.value[:40]} is not a number"


def is_wrong_octal(text: str) -> bool:
    """Return whether a text is a number with a leading zero, hence octal, that contains an 8 or a 9."""
    digits = text.removeprefix("-")
    return digits[:1] == "0" and digits.isdecimal() and len(digits) > 1 and bool(set(digits) & {"8", "9"})


def _octals(device: LintedDevice) -> Iterator[Entry]:
    """Yield the entries whose value is a 0 followed by further digits."""
    entries = [entry for key in NUMERIC_KEYS for _, entry in device.entries[key]]
    for entry in entries + [each.entry for each in device.integers]:
        # `00` is 0 in any base.
        if entry.value[:1] in "0-" and entry.value.removeprefix("-")[1:].strip("0").isdecimal():
            yield entry


@RULES.rule("E431", "CiA 306, numbers")
def wrong_octal(device: LintedDevice) -> Violations:
    """A number with a leading zero is octal."""
    for entry in _octals(device):
        if is_wrong_octal(entry.value):
            yield entry, f"{entry.key} {entry.value[:40]} is octal (it starts with 0), but has an 8 or a 9"


@RULES.rule("W432", "CiA 306, numbers")
def octal(device: LintedDevice) -> Violations:
    """Numbers are not octal unless that is meant."""
    for entry in _octals(device):
        number = parse_number(entry.value)
        if number and entry.value.removeprefix("-").startswith("0"):
            yield entry, f"{entry.key} {entry.value[:40]} is octal, that is {number.value}; is that meant?"


@RULES.rule("E433", "CiA 306, $NODEID")
def misplaced_node_id(device: LintedDevice) -> Violations:
    """A value with the node-ID is $NODEID or $NODEID+number."""
    for each in device.integers:
        if each.number is None and each.has_node_id:
            text = f"{each.entry.value[:40]} is not $NODEID+number: $NODEID stands first, nothing but + follows"
            yield each.entry, text


@RULES.rule("W451", "CiA 306, $NODEID; public: canopen, objectdictionary/eds.py, silently gives such a value None")
def other_node_id(device: LintedDevice) -> Violations:
    """$NODEID is in capitals and stands first."""
    for each in device.integers:
        if each.number and each.has_node_id and not is_standard_number(each.entry.value):
            yield each.entry, f"{each.entry.value[:40]} is not written $NODEID+number, which some tools cannot read"


@RULES.rule("E434", "CiA 306, $NODEID")
def node_id_in_text(device: LintedDevice) -> Violations:
    """$NODEID is in integers only."""
    for each in device.others:
        if each.has_node_id:
            yield each.entry, f"$NODEID in a {each.type.name}, where it means nothing"


def outside_type_of(keys: tuple[str, ...]) -> Check:
    """Return the check that limits, or values, fit the variable's type."""

    def check(device: LintedDevice) -> Violations:
        for each in (value for value in device.integers if value.key in keys):
            if each.number is None:
                continue
            # The value grows with the node-ID: the lower end is checked without one, the upper end with the highest.
            ends = (each.number.value, each.number.at(device.node_ids[-1]))
            if not all(each.type.low <= end <= each.type.high for end in ends):
                text = f"{each.entry.key}={each.entry.value[:40]} of {each.variable.where} is outside {each.type.name}"
                yield each.entry, text

    return check


@RULES.rule("E437", "CiA 306, object description")
def crossed_limits(device: LintedDevice) -> Violations:
    """LowLimit is not above HighLimit."""
    for each in device.variables:
        section = each.section
        low = each.number("lowlimit")
        high = each.number("highlimit")
        if low and high and low.at(device.node_ids[0]) > high.at(device.node_ids[0]):
            text = f"LowLimit {section.text('lowlimit')[:20]} of [{section.name}] is above HighLimit"
            yield section.at("lowlimit"), f"{text} {section.text('highlimit')[:20]}"


def outside_limits_of(key: str) -> Check:
    """Return the check that values of a key are inside the variable's limits."""

    def check(device: LintedDevice) -> Violations:
        for each in (value for value in device.integers if value.key == key):
            number = each.number or Number(0)
            (low, high) = map(each.variable.number, LIMITS)
            # If value and limit both contain the node-ID, every node-ID gives the same result.
            first = device.node_ids[0]
            last = device.node_ids[-1]
            if (low and number.at(first) < low.at(first)) or (high and number.at(last) > high.at(last)):
                text = f"{each.entry.key}={each.entry.value[:40]} of {each.variable.where} is outside its limits"
                yield each.entry, text

    return check


@RULES.rule("W440", "CiA 306, object description")
def limits_without_meaning(device: LintedDevice) -> Violations:
    """Only numbers have limits."""
    for each in (value for value in device.others if value.key in LIMITS):
        if each.type not in values.REALS:  # real numbers have an order, too
            yield each.entry, f"{each.entry.key} of {each.variable.where}, a {each.type.name}, which has no order"


def is_real(text: str) -> bool:
    """Return whether a text is a REAL: a decimal number, or 0x and its bits in hexadecimal."""
    if text[:2].lower() == "0x":
        return parse_number(text) is not None
    try:
        float(text)
    except ValueError:
        return False
    return True


@RULES.rule("E441", "CiA 306, numbers")
def malformed_real(device: LintedDevice) -> Violations:
    """A REAL is a decimal number or a bit pattern."""
    for each in device.others:
        if each.type in values.REALS and not is_real(each.entry.value) and not each.has_node_id:
            yield each.entry, f"{each.entry.value[:40]} is not a {each.type.name}"


@RULES.rule("W442", "public: dcf-tools reads bit patterns, canopen decimal numbers")
def ambiguous_real(device: LintedDevice) -> Violations:
    """A REAL has no value other than 0."""
    for each in device.others:
        # The bits of 0.0 are 0.
        if each.type in values.REALS and is_real(each.entry.value) and each.number != Number(0):
            text = f"{each.entry.key} {each.entry.value[:40]} is a {each.type.name}"
            yield each.entry, f"{text}: some tools read decimals, others bits"


@RULES.rule("W443", "public: dcf-tools and canopen both read it so")
def odd_octets(device: LintedDevice) -> Violations:
    """An OCTET_STRING is written in hexadecimal."""
    for each in (value for value in device.others if value.key in VALUES):
        text = each.entry.value.replace(" ", "")
        if each.type is values.OCTET_STRING and (len(text) % 2 or text.strip("0123456789abcdefABCDEF")):
            yield each.entry, f"{each.entry.value[:40]} is not an OCTET_STRING: two hexadecimal digits for each byte"


@RULES.rule("W452", "CiA 306, UploadFile and DownloadFile; public: canopen, objectdictionary/eds.py, drops it")
def value_of_domain(device: LintedDevice) -> Violations:
    """A DOMAIN has its content in a file, not as a value."""
    for each in device.others:
        if each.type is values.DOMAIN and each.key in VALUES:
            yield each.entry, f"{each.entry.key} of {each.variable.where}, a DOMAIN: tools drop it"


@RULES.rule("W446", "CiA 306, object description")
def constant_without_value(device: LintedDevice) -> Violations:
    """A constant has a value."""
    for each in device.variables:
        if each.access == "const" and not (each.value_entry and each.value_entry.value):
            yield each.section.at("defaultvalue"), f"{each.where} is const, but has no value"


@RULES.rule("W447", "CiA 306, object description")
def mappable_rw(device: LintedDevice) -> Violations:
    """A mappable variable is rwr or rww, not rw."""
    for each in device.variables:
        if each.access == "rw" and each.is_mappable:
            at = each.section.at("accesstype")
            yield at, f"{each.where} is mappable and rw; rwr (TPDO) or rww (RPDO) says where to"


@RULES.rule("W448", "CiA 301, PDO mapping")
def mappable_text(device: LintedDevice) -> Violations:
    """A mappable variable has a fixed length."""
    for each in device.variables:
        if each.is_mappable and each.type and each.type.bits == 0:
            at = each.section.at("pdomapping")
            yield at, f"{each.where}, a {each.type.name}, is mappable, but has no fixed length"


@RULES.rule("I449", "CiA 301, PDO mapping")
def mappable_without_pdo(device: LintedDevice) -> Violations:
    """A device with mappable variables has a PDO."""
    first = next((each for each in device.variables if each.is_mappable), None)
    if first and not device.pdos:
        yield first.section.at("pdomapping"), f"{first.where} is mappable, but the device has no PDO"


@RULES.rule("W450", "CiA 306, [DeviceInfo]")
def finer_than_granularity(device: LintedDevice) -> Violations:
    """No mappable variable is shorter than the granularity."""
    bits = granularity(device) or 0
    for each in device.variables:
        if each.is_mappable and each.type and 0 < each.type.bits < bits:
            text = f"{each.where} has {each.type.bits} bits and is mappable, but the granularity is {bits}"
            yield each.section.at("pdomapping"), text


RULES += (
    Rule("E435", "DefaultValue and ParameterValue fit the type, for every node-ID.", "CiA 301, data types",
         outside_type_of(VALUES)),
    Rule("E436", "LowLimit and HighLimit fit the type.", "CiA 301, data types", outside_type_of(LIMITS)),
    Rule("E438", "DefaultValue is inside the limits.", "CiA 306, object description",
         outside_limits_of("defaultvalue")),
    Rule("E439", "ParameterValue is inside the limits.", "CiA 306, DCF", outside_limits_of("parametervalue")),
)  # fmt: skip

# Single objects of CiA 301 and 302


def _known(device: LintedDevice) -> Iterator[tuple[DescribedVariable, Known]]:
    """Yield every variable of the communication profile that the standard describes, with its description."""
    for index, found in device.objects.items():
        if index >= values.MANUFACTURER[0]:
            continue
        for known in KNOWN:
            if index in known.indices:
                yield from ((variable, known) for sub, variable in found.subs.items() if sub in known.subs)


@RULES.rule("E501", "CiA 301, each object")
def known_types(device: LintedDevice) -> Violations:
    """Objects of the communication profile have the standard's type."""
    for variable, known in _known(device):
        if variable.section.text("datatype") and variable.type != known.type:
            at = variable.section.at("datatype")
            declared = variable.section.text("datatype")[:20]
            yield at, f"{variable.where} has type {declared}, CiA 301 says {known.type.name}"


@RULES.rule("E502", "CiA 301, each object")
def known_access(device: LintedDevice) -> Violations:
    """Objects that the standard makes read-only are ro or const."""
    for variable, known in _known(device):
        if known.access and variable.access in values.ACCESS_TYPES and variable.access not in known.access:
            at = variable.section.at("accesstype")
            yield at, f"{variable.where} is {variable.access}, CiA 301 says {' or '.join(known.access)}"


@RULES.rule("W503", "CiA 301, each object")
def mappable_communication(device: LintedDevice) -> Violations:
    """An object that configures communication is not mappable."""
    for variable, _ in _known(device):
        # Error register and manufacturer status register may be mapped (CiA 301, 7.5.2.2 and 7.5.2.3).
        if variable.is_mappable and variable.index not in (0x1001, 0x1002):
            yield variable.section.at("pdomapping"), f"{variable.where} is mappable, but configures communication"


def value_of(index: int, subs: range, fits: Callable[[int], bool], sentence: str) -> Check:
    """Return the check that the values of an object's sub-indices are valid for every node-ID."""

    def check(device: LintedDevice) -> Violations:
        for sub, variable in device.subs(index).items():
            at, value = variable.value_entry, variable.value
            if sub in subs and at and value and not all(fits(value.at(n)) for n in device.node_ids):
                yield at, f"{variable.where} is {at.value[:40]}; {sentence}"

    return check


def is_cob_id(value: int) -> bool:
    """Return whether a COB-ID of SYNC, TIME or EMCY has only bits that are allowed for its frame format."""
    # With bit 29 set, all 29 bits are the identifier.
    return 0 <= value <= UNSIGNED32.high and (bool(value & values.EXTENDED) or not value & 0x1FFFF800)


def heartbeats(device: LintedDevice) -> list[tuple[DescribedVariable, int, int]]:
    """Return the consumer heartbeat times: variable of 0x1016, node-ID, and time in ms."""
    # Node-ID in bits 16 to 23, time in bits 0 to 15; an entry with time 0 is unused (CiA 301, 7.5.2.19).
    times = ((each, each.value) for sub, each in device.subs(0x1016).items() if sub)
    return [(each, t.value >> 16 & 0xFF, t.value & 0xFFFF) for each, t in times if t and t.value & 0xFFFF]


@RULES.rule("E509", "CiA 301, object 0x1016")
def double_heartbeats(device: LintedDevice) -> Violations:
    """A node's heartbeat is consumed once."""
    first: dict[int, DescribedVariable] = {}
    for variable, node_id, _ in heartbeats(device):
        if node_id and first.setdefault(node_id, variable) is not variable:
            yield variable.place, f"{variable.where} waits for node {node_id}, as sub {first[node_id].sub} does"


@RULES.rule("W510", "CiA 301, error control")
def no_error_control(device: LintedDevice) -> Violations:
    """A device has heartbeat or node guarding."""
    if device.objects and not {0x1017, 0x100C} & device.objects.keys():
        at = next(iter(device.objects.values())).place
        yield at, "neither heartbeat (0x1017) nor node guarding (0x100C): nobody can see this device fail"


@RULES.rule("W511", "CiA 301, error control")
def both_error_controls(device: LintedDevice) -> Violations:
    """A device uses heartbeat or node guarding."""
    heartbeat, *times = (device.variable(index) for index in (0x1017, 0x100C, 0x100D))
    # Guarding is on if guard time and life time factor are both above 0.
    if heartbeat and all(each and each.value and each.value.value for each in (heartbeat, *times)):
        yield heartbeat.place, "heartbeat and node guarding are both on; a device uses one of them"


def needs_of(index: int, needed: int, why: str) -> Check:
    """Return the check that an object comes together with another one."""

    def check(device: LintedDevice) -> Violations:
        found = device.objects.get(index)
        if found and needed not in device.objects:
            yield found.place, f"0x{index:04X} without 0x{needed:04X}: {why}"

    return check


@RULES.rule("E515", "CiA 301, object 0x1200")
def first_server(device: LintedDevice) -> Violations:
    """The first SDO server has the fixed identifiers."""
    for sub, base in ((1, values.SDO_REQUEST_BASE), (2, values.SDO_RESPONSE_BASE)):
        variable = device.variable(0x1200, sub)
        at, value = (variable.value_entry, variable.value) if variable else (None, None)
        fixed = value and all(value.at(n) == base + n for n in device.node_ids)
        if variable and at and value and not fixed:
            yield at, f"{variable.where} is {at.value[:40]}; the first SDO server has $NODEID+0x{base:X}"


@RULES.rule("I524", "CiA 301, object 0x1000")
def profile_objects(device: LintedDevice) -> Violations:
    """A device with objects of a device profile says which profile."""
    type_ = device.value(0x1000)
    first = next((each for index, each in device.objects.items() if 0x6000 <= index < 0xA000), None)
    if first and type_ and type_.value & 0xFFFF == 0:  # bits 0 to 15 are the number of the profile
        yield first.place, f"0x{first.index:04X} belongs to a device profile, but 0x1000 says the device has none"


ALL_SUBS = range(255)
LAST_MILLISECOND = 86_399_999

RULES += (
    Rule("E504", "COB-ID SYNC has no bits other than 30, 29 and the identifier.", "CiA 301, object 0x1005",
         value_of(0x1005, ALL_SUBS, is_cob_id, "bits 11 to 28 are 0 for a base frame")),
    Rule("E505", "COB-ID TIME has no bits other than 31, 30, 29 and the identifier.", "CiA 301, object 0x1012",
         value_of(0x1012, ALL_SUBS, is_cob_id, "bits 11 to 28 are 0 for a base frame")),
    Rule("E506", "COB-ID EMCY has no bits other than 31, 29 and the identifier.", "CiA 301, object 0x1014",
         value_of(0x1014, ALL_SUBS, lambda v: is_cob_id(v) and not v & 1 << 30,
                  "bits 11 to 28 are 0 for a base frame, bit 30 always")),
    Rule("W507", "COB-ID EMCY is $NODEID+0x80 by default, if it is valid.", "CiA 301, object 0x1014",
         value_of(0x1014, ALL_SUBS, lambda v: bool(v & values.NOT_VALID) or v - values.EMCY_BASE in values.NODE_IDS,
                  "the default is $NODEID+0x80")),
    Rule("E508", "A consumer heartbeat time has a node-ID from 0 to 127 in bits 16 to 23, and bits 24 to 31 are 0.",
         "CiA 301, object 0x1016",
         value_of(0x1016, DATA_SUBS, lambda v: 0 <= v < 0x800000, "bits 16 to 23 are a node-ID up to 127")),
    Rule("E512", "A device with a communication cycle period has a SYNC.", "CiA 301, object 0x1006",
         needs_of(0x1006, 0x1005, "a period of a SYNC that is not there")),
    Rule("E513", "A device with a synchronous window has a SYNC.", "CiA 301, object 0x1007",
         needs_of(0x1007, 0x1005, "a window after a SYNC that is not there")),
    Rule("E514", "A device has both life time factor and guard time, or neither.", "CiA 301, objects 0x100C and 0x100D",
         needs_of(0x100D, 0x100C, "a factor of a guard time that is not there")),
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
)  # fmt: skip
