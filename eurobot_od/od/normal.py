"""The normal form of an EDS or DCF: a plain EDS that canopen and every other tool reads correctly.

A normal form has no byte order mark; every section and key once, in the spelling of CiA 306; numbers in decimal or 0x
hexadecimal with `$NODEID+` in front; negative numbers with their sign; compact arrays and PDOs expanded; a type for
every variable; and the sections and counts that CiA 306 requires. What has no place in it, such as a repeated entry or
a default that does not fit its type, becomes a comment, so that nothing is lost. The normal form of a normal form is
itself.

canopen ignores some attributes even in normal form, such as limits of a REAL; `NormalizedEds.canopen_attributes` has
them, for `dictionary` to set.

The order matters: objects come after the lists, an object before its sub-indices (as canopen expects), and the
commissioning last, so that a truncated DCF has none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od import document as cia306
from eurobot_od.od import formats, values
from eurobot_od.od.description import (
    SIMPLE,
    DescribedDevice,
    DescribedObject,
    DescribedVariable,
    ObjectCode,
    list_entries,
    listed,
)
from eurobot_od.od.document import STRAY, UNKNOWN, Document, Entry, Odd, Section, code_page, parse
from eurobot_od.od.modules import CONNECTED, with_modules
from eurobot_od.od.patches import Patch, patched, with_settings
from eurobot_od.od.standard import known_type
from eurobot_od.od.values import NODE_ID, DataType, MappingEntry, Number, is_standard_number, parse_number

NO_VALUE = (ObjectCode.NULL, ObjectCode.DEFTYPE)
"""Objects without a value: a placeholder, and a type definition."""


class Change(NamedTuple):
    """A difference between the normal form and the file: its line, and what was changed.

    `standard` is set if CiA 306 allows the original; other changes repair the file. `guessed` is set if the meaning is
    uncertain.
    """

    line: int
    what: str
    standard: bool = False
    guessed: bool = False


class Refusal(NamedTuple):
    """An object, or a sub-index of it (None: the whole), that cannot be used: its line, and the reason."""

    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple
    sub: int | None
    line: int
    what: str

    def __str__(self) -> str:
        return f"line {self.line}: {f'0x{self.index:04X}: ' if self.index else ''}{self.what}"


NO_OBJECT = 0
"""Index of a refusal that is not about an object, but, for example, a module."""


class CanopenAttribute(NamedTuple):
    """An attribute that canopen's object at an index and sub-index (None: the whole) needs in addition to the text."""

    index: int  # type: ignore[assignment]  # as above
    sub: int | None
    attribute: str
    value: object


class NormalizedEds(NamedTuple):
    """A file in normal form.

    `text` is that form, `encoding` the file's. `changes` lists the differences from the file, `refusals` what cannot be
    used, `canopen_attributes` what canopen does not read. `has_modules` is set if connected modules have added objects,
    `is_xml` if the file is in XML, `is_patched` if patches were applied. `read` is the parsed text, if the file was in
    normal form.
    """

    text: str
    encoding: str
    changes: list[Change]
    refusals: list[Refusal]
    canopen_attributes: list[CanopenAttribute]
    has_modules: bool = False
    is_xml: bool = False
    is_patched: bool = False
    read: DescribedDevice | None = None

    @property
    def device(self) -> DescribedDevice:
        """The device in the text: every variable has a section and a basic type."""
        return self.read or DescribedDevice(parse(self.text))

    @property
    def deviations(self) -> list[Change]:
        """Changes that repair violations of CiA 306."""
        return [each for each in self.changes if not each.standard]

    @property
    def about(self) -> str:
        """The text without its objects."""
        first = AN_OBJECT.search(self.text)
        start = first.start() if first else len(self.text)
        end = self.text.find(f"\n[{cia306.COMMISSIONING}]", start)
        return self.text[:start] + (self.text[end:] if end >= 0 else "")


