"""The object dictionary of one node in one dialect: every object that its EDS lists, and which CANopen tools may map.

An object is a row of values, and each row of a standard's object names its clause (CiA 301 version 4.2.0, CiA 302-2).
Nothing here knows how an EDS is written.

Where the standard leaves room, this is the form that every tool accepts that was given the files:

- A field has the type of exactly as many bytes as its bits need.
- Every PDO has all five communication parameters. Every mapping record, even that of a message without data, has the
  same number of entries, filled up with zeros: a master can write only entries that are there.
- Data that is received is `rww`, data that is sent `rwr`, and all of it has limits.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from eurobot_od.od.make.layout import ObjectLayout, Slice, layouts
from eurobot_od.od.make.table import OWN_NODE_ID, DialectRow, Field, MessageRow, NodeRow, Record, Table
from eurobot_od.yaml_places import Number, Text


class ObjectCode(Enum):
    """What an object is (CiA 301, 7.4.3)."""

    VAR = 0x7
    ARRAY = 0x8
    RECORD = 0x9


class Type(Enum):
    """Data types (CiA 301, 7.4.7), as far as we use them."""

    UNSIGNED8 = 0x0005
    UNSIGNED16 = 0x0006
    UNSIGNED32 = 0x0007
    VISIBLE_STRING = 0x0009
    DOMAIN = 0x000F
    UNSIGNED24 = 0x0016


U8, U16, U32, STRING = Type.UNSIGNED8, Type.UNSIGNED16, Type.UNSIGNED32, Type.VISIBLE_STRING
UNSIGNED = {1: U8, 2: U16, 3: Type.UNSIGNED24, 4: U32}
"""The unsigned type of each number of bytes."""

HIGHEST = "Highest sub-index supported"
ERROR_HISTORY = 8
"""Errors that 0x1003 remembers; CiA 301 allows 1 to 254."""
ON_COMMAND = 0x00000001
"""0x1010 and 0x1011, read: the device stores or restores when told to, not by itself."""
SELF_STARTING = 0x00000008
"""0x1F80: bit 0 clear, no NMT master; bit 2 clear, enters OPERATIONAL by itself; bit 3 set, starts no other node."""
EVENT_DRIVEN = 254
"""Transmission type of every PDO (7.5.2.35, 7.5.2.37): sent when the protocol says so."""
INVALID, NO_RTR = 1 << 31, 1 << 30
"""Control bits of a PDO's COB-ID."""
LEAST_ENTRIES = 8
"""Entries of a mapping record, unless a mapping needs more: the same in every PDO, so that any may be remapped."""


class PdoBase(NamedTuple):
    """The first indices of one direction's communication and mapping records (7.5.2.35 to 7.5.2.38)."""

    communication: int
    mapping: int


RPDO, TPDO = PdoBase(0x1400, 0x1600), PdoBase(0x1800, 0x1A00)
ACCESS = {(True, False): "rwr", (False, True): "rww", (True, True): "rw"}
"""Access to data by (sent, received) of its node: always writable, as an operator may want to set what is sent next."""


class SubObject(NamedTuple):
    """A variable: a VAR object or a sub-index. A text as default of a number is a formula of the node-ID."""

    name: str
    type: Type
    access: str
    default: int | str | None
    low: int | None = None
    high: int | None = None
    mappable: bool = False


@dataclass(frozen=True)
class DictionaryObject:
    """An object: a VAR has one entry, an ARRAY or a RECORD one for each sub-index from 0 on."""

    index: int
    name: str
    kind: ObjectCode
    entries: tuple[SubObject, ...]


def variable(index: int, entry: SubObject) -> DictionaryObject:
    """Make a VAR object."""
    return DictionaryObject(index, entry.name, ObjectCode.VAR, (entry,))


def record(index: int, name: str, *entries: SubObject) -> DictionaryObject:
    """Make a RECORD; its sub-index 0 says how many entries follow."""
    return DictionaryObject(index, name, ObjectCode.RECORD, (SubObject(HIGHEST, U8, "const", len(entries)), *entries))


def array(index: int, name: str, *entries: SubObject) -> DictionaryObject:
    """Make an ARRAY; its sub-index 0 says how many entries follow."""
    return DictionaryObject(index, name, ObjectCode.ARRAY, (SubObject(HIGHEST, U8, "const", len(entries)), *entries))


# What is the same in every node. Not here: 0x1005 and 0x1012. Their defaults are 0x080 and 0x100, on the robot of 2014
# identifiers of messages; a node with these objects would take them for SYNC and TIME.

