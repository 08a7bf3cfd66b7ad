"""The protocol table: what `protocol.yaml` says, as values, and what must hold between its parts.

The shape of the YAML is that of the dataclasses: their annotations make its readers. The rules between its parts are a
table of checks. A check yields problems and repairs nothing, so that one run shows everything that has to be changed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, NewType, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import yaml

from eurobot_od.errors import EurobotError
from eurobot_od.od.keys import BIT_RATES
from eurobot_od.od.pdos import RESERVED, carries_nothing
from eurobot_od.od.values import BASE_IDENTIFIER, MAX_BITS, NODE_ID, NODE_IDS
from eurobot_od.support import bounded, durations, yaml_places
from eurobot_od.support.escaping import one_line
from eurobot_od.support.yaml_places import (
    NodeReader,
    Place,
    PlacedNumber,
    PlacedText,
    Problem,
    Problems,
    ReadError,
    refuse,
)

FIELD_BITS = 32
HIGHEST_16, HIGHEST_32 = 0xFFFF, 0xFFFFFFFF
FILE_NAME = re.compile(r"[A-Za-z0-9_-]+")
SERVICES = ("EMCY", "SDO")
"""CANopen services that may have a row in the traffic, for all nodes."""
FORMS = {"identifier": "0x{:03X}", "index": "0x{:04X}", "setting": "'{}'"}
"""How the values of a kind are written in problems, if not as they are."""
EntriesT = TypeVar("EntriesT", bound=dict[PlacedText, Any])
Time = NewType("Time", PlacedText)
Date = NewType("Date", PlacedText)


# The shape of the YAML


def filled(read_entries: NodeReader[EntriesT]) -> NodeReader[EntriesT]:
    """Make a reader that refuses an empty mapping."""

    def read(node: yaml.Node, problems: Problems) -> EntriesT:
        return read_entries(node, problems) or refuse(node, problems, "expected at least one entry")

    return read


def naming_files(read_entries: NodeReader[EntriesT]) -> NodeReader[EntriesT]:
    """Make a reader of a mapping whose keys become names of files or folders, on any system."""

    def read(node: yaml.Node, problems: Problems) -> EntriesT:
        entries = filled(read_entries)(node, problems)
        wrong = [name for name in entries if not FILE_NAME.fullmatch(name)]
        for name in wrong:
            problems.append(Problem(name.place, f"'{name}' cannot name a file: letters, digits, _ and - only"))
        if wrong:
            raise ReadError
        return entries

    return read


@dataclass(frozen=True)
class TableField:
    """A field of an object: `bits` wide, plain values in `range`, values with another meaning in `codes`.

    `default` is a number, one of the codes or, of a setting, `$NODEID`: the node-ID of the node that has the setting.
    """

    bits: PlacedNumber
    range: tuple[PlacedNumber, PlacedNumber]
    default: PlacedNumber | PlacedText
    codes: dict[PlacedText, PlacedNumber] = field(default_factory=dict)
    unit: str = ""  # for readers of the table; an EDS has no key for it

    @property
    def low(self) -> int:
        """The lowest value, plain or coded (EDS LowLimit)."""
        return min((self.range[0], *self.codes.values()))

    @property
    def high(self) -> int:
        """The highest value, plain or coded (EDS HighLimit)."""
        return max((self.range[1], *self.codes.values()))


def always_zero(bits: PlacedNumber) -> TableField:
    """Make a field that is always 0."""
    zero = PlacedNumber(0, bits.place)
    return TableField(bits, (zero, zero), zero)


@dataclass(frozen=True)
class Record:
    """An object of the dictionary: its index and its fields, sub-indices 1, 2, ... in this order."""

    index: PlacedNumber
    fields: Annotated[dict[PlacedText, TableField], filled]


@dataclass(frozen=True)
class MessageRow:
    """A message: one PDO in each of its nodes; `object` is its data, None without any."""

    identifier: PlacedNumber
    senders: tuple[PlacedText, ...]
    receivers: tuple[PlacedText, ...]
    listeners: tuple[PlacedText, ...] = ()
    object: PlacedText | None = None
    # for readers of the table; an EDS has no keys for them
    priority: str = ""
    protocol: str = ""
    command: str = ""


@dataclass(frozen=True)
class NodeRow:
    """A node: its identity, the nodes whose heartbeats it watches and whose SDO servers it asks, its own settings.

    `readings` are objects that it measures and that cannot be written. `heartbeat` and `heartbeat_timeout` are this
    node's own times, in place of the table's.
    """

    node_id: PlacedNumber
    product_name: PlacedText
    product_number: PlacedNumber
    order_code: PlacedText
    watches: tuple[PlacedText, ...]
    communication_error: PlacedNumber
    settings: dict[PlacedText, Record]
    readings: dict[PlacedText, Record] = field(default_factory=dict)
    asks: tuple[PlacedText, ...] = ()
    heartbeat: PlacedNumber | None = None
    heartbeat_timeout: PlacedNumber | None = None


@dataclass(frozen=True)
class DialectRow:
    """How one dialect differs: its number in the identity, further fields, other widths, reserved bits, its bit order.

    `reserved` says about an object how many bits of its PDO carry nothing, by the field that they stand before.
    """

    revision_number: PlacedNumber
    fields: dict[PlacedText, dict[PlacedText, TableField]] = field(default_factory=dict)
    widths: dict[PlacedText, dict[PlacedText, PlacedNumber]] = field(default_factory=dict)
    reserved: dict[PlacedText, dict[PlacedText, PlacedNumber]] = field(default_factory=dict)
    most_significant_first: tuple[PlacedText, ...] = ()

    def form_of(self, name: PlacedText, plain: Record) -> Record:
        """Return the object `name` with the further fields, the widths and, behind its fields, the reserved bits."""
        widths, reserved = self.widths.get(name, {}), self.reserved.get(name, {})
        every = {**plain.fields, **self.fields.get(name, {})}
        fields = {key: replace(f, bits=widths.get(key, f.bits)) for key, f in every.items()}
        fields |= {self.reserved_before(name)[field]: always_zero(bits) for field, bits in reserved.items()}
        return replace(plain, fields=fields)

    def reserved_before(self, name: PlacedText) -> dict[PlacedText, PlacedText]:
        """Return the names of the reserved bits of the object `name`, by the field that they stand before."""
        fields = self.reserved.get(name, {})
        return {each: PlacedText(RESERVED + f" {n}" * (n > 1), each.place) for n, each in enumerate(fields, start=1)}


@dataclass(frozen=True)
class TrafficRow:
    """How often a message, or a CANopen service of every node, is sent: `every` so often, or when it `answers` another.

    `every`, `jitter` and `deadline` are a duration, or the name `Record.Member` of a setting in ms.
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
    number: PlacedNumber


