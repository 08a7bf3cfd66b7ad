"""A network's messages and its devices' objects as a document to read, in the forms of `forms`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from eurobot_od.errors import UnknownName
from eurobot_od.export.description import DescribedMessage, Numeral, described
from eurobot_od.export.forms import FORMS, DocBlock, DocHeading, DocLink, DocTable, Paragraph
from eurobot_od.od.description import COMPOSED
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.protocol import Protocol


def docs_text(protocol: Protocol, dictionaries: Iterable[Dictionary], form: str) -> str:
    """Return the document of a network in a form of FORMS; raises UnknownName."""
    if form not in FORMS:
        raise UnknownName("format", form, FORMS)
    return FORMS[form](list(blocks(protocol, list(dictionaries))))


# What it says


def blocks(protocol: Protocol, dictionaries: Sequence[Dictionary]) -> Iterator[DocBlock]:
    """Yield the document: all messages as a table, each message with data, each device."""
    yield DocHeading(1, f"CANopen network: {', '.join(each.name for each in dictionaries)}")
    messages = described(protocol) if protocol.bindings else []
    yield DocHeading(2, "Messages")
    if messages:
        rows = [
            (
                f"0x{each.cob_id:03X}",
                DocLink(each.name, _anchor(each)) if each.fields else each.name,  # one without data has no section
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
    size = f"{lengths} byte{'s' * (message.length > 1)}"
    yield Paragraph(f"COB-ID 0x{message.cob_id:03X}, {message.path}, {size}. {message.text}".rstrip())
    head = ("Field", "Bits", "Width", "Number", "Range", "Unit", "Values with names")
    rows = []
    for field in message.fields:
        runs: list[list[int]] = []  # `1.4..1.7, 0.0..0.7`: a field that is mapped in slices has more than one
        for place in field.places:
            if runs and place == runs[-1][-1] + 1:
                runs[-1].append(place)
            else:
                runs.append([place])
        ends = (dict.fromkeys((run[0], run[-1])) for run in runs)
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
OBJECT_HEAD = ("Index", "Sub", "Name", "Type", "Access", "PDO", "Value", "Low limit", "High limit")


def _device(dictionary: Dictionary) -> Iterator[DocBlock]:
    yield DocHeading(2, f"{dictionary.name}, node-ID {dictionary.node_id}", f"device-{dictionary.node_id}")
    texts = ((what, dictionary.device.document.text("deviceinfo", key)) for what, key in INFORMATION)
    facts = ", ".join(f"{what} {text}" for what, text in texts if text)
    yield Paragraph(f"From {dictionary.file.name}. {facts}".rstrip())
    rows: list[tuple[str, ...]] = []
    for number, each in ((f"0x{index:04X}", dictionary.device.objects[index]) for index in dictionary.members):
        if each.code in COMPOSED:
            rows.append((number, "", each.name, each.code.name if each.code else "", "", "", "", "", ""))
        for sub, variable in each.subs.items():
            value = variable.value_entry.value if variable.value_entry else ""
            limits = (variable.section.text(key) for key in ("lowlimit", "highlimit"))
            type_, is_mappable = variable.type.name if variable.type else "", "yes" if variable.is_mappable else ""
            rows.append((number, str(sub), variable.name, type_, variable.access, is_mappable, value, *limits))
    yield DocTable(OBJECT_HEAD, rows, words=("Index", "Type"))