COMMON = (
    variable(0x1000, SubObject("Device type", U32, "ro", 0)),  # 7.5.2.1: 0, no device profile
    variable(0x1001, SubObject("Error register", U8, "ro", 0)),  # 7.5.2.2
    DictionaryObject(  # 7.5.2.4: sub-index 0 counts the errors, 0 written to it clears them
        0x1003,
        "Pre-defined error field",
        ObjectCode.ARRAY,
        (
            SubObject("Number of errors", U8, "rw", 0),
            *(SubObject(f"Standard error field {n}", U32, "ro", 0) for n in range(1, ERROR_HISTORY + 1)),
        ),
    ),
    # 7.5.2.13 and 7.5.2.14: all parameters at once; smaller portions are optional
    array(0x1010, "Store parameters", SubObject("Save all parameters", U32, "rw", ON_COMMAND)),
    array(0x1011, "Restore default parameters", SubObject("Restore all default parameters", U32, "rw", ON_COMMAND)),
    variable(0x1014, SubObject("COB-ID EMCY", U32, "ro", f"{OWN_NODE_ID}+0x80")),  # 7.5.2.17
    variable(0x1015, SubObject("Inhibit time EMCY", U16, "rw", 0)),  # 7.5.2.18
    array(  # 7.5.2.23: both 0, not configured
        0x1020,
        "Verify configuration",
        SubObject("Configuration date", U32, "rw", 0),
        SubObject("Configuration time", U32, "rw", 0),
    ),
    variable(0x1021, SubObject("Store EDS", Type.DOMAIN, "ro", None)),  # 7.5.2.24
    variable(0x1022, SubObject("Store format", U8, "ro", 0)),  # 7.5.2.25: 0, plain text
    record(  # 7.5.2.33
        0x1200,
        "SDO server parameter",
        SubObject("COB-ID client to server (rx)", U32, "ro", f"{OWN_NODE_ID}+0x600"),
        SubObject("COB-ID server to client (tx)", U32, "ro", f"{OWN_NODE_ID}+0x580"),
    ),
    variable(0x1F80, SubObject("NMT startup", U32, "rw", SELF_STARTING)),  # CiA 302-2
)


def own_objects(table: Table, dialect: DialectRow, node: NodeRow) -> tuple[DictionaryObject, ...]:
    """Return the communication objects whose values differ between nodes or come from the table."""
    return (
        # 7.5.2.8 to 7.5.2.10
        variable(0x1008, SubObject("Manufacturer device name", STRING, "const", node.product_name)),
        variable(0x1009, SubObject("Manufacturer hardware version", STRING, "const", table.hardware_version)),
        variable(0x100A, SubObject("Manufacturer software version", STRING, "const", table.software_version)),
        array(0x1016, "Consumer heartbeat time", *watched(table, node)),  # 7.5.2.19
        variable(0x1017, SubObject("Producer heartbeat time", U16, "rw", table.heartbeat)),  # 7.5.2.20
        record(  # 7.5.2.21
            0x1018,
            "Identity object",
            SubObject("Vendor-ID", U32, "ro", table.vendor.number),
            SubObject("Product code", U32, "ro", node.product_number),
            SubObject("Revision number", U32, "ro", dialect.revision_number),
            SubObject("Serial number", U32, "ro", table.serial_number),
        ),
        # 7.5.2.32
        array(0x1029, "Error behaviour", SubObject("Communication error", U8, "rw", node.communication_error, 0, 2)),
    )


def watched(table: Table, node: NodeRow) -> list[SubObject]:
    """Return an entry for each other node, at least one: its node-ID and the time to wait for it, or 0 for nobody."""
    times = [table.nodes[each].node_id << 16 | table.heartbeat_timeout for each in node.watches]
    times += [0] * (max(1, len(table.nodes) - 1) - len(times))
    return [SubObject(f"Consumer heartbeat time {n}", U32, "rw", time) for n, time in enumerate(times, start=1)]


def clients(table: Table, node: NodeRow) -> list[DictionaryObject]:
    """Return an SDO client channel to each node that is watched, to read its identity (7.5.2.34)."""
    return [
        record(
            0x1280 + n,
            f"SDO client parameter {each}",
            SubObject("COB-ID client to server (tx)", U32, "rw", 0x600 + table.nodes[each].node_id),
            SubObject("COB-ID server to client (rx)", U32, "rw", 0x580 + table.nodes[each].node_id),
            SubObject("Node-ID of the SDO server", U8, "rw", table.nodes[each].node_id, 1, 127),
        )
        for n, each in enumerate(node.watches)
    ]


# PDOs


class PdoRow(NamedTuple):
    """One PDO of a node: its message, its COB-ID with the control bits, its mapping entries."""

    name: str
    cob_id: int
    mapping: tuple[int, ...]


def pdo_objects(base: PdoBase, pdos: list[PdoRow], entries: int) -> list[DictionaryObject]:
    """Return the communication and the mapping records of all PDOs of one direction, in the order of the list."""
    communication = [record(base.communication + n, pdo.name, *parameters(pdo)) for n, pdo in enumerate(pdos)]
    return communication + [mapping_record(base.mapping + n, pdo, entries) for n, pdo in enumerate(pdos)]


def parameters(pdo: PdoRow) -> tuple[SubObject, ...]:
    """Return the communication parameters of a PDO (7.5.2.35, 7.5.2.37)."""
    return (
        SubObject("COB-ID used by PDO", U32, "rw", pdo.cob_id),
        SubObject("Transmission type", U8, "rw", EVENT_DRIVEN),
        SubObject("Inhibit time", U16, "rw", 0),
        SubObject("Compatibility entry", U8, "rw", 0),
        SubObject("Event timer", U16, "rw", 0),
    )


