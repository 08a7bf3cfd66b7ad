"""Rules about the file itself (CiA 306): how it is written, [FileInfo], [DeviceInfo], dummies, comments, object lists.

Here and in the other files of rules, a rule is one row of a table at the end of its part and a small function above
it, which gets the device and yields problems; a check that is made from data is made by a function named `..._of`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from eurobot_od.lint.findings import Problem, Problems, Rule
from eurobot_od.lint.model import LintedDevice
from eurobot_od.od.description import OBJECT_LISTS, DescribedObject
from eurobot_od.od.document import Entry, Odd, Section
from eurobot_od.od.values import (
    COMMUNICATION_RECORDS,
    DATA_TYPES,
    DUMMIES,
    MANUFACTURER,
    PDO_COUNT,
    UNSIGNED32,
    PdoDirection,
    parse_number,
)

Check = Callable[[LintedDevice], Problems]

# How it is written


def oddity_of(kind: Odd, sentence: str) -> Check:
    """Make the rule that reports what the reader stumbled over; `{}` in the sentence is the oddity's own text."""

    def check(device: LintedDevice) -> Problems:
        return (Problem(each, sentence.format(each.text)) for each in device.document.oddities if each.kind is kind)

    return check


BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates in kbit/s that have a key in [DeviceInfo] (CiA 306) and a bit timing (CiA 301, Table 1)."""
BIT_RATE_KEYS = tuple(f"BaudRate_{rate}" for rate in BIT_RATES)
FLAGS = ("SimpleBootUpMaster", "SimpleBootUpSlave", "GroupMessaging", "LSS_Supported")
IDENTITY = ("VendorNumber", "ProductNumber", "RevisionNumber")
"""Keys of [DeviceInfo] that say the same as 0x1018 sub 1, 2 and 3."""
FILE_INFO = ("FileName", "FileVersion", "FileRevision", "EDSVersion", "Description")
TIMES = ("CreationTime", "ModificationTime")
DATES = ("CreationDate", "ModificationDate")
PEOPLE = ("CreatedBy", "ModifiedBy")
DEVICE_INFO = ("VendorName", "ProductName", "OrderCode", "NrOfRXPDO", "NrOfTXPDO", "Granularity")
COMMISSIONING = (
    "NodeID",
    "NodeName",
    "NodeRefd",
    "Baudrate",
    "NetNumber",
    "NetworkName",
    "NetRefd",
    "CANopenManager",
    "LSS_SerialNumber",
)
OBJECT_KEYS = (
    "SubNumber",
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "LowLimit",
    "HighLimit",
    "DefaultValue",
    "PDOMapping",
    "ObjFlags",
    "CompactSubObj",
    "ParameterValue",
    "UploadFile",
    "DownloadFile",
    "Denotation",
    "ParamRefd",
)


def _lower(*keys: str) -> frozenset[str]:
    return frozenset(each.lower() for each in keys)


KNOWN_KEYS: dict[str, frozenset[str]] = {
    "fileinfo": _lower(*FILE_INFO, *TIMES, *DATES, *PEOPLE, "LastEDS"),
    "deviceinfo": _lower(
        *DEVICE_INFO, *IDENTITY, *BIT_RATE_KEYS, *FLAGS, "DynamicChannelsSupported", "CompactPDO",
        "ExtendedBootUpMaster", "ExtendedBootUpSlave",
    ),
    "devicecomissioning": _lower(*COMMISSIONING),
    "devicecommissioning": _lower(*COMMISSIONING),
    "dummyusage": frozenset(f"dummy{code:04x}" for code in range(1, 0x20)),
}  # fmt: skip
"""The keys of each section with a fixed set of them, in lower case."""

NUMBERED = {"comments": ("lines", "line"), **{each.lower(): ("supportedobjects", "") for each in OBJECT_LISTS}}
"""Sections that count: the key with the number of entries, and what stands before an entry's number."""

ELSEWHERE = ("tool", "dynamicchannels", "supportedmodules", "connectedmodules", "standarddatatypes", "links")
"""First words of further sections that exist (tools, modular devices, older editions) and are not checked."""

_OBJECT_KEYS = _lower(*OBJECT_KEYS)
_HEXADECIMAL = frozenset("0123456789abcdef")


