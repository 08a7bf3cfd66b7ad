"""Reads the text of an EDS or DCF into sections and entries that know their line and column, whatever the bytes.

At the end are the sections and keys of CiA 306, as it spells them.

Rule of this file: reading never raises, and never skips anything silently. What does not belong in an EDS becomes an
`Oddity`; lint turns each into a finding, and `normal` refuses a file with those that may hide objects.
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
"""Most characters of a key and its value together (CiA 306: shorter than 255)."""

WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""How a UTF-16 text starts."""


class Odd(Enum):
    """What the reader stumbles over."""

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
"""Oddities that leave unclear what the file was to say: it is not an EDS at all, or entries have no section."""

STRAY = (Odd.NOT_AN_ENTRY, Odd.NO_SECTION, Odd.NO_KEY)
"""Lines that say nothing about an object; if one is the last line, though, the file was cut off."""

END_MARKS = "\0\x1a"
"""What old editors and programs put at the end of a text: Ctrl-Z, and NUL up to a full block."""


class Oddity(NamedTuple):
    """One odd thing: its kind, its line and column (both from 1) and the words about it for a message."""

    kind: Odd
    line: int
    column: int
    text: str


class Remark(NamedTuple):
    """What is to be said about a line of a file."""

    line: int
    what: str


class HasPlace(Protocol):
    """What stands somewhere in a file: in a line and a column, both from 1."""

    @property
    def line(self) -> int: ...
    @property
    def column(self) -> int: ...


class Entry(NamedTuple):
    """`key=value`, as written but without blanks around either; `line` and `column` (of the value) count from 1."""

    key: str
    value: str
    line: int
    column: int


class Section(NamedTuple):
    """`[name]`, its place, and its entries by lower-case key; of an entry given twice the first."""

    name: str
    line: int
    column: int
    entries: dict[str, Entry]

    def text(self, key: str) -> str:
        """Return the value of a key (in lower case), the empty text if there is none."""
        entry = self.entries.get(key)
        return entry.value if entry else ""

    def at(self, key: str) -> Entry | Section:
        """Return the entry of a key (in lower case), or the section itself where there is none, for its place."""
        return self.entries.get(key, self)

    def numbered(self) -> Iterator[Entry]:
        """Yield the entries whose keys are numbers: those of a list of objects or modules (CiA 306-1, 4.6.1)."""
        return (entry for key, entry in self.entries.items() if key.isdecimal())

    def saying(self, **entries: str) -> Section:
        """Return the section with other values; a key that is new stands where the section begins."""
        places = ((key, text, self.at(key.lower())) for key, text in entries.items())
        said = {key.lower(): Entry(key, text, at.line, at.column) for key, text, at in places}
        return self._replace(entries={**self.entries, **said})

    def without_lines(self) -> Section:
        """Return the section for another file, in which its lines are those of something else."""
        return self._replace(line=0, entries={key: each._replace(line=0) for key, each in self.entries.items()})


BREAKS = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")


def section_at(name: str, at: HasPlace, entries: Mapping[str, str]) -> Section:
    """Return a section that stands where a file of any form says what is in it."""
    # A line end in a value, which XML can have, would make two lines of an EDS.
    lines = {key: BREAKS.sub(" ", value).strip() for key, value in entries.items()}
    return Section(name, at.line, at.column, {}).saying(**lines)


class Document(NamedTuple):
    """A file as read: its sections by lower-case name (of a section given twice the first), and what was odd.

    `lines` is the whole text and `headers` the line numbers of all section headers, so that the text can be written
    again with single lines changed; `encoding` is the one in which that gives the same bytes. A document of an XML file
    (`is_xml`) has no lines that could be changed. `has_comments` tells whether a line is a comment.
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
        """The encoding in which the file's texts are the bytes of a VISIBLE_STRING: as they stand in the file."""
        return "utf-8" if self.encoding == "utf-16" else self.encoding

    def text(self, section: str, key: str) -> str:
        """Return the value of a key in a section (both in lower case), the empty text if either is missing."""
        found = self.sections.get(section)
        return found.text(key) if found else ""

    @property
    def hiding(self) -> Oddity | None:
        """The first oddity that leaves unclear what the file was to say; None without one."""
        end = len(self.lines)  # the last line has no line end: it is empty, or the file stops in the middle of it
        odd = (each for each in self.oddities if each.kind in HIDING or (each.kind in STRAY and each.line == end))
        return next(odd, None)