def mapping_record(index: int, pdo: PdoRow, entries: int) -> DictionaryObject:
    """Return the mapping of a PDO, padded to `entries` (7.5.2.36, 7.5.2.38)."""
    targets = [*pdo.mapping, *[0] * (entries - len(pdo.mapping))]
    return DictionaryObject(
        index,
        f"{pdo.name} mapping",
        ObjectCode.RECORD,
        (
            SubObject("Number of mapped objects in PDO", U8, "rw", len(pdo.mapping), 0, entries),
            *(SubObject(f"Application object {n}", U32, "rw", target) for n, target in enumerate(targets, start=1)),
        ),
    )


def sent(table: Table, name: Text) -> dict[Text, MessageRow]:
    """Return the messages that the node sends, in the order of their COB-IDs."""
    return {key: each for key, each in table.by_identifier.items() if name in each.senders}


def received(table: Table, name: Text) -> dict[Text, MessageRow]:
    """Return the messages for which the node has an RPDO, in the order of their COB-IDs."""
    return {key: each for key, each in table.by_identifier.items() if name in (*each.receivers, *each.listeners)}


# Data and settings


def data_objects(layout: ObjectLayout, access: str) -> list[DictionaryObject]:
    """Return a message's data: the object of its fields and, if the dialect cuts them, the object of their slices."""
    entries = (field_entry(name, each, access) for name, each in layout.fields.items())
    whole = record(layout.index, layout.name, *(each._replace(mappable=True) for each in entries))
    if not layout.cut:
        return [whole]
    slices = (slice_entry(each, layout.fields.get(each.field), access) for each in layout.cut)
    return [whole, record(layout.slices_index, f"{layout.name} slices", *slices)]


def slice_entry(part: Slice, whole: Field | None, access: str) -> SubObject:
    """Return the entry of a slice of a field; padding is a slice of no field."""
    highest = (1 << part.bits) - 1
    default = default_of(whole) >> part.low & highest if whole else 0
    return SubObject(part.name, unsigned(part.bits), access, default, 0, highest, mappable=True)


def settings(records: dict[Text, Record], node: NodeRow) -> list[DictionaryObject]:
    """Return the objects of a node's settings."""
    return [
        record(each.index, name, *(field_entry(key, entry, "rw", node) for key, entry in each.fields.items()))
        for name, each in records.items()
    ]


def field_entry(name: str, whole: Field, access: str, node: NodeRow | None = None) -> SubObject:
    """Return the entry of a whole field or of a setting."""
    return SubObject(name, unsigned(whole.bits), access, default_of(whole, node), whole.low, whole.high)


def default_of(whole: Field, node: NodeRow | None = None) -> int:
    """Return a field's default as a number; `node` is the one whose setting it is."""
    if isinstance(whole.default, Number):
        return whole.default
    return node.node_id if node and whole.default == OWN_NODE_ID else whole.codes[whole.default]


def unsigned(bits: int) -> Type:
    """Return the type of exactly as many bytes as the bits need."""
    return UNSIGNED[-(-bits // 8)]


# All of it


def object_dictionary(table: Table, dialect: DialectRow, name: Text) -> list[DictionaryObject]:
    """Return all objects of the node `name`, in the order of their indices."""
    node, data = table.nodes[name], layouts(table, dialect)
    objects = [*COMMON, *own_objects(table, dialect, node), *clients(table, node)]
    objects += [*pdos(table, name, data), *all_data(table, name, data)]
    objects += [*settings(table.settings, node), *settings(node.settings, node)]
    return sorted(objects, key=lambda each: each.index)


def pdos(table: Table, name: Text, data: dict[Text, ObjectLayout]) -> list[DictionaryObject]:
    """Return the records of all PDOs of the node `name`.

    They are numbered in the order of their COB-IDs. That is not only tidy: CANopenNode takes a COB-ID that equals the
    default of the very PDO that has it (TPDO1 0x180, RPDO1 0x200, ...) for that default, and adds the node-ID.
    """
    entries = max([LEAST_ENTRIES, *(len(each.targets) for each in data.values())])
    targets = {key: data[each.object].targets if each.object else () for key, each in table.messages.items()}
    receiving = [
        PdoRow(key, each.identifier | (INVALID if name in each.listeners else 0), targets[key])
        for key, each in received(table, name).items()
    ]
    sending = [PdoRow(key, each.identifier | NO_RTR, targets[key]) for key, each in sent(table, name).items()]
    return [*pdo_objects(RPDO, receiving, entries), *pdo_objects(TPDO, sending, entries)]


def all_data(table: Table, name: Text, data: dict[Text, ObjectLayout]) -> list[DictionaryObject]:
    """Return the data objects that the PDOs of the node `name` map."""
    out = {each.object for each in sent(table, name).values()}
    come = {each.object for each in received(table, name).values()}
    mine = {key: ACCESS[key in out, key in come] for key in data if key in out | come}
    return [each for key, access in mine.items() for each in data_objects(data[key], access)]