def normal(
    data: bytes, file: object = "", modules: Sequence[str] | None = None, patches: Sequence[Patch] = ()
) -> NormalizedEds:
    """Return the normal form of an EDS or DCF.

    Args:
        data: bytes of the file
        file: its name in errors
        modules: numbers or names of modules, by position (CiA 306-1, 8); None for those connected in the file
        patches: patches of the file and its modules' objects, applied in order

    Raises:
        DictionaryError: the file is not an EDS or may hide objects, a module is unknown, or a patch does not fit
    """
    document = formats.read(data)
    hiding = document.hiding
    if hiding:
        what = f"{hiding.kind.value} ({hiding.text})" if hiding.text else hiding.kind.value
        raise DictionaryError(str(file), None, f"not a readable EDS: line {hiding.line}: {what}")
    writer = _Writer(document, modules, patches)
    is_asked = modules is not None or any(CONNECTED in each.settings for each in patches)
    if is_asked and writer.misfits:
        raise DictionaryError(str(file), None, writer.misfits[0].what)
    return writer.write()


def in_normal_form(data: bytes, file: object = "") -> tuple[bytes, list[Change]]:
    """Return a file in normal form, with its own line ends, and the changes; see `normal`.

    It is in UTF-8, which canopen always reads, unless that would change the bytes of a value that the device serves.
    """
    made = normal(data, file)
    if not AN_OBJECT.search(made.text):
        raise DictionaryError(str(file), None, formats.no_objects(data))
    text = made.text.replace("\n", "\r\n" if b"\r\n" in data else "\n")
    is_known = made.encoding != UNKNOWN or code_page(data) is not None
    if made.encoding == "utf-8" or VALUE_BEYOND_ASCII.search(text) or not is_known:
        return text.encode(made.encoding), made.changes
    return text.encode(), [Change(1, f"{ENCODINGS[made.encoding]} written as UTF-8"), *made.changes]


ENCODINGS = {
    "latin-1": "Latin-1",
    "cp1252": "Windows-1252",
    "cp1251": "Windows-1251",
    "koi8-r": "KOI8-R",
    "cp932": "Shift-JIS",
    "gb2312": "GB2312",
}

AN_OBJECT = re.compile(r"^\[[0-9A-Fa-f]{4}\]$", re.MULTILINE)
VALUE_BEYOND_ASCII = re.compile(r"^(?:Default|Parameter)Value=.*[^\x00-\x7F]", re.MULTILINE)


# Irregularities that are repaired

ODDITIES = {
    Odd.WIDE: "UTF-16 written as UTF-8",
    Odd.BYTE_ORDER_MARK: "byte order mark taken off",
    Odd.END_MARK: "Ctrl-Z or NUL at the end taken off",
    Odd.NOT_AN_ENTRY: "{}: no entry, made a comment",
    Odd.NO_SECTION: "entry {} before the first section made a comment",
    Odd.NO_KEY: "entry without a key made a comment",
    Odd.LINE_ENDS: "line ends made alike",
    Odd.COMMENT_AFTER_VALUE: "comment put on a line of its own",
    Odd.HASH: "comment with ; instead of #",
    Odd.INDENTED: "indent taken off",
    Odd.DISABLED: "{} left out: its editor has disabled it (CO_disabled)",
    Odd.TWO_ENTRIES: "key {}: the second made a comment",
    Odd.TWO_SECTIONS: "section {}: the second made a comment",
}


class Comments(NamedTuple):
    """Comments `above` and `below` each line, by number; repeated entries and sections become comments."""

    above: dict[int, list[str]]
    below: dict[int, list[str]]


def _comments(document: Document) -> Comments:
    """Return the comments: those directly below an entry and before an empty line belong to it, others to the next."""
    dead, beside = _dead_lines(document)
    found = Comments({}, {})
    if not (document.has_comments or dead or beside):
        return found  # as for most large files, which programs have made
    pending: list[str] = []
    last, is_right_below = 0, False
    for number, line in enumerate([*document.lines, ""], start=1):
        text = dead.get(number) or line.strip()
        if text[:1] in (";", "#"):
            pending.append(f";{text[1:]}")
            continue
        if not text and pending and is_right_below:
            found.below[last] = pending
            pending = []
        elif text and (pending or number in beside):
            found.above[number] = pending + beside.get(number, [])
            pending = []
        is_right_below = bool(text)
        if text:
            last = number
    if pending:
        found.below.setdefault(last, []).extend(pending)
    return found