def read_bytes(file: str | Path) -> bytes:
    """Return what a file holds; raises DictionaryError if it cannot be read, or is too large."""
    try:
        data = read_whole(file)
    except FileError as error:
        raise DictionaryError(file, None, error.what) from error
    for what, most, count in COUNTED:
        if (number := count(data)) > most:
            raise DictionaryError(file, None, f"{number} {what}, and {most} are the most that are read")
    return data


MOST_SECTIONS, MOST_LINES, MOST_TAGS = 100_000, 500_000, 600_000
"""Most of what becomes an object in memory: sections and lines of an EDS, tags of XML; makers' files have a tenth."""

HEADER_LINE = re.compile(rb"(?:^|[\r\n])[ \t\0]*\[")


def _sections(data: bytes) -> int:
    """Return how many lines are headers; of a file with few brackets how many of those there are."""
    brackets = data.count(b"[")
    return brackets if brackets <= MOST_SECTIONS else sum(1 for _ in HEADER_LINE.finditer(data))


COUNTED: Sequence[tuple[str, int, Callable[[bytes], int]]] = (
    ("sections", MOST_SECTIONS, _sections),
    ("lines", MOST_LINES, lambda data: max(data.count(b"\n"), data.count(b"\r"))),
    ("tags", MOST_TAGS, lambda data: data.count(b"<")),
)


def read(data: bytes) -> Document:
    """Read the bytes of an EDS or DCF. CiA 306 asks for ASCII; files come in UTF-8 and in Windows' code pages, too."""
    oddities: list[Oddity] = []
    if data.startswith(WIDE_MARKS):  # before UTF-8: as Latin-1 every second character would be a NUL
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
"""Gives every byte a character, so that it cannot fail, and writing gives the same bytes back."""


