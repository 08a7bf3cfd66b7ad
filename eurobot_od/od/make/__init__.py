"""The protocol table in `protocol.yaml`, from which the EDS files and the network file are made.

The dataclasses' annotations define the YAML. The rules between its parts are a table of checks; all their problems are
reported in one run. Only `text`, which makes the files, writes to the disk.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Annotated, TypeAlias

import yaml

from eurobot_od.errors import UnknownName
from eurobot_od.od.document import BIT_RATES
from eurobot_od.od.fingerprints import FINGERPRINTS, MOST_MESSAGES
from eurobot_od.od.meanings import RESERVED_SIGNS, ObjectMeaning
from eurobot_od.od.pdos import RESERVED, carries_nothing
from eurobot_od.od.values import BASE_IDENTIFIER, EMCY_BASE, MAX_BITS, NODE_ID, NODE_IDS, REAL32, RESTRICTED, Limits
from eurobot_od.support import texts, yaml_places
from eurobot_od.support.declared import Within
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_places import (
    Place,
    PlacedInteger,
    PlacedNumber,
    PlacedReal,
    PlacedText,
    Problem,
    Problems,
)
from eurobot_od.support.yaml_shapes import (
    ANY_NUMBER,
    ASCII,
    NUMBER_OR_ASCII,
    PLAIN,
    SCALAR,
    Plain,
    filled,
    matching,
    shape_of,
)

SERVICES = ("EMCY", "SDO")
"""CANopen services of all nodes that may have a row in the traffic."""
FORMS = {"identifier": "0x{:03X}", "index": "0x{:04X}", "setting": "'{}'"}
"""Formats of values in problems, by kind."""

Bits: TypeAlias = Annotated[PlacedNumber, Within(1, 32)]
Milliseconds: TypeAlias = Annotated[PlacedNumber, Within(0, 0xFFFF, "ms")]
Number32: TypeAlias = Annotated[PlacedNumber, Within(0, 0xFFFFFFFF)]
Unit: TypeAlias = Annotated[PlacedText, matching(f"[^{RESERVED_SIGNS}]*", f"a unit without {RESERVED_SIGNS}")]
CodeName: TypeAlias = Annotated[PlacedText, matching(f"[^{RESERVED_SIGNS}]+", f"a name without {RESERVED_SIGNS}")]
FileName: TypeAlias = Annotated[PlacedText, matching(r"[A-Za-z0-9_-]+", "a name of letters, digits, _ and -")]
"""Name of a folder or file that is valid on any system."""


NOWHERE = Place(0, 0)
"""Place of a value that is not in the file."""
NO_UNIT = PlacedText("", NOWHERE)


# The shape of the YAML


class FieldType(Enum):
    """Data type of a field."""

    INTEGER = "INTEGER"
    REAL32 = "REAL32"


@dataclass(frozen=True)
class TableField:
    """A field of an object: `bits` wide, with plain values in `range`, and `codes` for values with a meaning.

    A field with a value below 0 is signed. A REAL32 has 32 bits, and neither range nor codes. `default` is a number, a
    code or, for a setting, `$NODEID`; only a REAL32 may have a fraction.
    """

    bits: Bits
    default: PlacedInteger | PlacedReal | PlacedText
    range: tuple[PlacedInteger, PlacedInteger] | None = None
    codes: dict[CodeName, PlacedInteger] = field(default_factory=dict)
    type: FieldType = FieldType.INTEGER
    unit: Unit = NO_UNIT  # may have a step: `0.1 N`

    @property
    def limits(self) -> tuple[int, ...]:
        """Lowest and highest value, plain or coded (LowLimit, HighLimit in an EDS); empty for a REAL32."""
        values = (*(self.range or ()), *self.codes.values())
        return (min(values), max(values)) if values else ()

    @property
    def meaning(self) -> ObjectMeaning:
        """Unit, plain values and codes, for which an EDS has no keys."""
        plain = Limits(*map(int, self.range)) if self.range and (self.unit or self.codes) else None
        return ObjectMeaning(str(self.unit), plain, {str(name): int(number) for name, number in self.codes.items()})

    @property
    def is_signed(self) -> bool:
        """Whether the field has a value below 0."""
        return bool(self.limits) and self.limits[0] < 0


def always_zero(bits: PlacedNumber) -> TableField:
    """Return a field that is always 0."""
    zero = PlacedInteger(0, bits.place)
    return TableField(bits, zero, (zero, zero))


@dataclass(frozen=True)
class Record:
    """An object of the dictionary: its index, and its fields as sub-indices 1, 2, ...

    A frame may omit fields from `optional` on.
    """

    index: Annotated[PlacedNumber, Within(0x2000, 0x2FFF, form="0x{:04X}")]
    fields: Annotated[dict[PlacedText, TableField], filled]
    optional: PlacedText | None = None


@dataclass(frozen=True)
class MessageRow:
    """A message: a PDO in each of its nodes; `object` has its data, None if it has none.

    With an `event_timer`, its senders repeat it with that period.
    """

    identifier: Annotated[PlacedNumber, Within(1, BASE_IDENTIFIER, form="0x{:03X}")]
    senders: tuple[PlacedText, ...]
    receivers: tuple[PlacedText, ...]
    listeners: tuple[PlacedText, ...] = ()
    object: PlacedText | None = None
    event_timer: Milliseconds | None = None
    # For readers of the table; not in the EDS.
    priority: str = ""
    protocol: str = ""
    command: str = ""


@dataclass(frozen=True)
class NodeRow:
    """A node: its identity, the nodes that it watches by heartbeat and asks by SDO, and its own settings.

    `readings` are measured, read-only objects. `orders` are messages that it sends when their objects are written; such
    objects of other messages are read-only. `heartbeat` and `heartbeat_timeout` override the table's times.
    """

    node_id: Annotated[PlacedNumber, Within(NODE_IDS[0], NODE_IDS[-1])]
    product_name: PlacedText
    product_number: Number32
    order_code: PlacedText
    watches: tuple[PlacedText, ...]
    communication_error: Annotated[PlacedNumber, Within(0, 2)]
    settings: dict[PlacedText, Record]
    readings: dict[PlacedText, Record] = field(default_factory=dict)
    asks: tuple[PlacedText, ...] = ()
    orders: tuple[PlacedText, ...] = ()
    heartbeat: Milliseconds | None = None
    heartbeat_timeout: Milliseconds | None = None


@dataclass(frozen=True)
class DialectRow:
    """The differences of one dialect: revision, further fields, other widths, reserved bits, bit order.

    `reserved` has the numbers of unused bits of an object's PDO, by the field after them. `defaults` has the settings'
    defaults that differ.
    """

    revision_number: Number32
    fields: dict[PlacedText, dict[PlacedText, TableField]] = field(default_factory=dict)
    widths: dict[PlacedText, dict[PlacedText, Bits]] = field(default_factory=dict)
    reserved: dict[PlacedText, dict[PlacedText, Bits]] = field(default_factory=dict)
    defaults: dict[PlacedText, dict[PlacedText, PlacedInteger | PlacedReal]] = field(default_factory=dict)
    most_significant_first: tuple[PlacedText, ...] = ()

    def form_of(self, name: PlacedText, plain: Record) -> Record:
        """Return an object with this dialect's fields, widths and, after its fields, reserved bits."""
        widths, reserved = self.widths.get(name, {}), self.reserved.get(name, {})
        every = {**plain.fields, **self.fields.get(name, {})}
        fields = {key: replace(f, bits=widths.get(key, f.bits)) for key, f in every.items()}
        fields |= {self.reserved_before(name)[field]: always_zero(bits) for field, bits in reserved.items()}
        return replace(plain, fields=fields)

    def setting_of(self, name: PlacedText, plain: Record) -> Record:
        """Return settings with this dialect's defaults."""
        own = self.defaults.get(name, {})
        fields = {key: replace(f, default=own.get(key, f.default)) for key, f in plain.fields.items()}
        return replace(plain, fields=fields)

    def reserved_before(self, name: PlacedText) -> dict[PlacedText, PlacedText]:
        """Return the names of an object's reserved bits, by the field after them."""
        fields = self.reserved.get(name, {})
        return {
            each: PlacedText(f"{RESERVED} {n}" if n > 1 else RESERVED, each.place)
            for n, each in enumerate(fields, start=1)
        }


