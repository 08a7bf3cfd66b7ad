"""The files made from a protocol table: a network file, and for each node an EDS that every CANopen tool accepts.

The same table always makes the same bytes, so that a committed file can be checked against its table.

Tools differ in what they accept of CiA 306. All of dcf-tools, objdictgen, EDSSharp, Lely, CANopenNode, CanFestival,
canmatrix and canopen accept this:

- The number of PDOs is spelled `NrOfRXPDO` and `NrOfTXPDO`.
- A value that depends on the node-ID begins with it: `$NODEID+0x80`.
- All of Dummy0001 to Dummy0007 are there, and [Comments] has as many lines as `Lines` says.
- Sub-index 0 of every record has a DefaultValue.
- Objects have no Unit, Factor or Description, and there are no sections of our own, which checkers would refuse. Units
  and codes are in [Comments] (see `meanings`).
- A field's type has as many bytes as the field touches in its frame, because canopen reads and writes these.
- Every PDO has all five communication parameters. Every mapping record has the same number of entries, padded with
  zeros, because a master can write only existing entries.
- Received data is `rww`, sent data `ro`, or `rwr` if it is in the node's `orders`; all data has limits.

Rows of standard objects name their clause (CiA 301 version 4.2.0, CiA 302-2).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, groupby, product, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import yaml

from eurobot_od.od import values
from eurobot_od.od.description import ObjectCode, list_entries, listed
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import BIT_RATES
from eurobot_od.od.fingerprints import ALL_NAME, FINGERPRINTS, OBJECT_NAME, MappedPart, fingerprint, of_all, of_pdo
from eurobot_od.od.make import NOWHERE, DialectRow, FieldType, MessageRow, NodeRow, Record, Table, TableField
from eurobot_od.od.meanings import HEAD as MEANINGS_HEAD
from eurobot_od.od.meanings import NO_MEANING
from eurobot_od.od.pdos import PADDING as PADDING_NAME
from eurobot_od.od.pdos import carries_nothing, unheard
from eurobot_od.od.standard import REVISION
from eurobot_od.od.values import COMMUNICATION_RECORDS, DataType, MappingEntry, PdoDirection
from eurobot_od.support.yaml_places import PlacedNumber, PlacedReal, PlacedText, Problem

KeyValues = list[tuple[str, object]]
EdsSection = tuple[str, KeyValues]
Fields = dict[PlacedText, TableField]


def eds_text(table: Table, dialect_name: PlacedText, node_name: PlacedText) -> str:
    """Return the EDS file of a node in a dialect."""
    dialect = table.dialects[dialect_name]
    objects = object_dictionary(table, dialect, node_name)
    indices = listed(each.index for each in objects)
    lists: list[EdsSection] = [(name, [*list_entries(each).items()]) for name, each in indices.items()]
    sections: list[EdsSection] = [
        file_info(table, dialect_name, node_name),
        device_info(table, dialect.revision_number, table.nodes[node_name], objects),
        ("DummyUsage", [(f"Dummy{each:04X}", 0) for each in values.DUMMIES]),
        comments(table, dialect, node_name),
        *lists,
        *(section for each in objects for section in each.sections),
    ]
    return "\n".join(f"[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys) for name, keys in sections)


def comments(table: Table, dialect: DialectRow, node_name: PlacedText) -> EdsSection:
    """Return [Comments]: the origin of the file, and the units and codes of its objects."""
    said = [
        field.meaning.line((each.index, sub))
        for each in all_records(table, dialect, node_name)
        for sub, field in enumerate(each.fields.values(), start=1)
        if field.meaning != NO_MEANING
    ]
    lines = [table.file.comment, *([MEANINGS_HEAD, *said] if said else [])]
    return "Comments", [("Lines", len(lines)), *((f"Line{n}", line) for n, line in enumerate(lines, start=1))]


def all_records(table: Table, dialect: DialectRow, node_name: PlacedText) -> list[Record]:
    """Return the data, settings and readings of a node, ordered by index."""
    node = table.nodes[node_name]
    names = data_names(table, node_name)
    data = (each for name, each in table.objects_in(dialect).items() if name in names)
    own = (*table.settings.values(), *node.settings.values(), *node.readings.values())
    return sorted((*data, *own), key=lambda each: each.index)


def file_info(table: Table, dialect_name: PlacedText, node_name: PlacedText) -> EdsSection:
    """Return [FileInfo]; creation and modification have the table's fixed date."""
    file = table.file
    return "FileInfo", [
        ("FileName", f"{node_name}.eds"),
        ("FileVersion", file.version),
        ("FileRevision", file.revision),
        ("EDSVersion", "4.0"),
        ("Description", f"{table.nodes[node_name].product_name}, dialect {dialect_name}"),
        ("CreationTime", file.time),
        ("CreationDate", file.date),
        ("CreatedBy", file.author),
        ("ModificationTime", file.time),
        ("ModificationDate", file.date),
        ("ModifiedBy", file.author),
    ]


