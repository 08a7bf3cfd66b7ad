"""Reads the text of an EDS or DCF into sections and entries with line and column, for any bytes.

The end has the sections and keys of CiA 306 in its spelling. Reading never raises and never skips anything silently:
irregularities become an `Oddity`, which lint reports; `normal` refuses a file with those that may hide objects.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from codecs import BOM_UTF8
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple, Protocol

from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.support.files import read_whole

if TYPE_CHECKING:
    from pathlib import Path

LONGEST = 254
"""Longest key and value together, in characters (CiA 306: shorter than 255)."""

WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Byte order marks of UTF-16."""


class Odd(Enum):
    """Kinds of irregularities in a file."""

    BINARY = "a NUL byte"
    END_MARK = "an end mark"
    WIDE = "UTF-16 text"
    BYTE_ORDER_MARK = "a byte order mark"
    LINE_ENDS = "different line ends"
    NOT_ASCII = "a character outside ASCII"
    NOT_AN_ENTRY = "neither section nor entry nor comment"
    HEADER = "a malformed section header"
    NO_SECTION = "an entry before the first section"
    TWO_SECTIONS = "a section twice"
    TWO_ENTRIES = "an entry twice"
    NO_KEY = "no key"
    TOO_LONG = "a long line"
    COMMENT_AFTER_VALUE = "a comment after a value"
    HASH = "a comment with #"
    INDENTED = "an indented line"
    XML = "no XML of a device description"
    DISABLED = "an object that its editor has disabled"
    ADDRESS = "an object without an address"


HIDING = (Odd.BINARY, Odd.HEADER, Odd.XML)
"""Oddities that may hide objects: the file is not an EDS, or entries have no section."""

STRAY = (Odd.NOT_AN_ENTRY, Odd.NO_SECTION, Odd.NO_KEY)
"""Oddities of lines that are harmless unless the line is the last one: then the file is truncated."""

CUT_OFF = "; the file ends here: it is cut off"

END_MARKS = "\0\x1a"
"""Characters that old editors append to a text: Ctrl-Z, and NUL up to a full block."""


class Oddity(NamedTuple):
    """An irregularity: its kind, its line and column (both from 1), and its text in a message."""

    kind: Odd
    line: int
    column: int
    text: str


class Remark(NamedTuple):
    """A remark about a line of a file."""

    line: int
    what: str


class HasPlace(Protocol):
    """Anything with a line and a column, both from 1."""

    @property
    def line(self) -> int: ...
    @property
    def column(self) -> int: ...


class Entry(NamedTuple):
    """`key=value` as written, without surrounding blanks; `line` and `column` (of the value) from 1."""

    key: str
    value: str
    line: int
    column: int


class Section(NamedTuple):
    """`[name]`, its place, and its entries by lower-case key; the first one of a repeated key."""

    name: str
    line: int
    column: int
    entries: dict[str, Entry]

    def text(self, key: str) -> str:
        """Return the value of a key (in lower case), or an empty text."""
        entry = self.entries.get(key)
        return entry.value if entry else ""

    def at(self, key: str) -> Entry | Section:
        """Return the entry of a key (in lower case), else the section, for its place."""
        return self.entries.get(key, self)

    def numbered(self) -> Iterator[Entry]:
        """Yield the entries with numbers as keys: those of a list of objects or modules (CiA 306-1, 4.6.1)."""
        return (entry for key, entry in self.entries.items() if key.isdecimal())

    def saying(self, **entries: str) -> Section:
        """Return the section with other values; a new key has the place of the section."""
        places = ((key, text, self.at(key.lower())) for key, text in entries.items())
        said = {key.lower(): Entry(key, text, at.line, at.column) for key, text, at in places}
        return self._replace(entries={**self.entries, **said})

    def without_lines(self) -> Section:
        """Return the section without line numbers, for use in another file."""
        return self._replace(line=0, entries={key: each._replace(line=0) for key, each in self.entries.items()})


BREAKS = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")


def section_at(name: str, at: HasPlace, entries: Mapping[str, str]) -> Section:
    """Return a section made from a file in another format, with the place `at`."""
    # A value in XML may contain a line end.
    lines = {key: BREAKS.sub(" ", value).strip() for key, value in entries.items()}
    return Section(name, at.line, at.column, {}).saying(**lines)