@dataclass(frozen=True)
class FileData:
    """The fixed [FileInfo] of every EDS file: `time` hh:mmAM or PM, `date` mm-dd-yyyy, `comment` who made it."""

    version: PlacedNumber
    revision: PlacedNumber
    time: Time
    date: Date
    author: PlacedText
    comment: str = "Made by eurobot-od make-eds from a protocol table; change it there."


@dataclass(frozen=True)
class Table:
    """The whole protocol table."""

    file: FileData
    vendor: Vendor
    serial_number: PlacedNumber
    hardware_version: PlacedText
    software_version: PlacedText
    bit_rate: PlacedNumber
    bit_rates: tuple[PlacedNumber, ...]
    heartbeat: PlacedNumber
    heartbeat_timeout: PlacedNumber
    nodes: Annotated[dict[PlacedText, NodeRow], naming_files]
    settings: dict[PlacedText, Record]
    objects: dict[PlacedText, Record]
    messages: dict[PlacedText, MessageRow]
    dialects: Annotated[dict[PlacedText, DialectRow], naming_files]
    traffic: dict[PlacedText, TrafficRow] = field(default_factory=dict)

    @property
    def by_identifier(self) -> dict[PlacedText, MessageRow]:
        """The messages in the order of their identifiers, the most urgent first."""
        return dict(sorted(self.messages.items(), key=lambda item: item[1].identifier))

    def objects_in(self, dialect: DialectRow) -> dict[PlacedText, Record]:
        """Return the objects with the fields, widths and reserved bits of `dialect`."""
        return {name: dialect.form_of(name, each) for name, each in self.objects.items()}