def device_info(table: Table, revision: int, node: NodeRow, objects: Iterable[MadeObject]) -> EdsSection:
    """Return [DeviceInfo]; `RevisionNumber` is the dialect's, for people: nodes compare fingerprints."""
    indices = {each.index for each in objects}
    return "DeviceInfo", [
        ("VendorName", table.vendor.name),
        ("VendorNumber", f"0x{table.vendor.number:08X}"),
        ("ProductName", node.product_name),
        ("ProductNumber", f"0x{node.product_number:08X}"),
        ("RevisionNumber", f"0x{revision:08X}"),
        ("OrderCode", node.order_code),
        *((f"BaudRate_{rate}", int(rate in table.bit_rates)) for rate in BIT_RATES),
        ("SimpleBootUpMaster", 0),
        ("SimpleBootUpSlave", 1),
        ("Granularity", 1),
        ("DynamicChannelsSupported", 0),
        ("GroupMessaging", 0),
        ("NrOfRXPDO", len(indices.intersection(COMMUNICATION_RECORDS[PdoDirection.RPDO]))),
        ("NrOfTXPDO", len(indices.intersection(COMMUNICATION_RECORDS[PdoDirection.TPDO]))),
        ("LSS_Supported", 0),
    ]


# Places of an object's bits in its PDO: whole fields, or slices of them, in CiA 301's order.
#
# CiA 301 fills a frame from the least significant bit of its first byte (7.5.2.36). For a device with another bit
# order, fields are cut into slices of bits that are adjacent both in the value and in the frame, and the slices are
# mapped in the device's order. Loading such an EDS joins the slices by their names, such as `X position (11:4)`.


PADDING = PlacedText(PADDING_NAME, NOWHERE)
BYTE = 8
FIRST_SLICES = 0x3000
"""Index of the slices of the first cut object; the next ones follow."""


class Slice(NamedTuple):
    """Bits `high` down to `low` of a field of an object; bit 0 is the least significant one."""

    field: PlacedText
    high: int
    low: int

    @property
    def bits(self) -> int:
        """Number of bits."""
        return self.high - self.low + 1

    @property
    def name(self) -> str:
        """ParameterName, such as `X position (11:4)`; padding has no bit numbers."""
        return PADDING if self.field == PADDING else f"{self.field} ({self.high}:{self.low})"


def whole_fields(fields: Fields) -> tuple[Slice, ...]:
    """Return the layout of CiA 301: each field whole, the least significant bit first (7.5.2.36)."""
    return tuple(Slice(name, each.bits - 1, 0) for name, each in fields.items())


def most_significant_first(fields: Fields) -> tuple[Slice, ...]:
    """Return the layout from the first byte's most significant bit on; the rest of the last byte is padding."""
    bits = [(name, bit) for name, each in fields.items() for bit in reversed(range(each.bits))]
    bits += [(PADDING, bit) for bit in reversed(range(-len(bits) % BYTE))]
    frame = [bit for start in range(0, len(bits), BYTE) for bit in reversed(bits[start : start + BYTE])]
    return tuple(runs(frame))