def _is_module(name: str) -> bool:
    """Whether a section belongs to a module of a modular device: M1ModuleInfo, M2SubExt1000."""
    return name[:1] == "m" and name[1:2].isdigit()


def unknown_sections(device: LintedDevice) -> Iterator[Problem]:
    """Yield sections that no edition of CiA 306 has."""
    for section in device.other_sections:
        name = section.name.strip().lower()
        if name in KNOWN_KEYS or name in NUMBERED or looks_like_object(name):
            continue
        if not name.startswith(ELSEWHERE) and not name.endswith("objectlinks") and not _is_module(name):
            yield Problem(section, f"unknown section [{section.name}]")


def looks_like_object(name: str) -> bool:
    """Whether a name is meant as that of an object's section, however it is written: 0x1000, 01000, 1000sub01."""
    bare = name.replace(" ", "").replace("\t", "").removeprefix("0x")
    head, sub, tail = bare.partition("sub")
    digits = head.lstrip("0") if len(head) != 4 else head
    fits = bool(tail.lstrip("0") or "0" in tail) if sub else bool(digits)
    return fits and 3 <= len(digits) <= 4 and set(digits + tail) <= _HEXADECIMAL and any(d.isdigit() for d in digits)


def malformed_names(device: LintedDevice) -> Iterator[Problem]:
    """Yield sections of objects whose names other programs do not find."""
    wrong = [each for each in device.other_sections if looks_like_object(each.name.strip().lower())]
    for section in wrong + [each for _, each in device.object_sections if each.name != each.name.strip()]:
        yield Problem(section, f"[{section.name}] is not how an object's section is named, as [1018] or [1018sub1] is")


def unknown_keys(device: LintedDevice) -> Iterator[Problem]:
    """Yield keys that their section does not have."""
    for name, known in KNOWN_KEYS.items():
        section = device.section(name)
        yield from _unknown(section, known) if section else ()
    for object_name, section in device.object_sections:
        if not object_name.list and not section.entries.keys() <= _OBJECT_KEYS:
            yield from _unknown(section, _OBJECT_KEYS)


def _unknown(section: Section, known: frozenset[str]) -> Iterator[Problem]:
    for key, entry in section.entries.items():
        if key and key not in known:
            yield Problem(entry, f"unknown key {entry.key} in [{section.name}]")


def unknown_numbers(device: LintedDevice) -> Iterator[Problem]:
    """Yield keys of a counting section that are no entry's number."""
    for name, (count, prefix) in NUMBERED.items():
        for key, entry in _entries(device, name):
            number = key.removeprefix(prefix)
            if (
                key
                and key != count
                and (not number.isdecimal() or number.startswith("0") or not key.startswith(prefix))
            ):
                yield Problem(entry, f"{entry.key} is no number of an entry of [{device.document.sections[name].name}]")


def _entries(device: LintedDevice, name: str) -> list[tuple[str, Entry]]:
    section = device.section(name)
    return list(section.entries.items()) if section else []


def missing_sections(device: LintedDevice) -> Iterator[Problem]:
    """Yield sections that every file has."""
    for name in ("FileInfo", "DeviceInfo", "MandatoryObjects"):
        if device.section(name.lower()) is None:
            yield Problem(TOP, f"[{name}] is missing")


TOP = Entry("", "", 1, 1)
"""Where a finding about the whole file stands."""

