"""Rules about the file itself (CiA 306): syntax, [FileInfo], [DeviceInfo], dummies, comments, object lists.

The rules about configuration (DCF) and about modules are at the end. In all files of rules, a rule is a function that
takes the device and yields problems; its docstring states the rule. Rules that differ only in data are rows of a table,
and functions named `..._of` make their checks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product

from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.od import dcf, values
from eurobot_od.od import document as cia306
from eurobot_od.od.document import BIT_RATES, Entry, Odd, Section
from eurobot_od.od.formats import misspelled
from eurobot_od.od.modules import CONNECTED, COUNT, SUPPORTED
from eurobot_od.od.standard import MANDATORY, MODULE_LIST
from eurobot_od.od.values import MOST_SUBS, UNSIGNED32, Number, PdoDirection, parse_number

RULES = Rules()
"""Rules about the file itself."""

CONFIGURATION = Rules()
"""Rules about the configuration in a DCF."""

MODULES = Rules()
"""Rules about the modules of a modular device."""

Check = Callable[[LintedDevice], Violations]

# Syntax


def oddity_of(kind: Odd, sentence: str) -> Check:
    """Return the check that reports one kind of irregularity found by the reader; `{}` in the sentence is its text."""

    def check(device: LintedDevice) -> Violations:
        return ((each, sentence.format(each.text)) for each in device.document.oddities if each.kind is kind)

    return check


ODDITIES = (
    ("E101", "A file is text.", Odd.BINARY, "a NUL byte: this is not a text file"),
    ("E102", "A file is ASCII text, not UTF-16.", Odd.WIDE,
     "this is UTF-16, which most tools cannot read; save it as ASCII"),
    ("W103", "A file has only ASCII characters.", Odd.NOT_ASCII,
     "a character outside ASCII; what it shows depends on the reader's code page"),
    ("I104", "A file has no byte order mark.", Odd.BYTE_ORDER_MARK,
     "a byte order mark, which some tools take as part of the first section"),
    ("I105", "All lines of a file have the same line ending.", Odd.LINE_ENDS,
     "lines end in different ways (CR, LF, CRLF)"),
    ("E106", "A line is a section header, an entry or a comment.", Odd.NOT_AN_ENTRY,
     "neither [section] nor key=value nor ;comment: {}"),
    ("E107", "A section header is [name] and nothing else.", Odd.HEADER, "malformed section header {}"),
    ("E108", "Every entry is in a section.", Odd.NO_SECTION, "entry {} stands before the first section"),
    ("E109", "A section occurs once, regardless of upper and lower case.", Odd.TWO_SECTIONS,
     "section {}, is there again; only the first counts here"),
    ("E110", "A key occurs once in its section, regardless of upper and lower case.", Odd.TWO_ENTRIES,
     "key {}, is there again; only the first counts here"),
    ("E111", "An entry has a key.", Odd.NO_KEY, "an entry without a key"),
    ("E112", "A key and its value together have fewer than 255 characters.", Odd.TOO_LONG, "{}; 254 is the most"),
    ("E123", "A device description in XML is well-formed, without a document type.", Odd.XML, "no XML: {}"),
    ("E124", "An object of a file in XML has an index, a sub-object a sub-index.", Odd.ADDRESS, "{}: it is lost"),
    ("W122", "A file ends with its last line.", Odd.END_MARK,
     "Ctrl-Z or NUL at the end, which most tools take for an entry"),
    ("W114", "A comment starts with a semicolon.", Odd.HASH, "a comment with #, which only some tools skip"),
)  # fmt: skip
"""Code, rule, kind of irregularity, and the sentence about it."""

RULES += (Rule(code, demand, "CiA 306, file format", oddity_of(kind, text)) for code, demand, kind, text in ODDITIES)
RULES += (
    Rule("I113", "A comment is a line of its own.", "CiA 306, file format (some readers cut it, others keep it)",
         oddity_of(Odd.COMMENT_AFTER_VALUE, "a comment after a value, which some tools take as part of the value")),
    Rule("W115", "A line is not indented.", "public: Python's configparser adds such a line to the last value",
         oddity_of(Odd.INDENTED, "an indented line, which tools built on configparser add to the value before")),
)  # fmt: skip

# Sections and their keys


def _lower(*keys: str) -> frozenset[str]:
    return frozenset(each.lower() for each in keys)


OBJECT_KEYS = _lower(*cia306.OBJECT_KEYS)
KNOWN_KEYS: Mapping[str, frozenset[str]] = {name.lower(): _lower(*keys) for name, keys in cia306.SECTION_KEYS.items()}
KNOWN_KEYS = {**KNOWN_KEYS, "devicecommissioning": KNOWN_KEYS[cia306.COMMISSIONING.lower()]}
"""The keys of each section with a fixed set of them, in lower case."""

LISTS = tuple(each.lower() for each in cia306.OBJECT_LISTS)
NUMBERED = {"comments": ("lines", "line"), **dict.fromkeys(LISTS, ("supportedobjects", ""))}
"""Sections with numbered entries: the key of their number, and the prefix of each entry's number."""