def runs(frame: Iterable[tuple[PlacedText, int]]) -> Iterator[Slice]:
    """Yield the longest slices of adjacent bits of a field; `frame` has the bits in CiA 301's order.

    Within a slice, a bit of the value and its place in the frame have a constant distance.
    """
    for (name, _), run in groupby(enumerate(frame), key=lambda each: (each[1][0], each[1][1] - each[0])):
        bits = [bit for _, (_, bit) in run]
        yield Slice(name, bits[-1], bits[0])


@dataclass(frozen=True)
class ObjectLayout:
    """An object in a dialect: index, fields, `parts` in PDO order, and the index of its slices."""

    index: int
    fields: Fields
    parts: tuple[Slice, ...]
    slices_index: int

    @property
    def cut(self) -> tuple[Slice, ...]:
        """The parts that are not whole fields: sub-indices 1, 2, ... of the slices' object."""
        return tuple(each for each in self.parts if not self.is_whole(each))

    @property
    def targets(self) -> tuple[int, ...]:
        """Mapping entries of a PDO: index, sub-index and bits of every part (CiA 301, 7.5.2.36)."""
        fields = {name: (self.index, sub) for sub, name in enumerate(self.fields, start=1)}
        cut = {each: (self.slices_index, sub) for sub, each in enumerate(self.cut, start=1)}
        places = ((fields[each.field] if self.is_whole(each) else cut[each], each.bits) for each in self.parts)
        return tuple(MappingEntry(*address, bits).number for address, bits in places)

    @property
    def mapped(self) -> list[MappedPart]:
        """The mapping, as far as it affects how a frame is read."""
        return [self._mapped_part(entry, part) for entry, part in zip(self.targets, self.parts)]

    def _mapped_part(self, entry: int, part: Slice) -> MappedPart:
        if carries_nothing(part.field):
            return MappedPart("", entry, None, is_real=False, meaning=NO_MEANING)
        name = part.field if self.is_whole(part) else part.name
        whole = self.fields[part.field]
        return MappedPart(name, entry, whole.is_signed, whole.type is FieldType.REAL32, whole.meaning)

    @property
    def begins(self) -> dict[PlacedText, int]:
        """First bit, 0 to 7, within a byte of the frame, for each field that is mapped whole."""
        offsets = accumulate((each.bits for each in self.parts), initial=0)
        return {part.field: at % BYTE for part, at in zip(self.parts, offsets) if self.is_whole(part)}

    def is_whole(self, part: Slice) -> bool:
        """Return whether a part is a whole field."""
        return part.field in self.fields and part.bits == self.fields[part.field].bits


def layouts(table: Table, dialect: DialectRow) -> dict[PlacedText, ObjectLayout]:
    """Return the layout of every object of the table in a dialect."""
    return {name: layout(dialect, name, each) for name, each in table.objects_in(dialect).items()}


def layout(dialect: DialectRow, name: PlacedText, record: Record) -> ObjectLayout:
    """Return the layout of an object in a dialect."""
    fields = in_pdo_order(record.fields, dialect.reserved_before(name))
    if name not in dialect.most_significant_first:
        return ObjectLayout(record.index, record.fields, whole_fields(fields), 0)
    slices_index = FIRST_SLICES + dialect.most_significant_first.index(name)
    return ObjectLayout(record.index, record.fields, most_significant_first(fields), slices_index)


def in_pdo_order(fields: Fields, reserved: dict[PlacedText, PlacedText]) -> Fields:
    """Return the fields with each one's reserved bits before it."""
    named = (name for name in fields if name not in reserved.values())
    order = (each for name in named for each in (reserved.get(name), name) if each is not None)
    return {name: fields[name] for name in order}


# Objects


class MadeObject(NamedTuple):
    """An object: its index, its section and those of its sub-indices."""

    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple
    sections: list[EdsSection]