TEXT_RULES = (
    Rule("E101", "A file is text.", "CiA 306, file format", oddity_of(Odd.BINARY, "a NUL byte: this is no text file")),
    Rule("E102", "A file is ASCII text, not UTF-16.", "CiA 306, file format",
         oddity_of(Odd.WIDE, "this is UTF-16, which most tools cannot read; save it as ASCII")),
    Rule("W103", "A file has ASCII characters only.", "CiA 306, file format",
         oddity_of(Odd.NOT_ASCII, "a character outside ASCII; what it shows depends on the reader's code page")),
    Rule("I104", "A file has no byte order mark.", "CiA 306, file format",
         oddity_of(Odd.BYTE_ORDER_MARK, "a byte order mark, which some tools take as part of the first section")),
    Rule("I105", "All lines of a file end alike.", "CiA 306, file format",
         oddity_of(Odd.LINE_ENDS, "lines end in different ways (CR, LF, CRLF)")),
    Rule("E106", "A line is a section header, an entry or a comment.", "CiA 306, file format",
         oddity_of(Odd.NOT_AN_ENTRY, "neither [section] nor key=value nor ;comment: {}")),
    Rule("E107", "A section header is [name] and nothing else.", "CiA 306, file format",
         oddity_of(Odd.HEADER, "malformed section header {}")),
    Rule("E108", "Every entry is in a section.", "CiA 306, file format",
         oddity_of(Odd.NO_SECTION, "entry {} stands before the first section")),
    Rule("E109", "A section is there once, whatever its upper and lower case.", "CiA 306, file format",
         oddity_of(Odd.TWO_SECTIONS, "section {}, is there again; only the first counts here")),
    Rule("E110", "A key is in a section once, whatever its upper and lower case.", "CiA 306, file format",
         oddity_of(Odd.TWO_ENTRIES, "key {}, is there again; only the first counts here")),
    Rule("E111", "An entry has a key.", "CiA 306, file format", oddity_of(Odd.NO_KEY, "an entry without a key")),
    Rule("E112", "A key and its value have together less than 255 characters.", "CiA 306, file format",
         oddity_of(Odd.TOO_LONG, "{}; 254 is the most")),
    Rule("I113", "A comment is a line of its own.", "CiA 306, file format (some readers cut, others keep it)",
         oddity_of(Odd.COMMENT_AFTER_VALUE, "a comment after a value, which some tools take as part of the value")),
    Rule("W114", "A comment starts with a semicolon.", "CiA 306, file format",
         oddity_of(Odd.HASH, "a comment with #, which only some tools skip")),
    Rule("W115", "A line is not indented.", "public: Python's configparser takes such a line as the last value's next",
         oddity_of(Odd.INDENTED, "an indented line, which tools built on configparser add to the value before")),
    Rule("W116", "A section is one of those of CiA 306.", "CiA 306, all sections", unknown_sections),
    Rule("E117", "An object's section is named by 4 hexadecimal digits, `sub` and the sub-index without leading zero.",
         "CiA 306, object description", malformed_names),
    Rule("W118", "A key is one of those its section has.", "CiA 306, all sections", unknown_keys),
    Rule("E119", "Entries that are counted are numbered 1, 2, 3 without leading zeros.",
         "CiA 306, object lists and comments", unknown_numbers),
    Rule("E120", "[FileInfo], [DeviceInfo] and [MandatoryObjects] are there.", "CiA 306, all sections",
         missing_sections),
)  # fmt: skip

# [FileInfo], [DeviceInfo]


def missing_of(name: str, keys: tuple[str, ...], why: str = "") -> Check:
    """Make the rule that a section, if it is there, has these keys."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        section = device.section(name)
        for key in keys if section else ():
            if section and not section.text(key.lower()):
                yield Problem(section.at(key.lower()), f"{key} is missing in [{section.name}]{why}")

    return check


def form_of(name: str, keys: tuple[str, ...], fits: Callable[[str], bool], form: str) -> Check:
    """Make the rule that the values of these keys of a section, where they are given, have a form."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        for key, entry in _entries(device, name):
            if key in lower and entry.value and not fits(entry.value):
                yield Problem(entry, f"{entry.key} is {entry.value[:40]}, but has to be {form}")

    lower = _lower(*keys)
    return check


def in_range_of(low: int, high: int) -> Callable[[str], bool]:
    """Make the test whether a text is a number from `low` to `high`."""

    def fits(text: str) -> bool:
        number = parse_number(text)
        return number is not None and not number.relative and low <= number.value <= high

    return fits


IS_FLAG = in_range_of(0, 1)


def is_version(text: str) -> bool:
    """Whether a text is a version: 4.0."""
    major, point, minor = text.partition(".")
    return major.isdecimal() and (minor.isdecimal() if point else True)


def is_time(text: str) -> bool:
    """Whether a text is a time: 09:30AM."""
    hour, minute, half = text[:2], text[3:5], text[5:].upper()
    digits = hour.isdecimal() and minute.isdecimal() and text[2:3] == ":"
    return digits and int(hour) <= 12 and int(minute) <= 59 and half in ("AM", "PM")


def is_date(text: str) -> bool:
    """Whether a text is a date: 05-28-2014."""
    parts = text.split("-")
    if [len(each) for each in parts] != [2, 2, 4] or not all(each.isdecimal() for each in parts):
        return False
    return 1 <= int(parts[0]) <= 12 and 1 <= int(parts[1]) <= 31