ELSEWHERE = ("tool", "dynamicchannels", "supportedmodules", "connectedmodules", "standarddatatypes", "links")
"""Beginnings of names of further valid sections (tools, modular devices, older editions), which are not checked."""


DEFTYPE = 5
"""Object code DEFTYPE."""


@RULES.rule("W116", "CiA 306, all sections")
def unknown_sections(device: LintedDevice) -> Violations:
    """A section is one of those of CiA 306."""
    for section in device.other_sections:
        name = section.name.strip().lower()
        if name in KNOWN_KEYS or name in NUMBERED or looks_like_object(name):
            continue
        is_module = name[:1] == "m" and name[1:2].isdigit()  # of a modular device: M1ModuleInfo, M2SubExt1000
        if parse_number(device.document.text(name.partition("sub")[0], "objecttype")) == Number(DEFTYPE):
            continue  # CanFestival's editor describes its own types in [A0], [A0sub1] and so on
        if not name.startswith(ELSEWHERE) and not name.endswith("objectlinks") and not is_module:
            yield section, f"unknown section [{section.name}]"


def looks_like_object(name: str) -> bool:
    """Return whether a name is a possibly malformed name of an object's section, such as 0x1000, 01000 or 1000sub01."""
    head, sub, tail = name.replace(" ", "").replace("\t", "").removeprefix("0x").partition("sub")
    digits = head.lstrip("0") if len(head) != 4 else head
    fits = bool(tail.lstrip("0") or "0" in tail) if sub else bool(digits)
    is_hexadecimal = not (digits + tail).strip("0123456789abcdef")
    # A name without a decimal digit is taken for a word, such as [Feed].
    return fits and 3 <= len(digits) <= 4 and is_hexadecimal and any(each.isdigit() for each in digits)


@RULES.rule("E117", "CiA 306, object description")
def malformed_names(device: LintedDevice) -> Violations:
    """An object's section is named by 4 hexadecimal digits, `sub` and the sub-index without a leading zero."""
    wrong = [each for each in device.other_sections if looks_like_object(each.name.strip().lower())]
    for section in wrong + [each for _, each in device.object_sections if each.name != each.name.strip()]:
        yield section, f"[{section.name}] is not how an object's section is named, as [1018] or [1018sub1] is"


@RULES.rule("W118", "CiA 306, all sections")
def unknown_keys(device: LintedDevice) -> Violations:
    """A key is one that its section can have."""
    known = [(section, keys) for name, keys in KNOWN_KEYS.items() for section in [device.section(name)] if section]
    # Lists such as [2000Name] have a key for each sub-index; E424 checks those.
    known += [(section, OBJECT_KEYS) for name, section in device.object_sections if not name.list]
    for section, keys in known:
        for key in section.entries.keys() - keys - {""}:  # E111 reports an entry without a key
            yield section.entries[key], f"unknown key {section.entries[key].key} in [{section.name}]"


@RULES.rule("E119", "CiA 306, object lists and comments")
def unknown_numbers(device: LintedDevice) -> Violations:
    """Entries that are counted are numbered 1, 2, 3 without leading zeros."""
    for name, (count, prefix) in NUMBERED.items():
        for key, entry in _entries(device, name).items():
            number = key.removeprefix(prefix)
            is_number = key.startswith(prefix) and number.isdecimal() and not number.startswith("0")
            if key and key != count and not is_number:
                yield entry, f"{entry.key} is not the number of an entry of [{device.document.sections[name].name}]"


def _entries(device: LintedDevice, name: str) -> Mapping[str, Entry]:
    section = device.section(name)
    return section.entries if section else {}


@RULES.rule("W121", "public: canopen, dcf-tools and others look sections and keys up letter by letter")
def other_spelling(device: LintedDevice) -> Violations:
    """Sections and keys are spelled as CiA 306 spells them."""
    # W702 checks the section of the commissioning, which CiA 306 itself misspells.
    found = [each for each in misspelled(device.document) if "comissioning" not in each.what.lower()]
    if found:
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        yield Entry("", "", found[0].line, 1), f"{found[0].what} is how CiA 306 has it{more}"


@RULES.rule("E120", "CiA 306, all sections")
def missing_sections(device: LintedDevice) -> Violations:
    """A file has [FileInfo], [DeviceInfo] and [MandatoryObjects]."""
    for name in ("FileInfo", "DeviceInfo", "MandatoryObjects"):
        if device.section(name.lower()) is None:
            yield TOP, f"[{name}] is missing"


# [FileInfo], [DeviceInfo]


def missing_of(
    sections: Callable[[LintedDevice], Iterable[Section]], *keys: str, sentence: str = "{key} is missing in [{name}]"
) -> Check:
    """Return the check that some sections have these keys."""

    def check(device: LintedDevice) -> Violations:
        for section, key in product(sections(device), keys):
            if not section.text(key.lower()):
                yield section.at(key.lower()), sentence.format(key=key, name=section.name)

    return check