@dataclass(frozen=True)
class TrafficRow:
    """When a message, or a service of every node, is sent: periodically (`every`), or as an answer.

    `every`, `jitter` and `deadline` are durations, or the name `Record.Member` of a setting in ms.
    """

    every: PlacedText | None = None
    answers: PlacedText | None = None
    jitter: PlacedText | None = None
    deadline: PlacedText | None = None
    reason: str = ""


@dataclass(frozen=True)
class Vendor:
    """The vendor in the identity of every node."""

    name: PlacedText
    number: Number32


@dataclass(frozen=True)
class FileData:
    """The fixed [FileInfo] of every EDS file: `time` as hh:mmAM or PM, `date` as mm-dd-yyyy."""

    version: PlacedNumber
    revision: PlacedNumber
    time: Annotated[PlacedText, matching(r"(0[1-9]|1[0-2]):[0-5][0-9](AM|PM)", "a time hh:mmAM or hh:mmPM")]
    date: Annotated[PlacedText, matching(r"(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])-[0-9]{4}", "a date mm-dd-yyyy")]
    author: PlacedText
    comment: str = "Made by eurobot-od make-eds from a protocol table; change it there."


@dataclass(frozen=True)
class Table:
    """The whole protocol table."""

    file: FileData
    vendor: Vendor
    serial_number: Number32
    hardware_version: PlacedText
    software_version: PlacedText
    bit_rate: PlacedNumber
    bit_rates: tuple[PlacedNumber, ...]
    heartbeat: Milliseconds
    heartbeat_timeout: Milliseconds
    nodes: Annotated[dict[FileName, NodeRow], filled]
    settings: dict[PlacedText, Record]
    objects: dict[PlacedText, Record]
    messages: dict[PlacedText, MessageRow]
    dialects: Annotated[dict[FileName, DialectRow], filled]
    traffic: dict[PlacedText, TrafficRow] = field(default_factory=dict)

    @property
    def by_identifier(self) -> dict[PlacedText, MessageRow]:
        """Messages ordered by identifier, highest priority first."""
        return dict(sorted(self.messages.items(), key=lambda item: item[1].identifier))

    def objects_in(self, dialect: DialectRow) -> dict[PlacedText, Record]:
        """Return the objects in a dialect."""
        return {name: dialect.form_of(name, each) for name, each in self.objects.items()}