def code_page(data: bytes) -> str | None:
    """Return the encoding that fits bytes that are not UTF-8, and gives the same bytes again; None for an open one.

    Words tell: in Western ones a letter beyond ASCII stands among ASCII's, Cyrillic ones have none of those, kana has
    lead bytes that no other text has, and most Chinese characters of GB2312 are among its common ones.
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
        ("koi8-r", is_cyrillic and low > high > 0),  # where the small letters are Windows' capitals
        ("gb2312", not is_cyrillic and all(len(word) % 2 == 0 for word in words) and _share(leads, HANZI) > 0.5),
        ("cp1252", mean < WESTERN_WORD and control > 0),
        ("latin-1", mean < WESTERN_WORD and not control),
    )
    return next((name for name, fits in fitting if fits and _is_kept(data, name)), None)


def _share(found: Sequence[int], wanted: Container[int]) -> float:
    return sum(each in wanted for each in found) / len(found)


KANA, HANZI = (0x82, 0x83), range(0xB0, 0xD8)
"""Lead bytes of kana in Shift-JIS, and of the common characters of GB2312."""

MOST_OF = 0.9
CYRILLIC_WORD, WESTERN_WORD = 2.5, 2.0
"""Bytes beyond ASCII beside each other, on average: more of them in Cyrillic texts, fewer in Western ones."""


def _is_kept(data: bytes, encoding: str) -> bool:
    try:
        return data.decode(encoding).encode(encoding) == data
    except UnicodeError:
        return False


def parse(text: str) -> Document:
    """Read the text of an EDS or DCF."""
    return _Reader([]).read(text, "utf-8")


def is_text(text: str, encoding: str = "ascii") -> bool:
    """Return whether a line of a file in this encoding can hold a text so that every reader finds the same."""
    # Asked of the reader itself: blanks at an end, ` ;`, `#` and lines that are too long all come out here.
    line = parse(f"[x]\nParameterValue={text}") if text.isprintable() else Document({})
    kinds = {each.kind for each in line.oddities} - {Odd.NOT_ASCII}
    try:
        return not kinds and line.text("x", "parametervalue") == text and text.encode(encoding).decode(encoding) == text
    except UnicodeEncodeError:
        return False


class _Reader:
    """Walks over the lines of one file; the usual line takes the short way, any other `_other`."""

    def __init__(self, oddities: list[Oddity]) -> None:
        self._sections: dict[str, Section] = {}
        self._headers: list[int] = []
        self._oddities = oddities
        self._before: dict[str, Entry] = {}  # what stands before the first section
        self._entries = self._before
        self._has_comments = False

    def read(self, text: str, encoding: str) -> Document:
        lines, new = self._split(text), tuple.__new__  # Entry() itself takes twice as long, for ten thousand lines
        entries = self._entries
        for number, line in enumerate(lines if not text.isascii() else (), start=1):
            if not line.isascii():
                self._note(Odd.NOT_ASCII, number, 1 + next(n for n, each in enumerate(line) if not each.isascii()))
        for number, line in enumerate(lines, start=1):
            key, equals, value = line.partition("=")
            if equals and key.isalnum() and value.strip() is value and ";" not in value and len(line) <= LONGEST + 1:
                entry = new(Entry, (key, value, number, len(key) + 2))
                # the usual line ends here: 9 of 10 lines are such, and a call for each would take a third of the time
                if entries.setdefault(key.lower(), entry) is not entry or entries is self._before:
                    self._doubt(entry, entries[key.lower()], 0)
            elif line:
                self._other(number, line)
                entries = self._entries
        return Document(self._sections, self._oddities, lines, self._headers, encoding, has_comments=self._has_comments)

    def _split(self, text: str) -> list[str]:
        """Split at LF, CRLF and CR; str.splitlines would split at form feeds and others, too."""
        if text.rstrip("\r\n")[-1:] in tuple(END_MARKS):
            text = text.rstrip(f"\r\n{END_MARKS}") + ("\r\n" if "\r\n" in text else "\n")
            self._note(Odd.END_MARK, text.count("\n") + 1, 1)
        if "\0" in text:  # said once: a binary file would have thousands of lines to complain of
            before = text[: text.index("\0")]
            self._note(Odd.BINARY, before.count("\n") + 1, len(before) - before.rfind("\n"))
        if "\r" not in text:
            return text.split("\n")
        pairs, returns, feeds = text.count("\r\n"), text.count("\r"), text.count("\n")
        # CRLF throughout gives three equal numbers, CR alone (old Macs) one that is not 0.
        if len({pairs, returns, feeds} - {0}) > 1 or (not pairs and feeds):
            self._note(Odd.LINE_ENDS, 1, 1)
        return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    def _other(self, number: int, line: str) -> None:
        text, indent = line.strip(), len(line) - len(line.lstrip())
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
            self._note(Odd.NOT_AN_ENTRY, number, indent + 1, text[:40])

    def _header(self, number: int, text: str, indent: int) -> None:
        name, bracket, rest = text[1:].partition("]")
        rest = rest.strip()
        if not bracket or not name.strip() or (rest and not rest.startswith(";")):
            self._note(Odd.HEADER, number, indent + 1, text[:40])
        section = Section(name, number, indent + 1, {})
        self._headers.append(number)  # also of a second one: `Rewriting` has to know where the first ends
        first = self._sections.setdefault(name.strip().lower(), section)
        if first is not section:
            self._note(Odd.TWO_SECTIONS, number, indent + 1, f"[{name}], first in line {first.line}")
        self._entries = section.entries  # of the second one, if it is there twice: those entries are in no section

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
        """Note what is odd about an entry: it is in no section, it has no key, it is there already."""
        if self._entries is self._before:
            self._note(Odd.NO_SECTION, entry.line, indent + 1, entry.key[:40])
        elif not entry.key:
            self._note(Odd.NO_KEY, entry.line, indent + 1)
        else:
            self._note(Odd.TWO_ENTRIES, entry.line, indent + 1, f"{entry.key[:40]}, first in line {first.line}")

    def _without_comment(self, number: int, column: int, value: str) -> str:
        """Cut a comment off; a semicolon inside a word, as in a text value, starts none."""
        # CiA 306 has comments only on lines of their own, but many editors put them here.
        start = 0 if value.startswith(";") else value.find(" ;") + 1 or value.find("\t;") + 1
        if not start and not value.startswith(";"):
            return value
        self._note(Odd.COMMENT_AFTER_VALUE, number, column + start)
        return value[:start].rstrip()

    def _note(self, kind: Odd, line: int, column: int, text: str = "") -> None:
        self._oddities.append(Oddity(kind, line, column, text))


# Changing single lines of a file; all others stay as they are: comments, order, letter case


class Rewriting:
    """A document's text with entries set or left out and sections dropped; `text` gives it when all is done."""

    def __init__(self, document: Document) -> None:
        self._lines: list[str | None] = list(document.lines)
        if self._lines[-1:] == [""]:
            del self._lines[-1]  # what follows the last line end is not a line
        self._headers = [*document.headers, len(self._lines) + 1]
        self._added: dict[int, list[str]] = {}  # new lines by the number of the line they follow

    def set(self, section: Section, key: str, value: object) -> None:
        """Give a key its value: in its line if it has one, else in a new line after the section's last."""
        line, entry = f"{key}={value}", section.entries.get(key.lower())
        if entry:
            self._lines[entry.line - 1] = line
        else:
            numbers = range(self._next_header(section) - 1, section.line, -1)
            # Before the empty lines at a section's end, which belong to the next one for a reader.
            last = next((each for each in numbers if (self._lines[each - 1] or "").strip()), section.line)
            self._added.setdefault(last, []).append(line)

    def unset(self, section: Section, key: str) -> None:
        """Leave a key's line out."""
        entry = section.entries.get(key.lower())
        if entry:  # the place is kept, so that the numbers of all other lines stay right
            self._lines[entry.line - 1] = None

    def drop(self, section: Section) -> None:
        """Leave a section out."""
        end = self._next_header(section) - 1
        self._lines[section.line - 1 : end] = [None] * (end - section.line + 1)

    def append(self, name: str, entries: dict[str, object]) -> None:
        """Put a new section at the end."""
        self._lines += [f"[{name}]", *(f"{key}={value}" for key, value in entries.items())]

    def text(self) -> str:
        """Return the whole text, an empty line before each section."""
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


