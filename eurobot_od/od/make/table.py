"""The protocol table: what `protocol.yaml` says, as values, and what must hold between its parts.

Rule of this file: the shape of the YAML is a table of readers, the rules between its parts a table of checks; a check
yields problems and repairs nothing. Numbers that follow from others are properties.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from eurobot_od.yaml_places import (
    Number,
    Place,
    Problem,
    Problems,
    Reader,
    ReadError,
    Text,
    choice,
    listing,
    mapping,
    matching,
    number,
    number_or_text,
    read_yaml,
    record,
    text,
)

OWN_NODE_ID = "$NODEID"
PDO_BITS = 64
FIELD_BITS = 32
FORMS = {"identifier": "0x{:03X}", "index": "0x{:04X}", "setting": "'{}'"}
"""How the values of a kind are written in problems, if not as they are."""
T = TypeVar("T")


@dataclass(frozen=True)
class Field:
    """A field of an object: `bits` wide, plain values in `range`, values with another meaning in `codes`."""

    bits: Number
    range: tuple[Number, Number]
    default: Number | Text
    codes: dict[Text, Number] = field(default_factory=dict)
    unit: str = ""  # for readers of the table; an EDS has no key for it

    @property
    def low(self) -> int:
        """The lowest value, plain or coded (EDS LowLimit)."""
        return min((self.range[0], *self.codes.values()))

    @property
    def high(self) -> int:
        """The highest value, plain or coded (EDS HighLimit)."""
        return max((self.range[1], *self.codes.values()))


@dataclass(frozen=True)
class Record:
    """An object of the dictionary: its index and its fields, sub-indices 1, 2, ... in this order."""

    index: Number
    fields: dict[Text, Field]


@dataclass(frozen=True)
class Message:
    """A message (document, Tables 4 and 5): one PDO in each of its nodes; `object` is its data, None without any."""

    identifier: Number
    priority: Text
    protocol: Text
    command: Text
    senders: tuple[Text, ...]
    receivers: tuple[Text, ...]
    listeners: tuple[Text, ...] = ()
    object: Text | None = None


@dataclass(frozen=True)
class Node:
    """A node: its identity, the nodes whose heartbeats it watches, its own settings."""

    node_id: Number
    product_name: Text
    product_number: Number
    order_code: Text
    watches: tuple[Text, ...]
    communication_error: Number
    settings: dict[Text, Record]


@dataclass(frozen=True)
class Dialect:
    """How one dialect differs: its number in the identity, further fields, other widths, and its bit order."""

    revision_number: Number
    fields: dict[Text, dict[Text, Field]] = field(default_factory=dict)
    widths: dict[Text, dict[Text, Number]] = field(default_factory=dict)
    most_significant_first: tuple[Text, ...] = ()


@dataclass(frozen=True)
class Vendor:
    """The vendor in the identity of every node."""

    name: Text
    number: Number


@dataclass(frozen=True)
class FileData:
    """The fixed [FileInfo] of every EDS file: `time` hh:mmAM or PM, `date` mm-dd-yyyy (CiA 306)."""

    version: Number
    revision: Number
    time: Text
    date: Text
    author: Text


@dataclass(frozen=True)
class Table:
    """The whole protocol table."""

    file: FileData
    vendor: Vendor
    serial_number: Number
    hardware_version: Text
    software_version: Text
    bit_rates: tuple[Number, ...]
    heartbeat: Number
    heartbeat_timeout: Number
    nodes: dict[Text, Node]
    settings: dict[Text, Record]
    objects: dict[Text, Record]
    messages: dict[Text, Message]
    dialects: dict[Text, Dialect]

    def objects_in(self, dialect: Dialect) -> dict[Text, Record]:
        """Give the objects with the fields and widths of `dialect`."""
        return {name: in_dialect(each, name, dialect) for name, each in self.objects.items()}


def in_dialect(plain: Record, name: Text, dialect: Dialect) -> Record:
    """Give the object `name` with the further fields and the widths of `dialect`."""
    fields = {**plain.fields, **dialect.fields.get(name, {})}
    widths = dialect.widths.get(name, {})
    return replace(plain, fields={each: replace(f, bits=widths.get(each, f.bits)) for each, f in fields.items()})


class TableError(Exception):
    """The file is no protocol table: `problems`, each once, in the file's order."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Sort the problems; what several nodes or dialects share is one problem."""
        self.problems = sorted(set(problems))
        super().__init__("; ".join(each.what for each in self.problems))