SINGLE_VALUES: Plain = {
    **PLAIN,
    str: ASCII,
    PlacedInteger | PlacedReal: ANY_NUMBER,
    PlacedInteger | PlacedReal | PlacedText: NUMBER_OR_ASCII,
}
"""Shapes of the table's single values; an EDS holds only ASCII."""


# Rules between the parts of the table


def unknown_names(table: Table) -> Iterator[Problem]:
    """Yield problems for unknown nodes, objects and fields."""
    for message in table.messages.values():
        yield from unknown("node", [*message.senders, *message.receivers, *message.listeners], table.nodes)
        yield from unknown("object", [message.object] if message.object else [], table.objects)
    for name, node in table.nodes.items():
        yield from unknown("node", [*node.watches, *node.asks], table.nodes)
        sent = {key for key, each in table.messages.items() if name in each.senders}
        yield from unknown(f"message of the {name}", node.orders, sent)
    for dialect in table.dialects.values():
        named = [*dialect.fields, *dialect.widths, *dialect.reserved, *dialect.most_significant_first]
        yield from unknown("object", named, table.objects)
        yield from unknown_settings(table, dialect)
        for name, each in table.objects.items():
            about = [*dialect.widths.get(name, {}), *dialect.reserved.get(name, {})]
            yield from unknown("field", about, {*each.fields, *dialect.fields.get(name, {})})