def old_edition(device: LintedDevice) -> Iterator[Problem]:
    """Yield an EDSVersion before 4.0."""
    for key, entry in _entries(device, "fileinfo"):
        if key == "edsversion" and is_version(entry.value) and int(entry.value.partition(".")[0][:9]) < 4:
            yield Problem(entry, f"EDSVersion {entry.value[:40]} is before 4.0, the edition with all of today's keys")


def other_file_name(device: LintedDevice) -> Iterator[Problem]:
    """Yield a FileName that is not the file's."""
    section = device.section("fileinfo")
    name = section.text("filename") if section else ""
    if section and name and name.lower() != device.name.lower():
        yield Problem(section.at("filename"), f"FileName is {name[:60]}, the file is {device.name}")


def modified_before_created(device: LintedDevice) -> Iterator[Problem]:
    """Yield a modification date before the creation date."""
    section = device.section("fileinfo")
    created, modified = (section.text(key.lower()) for key in DATES) if section else ("", "")
    if section and is_date(created) and is_date(modified) and _sortable(modified) < _sortable(created):
        yield Problem(section.at("modificationdate"), f"modified {modified}, before it was created {created}")


def _sortable(date: str) -> tuple[str, str, str]:
    return date[6:], date[:2], date[3:5]


def identity_of(key: str, sub: int) -> Check:
    """Make the rule that a number of [DeviceInfo] is the one in the identity object."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        section = device.section("deviceinfo")
        said = parse_number(section.text(key.lower())) if section else None
        identity = device.value(0x1018, sub)
        if section and said and identity and said != identity:
            at = section.at(key.lower())
            yield Problem(at, f"{key} is 0x{said.value:08X}, but 0x1018 sub {sub} is 0x{identity.value:08X}")

    return check


def no_bit_rate(device: LintedDevice) -> Iterator[Problem]:
    """Yield a device that supports no bit rate."""
    section = device.section("deviceinfo")
    if section and not bit_rates(device):
        yield Problem(section.at("baudrate_10"), "no BaudRate_... is 1: the device fits to no network")


def bit_rates(device: LintedDevice) -> set[int]:
    """Return the bit rates in kbit/s that a device supports."""
    section = device.section("deviceinfo")
    return {rate for rate in BIT_RATES if section and (parse_number(section.text(f"baudrate_{rate}")) or (0,))[0] == 1}


def pdo_count_of(key: str, direction: PdoDirection) -> Check:
    """Make the rule that the number of PDOs is the number of communication records."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        section = device.section("deviceinfo")
        said = parse_number(section.text(key.lower())) if section else None
        real = sum(index in COMMUNICATION_RECORDS[direction] for index in device.objects)
        if section and said and said.value != real and not _compact_pdo(section):
            at = section.at(key.lower())
            yield Problem(at, f"{key} is {said.value}, but there are {real} records from 0x{direction.value:04X} on")

    return check


def _compact_pdo(section: Section) -> bool:
    number = parse_number(section.text("compactpdo"))
    return number is not None and number.value != 0


def granularity(device: LintedDevice) -> int | None:
    """Return the granularity of mappings in bits, if [DeviceInfo] has one from 0 to 64."""
    section = device.section("deviceinfo")
    number = parse_number(section.text("granularity")) if section else None
    return number.value if number and 0 <= number.value <= 64 else None


def _mappings(device: LintedDevice) -> list[DescribedObject]:
    return [pdo.mapping for pdo in device.pdos if pdo.mapping]


def _granularity_problem(device: LintedDevice, text: str) -> Iterator[Problem]:
    section = device.section("deviceinfo")
    if section:
        yield Problem(section.at("granularity"), text)


def granularity_zero(device: LintedDevice) -> Problems:
    """Yield granularity 0 where a mapping can be changed."""
    if granularity(device) == 0 and any(each.is_writable for each in _mappings(device)):
        return _granularity_problem(device, "Granularity is 0 (no mapping can be changed), but there is a writable one")
    return ()


def granularity_above_zero(device: LintedDevice) -> Problems:
    """Yield a granularity where no mapping can be changed."""
    mappings = _mappings(device)
    if granularity(device) and mappings and not any(each.is_writable for each in mappings):
        return _granularity_problem(device, "Granularity is above 0, but no mapping is writable")
    return ()