U8, U16, U32, STRING = values.UNSIGNED8, values.UNSIGNED16, values.UNSIGNED32, values.VISIBLE_STRING
INTEGERS = {(t.size, t.is_signed): t for t in values.DATA_TYPES.values() if t.bits > 1 and t.is_integer}
"""Integer types by number of bytes and signedness."""

ERROR_HISTORY = 8
"""Number of errors that 0x1003 stores; CiA 301 allows 1 to 254."""
ON_COMMAND = 0x00000001
"""Value of 0x1010 and 0x1011: the device stores or restores on command only."""
SELF_STARTING = 0x00000008
"""Value of 0x1F80: no NMT master (bit 0), enters OPERATIONAL by itself (bit 2 clear), starts no other node (bit 3)."""
EVENT_DRIVEN = 254
"""Transmission type of every PDO: event-driven (7.5.2.35, 7.5.2.37)."""
LEAST_ENTRIES = 8
"""Least number of entries of a mapping record; the same in every PDO, so that any may be remapped."""
ACCESS = {(True, False): "ro", (False, True): "rww", (True, True): "rw"}
"""Access type of data by (sent, received); only `rw` may be mapped both ways."""
ORDERED = "rwr"
"""Access type of data that a node sends when it is written."""


def entry(
    name: str, type_: DataType, access: str, default: float | str | None, *limits: int | None, mappable: bool = False
) -> KeyValues:
    """Return the keys of a VAR or sub-index; limits and default only if given.

    A text as default of a number is a formula with the node-ID.
    """
    form = "0x{:08X}" if type_ is U32 else "{}"  # COB-IDs, mappings and identities
    numbers = {**dict(zip(("LowLimit", "HighLimit"), limits)), "DefaultValue": default}
    given = ((key, value) for key, value in numbers.items() if value is not None)
    return [
        ("ParameterName", name),
        ("ObjectType", f"0x{ObjectCode.VAR.value:X}"),
        ("DataType", f"0x{type_.code:04X}"),
        ("AccessType", access),
        *((key, value if isinstance(value, str) else form.format(value)) for key, value in given),
        ("PDOMapping", int(mappable)),
    ]


def variable(index: int, only: KeyValues) -> MadeObject:
    """Return a VAR."""
    return MadeObject(index, [(f"{index:04X}", only)])


def record(index: int, name: str, *entries: KeyValues, code: ObjectCode = ObjectCode.RECORD) -> MadeObject:
    """Return a RECORD or ARRAY, whose sub-index 0 is the number of entries."""
    return composed(index, name, code, entry("Highest sub-index supported", U8, "const", len(entries)), *entries)


def array(index: int, name: str, *entries: KeyValues) -> MadeObject:
    """Return an ARRAY."""
    return record(index, name, *entries, code=ObjectCode.ARRAY)


def composed(index: int, name: str, code: ObjectCode, *members: KeyValues) -> MadeObject:
    """Return a record or array with all its members, from sub-index 0 on."""
    head: KeyValues = [("ParameterName", name), ("ObjectType", f"0x{code.value:X}"), ("SubNumber", len(members))]
    subs = [(f"{index:04X}sub{sub:X}", each) for sub, each in enumerate(members)]
    return MadeObject(index, [(f"{index:04X}", head), *subs])


# Objects of every node. 0x1005 and 0x1012 are missing because their defaults, 0x080 and 0x100, are identifiers of
# messages in the robot of 2014, which a node with these objects would take for SYNC and TIME.