def _dead_lines(document: Document) -> tuple[dict[int, str], dict[int, list[str]]]:
    """Return repeated and stray lines as comments, and the comments beside values."""
    lines = document.lines
    dead: dict[int, str] = {}
    beside: dict[int, list[str]] = {}
    for each in document.oddities:
        if each.kind in (Odd.TWO_ENTRIES, *STRAY):
            dead[each.line] = f";{lines[each.line - 1].strip()}"
        elif each.kind is Odd.TWO_SECTIONS:
            end = next((header for header in document.headers if header > each.line), len(lines) + 1)
            dead |= {n: f";{lines[n - 1].strip()}" for n in range(each.line, end) if lines[n - 1].strip()}
        elif each.kind is Odd.COMMENT_AFTER_VALUE:
            beside[each.line] = [lines[each.line - 1][each.column - 1 :].strip()]
    return dead, beside


# The writer

ENTRIES = {"lowlimit": "min", "highlimit": "max"}
"""canopen's attributes for the limits of a variable."""

CANOPENS_SIGNED = (8, 16, 32, 64)
"""Sizes of signed integers whose limits canopen reads, in bits."""

IGNORED_BY_CANOPEN = {
    "objflags": "obj_flags",
    "uploadfile": "upload_file",
    "downloadfile": "download_file",
    "denotation": "denotation",
}
"""Keys that canopen ignores, and the attributes for their values."""

RAW = {"defaultvalue": "default_raw", "parametervalue": "value_raw"}
"""canopen's attributes for the text of a value, even if it does not fit its type."""

NUMBERS = ("objecttype", "datatype", "subnumber", "pdomapping", "objflags")
COMPACT_KEYS = ("compactsubobj", *cia306.OF_VARIABLE)
"""Keys of a compact object that describe its sub-indices."""

INFO_TEXTS = ("vendorname", "productname", "ordercode")

LOOKS_LIKE_AN_OBJECT = re.compile(r"[0-9A-Fa-f]{4}([S|s]ub[0-9A-Fa-f]+)?$|[0-9A-Fa-f]{4}Name|DEFAULT$")
"""Pattern of sections that canopen, or Python's configparser, misreads."""


