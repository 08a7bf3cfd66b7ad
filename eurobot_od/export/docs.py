"""A network's messages and its devices' objects as a document to read, in the forms of `forms`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from eurobot_od.errors import UnknownName
from eurobot_od.export.description import DescribedField, DescribedMessage, Numeral, described
from eurobot_od.export.forms import FORMS, Cell, DocBlock, DocHeading, DocLink, DocTable, Paragraph
from eurobot_od.od.description import COMPOSED, DescribedVariable
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.protocol import Protocol


def docs_text(protocol: Protocol, dictionaries: Iterable[Dictionary], form: str) -> str:
    """Return the document of a network in a form of FORMS; raises UnknownName."""
    if form not in FORMS:
        raise UnknownName("format", form, FORMS)
    return FORMS[form](list(blocks(protocol, list(dictionaries))))


# What it says


def blocks(protocol: Protocol, dictionaries: Sequence[Dictionary]) -> Iterator[DocBlock]:
    """Give the document: all messages as a table, each message with data, each device."""
    yield DocHeading(1, f"CANopen network: {', '.join(each.name for each in dictionaries)}")
    messages = described(protocol) if protocol.bindings else []
    yield DocHeading(2, "Messages")
    if messages:
        yield DocTable(("COB-ID", "Message", "From", "To", "Bytes", "Fields"), list(map(_row, messages)), ("Bytes",))
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


def _row(message: DescribedMessage) -> tuple[Cell, ...]:
    senders, receivers = ", ".join(message.senders), ", ".join(message.receivers)
    name = DocLink(message.name, _anchor(message)) if message.fields else message.name
    fields = ", ".join(f"{each.name} {each.width}" for each in message.fields)
    return f"0x{message.cob_id:03X}", name, senders, receivers, str(message.length), fields


def _message(message: DescribedMessage) -> Iterator[DocBlock]:
    yield DocHeading(3, message.name, _anchor(message))
    lengths = " or ".join(map(str, sorted({message.shortest, message.length})))
    size = f"{lengths} byte{'s' * (message.length > 1)}"
    yield Paragraph(f"COB-ID 0x{message.cob_id:03X}, {message.path}, {size}. {message.text}".rstrip())
    head = ("Field", "Bits", "Width", "Number", "Range", "Unit", "Values with names")
    yield DocTable(head, list(map(_field, message.fields)), ("Width",))


def _field(field: DescribedField) -> tuple[str, ...]:
    limits = "" if field.numeral is Numeral.REAL else f"{field.limits.low}..{field.limits.high}"
    named = ", ".join(f"{raw} {name}" for raw, name in field.named.items())
    return field.name, _bits(field), str(field.width), field.numeral.value, limits, field.unit, named


def _bits(field: DescribedField) -> str:
    """Write where a field's bits are, the lowest first: `0.0..1.3`, or `1.4..1.7, 0.0..0.7` for slices."""
    runs: list[list[int]] = []
    for place in field.places:
        if runs and place == runs[-1][-1] + 1:
            runs[-1].append(place)
        else:
            runs.append([place])
    return ", ".join("..".join(f"{bit // 8}.{bit % 8}" for bit in dict.fromkeys((run[0], run[-1]))) for run in runs)


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
    rows = [row for index in dictionary.members for row in _object(dictionary, index)]
    yield DocTable(OBJECT_HEAD, rows, words=("Index", "Type"))


def _object(dictionary: Dictionary, index: int) -> Iterator[tuple[str, ...]]:
    number, described_object = f"0x{index:04X}", dictionary.device.objects[index]
    if described_object.code in COMPOSED:
        code = described_object.code
        yield number, "", described_object.name, code.name if code else "", "", "", "", "", ""
    for sub, variable in described_object.subs.items():
        yield number, str(sub), variable.name, *_variable(variable)


def _variable(variable: DescribedVariable) -> tuple[str, ...]:
    value = variable.value_entry.value if variable.value_entry else ""
    limits = (variable.section.text(key) for key in ("lowlimit", "highlimit"))
    type_ = variable.type.name if variable.type else ""
    return type_, variable.access, "yes" if variable.is_mappable else "", value, *limits