def _only(name: str) -> Callable[[LintedDevice], Iterable[Section]]:
    return lambda device: filter(None, [device.section(name)])


Form = tuple[Callable[[str], bool], str]
"""A predicate for the format of a value, and the description of the format."""


def form_of(keys: Sequence[str], form: Form, *names: str) -> Check:
    """Return the check that the values of these keys, where given, have a format; `names` are the sections."""
    lower = _lower(*keys)
    (fits, words) = form

    def check(device: LintedDevice) -> Violations:
        for key, entry in (each for name in names for each in _entries(device, name).items()):
            if key in lower and entry.value and not fits(entry.value):
                yield entry, f"{entry.key} is {entry.value[:40]}, but has to be {words}"

    return check


def up_to(high: int, words: str = "") -> Form:
    """Return the format of a number from 0 to `high`."""

    def fits(text: str) -> bool:
        number = parse_number(text)
        return number is not None and not number.relative and 0 <= number.value <= high

    return fits, words or f"0 to {high}"


def is_version(text: str) -> bool:
    """Return whether a text is a version, such as 4.0."""
    return re.fullmatch(r"[0-9]+(\.[0-9]+)?", text) is not None


def is_time(text: str) -> bool:
    """Return whether a text is a time, such as 09:30AM."""
    return re.fullmatch(r"(0[0-9]|1[0-2]):[0-5][0-9](AM|PM)", text, re.IGNORECASE) is not None


def is_date(text: str) -> bool:
    """Return whether a text is a date, such as 05-28-2014."""
    return re.fullmatch(r"(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])-[0-9]{4}", text) is not None


FLAG = up_to(1, "0 or 1")
BYTE = up_to(255)
FORMS = (
    ("E204", "FileVersion is a number from 0 to 255.", "FileInfo", ("FileVersion",), BYTE),
    ("E205", "FileRevision is a number from 0 to 255.", "FileInfo", ("FileRevision",), BYTE),
    ("E206", "EDSVersion is two numbers with a point.", "FileInfo", ("EDSVersion",), (is_version, "like 4.0")),
    ("W208", "Times are hh:mm and AM or PM.", "FileInfo", cia306.TIMES, (is_time, "like 09:30AM")),
    ("W209", "Dates are mm-dd-yyyy.", "FileInfo", cia306.DATES, (is_date, "like 05-28-2014")),
    ("E214", "BaudRate_... are 0 or 1.", "DeviceInfo", cia306.BIT_RATE_KEYS, FLAG),
    ("E216", "SimpleBootUpMaster, SimpleBootUpSlave, GroupMessaging and LSS_Supported are 0 or 1.", "DeviceInfo",
     cia306.FLAGS, FLAG),
    ("E217", "VendorNumber, ProductNumber and RevisionNumber are UNSIGNED32.", "DeviceInfo",
     cia306.IDENTITY, up_to(values.UNSIGNED32.high, "0 to 0xFFFFFFFF")),
    ("E223", "NrOfRXPDO and NrOfTXPDO are numbers from 0 to 512.", "DeviceInfo",
     ("NrOfRXPDO", "NrOfTXPDO"), up_to(values.PDO_COUNT)),
    ("E224", "Granularity is a number from 0 to 64.", "DeviceInfo", ("Granularity",), up_to(64)),
    ("E228", "DynamicChannelsSupported is a number from 0 to 255.", "DeviceInfo", ("DynamicChannelsSupported",), BYTE),
    ("E231", "Dummy... are 0 or 1.", "DummyUsage", tuple(KNOWN_KEYS["dummyusage"]), FLAG),
)  # fmt: skip
"""Code, rule, section, keys, and the format of their values."""


@RULES.rule("W207", "CiA 306, [FileInfo]")
def old_edition(device: LintedDevice) -> Violations:
    """EDSVersion is 4.0 or later."""
    version = device.document.text("fileinfo", "edsversion")
    # Cut to nine digits, because `int` raises for thousands of them.
    if is_version(version) and int(version.partition(".")[0][:9]) < 4:
        at = device.at("fileinfo", "edsversion")
        yield at, f"EDSVersion {version[:40]} is before 4.0, the edition with all of today's keys"


@RULES.rule("W210", "CiA 306, [FileInfo]")
def other_file_name(device: LintedDevice) -> Violations:
    """FileName is the file's name."""
    name = device.document.text("fileinfo", "filename")
    if name and name.lower() != device.name.lower():  # some file systems ignore case
        yield device.at("fileinfo", "filename"), f"FileName is {name[:60]}, the file is {device.name}"


def identity_of(key: str, sub: int) -> Check:
    """Return the check that a number of [DeviceInfo] equals a sub-index of the identity object."""

    def check(device: LintedDevice) -> Violations:
        declared = device.number("deviceinfo", key.lower())
        identity = device.value(0x1018, sub)
        if declared and identity and declared != identity:
            at = device.at("deviceinfo", key.lower())
            yield at, f"{key} is 0x{declared.value:08X}, but 0x1018 sub {sub} is 0x{identity.value:08X}"

    return check