# The sections and keys of CiA 306, as it spells them. Readers look them up in lower case; other tools need them as
# they are written here.


BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates in kbit/s that have a key in [DeviceInfo] (CiA 306) and a bit timing (CiA 301, Table 1)."""

BIT_RATE_KEYS = tuple(f"BaudRate_{rate}" for rate in BIT_RATES)
FLAGS = ("SimpleBootUpMaster", "SimpleBootUpSlave", "GroupMessaging", "LSS_Supported")
IDENTITY = ("VendorNumber", "ProductNumber", "RevisionNumber")
"""Keys of [DeviceInfo] that say the same as 0x1018 sub 1, 2 and 3."""

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
"""Keys whose text goes by the data type, in lower case."""

OF_VARIABLE = ("datatype", "accesstype", "pdomapping", *TYPED)
"""Keys of an object with a value, in lower case; an object with sub-indices does not have them."""

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
"""The section of node-ID and bit rate in a DCF, in the spelling of the standard."""

SECTION_NAMES: Mapping[str, str] = {each.lower(): each for each in (*SECTION_KEYS, "Comments", *OBJECT_LISTS)} | {
    "devicecommissioning": COMMISSIONING
}
"""How the sections that belong to no object are spelled, by their names in lower case."""

SPELLED_OBJECT_KEYS: Mapping[str, str] = {each.lower(): each for each in OBJECT_KEYS}
SPELLED_KEYS: Mapping[str, Mapping[str, str]] = {
    **{name.lower(): {each.lower(): each for each in keys} for name, keys in SECTION_KEYS.items()},
    "comments": {"lines": "Lines", **{f"line{number}": f"Line{number}" for number in range(1, 1000)}},
    **{name.lower(): {"supportedobjects": "SupportedObjects"} for name in OBJECT_LISTS},
}
"""How keys are spelled, by their section and themselves in lower case."""