def common() -> tuple[MadeObject, ...]:
    """Return the communication objects that are the same in every node."""
    return (
        variable(0x1000, entry("Device type", U32, "ro", 0)),  # 7.5.2.1: 0, no device profile
        variable(0x1001, entry("Error register", U8, "ro", 0)),  # 7.5.2.2
        composed(  # 7.5.2.4: sub-index 0 is the number of errors, writing 0 clears them
            *(0x1003, "Pre-defined error field", ObjectCode.ARRAY),
            entry("Number of errors", U8, "rw", 0),
            *(entry(f"Standard error field {n}", U32, "ro", 0) for n in range(1, ERROR_HISTORY + 1)),
        ),
        # 7.5.2.13 and 7.5.2.14: all parameters together; smaller groups are optional
        array(0x1010, "Store parameters", entry("Save all parameters", U32, "rw", ON_COMMAND)),
        array(0x1011, "Restore default parameters", entry("Restore all default parameters", U32, "rw", ON_COMMAND)),
        variable(0x1014, entry("COB-ID EMCY", U32, "ro", f"{values.NODE_ID}+0x{values.EMCY_BASE:X}")),  # 7.5.2.17
        variable(0x1015, entry("Inhibit time EMCY", U16, "rw", 0)),  # 7.5.2.18
        # 7.5.2.23: both 0, not configured
        array(0x1020, "Verify configuration", *(entry(f"Configuration {n}", U32, "rw", 0) for n in ("date", "time"))),
        variable(0x1021, entry("Store EDS", values.DOMAIN, "ro", None)),  # 7.5.2.24
        variable(0x1022, entry("Store format", U8, "ro", 0)),  # 7.5.2.25: 0, plain text
        record(  # 7.5.2.33
            0x1200,
            "SDO server parameter",
            entry("COB-ID client to server (rx)", U32, "ro", f"{values.NODE_ID}+0x{values.SDO_REQUEST_BASE:X}"),
            entry("COB-ID server to client (tx)", U32, "ro", f"{values.NODE_ID}+0x{values.SDO_RESPONSE_BASE:X}"),
        ),
        variable(0x1F80, entry("NMT startup", U32, "rw", SELF_STARTING)),  # CiA 302-2
    )


def own_objects(table: Table, dialect: DialectRow, node: NodeRow) -> tuple[MadeObject, ...]:
    """Return the communication objects with values of the node or the table."""
    return (
        # 7.5.2.8 to 7.5.2.10
        variable(0x1008, entry("Manufacturer device name", STRING, "const", node.product_name)),
        variable(0x1009, entry("Manufacturer hardware version", STRING, "const", table.hardware_version)),
        variable(0x100A, entry("Manufacturer software version", STRING, "const", table.software_version)),
        array(0x1016, "Consumer heartbeat time", *watched(table, node)),  # 7.5.2.19
        # 7.5.2.20
        variable(0x1017, entry("Producer heartbeat time", U16, "rw", own(node.heartbeat, table.heartbeat))),
        record(  # 7.5.2.21
            0x1018,
            "Identity object",
            entry("Vendor-ID", U32, "ro", table.vendor.number),
            entry("Product code", U32, "ro", node.product_number),
            entry("Revision number", U32, "ro", dialect.revision_number),
            entry("Serial number", U32, "ro", table.serial_number),
        ),
        # 7.5.2.32
        array(0x1029, "Error behaviour", entry("Communication error", U8, "rw", node.communication_error, 0, 2)),
    )


def watched(table: Table, node: NodeRow) -> list[KeyValues]:
    """Return an entry for each watched node, at least one: its node-ID and time-out, or 0."""
    nodes = (table.nodes[each] for each in node.watches)
    times = [each.node_id << 16 | own(each.heartbeat_timeout, table.heartbeat_timeout) for each in nodes]
    times += [0] * (max(1, len(table.nodes) - 1) - len(times))
    return [entry(f"Consumer heartbeat time {n}", U32, "rw", time) for n, time in enumerate(times, start=1)]


def own(number: int | None, common: int) -> int:
    """Return a node's own number, else the table's."""
    return common if number is None else number