class Document(NamedTuple):
    """A parsed file: its sections by lower-case name (the first one of a repeated name), and its oddities.

    `lines` is the whole text and `headers` has the line numbers of all section headers, for rewriting single lines;
    `encoding` restores the same bytes. A document from XML (`is_xml`) has no lines. `has_comments` is set if any line
    is a comment.
    """

    sections: dict[str, Section]
    oddities: Sequence[Oddity] = ()
    lines: Sequence[str] = ()
    headers: Sequence[int] = ()
    encoding: str = "utf-8"
    is_xml: bool = False
    has_comments: bool = False

    @property
    def text_encoding(self) -> str:
        """Encoding of texts for a VISIBLE_STRING, so that its bytes are those in the file."""
        return "utf-8" if self.encoding == "utf-16" else self.encoding

    def text(self, section: str, key: str) -> str:
        """Return the value of a key in a section (both in lower case), or an empty text."""
        found = self.sections.get(section)
        return found.text(key) if found else ""

    @property
    def hiding(self) -> Oddity | None:
        """The first oddity that may hide objects, or None."""
        end = len(self.lines)  # the last line has no line end: it is empty, or the file is truncated
        odd = (each for each in self.oddities if each.kind in HIDING or (each.kind in STRAY and each.line == end))
        return next(odd, None)


def read_bytes(file: str | Path) -> bytes:
    """Return the content of a file; raises DictionaryError if it cannot be read, or is too large."""
    try:
        data = read_whole(file)
    except FileError as error:
        raise DictionaryError(file, None, error.what) from error
    for what, most, count in COUNTED:
        if (number := count(data)) > most:
            raise DictionaryError(file, None, f"{number} {what}, and {most} are the most that are read")
    return data


MOST_SECTIONS, MOST_LINES, MOST_TAGS = 100_000, 500_000, 600_000
"""Limits for sections and lines of an EDS and tags of XML; files of manufacturers have a tenth of these."""

HEADER_LINE = re.compile(rb"(?:^|[\r\n])[ \t\0]*\[")


def _sections(data: bytes) -> int:
    """Return the number of section headers, or of all brackets if these are few."""
    brackets = data.count(b"[")
    return brackets if brackets <= MOST_SECTIONS else sum(1 for _ in HEADER_LINE.finditer(data))


COUNTED: Sequence[tuple[str, int, Callable[[bytes], int]]] = (
    ("sections", MOST_SECTIONS, _sections),
    ("lines", MOST_LINES, lambda data: max(data.count(b"\n"), data.count(b"\r"))),
    ("tags", MOST_TAGS, lambda data: data.count(b"<")),
)


def read(data: bytes) -> Document:
    """Parse an EDS or DCF in ASCII (CiA 306), UTF-8, UTF-16 or a code page of Windows."""
    oddities: list[Oddity] = []
    if data.startswith(WIDE_MARKS):  # otherwise every second character would be a NUL
        oddities.append(Oddity(Odd.WIDE, 1, 1, ""))
        return _Reader(oddities).read(data.decode("utf-16", "replace"), "utf-16")
    if data.startswith(BOM_UTF8):
        oddities.append(Oddity(Odd.BYTE_ORDER_MARK, 1, 1, ""))
        data = data[len(BOM_UTF8) :]
    try:
        return _Reader(oddities).read(data.decode(), "utf-8")
    except UnicodeDecodeError:
        encoding = code_page(data) or UNKNOWN
        return _Reader(oddities).read(data.decode(encoding), encoding)


UNKNOWN = "latin-1"
"""Fallback that decodes and encodes any bytes."""


def code_page(data: bytes) -> str | None:
    """Return the encoding of bytes that are not UTF-8, if it restores the same bytes; None if it is uncertain.

    Western words have single letters beyond ASCII, Cyrillic words have no ASCII letters, kana has unique lead bytes,
    and most Chinese characters are among the common ones of GB2312.
    """
    words = re.findall(rb"[\x80-\xFF]+", data)
    beyond = b"".join(words)
    first = re.sub(rb"[^\x81-\x9F\xE0-\xFC]|(.)[\x40-\x7E\x80-\xFC]", rb"\1", data, flags=re.DOTALL)
    leads = b"".join(word[::2] for word in words)
    mean = len(beyond) / len(words)
    high, low, control = (_share(beyond, first) for first in (range(0xE0, 0x100), range(0xC0, 0xE0), range(0x80, 0xA0)))
    is_cyrillic = mean > CYRILLIC_WORD and high + low > MOST_OF
    fitting = (
        ("cp932", any(each in KANA for each in first) and _share(first, range(0x80, 0xA0)) > 0.5),
        ("cp1251", is_cyrillic and high > low),
        ("koi8-r", is_cyrillic and low > high > 0),  # its small letters are the capitals of cp1251
        ("gb2312", not is_cyrillic and all(len(word) % 2 == 0 for word in words) and _share(leads, HANZI) > 0.5),
        ("cp1252", mean < WESTERN_WORD and control > 0),
        ("latin-1", mean < WESTERN_WORD and not control),
    )
    return next((name for name, fits in fitting if fits and _is_kept(data, name)), None)