class TableError(EurobotError):
    """A file that is not a protocol table: `problems`, each once, in the file's order; a line for each."""

    def __init__(self, file: str | Path, problems: Iterable[Problem]) -> None:
        """Sort the problems; one that shows in several nodes or dialects is still one."""
        self.problems = sorted(set(problems))
        lines = (
            one_line(f"{getattr(place, 'file', file)}:{place.line}:{place.column}: {what}")
            for place, what in self.problems
        )
        super().__init__("\n".join(lines))


READERS: dict[Any, NodeReader[Any]] = {
    PlacedNumber: yaml_places.number,
    PlacedText: yaml_places.text,
    str: yaml_places.text,
    PlacedText | None: yaml_places.text,  # None by leaving it out
    PlacedNumber | None: yaml_places.number,
    PlacedNumber | PlacedText: yaml_places.number_or_text,
    Time: yaml_places.matching(r"(0[1-9]|1[0-2]):[0-5][0-9](AM|PM)", "a time hh:mmAM or hh:mmPM"),
    Date: yaml_places.matching(r"(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])-[0-9]{4}", "a date mm-dd-yyyy"),
}
"""What reads a single value, by its annotation."""


def reader_of(kind: Any) -> NodeReader[Any]:
    """Make the reader of what an annotation says; in a dataclass, what has a default may be left out."""
    if kind in READERS:
        return READERS[kind]
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        wrap: Callable[[NodeReader[Any]], NodeReader[Any]] = inner[1]
        return wrap(reader_of(inner[0]))
    if origin is dict:
        return yaml_places.mapping(reader_of(inner[1]))
    if origin is tuple:
        return yaml_places.listing(reader_of(inner[0]), None if inner[-1] is ... else len(inner))
    readers = {name: reader_of(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}
    left_out = [each.name for each in fields(kind) if (each.default, each.default_factory) != (MISSING, MISSING)]
    may = {name: readers.pop(name) for name in left_out}
    return yaml_places.record(kind, readers, may)


# The rules between its parts


def unknown_names(table: Table) -> Iterator[Problem]:
    """Check that the nodes and objects that are named are there, and the fields of which a dialect says something."""
    for message in table.messages.values():
        yield from unknown("node", [*message.senders, *message.receivers, *message.listeners], table.nodes)
        yield from unknown("object", [message.object] if message.object else [], table.objects)
    for node in table.nodes.values():
        yield from unknown("node", [*node.watches, *node.asks], table.nodes)
    for dialect in table.dialects.values():
        named = [*dialect.fields, *dialect.widths, *dialect.reserved, *dialect.most_significant_first]
        yield from unknown("object", named, table.objects)
        for name, each in table.objects.items():
            about = [*dialect.widths.get(name, {}), *dialect.reserved.get(name, {})]
            yield from unknown("field", about, {*each.fields, *dialect.fields.get(name, {})})


def unknown(kind: str, names: Iterable[PlacedText], known: Container[str]) -> Iterator[Problem]:
    """Yield a problem for each of the `names` that is not among the `known` ones."""
    yield from (Problem(name.place, f"unknown {kind} '{name}'") for name in names if name not in known)


def repeated_values(table: Table) -> Iterator[Problem]:
    """Check that identifiers, node-IDs and, within one node, indices and names of settings and readings occur once."""
    yield from repeated("identifier", (each.identifier for each in table.messages.values()))
    yield from repeated("node_id", (each.node_id for each in table.nodes.values()))
    for node in table.nodes.values():
        own = [*table.settings.values(), *node.settings.values(), *node.readings.values()]
        yield from repeated("index", (each.index for each in (*own, *table.objects.values())))
        yield from repeated("setting", (name for each in own for name in each.fields))


def repeated(kind: str, values: Iterable[PlacedNumber] | Iterable[PlacedText]) -> Iterator[Problem]:
    """Yield a problem for each value that occurred at an earlier place."""
    first: dict[int | str, Place] = {}
    for each in values:
        # an alias of YAML, or a setting that all nodes share, comes again with its first place: not a repetition
        if first.setdefault(each, each.place) != each.place:
            value = FORMS.get(kind, "{}").format(each)
            where = getattr(first[each], "file", "")
            where = f"{where}, line {first[each].line}" if where else f"line {first[each].line}"
            yield Problem(each.place, f"{kind} {value} is used twice, first in {where}")


def numbers_out_of_range(table: Table) -> Iterator[Problem]:
    """Check the numbers whose range CiA 301 fixes, by itself or by the width of the object that takes them."""
    messages, nodes, dialects = table.messages.values(), table.nodes.values(), table.dialects.values()
    records = (*data_records(table), *setting_records(table))
    yield from outside("identifier", 1, BASE_IDENTIFIER, *(each.identifier for each in messages))
    yield from outside("node_id", NODE_IDS[0], NODE_IDS[-1], *(each.node_id for each in nodes))
    yield from outside("communication_error", 0, 2, *(each.communication_error for each in nodes))
    yield from outside("index", 0x2000, 0x2FFF, *(each.index for each in records))
    heartbeats = (table.heartbeat, *(each.heartbeat for each in nodes))
    yield from outside("heartbeat", 0, HIGHEST_16, *(each for each in heartbeats if each is not None))
    timeouts = (table.heartbeat_timeout, *(each.heartbeat_timeout for each in nodes))
    yield from outside("heartbeat_timeout", 0, HIGHEST_16, *(each for each in timeouts if each is not None))
    yield from outside("vendor number", 0, HIGHEST_32, table.vendor.number)
    yield from outside("product_number", 0, HIGHEST_32, *(each.product_number for each in nodes))
    yield from outside("revision_number", 0, HIGHEST_32, *(each.revision_number for each in dialects))
    yield from outside("serial_number", 0, HIGHEST_32, table.serial_number)


def outside(kind: str, low: int, high: int, *values: PlacedNumber) -> Iterator[Problem]:
    """Yield a problem for each value that is not in `low`..`high`."""
    form = FORMS.get(kind, "{}").format
    for each in values:
        if not low <= each <= high:
            yield Problem(each.place, f"{kind} {form(each)} is not in {form(low)}..{form(high)}")


def bit_rates_that_no_node_has(table: Table) -> Iterator[Problem]:
    """Check that CiA 306 knows the bit rates, and that nodes have the network's."""
    for known, rates in ((BIT_RATES, table.bit_rates), (table.bit_rates, [table.bit_rate])):
        for each in rates:
            if each not in known:
                yield Problem(each.place, f"bit rate {each} is not one of {', '.join(map(str, known))} kbit/s")


def data_records(table: Table) -> Iterator[Record]:
    """Return the objects of every dialect, and what single nodes measure."""
    for dialect in table.dialects.values():
        yield from table.objects_in(dialect).values()
    for node in table.nodes.values():
        yield from node.readings.values()


def setting_records(table: Table) -> Iterator[Record]:
    """Return the settings, those of every node and those of one."""
    return (each for _, each in named_records(table))


def named_records(table: Table) -> Iterator[tuple[PlacedText, Record]]:
    """Return the settings with the names of their objects."""
    for settings in (table.settings, *(node.settings for node in table.nodes.values())):
        yield from settings.items()


def fields_that_do_not_hold(table: Table) -> Iterator[Problem]:
    """Check every field by itself. Only a setting is one node's, and so may have that node's ID as default."""
    for records, names in ((data_records(table), ()), (setting_records(table), (NODE_ID,))):
        for each in (entry for record in records for entry in record.fields.values()):
            yield from (*number_problems(each), *default_problems(each, [*each.codes, *names]))


def number_problems(each: TableField) -> Iterator[Problem]:
    """Check that a field's width holds its values, and that it has values."""
    low, high = each.range
    yield from outside("bits", 1, FIELD_BITS, each.bits)
    if each.high >= 1 << each.bits:
        yield Problem(each.bits.place, f"{each.high} does not fit into {each.bits} bits")
    if low > high:
        yield Problem(high.place, f"range {low}..{high} is empty")


def default_problems(each: TableField, names: list[str]) -> Iterator[Problem]:
    """Check that a field's default is one of its values or one of the `names` that stand for values."""
    if isinstance(each.default, PlacedText) and each.default not in names:
        yield Problem(each.default.place, f"unknown default '{each.default}'; known: {', '.join(names) or 'none'}")
    if isinstance(each.default, PlacedNumber) and not each.low <= each.default <= each.high:
        yield Problem(each.default.place, f"default {each.default} is not in {each.low}..{each.high}")


def fields_that_would_carry_nothing(table: Table) -> Iterator[Problem]:
    """Check that no field of a message has a name by which a mapped object carries nothing."""
    own = (each.fields for each in table.objects.values())
    further = (each for dialect in table.dialects.values() for each in dialect.fields.values())
    for name in (name for each in (*own, *further) for name in each):
        if carries_nothing(name):
            yield Problem(name.place, f"'{name}' names bits that carry nothing; a dialect has them under reserved")


def messages_too_long(table: Table) -> Iterator[Problem]:
    """Check that every message fits into a PDO in every dialect."""
    for objects in map(table.objects_in, table.dialects.values()):
        for name in (each.object for each in table.messages.values() if each.object in objects):
            bits = sum(each.bits for each in objects[name].fields.values())
            if bits > MAX_BITS:
                yield Problem(name.place, f"'{name}' has {bits} bits, a PDO at most {MAX_BITS}")


def traffic_that_does_not_hold(table: Table) -> Iterator[Problem]:
    """Check that every row of the traffic is one of a message or service, with a time that is one."""
    names = {*table.messages, *SERVICES}
    settings = {f"{record}.{name}" for record, each in named_records(table) for name in each.fields}
    yield from unknown("message", table.traffic, names)
    for name, row in table.traffic.items():
        yield from unknown("message", [row.answers] if row.answers else [], names)
        if (row.every is None) == (row.answers is None):
            yield Problem(name.place, f"'{name}' needs either every or answers")
        for time in (row.every, row.jitter, row.deadline):
            if time is not None and not durations.is_duration(time):
                yield from unknown("setting", [time], settings)


def _composed(source: str, find: FindTable, problems: Problems) -> yaml.Node:
    """Parse a table, and the one that it extends; raises ReadError, with the problems noted."""
    own = yaml_places.compose(source, problems)
    entries = own.value if isinstance(own, yaml.MappingNode) else ()
    named = next(((key, value) for key, value in entries if key.value == EXTENDS), None)
    if named is None:
        return own
    own.value = [pair for pair in own.value if pair[0] is not named[0]]
    file = find(yaml_places.scalar(named[1], problems))
    if file is None or not file.is_file():
        refuse(named[1], problems, f"there is no table to build on that is called {yaml_places.shown(named[1])}")
    base = _composed(bounded.read(file).decode(errors="replace"), find, problems)
    return yaml_places.merged(yaml_places.elsewhere(base, str(file)), own)


CHECKS = (
    unknown_names,
    repeated_values,
    numbers_out_of_range,
    bit_rates_that_no_node_has,
    fields_that_do_not_hold,
    fields_that_would_carry_nothing,
    messages_too_long,
    traffic_that_does_not_hold,
)


FindTable: TypeAlias = Callable[[str], "Path | None"]
"""Finds the table that another one `extends`, by its name; None if there is none."""

EXTENDS = "extends"


def read_table(source: str, file: str | Path, find: FindTable = lambda _: None) -> Table:
    """Read the table from the text of `file`; raises TableError with all problems, if there are any.

    A table may build on another one, which it `extends`: `find` finds that. What it says itself comes beside it, or in
    its place.
    """
    problems: Problems = []
    try:
        table: Table = reader_of(Table)(_composed(source, find, problems), problems)
    except ReadError:
        raise TableError(file, problems) from None
    if problems:
        raise TableError(file, problems)
    found = [each for check in CHECKS for each in check(table)]
    if found:
        raise TableError(file, found)
    return table