def clients(table: Table, node: NodeRow) -> list[MadeObject]:
    """Return an SDO client channel for each node whose identity this node reads (7.5.2.34)."""
    return [
        record(
            0x1280 + n,
            f"SDO client parameter {each}",
            entry("COB-ID client to server (tx)", U32, "rw", values.SDO_REQUEST_BASE + table.nodes[each].node_id),
            entry("COB-ID server to client (rx)", U32, "rw", values.SDO_RESPONSE_BASE + table.nodes[each].node_id),
            entry("Node-ID of the SDO server", U8, "rw", table.nodes[each].node_id, 1, 127),
        )
        for n, each in enumerate(node.asks)
    ]


# PDOs


def pdo_records(
    index: int, name: str, cob_id: int, event_timer: int, mapping: Sequence[int], entries: int
) -> Iterator[MadeObject]:
    """Yield a PDO's communication record, and its mapping record padded to `entries` (7.5.2.35 to 7.5.2.38)."""
    yield record(
        index,
        name,
        entry("COB-ID used by PDO", U32, "rw", cob_id),
        entry("Transmission type", U8, "rw", EVENT_DRIVEN),
        entry("Inhibit time", U16, "rw", 0),
        entry("Compatibility entry", U8, "rw", 0),
        entry("Event timer", U16, "rw", event_timer),
    )
    count = entry("Number of mapped objects in PDO", U8, "rw", len(mapping), 0, entries)
    targets = enumerate([*mapping, *[0] * (entries - len(mapping))], start=1)
    mapped = (entry(f"Application object {n}", U32, "rw", target) for n, target in targets)
    yield composed(index + values.MAPPING_OFFSET, f"{name} mapping", ObjectCode.RECORD, count, *mapped)


def sent(table: Table, name: PlacedText) -> dict[PlacedText, MessageRow]:
    """Return the messages that a node sends, ordered by COB-ID."""
    return {key: each for key, each in table.by_identifier.items() if name in each.senders}


def received(table: Table, name: PlacedText) -> dict[PlacedText, MessageRow]:
    """Return the messages for which a node has an RPDO, ordered by COB-ID."""
    return {key: each for key, each in table.by_identifier.items() if name in (*each.receivers, *each.listeners)}


def pdos(table: Table, name: PlacedText, data: dict[PlacedText, ObjectLayout]) -> Iterator[MadeObject]:
    """Yield the records of all PDOs of a node, numbered in the order of their COB-IDs.

    This order matters for CANopenNode: it takes a COB-ID that equals the base of this PDO's default (TPDO1 0x180, RPDO1
    0x200, ...) for the default, and adds the node-ID.
    """
    entries = max([LEAST_ENTRIES, *(len(each.targets) for each in data.values())])
    for direction, messages in ((PdoDirection.RPDO, received(table, name)), (PdoDirection.TPDO, sent(table, name))):
        for index, (key, each) in enumerate(messages.items(), start=direction.value):
            if direction is PdoDirection.TPDO:
                control = values.NO_RTR  # no remote frames
                timer = each.event_timer or 0
            else:
                control = values.NOT_VALID if name in each.listeners else 0  # a master enables it
                timer = 0
            targets = data[each.object].targets if each.object else ()
            yield from pdo_records(index, key, each.identifier | control, timer, targets, entries)


def fingerprints(table: Table, data: dict[PlacedText, ObjectLayout]) -> MadeObject:
    """Return the object with the fingerprints of all messages, ordered by identifier."""
    found: dict[str, int] = {
        name: fingerprint(name, each.identifier, data[each.object].mapped if each.object else ())
        for name, each in table.by_identifier.items()
    }
    entries: dict[str, int] = {ALL_NAME: of_all(found.values()), **found}
    return array(FINGERPRINTS, OBJECT_NAME, *(entry(name, U32, "ro", number) for name, number in entries.items()))


# Data and settings


def data_names(table: Table, name: PlacedText) -> set[PlacedText]:
    """Return the names of the objects with data that a node sends or receives."""
    rows = (*sent(table, name).values(), *received(table, name).values())
    return {each.object for each in rows if each.object is not None}