class _Writer:
    """Writes one file; comments stay with the entry or header below them."""

    def __init__(self, document: Document, modules: Sequence[str] | None, patches: Sequence[Patch]) -> None:
        described = with_settings(formats.completed(document), patches)
        whole, self.misfits = with_modules(described, modules)
        self._has_modules = whole is not described
        self._is_patched = bool(patches)
        self._device = DescribedDevice(patched(whole, patches))
        self._comments = _comments(document)
        odd = [each for each in document.oddities if each.kind in ODDITIES]
        self._changes = [Change(each.line, ODDITIES[each.kind].format(each.text)) for each in odd]
        self._changes += (Change(*each) for each in formats.misspelled(document))
        lost = ((each.line, each.text) for each in document.oddities if each.kind is Odd.ADDRESS)
        self._refusals = [Refusal(NO_OBJECT, None, *each) for each in (*self.misfits, *lost)]
        self._canopen_attributes: list[CanopenAttribute] = []
        self._out: list[str] = []

    def write(self) -> NormalizedEds:
        device = self._device
        self._known("FileInfo")
        self._known("DeviceInfo")
        self._dummies()
        self._comment_lines()
        for section in device.other_sections:
            self._foreign(section)
        self._lists()
        for each in device.objects.values():
            self._object(each)
        if device.commissioning:
            self._known(cia306.COMMISSIONING)
        left = (line for comments in self._comments for each in comments.values() for line in each)
        lines = [*self._out, *left, ""]
        same = lines == device.document.lines and not device.document.oddities
        return NormalizedEds("\n".join(lines), device.document.text_encoding, sorted({*self._changes}), self._refusals,
                      self._canopen_attributes, self._has_modules, device.document.is_xml, self._is_patched,
                      device if same else None)  # fmt: skip

    # Lines

    def _head(self, name: str, section: Section | None) -> None:
        """Begin a section."""
        if self._out:
            self._out.append("")
        if section is None:
            self._out.append(f"[{name}]")
        else:
            self._line(section, f"[{name}]")

    def _line(self, at: Entry | Section, text: str) -> None:
        """Write a line of the file, with the comments around it."""
        above, below = self._comments
        if at.line in above:
            self._out += above.pop(at.line)
        self._out.append(text)
        if at.line in below:
            self._out += below.pop(at.line)

    def _number(self, entry: Entry, key: str, text: str | None, type_name: str = "a number") -> None:
        """Write an entry's value in plain form; an invalid one (None) becomes a comment."""
        # As a comment, the original stays in the file.
        if text is None and entry.value:
            self._changes.append(Change(entry.line, f"{key} {entry.value[:40]} made a comment: not {type_name}"))
            self._line(entry, f";{key}={entry.value}")
            return
        if text is None:
            self._changes.append(Change(entry.line, f"{key} without a value left out"))
            return
        if text != entry.value:
            standard = is_standard_number(entry.value)
            self._changes.append(Change(entry.line, f"{key} {entry.value[:40]} written {text}", standard))
        self._line(entry, f"{key}={text}")

    def _as_comment(self, section: Section, why: str) -> None:
        """Write a section as a comment."""
        self._changes.append(Change(section.line, f"[{section.name}] made a comment: {why}", standard=True))
        self._out.append(f";[{section.name}]")
        for entry in section.entries.values():
            self._line(entry, f";{entry.key}={entry.value}")

    # Sections other than objects

    def _known(self, name: str) -> None:
        """Write a section of CiA 306 that has fixed keys."""
        section = self._device.commissioning if name == cia306.COMMISSIONING else self._device.section(name.lower())
        self._head(name, section)
        spelled = cia306.SPELLED_KEYS[name.lower()]
        entries = section.entries if section else {}
        for key, entry in entries.items():
            if key == "compactpdo" and (parse_number(entry.value) or Number(0)).value > 0:
                self._changes.append(Change(entry.line, "CompactPDO written out", standard=True))
            # canopen's configparser takes a colon for `=`.
            elif ":" in key:
                self._line(entry, f";{entry.key}={entry.value}")
            elif key in spelled and ((name == "DeviceInfo" and key not in INFO_TEXTS) or key in ("nodeid", "baudrate")):
                number = formats.plain_number(entry.value)
                # canopen reads Baudrate in decimal only.
                text = None if number is None or NODE_ID in number else number
                self._number(entry, spelled[key], str(int(text, 0)) if text and key == "baudrate" else text)
            else:
                self._line(entry, f"{spelled.get(key, entry.key)}={entry.value}")

    def _dummies(self) -> None:
        section = self._device.section("dummyusage")
        records = (each for each in self._device.objects.values() if each.index in values.MAPPINGS)
        entries_of = [entry for each in records for sub, entry in each.subs.items() if sub]
        # The EDS of a DCF has the default, which may map what the value does not.
        numbers = (entry.number(key) for entry in entries_of for key in ("defaultvalue", "parametervalue"))
        mapped = {MappingEntry.of(number.value).index for number in numbers if number}
        self._head("DummyUsage", section)
        entries = section.entries if section else {}
        for code in values.DUMMIES:
            key = f"Dummy{code:04X}"
            entry = entries.get(key.lower())
            said = int(entry is not None and parse_number(entry.value) == Number(1))
            if section and entry is None:
                self._changes.append(Change(section.line, f"{key}=0 added"))
            # canopen skips a mapped dummy that is not enabled, and shifts all fields after it.
            if code in mapped and not said:
                line = section.line if section else 1
                self._changes.append(Change(line, f"{key} set to 1: a PDO maps it", standard=section is None))
            self._out.append(f"{key}={int(said or code in mapped)}")
        for key, entry in entries.items():
            if key not in DUMMY_KEYS and ":" not in key:
                self._line(entry, f"{entry.key}={entry.value}")

    def _comment_lines(self) -> None:
        section = self._device.section("comments")
        self._head("Comments", section)
        lines = [each for key, each in section.entries.items() if key != "lines"] if section else []
        if section and parse_number(section.text("lines")) != Number(len(lines)):
            self._changes.append(Change(section.at("lines").line, f"Lines={len(lines)} written"))
        self._out.append(f"Lines={len(lines)}")
        for number, entry in enumerate(lines, start=1):
            self._line(entry, f"Line{number}={entry.value}")

    def _foreign(self, section: Section) -> None:
        """Write a section that is neither CiA 306's nor an object's."""
        name = section.name.strip()
        usual = formats.usual_name(name) if formats.looks_odd(name.lower()) else None
        sections = self._device.document.sections
        # Already written, by its own function or as an object under its usual name.
        if name.lower() in cia306.SECTION_NAMES or (usual and sections[usual].line == section.line):
            return
        if name.lower() == CONNECTED and self._has_modules:
            self._as_comment(section, "the objects of the modules are written out")
            return
        if usual or LOOKS_LIKE_AN_OBJECT.match(name):
            self._as_comment(section, f"[{usual}] is there" if usual else "no name of an object")
            return
        self._head(name, section)
        for key, entry in section.entries.items():
            self._line(entry, f"{';' if ':' in key else ''}{entry.key}={entry.value}")

    def _lists(self) -> None:
        """Write the lists of objects, unchanged if they have exactly the present objects."""
        sections = {name: self._device.section(name.lower()) for name in cia306.OBJECT_LISTS}
        entries = {name: section.numbered() if section else () for name, section in sections.items()}
        numbers = {name: filter(None, (parse_number(e.value) for e in found)) for name, found in entries.items()}
        present = {name: [each.value for each in found] for name, found in numbers.items()}
        there = [index for index, each in self._device.objects.items() if index >= values.FIRST and each.section]
        # Only wrong lists are changed, to keep the manufacturer's choice of list and order.
        if sorted(index for indices in present.values() for index in indices) != sorted(there):
            present = listed(sorted(there))
        for name, section in sections.items():
            self._head(name, section)
            rows = list_entries(present[name])
            if section and {key.lower(): parse_number(text) for key, text in rows.items()} != {
                key: parse_number(entry.value) for key, entry in section.entries.items()
            }:
                what = f"[{name}] written anew: the objects that are there"
                self._changes.append(Change(section.line, what, standard=self._has_modules or self._is_patched))
            self._out += (f"{key}={text}" for key, text in rows.items())
        if not any(sections.values()):
            self._changes.append(Change(1, "lists of objects added"))

    # Objects

    def _object(self, each: DescribedObject) -> None:
        section = each.section
        if section is None and each.subs:
            self._changes.append(Change(each.place.line, f"[{each.index:04X}] added: its sub-indices are there"))
            head = each.place._replace(name=f"{each.index:04X}", entries={})
            self._composed(DescribedObject(each.index, head, each.subs, each.lists), head)
        elif section is None:
            what = f"[{each.place.name}] has no object [{each.index:04X}]"
            self._refusals.append(Refusal(each.index, None, each.place.line, what))
            for part in (*(sub.section for sub in each.subs.values()), *each.lists.values()):
                self._as_comment(part, f"there is no [{each.index:04X}]")
        elif each.code is None or each.code in NO_VALUE:
            if each.code is None:
                what = f"ObjectType {section.text('objecttype')!r} is not one of CiA 301"
                self._refusals.append(Refusal(each.index, None, section.at("objecttype").line, what))
            self._head(f"{each.index:04X}", section)
            for entry in section.entries.values():
                self._line(entry, f"{cia306.SPELLED_OBJECT_KEYS.get(entry.key.lower(), entry.key)}={entry.value}")
            for sub in each.subs.values():
                if sub.section is not section:
                    self._as_comment(sub.section, "its object holds nothing")
        # A VAR with sub-indices and without a data type is a record that an editor has called VAR.
        elif each.code in SIMPLE and not each.compact and (section.text("datatype") or not _subs(each)):
            subs = _subs(each)
            own = DescribedVariable(each.index, 0, section) if subs else each.subs[0]
            self._variable(f"{each.index:04X}", own, each)
            for sub in subs:
                self._as_comment(sub.section, f"[{each.index:04X}] is a variable")
        else:
            self._composed(each, section)

    def _composed(self, each: DescribedObject, section: Section) -> None:
        """Write an object with sub-indices."""
        members = list(each.variables())
        count = sum(member.sub != values.STRUCTURE for member in members)
        code = ObjectCode.ARRAY if each.code is ObjectCode.ARRAY else ObjectCode.RECORD
        entries = section.entries
        self._head(f"{each.index:04X}", section)
        if "parametername" not in entries:
            self._out.append("ParameterName=")
        if each.code is not code and each.code is ObjectCode.DEFSTRUCT:
            # canopen does not know DEFSTRUCT, which can be used like a record.
            self._canopen_attributes.append(CanopenAttribute(each.index, None, "object_code", ObjectCode.DEFSTRUCT))
        type_text = f"ObjectType=0x{code.value:X}"
        if parse_number(section.text("objecttype")) != Number(code.value):
            self._changes.append(Change(section.at("objecttype").line, f"[{section.name}]: {type_text} written",
                                        standard=each.code is not ObjectCode.VAR))  # fmt: skip
        if "objecttype" not in entries:
            self._out.append(type_text)
        if each.compact:
            self._changes.append(Change(entries["compactsubobj"].line, "CompactSubObj written out", standard=True))
        elif parse_number(section.text("subnumber")) != Number(count):
            self._changes.append(Change(section.at("subnumber").line, f"[{section.name}]: SubNumber={count} written"))
        if "subnumber" not in entries:
            self._out.append(f"SubNumber={count}")
        for key, entry in entries.items():
            if key == "objecttype":
                number = formats.plain_number(entry.value)
                right = number is not None and Number(code.value) == parse_number(number)
                self._line(entry, f"ObjectType={number}" if right else type_text)
            elif key == "subnumber":
                self._line(entry, f"SubNumber={count}")
            elif key not in COMPACT_KEYS:
                self._entry(each.index, None, key, entry, None)
            elif not each.compact:
                what = f"[{section.name}]: {entry.key} made a comment: it is of the sub-indices"
                self._changes.append(Change(entry.line, what))
                self._line(entry, f";{entry.key}={entry.value}")
        for member in members:
            self._variable(f"{each.index:04X}sub{member.sub:X}", member, each)

    def _variable(self, name: str, each: DescribedVariable, whole: DescribedObject) -> None:
        """Write a variable, preceded by its missing entries."""
        section = each.section
        type_ = self._type(each, whole)
        sub = each.sub if name[4:] else None
        self._head(name, section)
        if "parametername" not in section.entries:  # canopen raises KeyError without one
            self._out.append("ParameterName=")
        if not section.text("datatype"):
            is_domain = whole.code is ObjectCode.DOMAIN
            is_guessed = type_ is formats.UNKNOWN_TYPE
            what = "no DataType, read as DOMAIN" if is_guessed else f"DataType=0x{type_.code:04X} added"
            self._changes.append(Change(section.line, f"[{name}]: {what}", is_domain, is_guessed))
            self._out.append(f"DataType=0x{type_.code:04X}")
        access = whole.subs[0].access if whole.compact and 0 in whole.subs else ""
        if not each.access and access:
            # The entries of a list are writable if their number is (CiA 301, mappings).
            self._changes.append(Change(section.line, f"[{name}]: AccessType={access} added, that of sub-index 0"))
            self._out.append(f"AccessType={access}")
        elif not each.access:
            self._refusals.append(Refusal(each.index, sub, section.line, f"sub {each.sub} has no AccessType"))
        if each.access == values.NO_ACCESS:  # canopen takes any AccessType with a `w` for writable
            self._canopen_attributes.append(CanopenAttribute(each.index, sub, "access_type", values.NO_ACCESS))
        if whole.code is ObjectCode.DOMAIN:
            self._canopen_attributes.append(CanopenAttribute(each.index, sub, "object_code", ObjectCode.DOMAIN))
        for key, entry in section.entries.items():
            self._entry(each.index, sub, key, entry, type_)
        if each.type is None and type_.is_integer:
            for key, entry in self._limits_of_type(each):
                self._entry(each.index, sub, key, entry, type_)

    def _limits_of_type(self, each: DescribedVariable) -> Iterator[tuple[str, Entry]]:
        """Yield the limits of a type of CanFestival's editor, such as INTEGER32[1-100], that a variable lacks."""
        code = each.number("datatype")
        for sub, key in enumerate(ENTRIES, start=2):
            section = self._device.document.sections.get(f"{code.value:x}sub{sub}") if code else None
            entry = section.entries.get("defaultvalue") if section else None
            if entry and not each.section.text(key):
                self._changes.append(Change(entry.line, f"{key} {entry.value[:40]} taken to 0x{each.index:04X}", True))
                yield key, entry

    def _entry(self, index: int, sub: int | None, key: str, entry: Entry, type_: DataType | None) -> None:
        """Write an entry of an object, or of a variable if there is a type."""
        text = entry.value
        spelled = cia306.SPELLED_OBJECT_KEYS.get(key)
        if type_ is not None and key in cia306.TYPED:
            if key in ENTRIES:
                limited = type_ if type_.is_integer or type_ in values.REALS else values.UNSIGNED64
                plain = formats.plain_value(text, limited) if text else None
                if plain is not None:
                    self._limit(index, sub, ENTRIES[key], plain, limited)
                self._number(entry, spelled or key, plain, limited.name)
            elif text or (key == "defaultvalue" and type_ in (*formats.TEXTS, *formats.BYTES)):
                plain = formats.plain_value(text, type_)
                if plain is None:
                    self._canopen_attributes.append(CanopenAttribute(index, sub, RAW[key], text))
                self._number(entry, spelled or key, plain, type_.name)
            else:  # an empty ParameterValue would hide the default
                self._number(entry, spelled or key, None)
        elif type_ is not None and key == "datatype" and text:
            number = parse_number(text)
            if number is None:
                what = f"sub {sub or 0}: DataType {text!r} is not a number"
                self._refusals.append(Refusal(index, sub, entry.line, what))
            known = number == Number(type_.code)
            self._number(entry, "DataType", formats.plain_number(text) if known else f"0x{type_.code:04X}")
        elif key in NUMBERS:
            if text or key != "datatype":
                self._number(entry, spelled or key, formats.plain_number(text))
        elif spelled or ":" not in key:
            self._line(entry, f"{spelled or CANOPENS_KEYS.get(key, entry.key)}={text}")
        else:
            self._line(entry, f";{entry.key}={text}")
        if key in IGNORED_BY_CANOPEN and text:
            value: object = text
            if key == "objflags":
                flags = parse_number(text)
                value = flags.value if flags else 0
            self._canopen_attributes.append(CanopenAttribute(index, sub, IGNORED_BY_CANOPEN[key], value))
        if key in SCALE and (real := formats.plain_value(text, values.REAL64)):
            self._canopen_attributes.append(CanopenAttribute(index, sub, key, float(real)))

    def _limit(self, index: int, sub: int | None, attribute: str, text: str, type_: DataType) -> None:
        """Note a limit that canopen does not read."""
        # canopen silently ignores limits of REALs, with `$NODEID`, and of signed integers of 24, 40, 48 or 56 bits.
        number = parse_number(text)
        if type_ in values.REALS:
            self._canopen_attributes.append(CanopenAttribute(index, sub, attribute, float(text)))
        elif number and (number.relative or (type_.is_signed and type_.bits not in CANOPENS_SIGNED)):
            self._canopen_attributes.append(CanopenAttribute(index, sub, attribute, number))

    def _type(self, each: DescribedVariable, whole: DescribedObject) -> DataType:
        """Return a variable's data type.

        CanFestival's editor defines its own types by objects whose sub-index 1 is the basic type. A missing type is
        that of the standard, or of the array. Any other type is taken as bytes.
        """
        unknown = values.DOMAIN if whole.code is ObjectCode.DOMAIN else formats.UNKNOWN_TYPE
        if each.type:
            return each.type
        if each.section.text("datatype"):
            code = each.number("datatype")
            basic = parse_number(self._device.document.text(f"{code.value:x}sub1", "defaultvalue")) if code else None
            return values.DATA_TYPES.get(basic.value, unknown) if basic else unknown
        if each.sub == 0 and whole.code not in SIMPLE:
            return values.UNSIGNED8  # as always for sub-index 0 (CiA 301)
        first = whole.subs.get(1) if whole.code is ObjectCode.ARRAY else None
        return known_type(each.index, each.sub) or (first.type if first else None) or unknown


SCALE = ("factor", "offset")
"""Keys of editors with a real number; canopen ignores Offset, and Factor with a decimal comma."""

CANOPENS_KEYS = {each.lower(): each for each in ("Factor", "Unit", "Description", "StorageLocation")}
"""Keys that canopen reads and CiA 306 does not have."""

DUMMY_KEYS = tuple(f"dummy{code:04x}" for code in values.DUMMIES)


def _subs(each: DescribedObject) -> list[DescribedVariable]:
    """Return the sub-indices with sections."""
    return [sub for sub in each.subs.values() if sub.section is not each.section]