@RULES.rule("W215", "CiA 301, bit rates")
def no_bit_rate(device: LintedDevice) -> Violations:
    """A device supports at least one bit rate."""
    if device.section("deviceinfo") and not bit_rates(device):
        yield device.at("deviceinfo", "baudrate_10"), "no BaudRate_... is 1: the device fits to no network"


def bit_rates(device: LintedDevice) -> set[int]:
    """Return the bit rates in kbit/s that a device supports."""
    return {rate for rate in BIT_RATES if device.number("deviceinfo", f"baudrate_{rate}") == Number(1)}


def pdo_count_of(key: str, direction: PdoDirection) -> Check:
    """Return the check that the declared number of PDOs is the number of communication records."""

    def check(device: LintedDevice) -> Violations:
        declared, compact = (device.number("deviceinfo", each) for each in (key.lower(), "compactpdo"))
        real = sum(index in values.COMMUNICATION_RECORDS[direction] for index in device.objects)
        # CompactPDO describes records without sections, which cannot be counted here.
        if declared and declared.value != real and not (compact and compact.value):
            at = device.at("deviceinfo", key.lower())
            yield at, f"{key} is {declared.value}, but there are {real} records from 0x{direction.value:04X} on"

    return check


def granularity(device: LintedDevice) -> int | None:
    """Return the mapping granularity in bits, if [DeviceInfo] has a valid one (0 to 64)."""
    number = device.number("deviceinfo", "granularity")
    return number.value if number and 0 <= number.value <= 64 else None


@RULES.rule("W225", "CiA 306, [DeviceInfo]")
def granularity_zero(device: LintedDevice) -> Violations:
    """Granularity is above 0 if a mapping can be changed."""
    if granularity(device) == 0 and any(pdo.mapping and pdo.mapping.is_writable for pdo in device.pdos):
        at = device.at("deviceinfo", "granularity")
        yield at, "Granularity is 0 (no mapping can be changed), but there is a writable one"


@RULES.rule("W226", "CiA 306, [DeviceInfo]")
def granularity_above_zero(device: LintedDevice) -> Violations:
    """Granularity is 0 if no mapping can be changed."""
    mappings = [pdo.mapping for pdo in device.pdos if pdo.mapping]
    if granularity(device) and mappings and not any(each.is_writable for each in mappings):
        yield device.at("deviceinfo", "granularity"), "Granularity is above 0, but no mapping is writable"


@RULES.rule("E227", "CiA 306, [DeviceInfo]")
def below_granularity(device: LintedDevice) -> Violations:
    """No mapped object is shorter than the granularity."""
    bits = granularity(device) or 0
    for pdo, each, by in device.mapped:
        if 0 < each.bits < bits:
            yield by.place, f"{pdo.title} maps {each.bits} bits of {each.where}, less than the granularity {bits}"


@RULES.rule("W230", "CiA 305, LSS address")
def incomplete_lss(device: LintedDevice) -> Violations:
    """A device with LSS has its whole identity, 0x1018 sub 1 to 4."""
    missing = [sub for sub in (1, 2, 3, 4) if device.variable(0x1018, sub) is None]
    if device.document.text("deviceinfo", "lss_supported") == "1" and missing and 0x1018 in device.objects:
        yield device.at("deviceinfo", "lss_supported"), f"LSS_Supported is 1, but 0x1018 has no sub {missing[0]}"


RULES += (
    Rule(code, demand, f"CiA 306, [{name}]", form_of(keys, form, name.lower()))
    for code, demand, name, keys, form in FORMS
)
RULES += (
    Rule("E229", "CompactPDO is a mask of the six communication parameters.",
         "CiA 306, [DeviceInfo]; public: dcf-tools, parse.py, reads bits 0 to 5",
         form_of(("CompactPDO",), up_to(0x3F, "0 to 0x3F"), "deviceinfo")),
    Rule("E201", "[FileInfo] has FileName, FileVersion and FileRevision.", "CiA 306, [FileInfo]",
         missing_of(_only("fileinfo"), *cia306.FILE_INFO)),
    Rule("E202", "[FileInfo] has EDSVersion.", "CiA 306, [FileInfo]",
         missing_of(_only("fileinfo"), "EDSVersion",
                    sentence="{key} is missing in [{name}]: a reader takes the file as one of edition 3.0")),
    Rule("W203", "[FileInfo] says what the file is, who made it and when.", "CiA 306, [FileInfo]",
         missing_of(_only("fileinfo"), *cia306.ORIGIN)),
    Rule("E212", "[DeviceInfo] names vendor, product and revision, as far as 0x1018 does.", "CiA 306, [DeviceInfo]",
         missing_of(_only("deviceinfo"), "VendorName", "VendorNumber", "ProductName")),
    Rule("W213", "[DeviceInfo] has all its keys.", "CiA 306, [DeviceInfo]",
         missing_of(_only("deviceinfo"), *cia306.DEVICE_INFO)),
    Rule("E218", "VendorNumber equals 0x1018 sub 1.", "CiA 306, [DeviceInfo]", identity_of("VendorNumber", 1)),
    Rule("E219", "ProductNumber equals 0x1018 sub 2.", "CiA 306, [DeviceInfo]", identity_of("ProductNumber", 2)),
    Rule("E220", "RevisionNumber equals 0x1018 sub 3.", "CiA 306, [DeviceInfo]", identity_of("RevisionNumber", 3)),
    Rule("E221", "NrOfRXPDO is the number of RPDO communication records, unless CompactPDO describes them.",
         "CiA 306, [DeviceInfo]", pdo_count_of("NrOfRXPDO", PdoDirection.RPDO)),
    Rule("E222", "NrOfTXPDO is the number of TPDO communication records, unless CompactPDO describes them.",
         "CiA 306, [DeviceInfo]", pdo_count_of("NrOfTXPDO", PdoDirection.TPDO)),
)  # fmt: skip