def _share(found: Sequence[int], wanted: Container[int]) -> float:
    return sum(each in wanted for each in found) / len(found)


KANA = (0x82, 0x83)
HANZI = range(0xB0, 0xD8)
"""Lead bytes of kana in Shift-JIS, and of the common characters of GB2312."""

MOST_OF = 0.9
CYRILLIC_WORD, WESTERN_WORD = 2.5, 2.0
"""Average number of adjacent bytes beyond ASCII: higher in Cyrillic texts, lower in Western ones."""


def _is_kept(data: bytes, encoding: str) -> bool:
    try:
        return data.decode(encoding).encode(encoding) == data
    except UnicodeError:
        return False


def parse(text: str) -> Document:
    """Parse the text of an EDS or DCF."""
    return _Reader([]).read(text, "utf-8")


def is_text(text: str, encoding: str = "ascii") -> bool:
    """Return whether a line of a file in this encoding can hold a text so that every reader reads the same."""
    # The reader itself detects outer blanks, ` ;`, `#` and long lines.
    line = parse(f"[x]\nParameterValue={text}") if text.isprintable() else Document({})
    kinds = {each.kind for each in line.oddities} - {Odd.NOT_ASCII}
    try:
        return not kinds and line.text("x", "parametervalue") == text and text.encode(encoding).decode(encoding) == text
    except UnicodeEncodeError:
        return False


