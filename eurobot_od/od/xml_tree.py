"""Elements of an XML file, with lines and columns, read by expat.

A document type with declarations, and so any entity, is refused; no other file is ever read.
"""

from __future__ import annotations

import codecs
import re
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.parsers import expat

from eurobot_od.errors import LONGEST_NAME
from eurobot_od.od.document import WIDE_MARKS

MOST_DEPTH = 200
"""Deepest nesting of elements; a device description has about ten levels."""


class XmlElement(NamedTuple):
    """An element: name without namespace, attributes, place, children and text."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    column: int
    children: list[XmlElement]
    texts: list[str]

    @property
    def text(self) -> str:
        """The text in one line, without outer blanks."""
        return " ".join("".join(self.texts).split())

    def all(self, tag: str) -> Iterator[XmlElement]:
        """Yield all descendants with a name, and the element itself, in the file's order."""
        waiting = [self]
        while waiting:
            each = waiting.pop()
            if each.tag == tag:
                yield each
            waiting.extend(reversed(each.children))

    def first(self, tag: str) -> XmlElement | None:
        """Return the first descendant with a name, or None."""
        return next(self.all(tag), None)

    def child(self, tag: str) -> XmlElement | None:
        """Return the first child with a name, or None."""
        return next((each for each in self.children if each.tag == tag), None)


class XmlError(Exception):
    """Malformed XML, or a construct that no device description has: description, line and column."""

    def __init__(self, what: str, line: int, column: int = 1) -> None:
        super().__init__(what)
        self.what, self.line, self.column = what, line, column


def read_xml(data: bytes, document_type: str = "") -> XmlElement:
    """Parse an XML file and return its first element; raises XmlError.

    `document_type` is the name of an allowed document type without declarations.
    """
    try:
        return _parsed(*in_known_encoding(data), document_type)
    except expat.ExpatError as error:
        raise XmlError(expat.ErrorString(error.code), error.lineno, error.offset + 1) from error


DECLARED_ENCODING = re.compile(rb"""<\?xml\b[^>]*?\bencoding\s*=\s*(["'])([A-Za-z][\w.-]*)\1""")
EXPATS_ENCODINGS = ("utf-8", "utf-16", "iso8859-1", "ascii")
"""Python's names of the encodings that expat reads."""

WIDER = {"gb2312": "gb18030", "gbk": "gb18030", "shift_jis": "cp932"}
"""Larger encodings that Windows programs write although they declare the smaller one."""


BY_MARK = {BOM_UTF8: "utf-8", **dict.fromkeys(WIDE_MARKS, "utf-16")}
"""Encodings by byte order mark, which has priority over the declaration."""


def in_known_encoding(data: bytes) -> tuple[bytes, str | None]:
    """Return XML in an encoding that expat can read, and that encoding; None if expat detects it.

    Raises XmlError for an unknown encoding.
    """
    marked = next((name for mark, name in BY_MARK.items() if data.startswith(mark)), None)
    declared = DECLARED_ENCODING.match(data)
    if declared is None:  # always the case after a byte order mark
        return data, marked
    name = declared[2].decode("ascii")
    try:
        encoding = codecs.lookup(name).name
        if encoding in EXPATS_ENCODINGS:
            return data, None
        # The declaration must be the same in its own encoding.
        if declared[0].decode(encoding).encode() != declared[0]:
            raise LookupError(name)
        text = data.decode(WIDER.get(encoding, encoding), "replace")
    except (LookupError, ValueError) as error:
        raise XmlError(f"the encoding {name[:LONGEST_NAME]!r}, which is not known", 1) from error
    return text.encode("utf-8", "replace"), "utf-8"


def _parsed(data: bytes, encoding: str | None, document_type: str) -> XmlElement:
    """Parse XML into elements; `encoding` has priority over the declared one."""
    parser = expat.ParserCreate(encoding)
    root = XmlElement("", {}, 1, 1, [], [])
    stack = [root]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > MOST_DEPTH:
            raise XmlError(f"more than {MOST_DEPTH} elements in each other", parser.CurrentLineNumber)
        named = {key.rpartition(":")[2]: value for key, value in attributes.items()}
        place = parser.CurrentLineNumber, parser.CurrentColumnNumber + 1  # expat counts columns from 0
        each = XmlElement(tag.rpartition(":")[2], named, *place, [], [])
        stack[-1].children.append(each)
        stack.append(each)

    def check_type(name: str, _system: str | None, _public: str | None, has_declarations: int) -> None:
        # Entities could expand to gigabytes, or refer to other files.
        if name != document_type or has_declarations:
            raise XmlError("a document type, which no device description has", parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = lambda text: stack[-1].texts.append(text)
    parser.StartDoctypeDeclHandler = check_type
    parser.Parse(data, True)
    return root.children[0]