# Dummies, comments


def dummies(device: LintedDevice) -> dict[int, Entry]:
    """Return the entries of [DummyUsage] by data type."""
    entries = _entries(device, "dummyusage")
    return {int(key[5:], 16): entry for key, entry in entries.items() if key in KNOWN_KEYS["dummyusage"]}


@RULES.rule("W232", "CiA 306, [DummyUsage]")
def missing_dummies(device: LintedDevice) -> Violations:
    """[DummyUsage] has Dummy0001 to Dummy0007."""
    section = device.section("dummyusage")
    missing = [code for code in values.DUMMIES if code not in dummies(device)]
    if section and missing:
        yield section, f"Dummy{missing[0]:04X} is missing"


@RULES.rule("W233", "CiA 306, [DummyUsage]")
def short_dummies(device: LintedDevice) -> Violations:
    """An enabled dummy is not shorter than the granularity."""
    least = granularity(device) or 0
    for code, entry in dummies(device).items():
        bits = values.DATA_TYPES[code].bits if code in values.DATA_TYPES else 0
        if entry.value == "1" and 0 < bits < least:
            yield entry, f"{entry.key} has {bits} bits, less than the granularity {least}"


@RULES.rule("E234", "CiA 306, [Comments]")
def comment_lines(device: LintedDevice) -> Violations:
    """Lines is the number of comment lines."""
    declared = device.number("comments", "lines")
    real = len(_entries(device, "comments").keys() - {"lines"})
    if device.section("comments") and (declared is None or declared.value != real):
        text = device.document.text("comments", "lines")[:20] or "missing"
        yield device.at("comments", "lines"), f"Lines is {text}, but there are {real} lines"


def gaps_of(*names: str) -> Check:
    """Return the check that the entries of sections with numbered entries have no gap."""

    def check(device: LintedDevice) -> Violations:
        for name in names:
            section = device.section(name)
            numbers = _numbers(device, name)
            missing = next((n for n in range(1, len(numbers) + 1) if n not in numbers), None)
            if section and missing:
                yield section, f"{NUMBERED[name][1].title()}{missing} is missing in [{section.name}]"

    return check


def _numbers(device: LintedDevice, name: str) -> dict[int, Entry]:
    """Return the entries of a section with numbered entries, by number."""
    keys = ((key.removeprefix(NUMBERED[name][1]), entry) for key, entry in _entries(device, name).items())
    # E119 reports longer numbers; `int` raises for thousands of digits.
    return {int(key): entry for key, entry in keys if key.isdecimal() and len(key) < 10}


# Lists of objects


def _lists(device: LintedDevice) -> Iterator[tuple[Section, dict[int, Entry]]]:
    """Yield the object lists in the file, with their entries by number."""
    for name in LISTS:
        section = device.section(name)
        if section:
            yield section, _numbers(device, name)


def listed(device: LintedDevice, *names: str) -> list[tuple[int, Entry]]:
    """Return the indices in some object lists, in order, with their entries."""
    entries = (entry for name in names for _, entry in sorted(_numbers(device, name).items()))
    return [(number.value, entry) for entry in entries for number in [parse_number(entry.value)] if number]


@RULES.rule("E301", "CiA 306, object lists")
def no_supported_objects(device: LintedDevice) -> Violations:
    """A list of objects says how many it has."""
    for section, _ in _lists(device):
        if parse_number(section.text("supportedobjects")) is None:
            yield section.at("supportedobjects"), f"[{section.name}] has no number as its SupportedObjects"


@RULES.rule("E302", "CiA 306, object lists")
def supported_objects(device: LintedDevice) -> Violations:
    """SupportedObjects is the number of entries."""
    for section, entries in _lists(device):
        declared = parse_number(section.text("supportedobjects"))
        real = len(entries)
        if declared and declared.value != real:
            at = section.at("supportedobjects")
            yield at, f"SupportedObjects is {declared.value}, but [{section.name}] has {real} entries"