def unknown_settings(table: Table, dialect: DialectRow) -> Iterator[Problem]:
    """Yield problems for defaults of a dialect whose settings do not exist."""
    known: dict[str, set[str]] = {}
    for name, each in named_records(table):
        known.setdefault(name, set()).update(each.fields)
    yield from unknown("object", dialect.defaults, known)
    for name, fields in dialect.defaults.items():
        yield from unknown("setting", fields, known.get(name, fields))


def unknown(kind: str, names: Iterable[PlacedText], known: Collection[str]) -> Iterator[Problem]:
    """Yield a problem for each of the `names` that is not in `known`."""
    yield from (Problem(each.place, str(UnknownName(kind, str(each), known))) for each in names if each not in known)


def repeated_values(table: Table) -> Iterator[Problem]:
    """Yield problems for repeated identifiers and node-IDs and, within a node, indices and names."""
    yield from repeated("identifier", (each.identifier for each in table.messages.values()))
    yield from repeated("node_id", (each.node_id for each in table.nodes.values()))
    for node in table.nodes.values():
        own = [*table.settings.values(), *node.settings.values(), *node.readings.values()]
        yield from repeated("index", (each.index for each in (*own, *table.objects.values())))
        yield from repeated("setting", (name for each in own for name in each.fields))


def repeated(kind: str, values: Iterable[PlacedNumber] | Iterable[PlacedText]) -> Iterator[Problem]:
    """Yield a problem for each value that occurred before."""
    first: dict[int | str, Place] = {}
    for each in values:
        # A YAML alias, or a setting of all nodes, has the same place and is not a repetition.
        if first.setdefault(each, each.place) != each.place:
            value = FORMS.get(kind, "{}").format(each)
            where = getattr(first[each], "file", "")
            where = f"{where}, line {first[each].line}" if where else f"line {first[each].line}"
            yield Problem(each.place, f"{kind} {value} is used twice, first in {where}")


def bit_rates_that_no_node_has(table: Table) -> Iterator[Problem]:
    """Yield problems for bit rates that CiA 306 does not have, or no node."""
    for known, rates in ((BIT_RATES, table.bit_rates), (table.bit_rates, [table.bit_rate])):
        for each in rates:
            if each not in known:
                yield Problem(each.place, f"bit rate {each} is not one of {', '.join(map(str, known))} kbit/s")


def data_records(table: Table) -> Iterator[Record]:
    """Yield the objects of every dialect, and the readings of all nodes."""
    for dialect in table.dialects.values():
        yield from table.objects_in(dialect).values()
    for node in table.nodes.values():
        yield from node.readings.values()


def named_records(table: Table) -> Iterator[tuple[PlacedText, Record]]:
    """Yield the settings with the names of their objects."""
    for settings in (table.settings, *(node.settings for node in table.nodes.values())):
        yield from settings.items()


def fields_that_do_not_hold(table: Table) -> Iterator[Problem]:
    """Yield problems of single fields; only a setting may have the node-ID as default."""
    settings = (each for _, each in named_records(table))
    for records, names in ((data_records(table), ()), (settings, (NODE_ID,))):
        for each in (entry for record in records for entry in record.fields.values()):
            yield from (*number_problems(each), *default_problems(each, [*each.codes, *names]))