def all_data(table: Table, name: PlacedText, data: dict[PlacedText, ObjectLayout]) -> Iterator[MadeObject]:
    """Yield the objects that a node's PDOs map: fields and, in dialects that cut them, slices."""
    out = {each.object for each in sent(table, name).values()}
    come = {each.object for each in received(table, name).values()}
    ordered = {table.messages[each].object for each in table.nodes[name].orders}
    for key in filter((out | come).__contains__, data):
        access = ORDERED if key in ordered else ACCESS[key in out, key in come]
        layout = data[key]
        begins = layout.begins
        fields = layout.fields.items()
        entries = (field_entry(field, each, access, begins.get(field, 0), mappable=True) for field, each in fields)
        yield record(layout.index, key, *entries)
        if layout.cut:
            slices = (slice_entry(part, layout.fields.get(part.field), access) for part in layout.cut)
            yield record(layout.slices_index, f"{key} slices", *slices)


def slice_entry(part: Slice, whole: TableField | None, access: str) -> KeyValues:
    """Return the entry of a slice of a field; `whole` is None for padding."""
    mask = (1 << part.bits) - 1
    said = default_of(whole) if whole else 0
    is_real = whole is not None and whole.type is FieldType.REAL32
    default = int.from_bytes(values.REAL32.write(said), "little") if is_real else int(said)
    if whole and whole.is_signed and part.high == whole.bits - 1:  # the slice with the sign bit
        type_ = integer(part.bits, signed=True)
        return entry(part.name, type_, access, default >> part.low, ~mask >> 1, mask >> 1, mappable=True)
    return entry(part.name, integer(part.bits), access, default >> part.low & mask, 0, mask, mappable=True)


def field_entry(
    name: str, whole: TableField, access: str, begin: int = 0, node: NodeRow | None = None, mappable: bool = False
) -> KeyValues:
    """Return the entry of a whole field, a setting or a reading."""
    type_ = values.REAL32 if whole.type is FieldType.REAL32 else integer(whole.bits, begin, whole.is_signed)
    return entry(name, type_, access, default_of(whole, node), *whole.limits, mappable=mappable)


def default_of(whole: TableField, node: NodeRow | None = None) -> float:
    """Return a field's default as a number; `node` is the node with the setting."""
    if isinstance(whole.default, PlacedNumber | PlacedReal):
        return whole.default
    return node.node_id if node and whole.default == values.NODE_ID else whole.codes[whole.default]