@RULES.rule("E304", "CiA 306, object lists")
def no_indices(device: LintedDevice) -> Violations:
    """The entries of a list are indices."""
    for _, entries in _lists(device):
        for entry in entries.values():
            number = parse_number(entry.value)
            if number is None or not 0 <= number.value <= 0xFFFF or number.relative:
                yield entry, f"{entry.value[:20] or 'nothing'} is not an index from 0x1000 to 0xFFFF"


@RULES.rule("E305", "CiA 306, object lists")
def listed_twice(device: LintedDevice) -> Violations:
    """An object is listed once."""
    first: dict[int, Entry] = {}
    for index, entry in listed(device, *LISTS):
        if first.setdefault(index, entry) is not entry:
            yield entry, f"0x{index:04X} is listed twice, first in line {first[index].line}"


@RULES.rule("E306", "CiA 306, object lists")
def listed_only(device: LintedDevice) -> Violations:
    """A listed object has a section."""
    for index, entry in listed(device, *LISTS):
        # W313 and E304 report indices below 0x1000 or above 0xFFFF.
        if values.FIRST <= index <= 0xFFFF and (index not in device.objects or device.objects[index].section is None):
            yield entry, f"0x{index:04X} is listed, but there is no section [{index:04X}]"


@RULES.rule("E307", "CiA 306, object lists")
def described_only(device: LintedDevice) -> Violations:
    """An object with a section is listed."""
    known = {index for index, _ in listed(device, *LISTS)}
    for index, each in device.objects.items():
        if index not in known:
            yield each.place, f"0x{index:04X} is described, but in none of the lists of objects"


@RULES.rule("E308", "CiA 301, mandatory objects")
def missing_mandatory(device: LintedDevice) -> Violations:
    """0x1000, 0x1001 and 0x1018 exist."""
    for index in MANDATORY:
        if index not in device.objects and device.objects:  # E120 reports a file without objects
            yield device.section("mandatoryobjects") or TOP, f"0x{index:04X} is missing, which every device has"


def misplaced_of(names: Sequence[str], is_wrong: Callable[[int], bool], sentence: str) -> Check:
    """Return the check that some object lists do not contain the wrong indices."""

    def check(device: LintedDevice) -> Violations:
        return ((entry, f"0x{index:04X} {sentence}") for index, entry in listed(device, *names) if is_wrong(index))

    return check


RULES += (
    Rule("E235", "Comment lines are numbered without gaps.", "CiA 306, [Comments]", gaps_of("comments")),
    Rule("E303", "The entries of a list are numbered without gaps.", "CiA 306, object lists", gaps_of(*LISTS)),
    Rule("E309", "0x1000, 0x1001 and 0x1018 are in [MandatoryObjects].", "CiA 306, object lists",
         misplaced_of(LISTS[1:], lambda index: index in MANDATORY, "belongs in [MandatoryObjects]")),
    Rule("E310", "Only 0x1000, 0x1001 and 0x1018 are in [MandatoryObjects].", "CiA 306, object lists",
         misplaced_of(LISTS[:1], lambda index: index not in MANDATORY and index >= values.FIRST,
                      "is not mandatory; it belongs in another list")),
    Rule("E311", "0x2000..0x5FFF are not in [OptionalObjects].", "CiA 306, object lists",
         misplaced_of(LISTS[1:2], lambda index: index in values.MANUFACTURER,
                      "is manufacturer-specific; it belongs in [ManufacturerObjects]")),
    Rule("E312", "Only 0x2000..0x5FFF are in [ManufacturerObjects].", "CiA 306, object lists",
         misplaced_of(LISTS[2:], lambda index: index not in values.MANUFACTURER and index not in MANDATORY,
                      "is outside 0x2000..0x5FFF; it belongs in [OptionalObjects]")),
    Rule("W313", "Data types are not listed as objects.", "CiA 306, object lists",
         misplaced_of(LISTS, lambda index: 0 <= index < values.FIRST, "is a data type, not an object")),
)  # fmt: skip


# Configuration: [DeviceComissioning], and keys of a DCF


SPELLINGS = ("devicecomissioning", "devicecommissioning")
"""Names of the section: as CiA 306 misspells it, and in correct spelling."""

DCF_KEYS = ("parametervalue", "denotation", "uploadfile", "downloadfile", "paramrefd")
"""Keys of objects that only a DCF has."""


@CONFIGURATION.rule("E701", "CiA 306, DCF")
def without_commissioning(device: LintedDevice) -> Violations:
    """A DCF has [DeviceComissioning]."""
    if device.is_dcf and device.commissioning is None:
        yield TOP, "a DCF without [DeviceComissioning]: its node-ID is unknown"


@CONFIGURATION.rule("W702", "CiA 306, DCF")
def spelling_of_commissioning(device: LintedDevice) -> Violations:
    """The section is spelled [DeviceComissioning]."""
    section = device.section("devicecommissioning")
    if section:
        yield section, "[DeviceCommissioning] is spelled [DeviceComissioning] in CiA 306, and tools look for that"