def number_problems(each: TableField) -> Iterator[Problem]:
    """Yield problems if a field has no values, or a width that does not hold them."""
    is_real = each.type is FieldType.REAL32
    if is_real and (each.range or each.codes or each.bits != REAL32.bits):
        yield Problem(each.bits.place, f"a REAL32 has {REAL32.bits} bits, and neither range nor codes")
    if not each.limits and not is_real:
        yield Problem(each.bits.place, "a field needs its range, or codes")
    lowest = -(1 << each.bits - 1) if each.is_signed else 0
    for value in each.limits:
        if not 0 <= value - lowest < 1 << each.bits:
            signed = "signed " if each.is_signed else ""
            yield Problem(each.bits.place, f"{value} does not fit into {each.bits} {signed}bits")
    if each.range and each.range[0] > each.range[1]:
        low, high = each.range
        yield Problem(high.place, f"range {low}..{high} is empty")


def default_problems(each: TableField, names: list[str]) -> Iterator[Problem]:
    """Yield problems if a field's default is neither one of its values nor one of `names`."""
    if isinstance(each.default, PlacedText) and each.default not in names:
        yield Problem(each.default.place, f"unknown default '{each.default}'; known: {', '.join(names) or 'none'}")
    if isinstance(each.default, PlacedText) or not each.limits:
        return
    if isinstance(each.default, PlacedReal):
        steps = f": in steps of {each.unit}" if each.unit else ""
        yield Problem(each.default.place, f"default {each.default} is not a whole number{steps}")
    low, high = each.limits
    if not low <= each.default <= high:
        yield Problem(each.default.place, f"default {each.default} is not in {low}..{high}")


def fields_that_would_carry_nothing(table: Table) -> Iterator[Problem]:
    """Yield problems for fields with a name that is reserved for unused bits."""
    own = (each.fields for each in table.objects.values())
    further = (each for dialect in table.dialects.values() for each in dialect.fields.values())
    for name in (name for each in (*own, *further) for name in each):
        if carries_nothing(name):
            yield Problem(name.place, f"'{name}' names bits that carry nothing; a dialect has them under reserved")


def messages_too_long(table: Table) -> Iterator[Problem]:
    """Yield problems for messages that do not fit a PDO in some dialect."""
    for objects in map(table.objects_in, table.dialects.values()):
        for name in (each.object for each in table.messages.values() if each.object in objects):
            bits = sum(each.bits for each in objects[name].fields.values())
            if bits > MAX_BITS:
                yield Problem(name.place, f"'{name}' has {bits} bits, a PDO at most {MAX_BITS}")


def traffic_that_does_not_hold(table: Table) -> Iterator[Problem]:
    """Yield problems for rows of the traffic without a message, or with an invalid time."""
    names = {*table.messages, *SERVICES}
    settings = {f"{record}.{name}" for record, each in named_records(table) for name in each.fields}
    yield from unknown("message", table.traffic, names)
    for name, row in table.traffic.items():
        yield from unknown("message", [row.answers] if row.answers else [], names)
        if (row.every is None) == (row.answers is None):
            yield Problem(name.place, f"'{name}' needs either every or answers")
        for time in (row.every, row.jitter, row.deadline):
            if time is not None and not texts.is_duration(time):
                yield from unknown("setting", [time], settings)


def _composed(source: str, find: FindTable, problems: Problems) -> yaml.Node:
    """Parse a table and the one that it extends; raises ReadError after noting the problems."""
    own = yaml_places.compose(source, problems)
    entries = own.value if isinstance(own, yaml.MappingNode) else ()
    named = next(((key, value) for key, value in entries if key.value == EXTENDS), None)
    if named is None:
        return own
    own.value = [pair for pair in own.value if pair[0] is not named[0]]
    file = find(SCALAR.read(named[1], problems))
    if file is None or not file.is_file():
        what = f"there is no table to build on that is called {yaml_places.shown(named[1])}"
        yaml_places.refuse(named[1], problems, what)
    base = _composed(read_whole(file).decode(errors="replace"), find, problems)
    return yaml_places.merged(yaml_places.elsewhere(base, str(file)), own)