class _Reader:
    """Reads the lines of one file; usual lines take a fast path, others go through `_other`."""

    def __init__(self, oddities: list[Oddity]) -> None:
        self._sections: dict[str, Section] = {}
        self._headers: list[int] = []
        self._oddities = oddities
        self._before: dict[str, Entry] = {}  # entries before the first section
        self._entries = self._before
        self._has_comments = False
        self._last = 0

    def read(self, text: str, encoding: str) -> Document:
        lines = self._split(text)
        self._last = len(lines)
        new = tuple.__new__  # twice as fast as Entry()
        entries = self._entries
        if not text.isascii():
            for number, line in enumerate(lines, start=1):
                if not line.isascii():
                    self._note(Odd.NOT_ASCII, number, 1 + next(n for n, each in enumerate(line) if not each.isascii()))
        for number, line in enumerate(lines, start=1):
            key, equals, value = line.partition("=")
            if equals and key.isalnum() and value.strip() is value and ";" not in value and len(line) <= LONGEST + 1:
                entry = new(Entry, (key, value, number, len(key) + 2))
                # 9 of 10 lines end here; a call for each would take a third of the time
                if entries.setdefault(key.lower(), entry) is not entry or entries is self._before:
                    self._doubt(entry, entries[key.lower()], 0)
            elif line:
                self._other(number, line)
                entries = self._entries
        return Document(self._sections, self._oddities, lines, self._headers, encoding, has_comments=self._has_comments)

    def _split(self, text: str) -> list[str]:
        """Split at LF, CRLF and CR; str.splitlines also splits at form feeds and others."""
        if text.rstrip("\r\n")[-1:] in tuple(END_MARKS):
            text = text.rstrip(f"\r\n{END_MARKS}") + ("\r\n" if "\r\n" in text else "\n")
            self._note(Odd.END_MARK, text.count("\n") + 1, 1)
        if "\0" in text:  # reported once, because a binary file has thousands
            before = text[: text.index("\0")]
            self._note(Odd.BINARY, before.count("\n") + 1, len(before) - before.rfind("\n"))
        if "\r" not in text:
            return text.split("\n")
        pairs, returns, feeds = text.count("\r\n"), text.count("\r"), text.count("\n")
        # Only CRLF: three equal numbers; only CR (old Macs): one that is not 0.
        if len({pairs, returns, feeds} - {0}) > 1 or (not pairs and feeds):
            self._note(Odd.LINE_ENDS, 1, 1)
        return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    def _other(self, number: int, line: str) -> None:
        text = line.strip()
        indent = len(line) - len(line.lstrip())
        if text.startswith("#"):
            self._note(Odd.HASH, number, 1)
        if not text or text[0] in "#;":
            self._has_comments |= bool(text)
            return
        if indent:
            self._note(Odd.INDENTED, number, indent + 1)
        if text.startswith("["):
            self._header(number, text, indent)
        elif "=" in text:
            self._entry(number, text, indent)
        else:
            # Only a line without its end can be the last one here.
            self._note(Odd.NOT_AN_ENTRY, number, indent + 1, text[:40] + CUT_OFF * (number == self._last))

    def _header(self, number: int, text: str, indent: int) -> None:
        name, bracket, rest = text[1:].partition("]")
        rest = rest.strip()
        if not bracket or not name.strip() or (rest and not rest.startswith(";")):
            self._note(Odd.HEADER, number, indent + 1, text[:40])
        section = Section(name, number, indent + 1, {})
        self._headers.append(number)  # also for a repeated section, because `Rewriting` needs the end of the first
        first = self._sections.setdefault(name.strip().lower(), section)
        if first is not section:
            self._note(Odd.TWO_SECTIONS, number, indent + 1, f"[{name}], first in line {first.line}")
        self._entries = section.entries  # entries of a repeated section are not in the document

    def _entry(self, number: int, line: str, indent: int) -> None:
        key, _, rest = line.partition("=")
        value = rest.strip()
        column = indent + len(key) + 2 + len(rest) - len(rest.lstrip())
        key = key.rstrip()
        if ";" in value:
            value = self._without_comment(number, column, value)
        length = len(key) + len(value)
        if length > LONGEST:
            self._note(Odd.TOO_LONG, number, column, f"{key[:40]} and its value have {length} characters")
        entry = Entry(key, value, number, column)
        first = self._entries.setdefault(key.lower(), entry) if key else entry
        if first is not entry or not key or self._entries is self._before:
            self._doubt(entry, first, indent)

    def _doubt(self, entry: Entry, first: Entry, indent: int) -> None:
        """Note an entry outside a section, without a key, or repeated."""
        if self._entries is self._before:
            self._note(Odd.NO_SECTION, entry.line, indent + 1, entry.key[:40])
        elif not entry.key:
            self._note(Odd.NO_KEY, entry.line, indent + 1)
        else:
            self._note(Odd.TWO_ENTRIES, entry.line, indent + 1, f"{entry.key[:40]}, first in line {first.line}")

    def _without_comment(self, number: int, column: int, value: str) -> str:
        """Cut off a comment; a semicolon inside a word starts none."""
        # CiA 306 allows comments only on their own lines, but many editors write them after values.
        start = 0 if value.startswith(";") else value.find(" ;") + 1 or value.find("\t;") + 1
        if not start and not value.startswith(";"):
            return value
        self._note(Odd.COMMENT_AFTER_VALUE, number, column + start)
        return value[:start].rstrip()

    def _note(self, kind: Odd, line: int, column: int, text: str = "") -> None:
        self._oddities.append(Oddity(kind, line, column, text))


# Changing single lines of a file; all others are kept: comments, order, letter case


class Rewriting:
    """A document's text with entries set or removed, and sections dropped; `text` returns the result."""

    def __init__(self, document: Document) -> None:
        self._lines: list[str | None] = list(document.lines)
        if self._lines[-1:] == [""]:
            del self._lines[-1]  # the empty text after the last line end
        self._headers = [*document.headers, len(self._lines) + 1]
        self._added: dict[int, list[str]] = {}  # new lines by the number of the line they follow

    def set(self, section: Section, key: str, value: object) -> None:
        """Set the value of a key in its line, or in a new line at the end of the section."""
        line = f"{key}={value}"
        entry = section.entries.get(key.lower())
        if entry:
            self._lines[entry.line - 1] = line
        else:
            numbers = range(self._next_header(section) - 1, section.line, -1)
            # Before the empty lines at the section's end.
            last = next((each for each in numbers if (self._lines[each - 1] or "").strip()), section.line)
            self._added.setdefault(last, []).append(line)

    def unset(self, section: Section, key: str) -> None:
        """Remove a key's line."""
        entry = section.entries.get(key.lower())
        if entry:  # the line's place is kept, so that line numbers stay valid
            self._lines[entry.line - 1] = None

    def drop(self, section: Section) -> None:
        """Remove a section."""
        end = self._next_header(section) - 1
        self._lines[section.line - 1 : end] = [None] * (end - section.line + 1)

    def append(self, name: str, entries: dict[str, object]) -> None:
        """Append a new section."""
        self._lines += [f"[{name}]", *(f"{key}={value}" for key, value in entries.items())]

    def text(self) -> str:
        """Return the whole text, with an empty line before each section."""
        lines: list[str] = []
        for number, line in enumerate(self._lines, start=1):
            if line is not None and line.startswith("[") and lines and lines[-1].strip():
                lines.append("")
            if line is not None:
                lines.append(line)
            lines += self._added.get(number, ())
        return "\n".join([*lines, ""] if lines and lines[-1] else lines)

    def _next_header(self, section: Section) -> int:
        return self._headers[bisect_right(self._headers, section.line)]