@CONFIGURATION.rule("E703", "CiA 306, [DeviceComissioning]")
def node_id(device: LintedDevice) -> Violations:
    """NodeID is 1 to 127."""
    section = device.commissioning
    if section and device.node_id is None:
        yield section.at("nodeid"), f"NodeID is {section.text('nodeid')[:20] or 'missing'}, not 1 to 127"


@CONFIGURATION.rule("E704", "CiA 306, [DeviceComissioning]")
def bit_rate(device: LintedDevice) -> Violations:
    """Baudrate is a bit rate of CANopen in kbit/s."""
    section = device.commissioning
    number = device.commissioned("baudrate")
    if section and (number is None or number.value not in BIT_RATES):
        text = section.text("baudrate")[:20] or "missing"
        yield section.at("baudrate"), f"Baudrate is {text}, not one of {BIT_RATES} kbit/s"


@CONFIGURATION.rule("E705", "CiA 306, [DeviceComissioning]")
def unsupported_bit_rate(device: LintedDevice) -> Violations:
    """Baudrate is one that the device supports."""
    section = device.commissioning
    number = device.commissioned("baudrate")
    rates = bit_rates(device)
    if section and number and number.value in BIT_RATES and rates and number.value not in rates:
        yield section.at("baudrate"), f"Baudrate is {number.value} kbit/s, but BaudRate_{number.value} is not 1"


@CONFIGURATION.rule("E708", "CiA 306, [DeviceComissioning]")
def serial_number(device: LintedDevice) -> Violations:
    """LSS_SerialNumber equals 0x1018 sub 4."""
    section = device.commissioning
    declared = device.commissioned("lss_serialnumber")
    real = device.value(0x1018, 4)
    if section and declared and real and declared != real:
        at = section.at("lss_serialnumber")
        yield at, f"LSS_SerialNumber is 0x{declared.value:08X}, but 0x1018 sub 4 is 0x{real.value:08X}"


@CONFIGURATION.rule("W709", "CiA 306, LastEDS")
def without_last_eds(device: LintedDevice) -> Violations:
    """A DCF says which EDS it was made from."""
    section = device.section("fileinfo")
    if device.is_dcf and section and not section.text("lasteds"):
        yield section.at("lasteds"), "LastEDS is missing, which says from which EDS this DCF was made"


@CONFIGURATION.rule("W710", "CiA 306, DCF")
def dcf_keys_in_eds(device: LintedDevice) -> Violations:
    """ParameterValue, Denotation, UploadFile and DownloadFile are only in a DCF."""
    if device.is_dcf:
        return
    for key in DCF_KEYS:
        for section, entry in device.entries[key]:
            yield entry, f"{entry.key} of [{section.name}] belongs in a DCF"


@CONFIGURATION.rule("E711", "CiA 306, DCF")
def parameter_of_constant(device: LintedDevice) -> Violations:
    """A constant's ParameterValue equals its DefaultValue."""
    for each in device.variables:
        given, default = each.number("parametervalue"), each.number("defaultvalue")
        if each.access == "const" and given and default and given != default:  # a master cannot write it
            at = each.section.at("parametervalue")
            yield at, f"ParameterValue of {each.where}, which is const, is not its DefaultValue"


@CONFIGURATION.rule("E712", "CiA 306, DCF")
def file_of_number(device: LintedDevice) -> Violations:
    """Only a DOMAIN, or a string that no line can hold, has UploadFile or DownloadFile."""
    for each in device.variables:
        for key in ("uploadfile", "downloadfile"):
            entry = each.section.entries.get(key)
            if entry and entry.value and each.type and each.type.size:
                yield entry, f"{entry.key} of {each.where}, a {each.type.name}"


def is_concise(text: str) -> bool:
    """Return whether a text is a concise DCF in hexadecimal digits."""
    try:
        dcf.unpack(bytes.fromhex(text))
    except ValueError:  # not hexadecimal, or concise.Truncated
        return False
    return True


@CONFIGURATION.rule("E713", "CiA 302-3, object 0x1F22; public: dcf-tools, dcfgen")
def concise_dcf(device: LintedDevice) -> Violations:
    """A concise DCF is complete."""
    for sub, variable in device.subs(0x1F22).items():
        at = variable.value_entry
        if sub and at and at.value and not is_concise(at.value):  # an empty one is valid
            yield at, f"{variable.where} is not a concise DCF: count, then index, sub-index, size and data for each"


CONFIGURATION += (
    Rule("E706", "NetNumber and LSS_SerialNumber are UNSIGNED32.", "CiA 306, [DeviceComissioning]",
         form_of(("NetNumber", "LSS_SerialNumber"), up_to(UNSIGNED32.high), *SPELLINGS)),
    Rule("E707", "CANopenManager is 0 or 1.", "CiA 306, [DeviceComissioning]",
         form_of(("CANopenManager",), up_to(1), *SPELLINGS)),
)  # fmt: skip