# The shape of the YAML


def shape(make: Callable[..., T], may: dict[str, Reader[Any]] | None = None, **needed: Reader[Any]) -> Reader[T]:
    """Make a reader of a record with these keys."""
    return record(make, needed, may or {})


TIME = matching(r"(0[1-9]|1[0-2]):[0-5][0-9](AM|PM)", "a time hh:mmAM or hh:mmPM")
DATE = matching(r"(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])-[0-9]{4}", "a date mm-dd-yyyy")
FIELD = shape(
    Field,
    {"codes": mapping(number), "unit": text},
    bits=number,
    range=listing(number, 2),
    default=number_or_text,
)
RECORDS = mapping(shape(Record, index=number, fields=mapping(FIELD)))
NAMES = listing(text)
TABLE = shape(
    Table,
    file=shape(FileData, version=number, revision=number, time=TIME, date=DATE, author=text),
    vendor=shape(Vendor, name=text, number=number),
    serial_number=number,
    hardware_version=text,
    software_version=text,
    bit_rates=listing(number),
    heartbeat=number,
    heartbeat_timeout=number,
    nodes=mapping(
        shape(
            Node,
            node_id=number,
            product_name=text,
            product_number=number,
            order_code=text,
            watches=NAMES,
            communication_error=number,
            settings=RECORDS,
        )
    ),
    settings=RECORDS,
    objects=RECORDS,
    messages=mapping(
        shape(
            Message,
            {"listeners": NAMES, "object": text},
            identifier=number,
            priority=choice("emergency", "normal", "information"),
            protocol=choice("GTP", "ELP", "GIP"),
            command=text,
            senders=NAMES,
            receivers=NAMES,
        )
    ),
    dialects=mapping(
        shape(
            Dialect,
            {"fields": mapping(mapping(FIELD)), "widths": mapping(mapping(number)), "most_significant_first": NAMES},
            revision_number=number,
        )
    ),
)


# The rules between its parts


def unknown_nodes(table: Table) -> Iterator[Problem]:
    """Check that senders, receivers, listeners and watched nodes are nodes."""
    for message in table.messages.values():
        yield from unknown("node", [*message.senders, *message.receivers, *message.listeners], table.nodes)
    for node in table.nodes.values():
        yield from unknown("node", node.watches, table.nodes)


def unknown_objects(table: Table) -> Iterator[Problem]:
    """Check that messages and dialects name objects that are there."""
    yield from unknown("object", [each.object for each in table.messages.values() if each.object], table.objects)
    for dialect in table.dialects.values():
        yield from unknown("object", [*dialect.fields, *dialect.widths], table.objects)
        yield from unknown("object", dialect.most_significant_first, table.objects)


def unknown_fields(table: Table) -> Iterator[Problem]:
    """Check that dialects change the width of fields that are there."""
    for dialect in table.dialects.values():
        for name, record_ in table.objects_in(dialect).items():
            yield from unknown("field", dialect.widths.get(name, {}), record_.fields)


def unknown(kind: str, names: Iterable[Text], known: Iterable[Text]) -> Iterator[Problem]:
    """Yield a problem for each of the `names` that is not among the `known` ones."""
    choices = set(known)
    yield from (Problem(name.place, f"unknown {kind} '{name}'") for name in names if name not in choices)


def repeated_values(table: Table) -> Iterator[Problem]:
    """Check that identifiers, Node-IDs and, within one node, indices and names of settings belong to one each."""
    yield from repeated("identifier", (each.identifier for each in table.messages.values()))
    yield from repeated("node_id", (each.node_id for each in table.nodes.values()))
    for node in table.nodes.values():
        records = [*table.settings.values(), *table.objects.values(), *node.settings.values()]
        yield from repeated("index", (each.index for each in records))
        settings = [*table.settings.values(), *node.settings.values()]
        yield from repeated("setting", (name for each in settings for name in each.fields))