# The sections and keys of CiA 306 in its spelling, which other tools need. Readers look them up in lower case.


BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates in kbit/s that have a key in [DeviceInfo] (CiA 306) and a bit timing (CiA 301, Table 1)."""

BIT_RATE_KEYS = tuple(f"BaudRate_{rate}" for rate in BIT_RATES)
FLAGS = ("SimpleBootUpMaster", "SimpleBootUpSlave", "GroupMessaging", "LSS_Supported")
IDENTITY = ("VendorNumber", "ProductNumber", "RevisionNumber")
"""Keys of [DeviceInfo] for the values of 0x1018 sub 1, 2 and 3."""

FILE_INFO = ("FileName", "FileVersion", "FileRevision")
TIMES, DATES = ("CreationTime", "ModificationTime"), ("CreationDate", "ModificationDate")
ORIGIN = ("Description", *TIMES, *DATES, "CreatedBy", "ModifiedBy")
DEVICE_INFO = ("ProductNumber", "RevisionNumber", "OrderCode", *BIT_RATE_KEYS, *FLAGS, "DynamicChannelsSupported",
               "NrOfRXPDO", "NrOfTXPDO", "Granularity")  # fmt: skip
COMMISSIONING_KEYS = ("NodeID", "NodeName", "NodeRefd", "Baudrate", "NetNumber", "NetworkName", "NetRefd",
                      "CANopenManager", "LSS_SerialNumber")  # fmt: skip
OBJECT_KEYS = ("SubNumber", "ParameterName", "ObjectType", "DataType", "AccessType", "LowLimit", "HighLimit",
               "DefaultValue", "PDOMapping", "ObjFlags", "CompactSubObj", "ParameterValue", "UploadFile",
               "DownloadFile", "Denotation", "ParamRefd")  # fmt: skip
"""The keys of an object, and of a sub-index."""

LIMITS, VALUES = ("lowlimit", "highlimit"), ("defaultvalue", "parametervalue")
TYPED = (*LIMITS, *VALUES)
"""Keys whose value depends on the data type, in lower case."""

OF_VARIABLE = ("datatype", "accesstype", "pdomapping", *TYPED)
"""Keys of an object with a value, in lower case; objects with sub-indices do not have them."""

SECTION_KEYS: Mapping[str, tuple[str, ...]] = {
    "FileInfo": (*FILE_INFO, *ORIGIN, "EDSVersion", "LastEDS"),
    "DeviceInfo": (*dict.fromkeys((*DEVICE_INFO, *IDENTITY)), "VendorName", "ProductName", "CompactPDO",
                   "ExtendedBootUpMaster", "ExtendedBootUpSlave"),
    "DeviceComissioning": COMMISSIONING_KEYS,
    "DummyUsage": tuple(f"Dummy{code:04X}" for code in range(1, 0x20)),
}  # fmt: skip
"""The keys of each section with a fixed set of them."""

OBJECT_LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
"""The sections that list the objects of a file (CiA 306-1, 4.6.1)."""

COMMISSIONING = "DeviceComissioning"
"""Section with node-ID and bit rate in a DCF, in the standard's spelling."""

SECTION_NAMES: Mapping[str, str] = {each.lower(): each for each in (*SECTION_KEYS, "Comments", *OBJECT_LISTS)} | {
    "devicecommissioning": COMMISSIONING
}
"""Spelling of sections other than objects, by lower-case name."""

SPELLED_OBJECT_KEYS: Mapping[str, str] = {each.lower(): each for each in OBJECT_KEYS}
SPELLED_KEYS: Mapping[str, Mapping[str, str]] = {
    **{name.lower(): {each.lower(): each for each in keys} for name, keys in SECTION_KEYS.items()},
    "comments": {"lines": "Lines", **{f"line{number}": f"Line{number}" for number in range(1, 1000)}},
    **{name.lower(): {"supportedobjects": "SupportedObjects"} for name in OBJECT_LISTS},
}
"""Spelling of keys, by section and key in lower case."""