def below_granularity(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped objects shorter than the granularity."""
    bits = granularity(device) or 0
    for pdo, each in device.mapped:
        if 0 < each.bits < bits:
            yield Problem(
                each.at, f"{pdo.name} maps {each.bits} bits of {each.where}, less than the granularity {bits}"
            )


def incomplete_lss(device: LintedDevice) -> Iterator[Problem]:
    """Yield LSS without the whole identity that LSS selects a device by."""
    section = device.section("deviceinfo")
    missing = [sub for sub in (1, 2, 3, 4) if device.variable(0x1018, sub) is None]
    if section and section.text("lss_supported") == "1" and missing and 0x1018 in device.objects:
        yield Problem(section.at("lss_supported"), f"LSS_Supported is 1, but 0x1018 has no sub {missing[0]}")


NUMBER8, NUMBER32 = in_range_of(0, 255), in_range_of(0, UNSIGNED32.high)

INFO_RULES = (
    Rule("E201", "[FileInfo] has FileName, FileVersion and FileRevision.", "CiA 306, [FileInfo]",
         missing_of("fileinfo", FILE_INFO[:3])),
    Rule("E202", "[FileInfo] has EDSVersion.", "CiA 306, [FileInfo]",
         missing_of("fileinfo", ("EDSVersion",), ": a reader takes the file as one of edition 3.0")),
    Rule("W203", "[FileInfo] says what the file is, who made it and when.", "CiA 306, [FileInfo]",
         missing_of("fileinfo", ("Description", *TIMES, *DATES, *PEOPLE))),
    Rule("E204", "FileVersion is a number from 0 to 255.", "CiA 306, [FileInfo]",
         form_of("fileinfo", ("FileVersion",), NUMBER8, "0 to 255")),
    Rule("E205", "FileRevision is a number from 0 to 255.", "CiA 306, [FileInfo]",
         form_of("fileinfo", ("FileRevision",), NUMBER8, "0 to 255")),
    Rule("E206", "EDSVersion is two numbers with a point.", "CiA 306, [FileInfo]",
         form_of("fileinfo", ("EDSVersion",), is_version, "like 4.0")),
    Rule("W207", "EDSVersion is 4.0 or later.", "CiA 306, [FileInfo]", old_edition),
    Rule("E208", "Times are hh:mm and AM or PM.", "CiA 306, [FileInfo]",
         form_of("fileinfo", TIMES, is_time, "like 09:30AM")),
    Rule("E209", "Dates are mm-dd-yyyy.", "CiA 306, [FileInfo]",
         form_of("fileinfo", DATES, is_date, "like 05-28-2014")),
    Rule("W210", "FileName is the file's name.", "CiA 306, [FileInfo]", other_file_name),
    Rule("I211", "A file is not modified before it is created.", "CiA 306, [FileInfo]", modified_before_created),
    Rule("E212", "[DeviceInfo] names vendor, product and revision, as far as 0x1018 does.", "CiA 306, [DeviceInfo]",
         missing_of("deviceinfo", ("VendorName", "VendorNumber", "ProductName"))),
    Rule("W213", "[DeviceInfo] has all its keys.", "CiA 306, [DeviceInfo]",
         missing_of("deviceinfo", ("ProductNumber", "RevisionNumber", "OrderCode", *BIT_RATE_KEYS, *FLAGS,
                                   "DynamicChannelsSupported", *DEVICE_INFO[3:]))),
    Rule("E214", "BaudRate_... are 0 or 1.", "CiA 306, [DeviceInfo]",
         form_of("deviceinfo", BIT_RATE_KEYS, IS_FLAG, "0 or 1")),
    Rule("W215", "A device supports at least one bit rate.", "CiA 301, bit rates", no_bit_rate),
    Rule("E216", "SimpleBootUpMaster, SimpleBootUpSlave, GroupMessaging and LSS_Supported are 0 or 1.",
         "CiA 306, [DeviceInfo]", form_of("deviceinfo", FLAGS, IS_FLAG, "0 or 1")),
    Rule("E217", "VendorNumber, ProductNumber and RevisionNumber are UNSIGNED32.", "CiA 306, [DeviceInfo]",
         form_of("deviceinfo", IDENTITY, NUMBER32, "0 to 0xFFFFFFFF")),
    Rule("E218", "VendorNumber is 0x1018 sub 1.", "CiA 306, [DeviceInfo]", identity_of("VendorNumber", 1)),
    Rule("E219", "ProductNumber is 0x1018 sub 2.", "CiA 306, [DeviceInfo]", identity_of("ProductNumber", 2)),
    Rule("E220", "RevisionNumber is 0x1018 sub 3.", "CiA 306, [DeviceInfo]", identity_of("RevisionNumber", 3)),
    Rule("E221", "NrOfRXPDO is the number of RPDO communication records, unless CompactPDO describes them.",
         "CiA 306, [DeviceInfo]", pdo_count_of("NrOfRXPDO", PdoDirection.RPDO)),
    Rule("E222", "NrOfTXPDO is the number of TPDO communication records, unless CompactPDO describes them.",
         "CiA 306, [DeviceInfo]", pdo_count_of("NrOfTXPDO", PdoDirection.TPDO)),
    Rule("E223", "NrOfRXPDO and NrOfTXPDO are numbers from 0 to 512.", "CiA 306, [DeviceInfo]",
         form_of("deviceinfo", ("NrOfRXPDO", "NrOfTXPDO"), in_range_of(0, PDO_COUNT), "0 to 512")),
    Rule("E224", "Granularity is a number from 0 to 64.", "CiA 306, [DeviceInfo]",
         form_of("deviceinfo", ("Granularity",), in_range_of(0, 64), "0 to 64")),
    Rule("E225", "Granularity is above 0 if a mapping can be changed.", "CiA 306, [DeviceInfo]", granularity_zero),
    Rule("W226", "Granularity is 0 if no mapping can be changed.", "CiA 306, [DeviceInfo]", granularity_above_zero),
    Rule("E227", "No mapped object is shorter than the granularity.", "CiA 306, [DeviceInfo]", below_granularity),
    Rule("E228", "DynamicChannelsSupported is a number from 0 to 255.", "CiA 306, [DeviceInfo]",
         form_of("deviceinfo", ("DynamicChannelsSupported",), NUMBER8, "0 to 255")),
    Rule("E229", "CompactPDO is a mask of the six communication parameters.",
         "CiA 306, [DeviceInfo]; public: dcf-tools, parse.py, reads bits 0 to 5",
         form_of("deviceinfo", ("CompactPDO",), in_range_of(0, 0x3F), "0 to 0x3F")),
    Rule("W230", "A device with LSS has its whole identity, 0x1018 sub 1 to 4.", "CiA 305, LSS address",
         incomplete_lss),
)  # fmt: skip

# Dummies, comments


def dummies(device: LintedDevice) -> dict[int, Entry]:
    """Return the entries of [DummyUsage] by data type."""
    return {int(key[5:], 16): entry for key, entry in _entries(device, "dummyusage") if key in KNOWN_KEYS["dummyusage"]}


def missing_dummies(device: LintedDevice) -> Iterator[Problem]:
    """Yield a list of dummies that leaves a type out."""
    section = device.section("dummyusage")
    missing = [code for code in DUMMIES if code not in dummies(device)]
    if section and missing:
        yield Problem(section, f"Dummy{missing[0]:04X} is missing")


def short_dummies(device: LintedDevice) -> Iterator[Problem]:
    """Yield enabled dummies shorter than the granularity."""
    bits = granularity(device) or 0
    for code, entry in dummies(device).items():
        if entry.value == "1" and code in DATA_TYPES and 0 < DATA_TYPES[code].bits < bits:
            yield Problem(entry, f"{entry.key} has {DATA_TYPES[code].bits} bits, less than the granularity {bits}")


def comment_lines(device: LintedDevice) -> Iterator[Problem]:
    """Yield a number of comment lines that is not theirs."""
    section = device.section("comments")
    said = parse_number(section.text("lines")) if section else None
    if section and (said is None or said.value != len(section.entries) - 1):
        real = sum(key != "lines" for key in section.entries)
        yield Problem(
            section.at("lines"), f"Lines is {section.text('lines')[:20] or 'missing'}, but there are {real} lines"
        )


def gaps_of(name: str) -> Check:
    """Make the rule that the entries of a counting section have no gap."""
    prefix = NUMBERED[name][1]

    def check(device: LintedDevice) -> Iterator[Problem]:
        section = device.section(name)
        numbers = _numbers(device, name)
        missing = next((n for n in range(1, len(numbers) + 1) if n not in numbers), None)
        if section and missing:
            yield Problem(section, f"{prefix.title()}{missing} is missing in [{section.name}]")

    return check


def _numbers(device: LintedDevice, name: str) -> dict[int, Entry]:
    """Return the entries of a counting section by number."""
    keys = ((key.removeprefix(NUMBERED[name][1]), entry) for key, entry in _entries(device, name))
    return {int(key): entry for key, entry in keys if key.isdecimal() and len(key) < 10}


DUMMY_RULES = (
    Rule("E231", "Dummy... are 0 or 1.", "CiA 306, [DummyUsage]",
         form_of("dummyusage", tuple(KNOWN_KEYS["dummyusage"]), IS_FLAG, "0 or 1")),
    Rule("W232", "[DummyUsage] has Dummy0001 to Dummy0007.", "CiA 306, [DummyUsage]", missing_dummies),
    Rule("W233", "An enabled dummy is not shorter than the granularity.", "CiA 306, [DummyUsage]", short_dummies),
    Rule("E234", "Lines is the number of comment lines.", "CiA 306, [Comments]", comment_lines),
    Rule("E235", "Comment lines are numbered without gap.", "CiA 306, [Comments]", gaps_of("comments")),
)  # fmt: skip

# Lists of objects

MANDATORY = (0x1000, 0x1001, 0x1018)
FIRST_OBJECT = 0x1000
"""Objects before this index are data types."""


def listed(device: LintedDevice, name: str) -> list[tuple[int, Entry]]:
    """Return the indices of one list, in its order, with their entries."""
    numbers = ((parse_number(entry.value), entry) for _, entry in sorted(_numbers(device, name).items()))
    return [(number.value, entry) for number, entry in numbers if number]


def _all_listed(device: LintedDevice) -> list[tuple[int, Entry]]:
    return [each for name in OBJECT_LISTS for each in listed(device, name.lower())]


def supported_objects(device: LintedDevice) -> Iterator[Problem]:
    """Yield lists whose number of entries is not that of their entries."""
    for name in OBJECT_LISTS:
        section = device.section(name.lower())
        said = parse_number(section.text("supportedobjects")) if section else None
        real = len(_numbers(device, name.lower()))
        if section and said and said.value != real:
            at = section.at("supportedobjects")
            yield Problem(at, f"SupportedObjects is {said.value}, but [{section.name}] has {real} entries")


def no_supported_objects(device: LintedDevice) -> Iterator[Problem]:
    """Yield lists that do not say how many entries they have."""
    for name in OBJECT_LISTS:
        section = device.section(name.lower())
        if section and parse_number(section.text("supportedobjects")) is None:
            yield Problem(
                section.at("supportedobjects"), f"[{section.name}] has no SupportedObjects, or no number as it"
            )


def list_gaps(device: LintedDevice) -> Iterator[Problem]:
    """Yield lists with a gap in their numbers."""
    for name in OBJECT_LISTS:
        yield from gaps_of(name.lower())(device)


def no_indices(device: LintedDevice) -> Iterator[Problem]:
    """Yield list entries that are no index."""
    for name in OBJECT_LISTS:
        for entry in _numbers(device, name.lower()).values():
            number = parse_number(entry.value)
            if number is None or not 0 <= number.value <= 0xFFFF or number.relative:
                yield Problem(entry, f"{entry.value[:20] or 'nothing'} is no index from 0x1000 to 0xFFFF")


def listed_twice(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects that are listed twice."""
    first: dict[int, Entry] = {}
    for index, entry in _all_listed(device):
        if first.setdefault(index, entry) is not entry:
            yield Problem(entry, f"0x{index:04X} is listed twice, first in line {first[index].line}")


def listed_only(device: LintedDevice) -> Iterator[Problem]:
    """Yield listed objects without a section."""
    for index, entry in _all_listed(device):
        if FIRST_OBJECT <= index <= 0xFFFF and (index not in device.objects or device.objects[index].section is None):
            yield Problem(entry, f"0x{index:04X} is listed, but there is no section [{index:04X}]")


def described_only(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects that no list has."""
    known = {index for index, _ in _all_listed(device)}
    for index, each in device.objects.items():
        if index not in known:
            yield Problem(each.place, f"0x{index:04X} is described, but in none of the lists of objects")


def missing_mandatory(device: LintedDevice) -> Iterator[Problem]:
    """Yield mandatory objects that are nowhere."""
    for index in MANDATORY:
        if index not in device.objects and device.objects:
            yield Problem(
                device.section("mandatoryobjects") or TOP, f"0x{index:04X} is missing, which every device has"
            )


def mandatory_elsewhere(device: LintedDevice) -> Iterator[Problem]:
    """Yield mandatory objects in another list."""
    for index, entry in listed(device, "optionalobjects") + listed(device, "manufacturerobjects"):
        if index in MANDATORY:
            yield Problem(entry, f"0x{index:04X} belongs in [MandatoryObjects]")


def not_mandatory(device: LintedDevice) -> Iterator[Problem]:
    """Yield other objects in the list of mandatory ones."""
    for index, entry in listed(device, "mandatoryobjects"):
        if index not in MANDATORY and index >= FIRST_OBJECT:
            yield Problem(entry, f"0x{index:04X} is not mandatory; it belongs in another list")


def manufacturer_elsewhere(device: LintedDevice) -> Iterator[Problem]:
    """Yield manufacturer-specific objects in the list of optional ones."""
    for index, entry in listed(device, "optionalobjects"):
        if index in MANUFACTURER:
            yield Problem(entry, f"0x{index:04X} is manufacturer-specific; it belongs in [ManufacturerObjects]")


def not_manufacturer(device: LintedDevice) -> Iterator[Problem]:
    """Yield standard objects in the list of manufacturer-specific ones."""
    for index, entry in listed(device, "manufacturerobjects"):
        if index not in MANUFACTURER and index not in MANDATORY:
            yield Problem(entry, f"0x{index:04X} is outside 0x2000..0x5FFF; it belongs in [OptionalObjects]")


def data_types_listed(device: LintedDevice) -> Iterator[Problem]:
    """Yield data types in the lists of objects."""
    for index, entry in _all_listed(device):
        if 0 <= index < FIRST_OBJECT:
            yield Problem(entry, f"0x{index:04X} is a data type, not an object")


def unsorted(device: LintedDevice) -> Iterator[Problem]:
    """Yield the first entry of a list that follows a higher one."""
    for name in OBJECT_LISTS:
        pairs = pairwise(listed(device, name.lower()))
        wrong = next((entry for (before, _), (index, entry) in pairs if index < before), None)
        if wrong:
            yield Problem(wrong, f"{wrong.value[:20]} follows a higher index")


LIST_RULES = (
    Rule("E301", "A list of objects says how many it has.", "CiA 306, object lists", no_supported_objects),
    Rule("E302", "SupportedObjects is the number of entries.", "CiA 306, object lists", supported_objects),
    Rule("E303", "The entries of a list are numbered without gap.", "CiA 306, object lists", list_gaps),
    Rule("E304", "The entries of a list are indices.", "CiA 306, object lists", no_indices),
    Rule("E305", "An object is listed once.", "CiA 306, object lists", listed_twice),
    Rule("E306", "A listed object has a section.", "CiA 306, object lists", listed_only),
    Rule("E307", "An object with a section is listed.", "CiA 306, object lists", described_only),
    Rule("E308", "0x1000, 0x1001 and 0x1018 are there.", "CiA 301, mandatory objects", missing_mandatory),
    Rule("E309", "0x1000, 0x1001 and 0x1018 are in [MandatoryObjects].", "CiA 306, object lists", mandatory_elsewhere),
    Rule("E310", "Only 0x1000, 0x1001 and 0x1018 are in [MandatoryObjects].", "CiA 306, object lists", not_mandatory),
    Rule("E311", "0x2000..0x5FFF are not in [OptionalObjects].", "CiA 306, object lists", manufacturer_elsewhere),
    Rule("E312", "Only 0x2000..0x5FFF are in [ManufacturerObjects].", "CiA 306, object lists", not_manufacturer),
    Rule("W313", "Data types are not listed as objects.", "CiA 306, object lists", data_types_listed),
    Rule("I314", "Lists are in the order of the indices.", "custom; many tools rely on nothing else", unsorted),
)  # fmt: skip

RULES = TEXT_RULES + INFO_RULES + DUMMY_RULES + LIST_RULES