def integer(bits: int, begin: int = 0, signed: bool = False) -> DataType:
    """Return the integer type with as many bytes as the bits touch, if they begin at bit `begin` of a byte."""
    return INTEGERS[-(-(begin + bits) // 8), signed]


# The whole dictionary


def object_dictionary(table: Table, dialect: DialectRow, name: PlacedText) -> list[MadeObject]:
    """Return all objects of a node, ordered by index."""
    node = table.nodes[name]
    data = layouts(table, dialect)
    objects = [*common(), *own_objects(table, dialect, node), *clients(table, node)]
    objects += [*pdos(table, name, data), *all_data(table, name, data), fingerprints(table, data)]
    settings = {key: dialect.setting_of(key, each) for key, each in {**table.settings, **node.settings}.items()}
    for access, records in (("rw", settings), ("ro", node.readings)):
        for key, each in records.items():
            fields = (field_entry(name, own, access, node=node) for name, own in each.fields.items())
            objects.append(record(each.index, key, *fields))
    return sorted(objects, key=lambda each: each.index)


# The files: written into a folder, or compared with its present files


NETWORK = "network.yaml"
HEAD = """\
# {}
# The network of dialect {} for `eurobot-od lint --network` and `load`: files and node-IDs of the nodes, messages that
# several of them send, the order of priorities, the most urgent first, and how often what is sent.
"""
LINE = 120
"""Line length of the network file."""
Texts = dict[str, str]
"""Contents of the files, by path below the folder."""


def make_files(table: Table) -> Texts:
    """Return all files: `DIALECT/NODE.eds`, and the network file."""
    pairs = product(table.dialects, table.nodes)
    texts = {f"{dialect}/{node}.eds": eds_text(table, dialect, node) for dialect, node in pairs}
    return {**texts, NETWORK: network_text(table)}


def network_text(table: Table) -> str:
    """Return the network file of the table's first dialect, for `lint --network` and `load`.

    Messages are ordered by identifier, which is their priority.
    """
    dialect = next(iter(table.dialects))
    messages = table.by_identifier
    network: dict[str, Any] = {
        "nodes": {
            str(name): {"file": f"{dialect}/{name}.eds", "node_id": int(node.node_id)}
            for name, node in table.nodes.items()
        },
        "shared": [str(name) for name, each in messages.items() if len(each.senders) > 1],
        "order": [str(name) for name in messages],
        "bit_rate": int(table.bit_rate),
    }
    if table.traffic:
        network["traffic"] = {  # PyYAML's safe_dump refuses subclasses of str
            str(name): {key: str(value) for key, value in vars(row).items() if value}
            for name, row in table.traffic.items()
        }
    return HEAD.format(table.file.comment, dialect) + yaml.safe_dump(network, sort_keys=False, width=LINE)


def changed_bits(table: Table, texts: Texts, folder: Path) -> Iterator[Problem]:
    """Yield a problem for each dialect whose files below `folder` map a message differently with the same revision.

    Raises DictionaryError for a file that cannot be read.
    """
    for name, dialect in table.dialects.items():
        pairs = ((folder / path, text) for path, text in texts.items() if path.startswith(f"{name}/"))
        found = {message for file, text in pairs if file.is_file() for message in _changed(file, text)}
        if found:
            revision = f"0x{dialect.revision_number:08X}"
            what = f"other bits or codes than in {folder / name} under the same revision {revision}: {', '.join(found)}"
            yield Problem(dialect.revision_number.place, f"{what}; raise it, or say --same-revision")


def _changed(file: Path, text: str) -> Iterator[str]:
    """Yield the messages that a file with the same revision maps differently from the text."""
    old = Dictionary.load(file)
    new = Dictionary.read(text.encode("ascii"), file)
    if old.number(REVISION) != new.number(REVISION) or FINGERPRINTS not in old.members:
        return
    before, now = ({pdo.name: of_pdo(pdo) for pdo in each.read_pdos(each.default, unheard)} for each in (old, new))
    yield from (name for name, each in now.items() if before.get(name, each) != each)


def write_files(texts: Texts, folder: Path) -> None:
    """Write all files below `folder`; old files are replaced only after all new ones are written. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in texts:
        (folder / path).parent.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".make-eds-") as scratch:  # a full disk raises here
        for number, text in enumerate(texts.values()):
            Path(scratch, str(number)).write_bytes(text.encode("ascii"))  # bytes, for the same line ends on any system
        for number, path in enumerate(texts):
            Path(scratch, str(number)).replace(folder / path)


def differences(texts: Texts, folder: Path) -> list[str]:
    """Return a line for each file below `folder` that differs, is missing, or should not be there.

    Only an EDS file in a dialect's folder should not be there: it would be loaded as a node. Raises OSError.
    """
    dialects = {path.partition("/")[0] for path in texts if path != NETWORK}
    there = {each.relative_to(folder).as_posix() for name in dialects for each in (folder / name).glob("*.eds")}
    lines = {path: difference(text, folder / path) for path, text in texts.items()}
    lines |= dict.fromkeys(there - texts.keys(), "should not be there")
    return [f"{folder / path}: {what}" for path, what in sorted(lines.items()) if what]


def difference(text: str, file: Path) -> str:
    """Return in which line a file first differs from `text`; empty if it does not."""
    try:
        pairs = zip_longest(text.encode("ascii").split(b"\n"), file.read_bytes().split(b"\n"))
    except FileNotFoundError:
        return "is missing"
    return next((f"differs first in line {n}" for n, (new, old) in enumerate(pairs, start=1) if new != old), "")