# Modules of a modular device (CiA 306-1); their objects exist once they are connected


CLAUSE = "CiA 306, modular devices"

INFO_KEYS = ("ProductName", "ProductVersion", "ProductRevision", "OrderCode")
DESCRIBED_BY = {"fixedobjects": "Fixed", "subextends": "SubExt"}
"""A module's lists, and the prefix of the sections of their objects after the module's number."""


@MODULES.rule("E461", CLAUSE)
def module_count(device: LintedDevice) -> Violations:
    """NrOfEntries of [SupportedModules] is the number of modules that are described."""
    section = device.section(SUPPORTED)
    real = len(device.modules.supported)
    if section and parse_number(section.text("nrofentries")) != Number(real):
        yield section.at("nrofentries"), f"NrOfEntries is not {real}, the number of [M...ModuleInfo] sections"
    elif section is None and real:
        yield device.section(f"m{min(device.modules.supported)}moduleinfo") or TOP, "[SupportedModules] is missing"


@MODULES.rule("E463", CLAUSE)
def undescribed_module_object(device: LintedDevice) -> Violations:
    """An object in a module's list has a section that describes it."""
    for number in device.modules.supported:
        for part, head in DESCRIBED_BY.items():
            for entry in device.modules.listed(number, part):
                index = parse_number(entry.value)
                names = [f"m{number}{head.lower()}{index.value:{form}}" for form in ("04x", "x")] if index else []
                if not any(device.section(name) for name in names):
                    shown = f"{index.value:04X}" if index else "..."
                    yield entry, f"{entry.value[:40]} is listed, but there is no section [M{number}{head}{shown}]"


@MODULES.rule("E464", CLAUSE)
def extension_count(device: LintedDevice) -> Violations:
    """Count is a number of sub-indices, or `0;` and the bits of one; ObjExtend is a sub-index."""
    for section in _extensions(device):
        # COUNT also matches 0, which adds nothing.
        if not COUNT.fullmatch(section.text("count")) or section.text("count") == "0":
            yield section.at("count"), f"Count of [{section.name}] is neither a number of sub-indices nor 0;bits"
        last = section.text("objextend")
        number = parse_number(last)
        if last and (number is None or not 0 <= number.value <= MOST_SUBS):
            yield section.at("objextend"), f"ObjExtend of [{section.name}] is not a sub-index from 0 to {MOST_SUBS}"


def _infos(device: LintedDevice) -> Iterator[Section]:
    return (device.document.sections[f"m{number}moduleinfo"] for number in device.modules.supported)


def _extensions(device: LintedDevice) -> list[Section]:
    """Return the sections that describe the sub-indices that modules add to arrays."""
    modules = device.modules
    # [M1SubExtends] is the list of the [M1SubExt6000] sections.
    heads = tuple(f"m{number}subext" for number in modules.supported)
    sections = device.document.sections
    return [each for name, each in sections.items() if name.startswith(heads) and not name.endswith("extends")]


@MODULES.rule("E465", CLAUSE)
def unknown_module(device: LintedDevice) -> Violations:
    """A connected module is one that the file supports."""
    for entry in device.modules.connected:
        if entry.value != "0" and device.modules.find(entry.value) is None:
            yield entry, f"module {entry.value[:40]} is connected, but there is no [M{entry.value[:40]}ModuleInfo]"


@MODULES.rule("W466", "CiA 301, object 0x1027")
def module_list(device: LintedDevice) -> Violations:
    """A device with modules has the module list, 0x1027, and no other has it."""
    section = device.section(SUPPORTED) or device.section(CONNECTED)
    there = device.objects.get(MODULE_LIST)
    if section and there is None:
        yield section, "there are modules, but no module list (0x1027)"
    if there and section is None and not device.modules.supported:
        yield there.place, "there is a module list (0x1027), but no [SupportedModules]"


@MODULES.rule("E467", CLAUSE)
def doubly_described(device: LintedDevice) -> Violations:
    """An object that a module brings once is not extended by it, nor described for the device itself."""
    for number in device.modules.supported:
        extended = device.modules.indices(number, "subextends")
        for entry in device.modules.listed(number, "fixedobjects"):
            index = parse_number(entry.value)
            if index and index.value in extended:
                yield entry, f"0x{index.value:04X} is both in [M{number}FixedObjects] and in [M{number}SubExtends]"
            # A DCF has sections for the objects of connected modules.
            elif index and index.value in device.objects and not device.modules.connected:
                yield entry, f"0x{index.value:04X} of module {number} is described as an object of the device, too"


MODULES += (
    Rule(
        "W462", "A module has a name, a version, a revision and an order code.", CLAUSE, missing_of(_infos, *INFO_KEYS)
    ),
    Rule("E468", "An extension of an array has a DataType.", CLAUSE, missing_of(_extensions, "DataType")),
    Rule("E469", "An extension of an array has an AccessType.", CLAUSE, missing_of(_extensions, "AccessType")),
)
