"""Documents as lists of blocks, written as Markdown or HTML with all texts escaped."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import look_up
from eurobot_od.export.description import DescribedMessage, Numeral, described
from eurobot_od.od.description import COMPOSED
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.units import RAW, digits, scale_of
from eurobot_od.pdo.codec import merged
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support import texts


class DocHeading(NamedTuple):
    """A heading: its level from 1, and its anchor for links."""

    level: int
    text: str
    anchor: str = ""


class DocLink(NamedTuple):
    """A text with a link to a heading."""

    text: str
    anchor: str


Cell: TypeAlias = "str | DocLink"


class Paragraph(NamedTuple):
    """A paragraph."""

    text: str


class DocTable(NamedTuple):
    """A table with heads and rows; columns in `numbers` are right-aligned, those in `words` are never wrapped.

    In a table without heads, the first column names the others.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    numbers: Sequence[str] = ()
    words: Sequence[str] = ()


class Preformatted(NamedTuple):
    """Preformatted lines."""

    lines: Sequence[str]


DocBlock: TypeAlias = "DocHeading | Paragraph | DocTable | Preformatted"


def form_of(file: Path) -> str:
    """Return the format for a file's suffix; raises UnknownName."""
    return look_up("document format", file.suffix.lower() or file.name, SUFFIXES)


MARKED = re.compile(r"([\\`*_\[\]<>|&#~$])")
"""Characters with a meaning in Markdown."""


def one_line(text: str) -> str:
    """Return a text in one line, with U+FFFD for unprintable characters."""
    return "".join(each if each.isprintable() else "\ufffd" for each in " ".join(text.split()))


def markdown_of(contents: Sequence[DocBlock]) -> str:
    """Return a document as Markdown."""
    return "\n\n".join("\n".join(_markdown_block(each)) for each in contents) + "\n"


def _markdown_block(block: DocBlock) -> Iterator[str]:
    if isinstance(block, DocHeading):
        if block.anchor:
            yield f'<a id="{block.anchor}"></a>\n'
        yield f"{'#' * block.level} {_marked(block.text)}"
    elif isinstance(block, Paragraph):
        yield _marked(block.text)
    elif isinstance(block, Preformatted):
        yield from (f"    {texts.one_line(each)}" for each in block.lines)
    else:
        yield _markdown_row(block.head)
        yield "|" + "|".join("---:" if each in block.numbers else "---" for each in block.head) + "|"
        yield from map(_markdown_row, block.rows)


def _markdown_row(cells: Iterable[Cell]) -> str:
    def written(cell: Cell) -> str:
        return f"[{_marked(cell.text)}](#{cell.anchor})" if isinstance(cell, DocLink) else _marked(cell)

    return f"| {' | '.join(map(written, cells))} |"


def _marked(text: str) -> str:
    return MARKED.sub(r"\\\1", one_line(text))


STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1c2329; max-width: 75rem; margin: 2rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.3rem; margin-top: 2.5rem; border-bottom: 1px solid #ccd3d9; }
h3 { font-size: 1.05rem; margin: 1.8rem 0 0.3rem; } p { margin: 0.4rem 0 0.6rem; }
table { border-collapse: collapse; margin: 0.6rem 0; }
th, td { text-align: left; padding: 0.2rem 0.7rem; border-bottom: 1px solid #e3e8ec; vertical-align: top; }
td { overflow-wrap: anywhere; } th { background: #f0f3f6; white-space: nowrap; }
pre { font-size: 13px; overflow-x: auto; background: #f0f3f6; padding: 0.6rem 0.8rem; }
.word, .number { white-space: nowrap; } .number { text-align: right; } a { color: #0b5cad; }
@media (prefers-color-scheme: dark) {
  body { background: #14181c; color: #dde3e8; } th, pre { background: #20262c; } th, td, h2 { border-color: #333c44; }
  a { color: #7db8f5; }
}
@media (max-width: 40rem) {
  body { margin: 1rem auto; padding: 0 0.8rem; } th, td { padding: 0.2rem 0.35rem; } th { white-space: normal; }
}
@media print {
  body { max-width: none; margin: 0; padding: 0; font-size: 11px; color: #000; background: #fff; }
  h2, h3 { break-after: avoid; } tr, pre { break-inside: avoid; } th, pre { background: #f0f3f6; color: #000; }
  pre { font-size: 9px; white-space: pre-wrap; }
}
"""


def html_of(contents: Sequence[DocBlock]) -> str:
    """Return a document as an HTML page; its first heading is the title."""
    title = next(each.text for each in contents if isinstance(each, DocHeading))
    body = "\n".join(line for each in contents for line in _html_block(each))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{_escaped(title)}</title>
<style>{STYLE}</style>
</head>
<body>
{body}
</body>
</html>
"""


def _html_block(block: DocBlock) -> Iterator[str]:
    if isinstance(block, DocHeading):
        anchor = f' id="{block.anchor}"' if block.anchor else ""
        yield f"<h{block.level}{anchor}>{_escaped(block.text)}</h{block.level}>"
    elif isinstance(block, Paragraph):
        yield f"<p>{_escaped(block.text)}</p>"
    elif isinstance(block, Preformatted):
        yield "<pre>" + "\n".join(escape(texts.one_line(each)) for each in block.lines) + "</pre>"
    else:
        of_columns = dict.fromkeys(block.words, ' class="word"') | dict.fromkeys(block.numbers, ' class="number"')
        has_heads = any(block.head)
        classes = [of_columns.get(each, "") for each in block.head] if has_heads else [' class="word"', ""]
        yield "<table>"
        if has_heads:
            yield f"<thead>{_html_row('th', block.head, classes)}</thead>"
        yield from (_html_row("td", row, classes) for row in block.rows)
        yield "</table>"


def _html_row(tag: str, cells: Iterable[Cell], classes: Iterable[str]) -> str:
    texts = (
        f'<a href="#{each.anchor}">{_escaped(each.text)}</a>' if isinstance(each, DocLink) else _escaped(each)
        for each in cells
    )
    return f"<tr>{''.join(f'<{tag}{each}>{text}</{tag}>' for text, each in zip(texts, classes))}</tr>"


def _escaped(text: str) -> str:
    return escape(one_line(text))


FORMS: Mapping[str, Callable[[Sequence[DocBlock]], str]] = {"markdown": markdown_of, "html": html_of}
SUFFIXES = {".md": "markdown", ".markdown": "markdown", ".html": "html", ".htm": "html"}


def docs_text(protocol: Protocol, dictionaries: Iterable[Dictionary], form: str) -> str:
    """Return the document of a network in a format of FORMS; raises UnknownName."""
    return look_up("format", form, FORMS)(list(blocks(protocol, list(dictionaries))))


# The document of a network


def blocks(protocol: Protocol, dictionaries: Sequence[Dictionary]) -> Iterator[DocBlock]:
    """Yield the document: a table of all messages, each message with data, each device."""
    yield DocHeading(1, f"CANopen network: {', '.join(each.name for each in dictionaries)}")
    messages = described(protocol) if protocol.bindings else []
    yield DocHeading(2, "Messages")
    if messages:
        rows = [
            (
                f"0x{each.cob_id:03X}",
                DocLink(each.name, _anchor(each))
                if each.fields
                else each.name,  # a message without data has no section
                ", ".join(each.senders),
                ", ".join(each.receivers),
                str(each.length),
                ", ".join(f"{field.name} {field.width}" for field in each.fields),
            )
            for each in messages
        ]
        yield DocTable(("COB-ID", "Message", "From", "To", "Bytes", "Fields"), rows, ("Bytes",))
        yield Paragraph(
            "Bits are byte.bit, both from 0 and bit 0 the least significant; a field's lowest bit comes first. "
            "Ranges and values with names are raw numbers."
        )
    else:
        yield Paragraph("None of the devices has a valid PDO.")
    for message in messages:
        if message.fields:
            yield from _message(message)
    for dictionary in dictionaries:
        yield from _device(dictionary)


def _anchor(message: DescribedMessage) -> str:
    return f"message-{message.cob_id:03x}"


def _message(message: DescribedMessage) -> Iterator[DocBlock]:
    yield DocHeading(3, message.name, _anchor(message))
    lengths = " or ".join(map(str, sorted({message.shortest, message.length})))
    size = f"{lengths} byte{'s' if message.length > 1 else ''}"
    yield Paragraph(f"COB-ID 0x{message.cob_id:03X}, {message.path}, {size}. {message.text}".rstrip())
    head = ("Field", "Bits", "Width", "Number", "Range", "Unit", "Values with names")
    rows = []
    for field in message.fields:
        # A field in slices has several runs: `1.4..1.7, 0.0..0.7`.
        ends = (dict.fromkeys((each.offset, each.offset + each.bits - 1)) for each in merged(field.places))
        bits = ", ".join("..".join(f"{bit // 8}.{bit % 8}" for bit in run) for run in ends)
        limits = "" if field.numeral is Numeral.REAL else f"{field.limits.low}..{field.limits.high}"
        named = ", ".join(f"{raw} {name}" for raw, name in field.named.items())
        rows.append((field.name, bits, str(field.width), field.numeral.value, limits, field.unit, named))
    yield DocTable(head, rows, ("Width",))


INFORMATION = (
    ("Vendor", "vendorname"),
    ("vendor number", "vendornumber"),
    ("product", "productname"),
    ("product number", "productnumber"),
    ("revision", "revisionnumber"),
)
OBJECT_HEAD = ("Index", "Sub", "Name", "Type", "Access", "PDO", "Value", "Low limit", "High limit", "Unit of a step")


def _device(dictionary: Dictionary) -> Iterator[DocBlock]:
    yield DocHeading(2, f"{dictionary.name}, node-ID {dictionary.node_id}", f"device-{dictionary.node_id}")
    texts = ((what, dictionary.device.document.text("deviceinfo", key)) for what, key in INFORMATION)
    facts = ", ".join(f"{what} {text}" for what, text in texts if text)
    yield Paragraph(f"From {dictionary.file.name}. {facts}".rstrip())
    rows: list[tuple[str, ...]] = []
    for number, each in ((f"0x{index:04X}", dictionary.device.objects[index]) for index in dictionary.members):
        if each.code in COMPOSED:
            rows.append((number, "", each.name, each.code.name if each.code else "", "", "", "", "", "", ""))
        for sub, variable in each.subs.items():
            value = variable.value_entry.value if variable.value_entry else ""
            limits = (variable.section.text(key) for key in ("lowlimit", "highlimit"))
            type_ = variable.type.name if variable.type else ""
            is_mappable = "yes" if variable.is_mappable else ""
            known = dictionary.variable((variable.index, sub))
            scale = scale_of(known) if known is not None else RAW
            step = f"{scale.step}, from {digits(scale.offset)}" if scale.offset else scale.step
            rows.append((number, str(sub), variable.name, type_, variable.access, is_mappable, value, *limits, step))
    yield DocTable(OBJECT_HEAD, rows, words=("Index", "Type"))