def fingerprints_without_room(table: Table) -> Iterator[Problem]:
    """Yield problems for objects at the index of the fingerprints, and for too many messages."""
    settings = (each for _, each in named_records(table))
    for each in (*table.objects.values(), *settings, *(r for n in table.nodes.values() for r in n.readings.values())):
        if each.index == FINGERPRINTS:
            yield Problem(each.index.place, f"index 0x{FINGERPRINTS:04X} is that of the message fingerprints")
    for name in [*table.messages][MOST_MESSAGES:]:
        yield Problem(name.place, f"a table has at most {MOST_MESSAGES} messages")


def identifiers_of_services(table: Table) -> Iterator[Problem]:
    """Yield problems for messages with an identifier of CANopen's own services (CiA 301, 7.3.5)."""
    emergencies = {EMCY_BASE + each.node_id: name for name, each in table.nodes.items()}
    for each in table.messages.values():
        number = each.identifier
        owner = next((each.whose(number) for each in RESTRICTED if each.low <= number <= each.high), "")
        owner = f"the EMCY of {emergencies[number]}" if number in emergencies else owner
        if owner:
            yield Problem(number.place, f"identifier 0x{number:03X} is CANopen's own: {owner}")


def codes_with_one_number(table: Table) -> Iterator[Problem]:
    """Yield problems for codes of a field with the same number."""
    settings = (each for _, each in named_records(table))
    for entry in (each for record in (*data_records(table), *settings) for each in record.fields.values()):
        first: dict[int, str] = {}
        for name, number in entry.codes.items():
            if first.setdefault(number, name) != name:
                yield Problem(number.place, f"codes '{first[number]}' and '{name}' are both {number}")


def tails_that_begin_within_a_byte(table: Table) -> Iterator[Problem]:
    """Yield problems for optional fields that do not begin on a byte, where a frame may end.

    Dialects with the most significant byte first describe an existing robot, and are not checked.
    """
    for dialect in table.dialects.values():
        for name, each in table.objects.items():
            if each.optional is not None and name not in dialect.most_significant_first:
                yield from _within_a_byte(dialect, name, each, each.optional)


def _within_a_byte(dialect: DialectRow, name: PlacedText, plain: Record, optional: PlacedText) -> Iterator[Problem]:
    fields = dialect.form_of(name, plain).fields
    reserved = dialect.reserved.get(name, {})
    if optional not in fields:
        yield Problem(optional.place, f"unknown field '{optional}'")
        return
    begin = 0
    for field_name, each in fields.items():
        begin += reserved.get(field_name, 0)
        if field_name == optional:
            break
        begin += each.bits
    if begin % 8:
        more = f"{(reserved.get(optional, 0) - begin) % 8} reserved bits"
        what = f"'{optional}' is optional and begins at bit {begin % 8} of byte {begin // 8}; a dialect with {more}"
        yield Problem(
            reserved[optional].place if optional in reserved else optional.place, f"{what} before it has it on a byte"
        )


CHECKS = (
    fingerprints_without_room,
    identifiers_of_services,
    codes_with_one_number,
    unknown_names,
    repeated_values,
    bit_rates_that_no_node_has,
    fields_that_do_not_hold,
    fields_that_would_carry_nothing,
    messages_too_long,
    tails_that_begin_within_a_byte,
    traffic_that_does_not_hold,
)


FindTable: TypeAlias = Callable[[str], "Path | None"]
"""Function from the name after `extends` to the table's file, None if there is none."""

EXTENDS = "extends"


def read_table(source: str, file: str | Path, find: FindTable = lambda _: None) -> Table:
    """Parse a table; raises YamlError with all its problems.

    A table may extend another one, which `find` finds; its own entries are added, or replace those of the other.
    """
    with yaml_places.telling(file) as problems:
        table: Table = shape_of(Table, SINGLE_VALUES).read(_composed(source, find, problems), problems)
        problems += (each for check in CHECKS for each in check(table))
        return table