def repeated(kind: str, values: Iterable[Number] | Iterable[Text]) -> Iterator[Problem]:
    """Yield a problem for each value that stood at an earlier place already."""
    first: dict[int | str, Place] = {}
    for each in values:
        if first.setdefault(each, each.place) != each.place:
            what = f"{kind} {shown(kind, each)} is used twice, first in line {first[each].line}"
            yield Problem(each.place, what)


def numbers_out_of_range(table: Table) -> Iterator[Problem]:
    """Check the numbers whose range a standard fixes."""
    for message in table.messages.values():
        yield from outside("identifier", message.identifier, 1, 0x7FF)
    for node in table.nodes.values():
        yield from outside("node_id", node.node_id, 1, 127)
        yield from outside("communication_error", node.communication_error, 0, 2)
    for each in (*data_records(table), *setting_records(table)):
        yield from outside("index", each.index, 0x2000, 0x2FFF)


def outside(kind: str, value: Number, low: int, high: int) -> Iterator[Problem]:
    """Yield a problem if `value` is not in `low`..`high`."""
    if not low <= value <= high:
        yield Problem(value.place, f"{kind} {shown(kind, value)} is not in {shown(kind, low)}..{shown(kind, high)}")


def shown(kind: str, value: int | str) -> str:
    """Write a value of a kind for a person."""
    return FORMS.get(kind, "{}").format(value)


def data_records(table: Table) -> Iterator[Record]:
    """Give the objects of every dialect."""
    for dialect in table.dialects.values():
        yield from table.objects_in(dialect).values()


def setting_records(table: Table) -> Iterator[Record]:
    """Give the settings, those of every node and those of one."""
    for settings in (table.settings, *(node.settings for node in table.nodes.values())):
        yield from settings.values()


def fields_that_do_not_hold(table: Table) -> Iterator[Problem]:
    """Check every field on its own; only a setting is one node's, and so may have its Node-ID as default."""
    for each in (entry for record_ in data_records(table) for entry in record_.fields.values()):
        yield from (*number_problems(each), *default_problems(each, [*each.codes]))
    for each in (entry for record_ in setting_records(table) for entry in record_.fields.values()):
        yield from (*number_problems(each), *default_problems(each, [*each.codes, OWN_NODE_ID]))


def number_problems(each: Field) -> Iterator[Problem]:
    """Check that a field's width holds its values, and that it has values."""
    low, high = each.range
    yield from outside("bits", each.bits, 1, FIELD_BITS)
    if each.high >= 1 << each.bits:
        yield Problem(each.bits.place, f"{each.high} does not fit into {each.bits} bits")
    if low > high:
        yield Problem(high.place, f"range {low}..{high} is empty")


def default_problems(each: Field, names: list[str]) -> Iterator[Problem]:
    """Check that a field's default is one of its values or one of the `names` that stand for values."""
    if isinstance(each.default, Text) and each.default not in names:
        yield Problem(each.default.place, f"unknown default '{each.default}'; known: {', '.join(names) or 'none'}")
    if isinstance(each.default, Number) and not each.low <= each.default <= each.high:
        yield Problem(each.default.place, f"default {each.default} is not in {each.low}..{each.high}")


def messages_too_long(table: Table) -> Iterator[Problem]:
    """Check that every message fits into a PDO in every dialect."""
    for dialect in table.dialects.values():
        objects = table.objects_in(dialect)
        for message in table.messages.values():
            if message.object in objects:
                yield from length_problems(message.object, objects[message.object])


def length_problems(name: Text, record_: Record) -> Iterator[Problem]:
    """Check that an object fits into a PDO."""
    bits = sum(each.bits for each in record_.fields.values())
    if bits > PDO_BITS:
        yield Problem(name.place, f"'{name}' has {bits} bits, a PDO at most {PDO_BITS}")


CHECKS = (
    unknown_nodes,
    unknown_objects,
    unknown_fields,
    repeated_values,
    numbers_out_of_range,
    fields_that_do_not_hold,
    messages_too_long,
)


def read_table(source: str) -> Table:
    """Read the table from the text of the YAML file; raise TableError with all problems, if there are any."""
    problems: Problems = []
    try:
        table = read_yaml(source, TABLE, problems)
    except ReadError:
        raise TableError(problems) from None
    found = [each for check in CHECKS for each in check(table)]
    if found:
        raise TableError(found)
    return table
