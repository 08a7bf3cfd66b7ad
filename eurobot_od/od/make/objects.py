"""The object dictionary of one node in one dialect: every object that its EDS lists.

Rule of this file: an object is a row of values, and each row of a standard's object names its clause (CiA 301 version
4.2.0, CiA 302-2). Nothing here knows how an EDS is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from eurobot_od.od.make.layout import Layout, Slice, layouts
from eurobot_od.od.make.table import OWN_NODE_ID, Dialect, Field, Message, Node, Record, Table
from eurobot_od.yaml_places import Number, Text


class Kind(Enum):
    """Object codes (CiA 301, 7.4.3)."""

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


U8, U16, U32 = Type.UNSIGNED8, Type.UNSIGNED16, Type.UNSIGNED32
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
"""Access to data by (sent, received) of its node: always writable, so that an operator may set what is sent next."""


class Entry(NamedTuple):
    """A variable: a VAR object or a sub-index. A text as default of a number is a formula of the Node-ID."""

    name: str
    type: Type
    access: str
    default: int | str | None
    low: int | None = None
    high: int | None = None
    mappable: bool = False


@dataclass(frozen=True)
class Object:
    """An object: a VAR has one entry, an ARRAY or a RECORD one for each sub-index from 0 on."""

    index: int
    name: str
    kind: Kind
    entries: tuple[Entry, ...]


def variable(index: int, entry: Entry) -> Object:
    """Make a VAR object."""
    return Object(index, entry.name, Kind.VAR, (entry,))


def record(index: int, name: str, *entries: Entry) -> Object:
    """Make a RECORD; its sub-index 0 says how many entries follow."""
    return Object(index, name, Kind.RECORD, (Entry(HIGHEST, U8, "const", len(entries)), *entries))


def array(index: int, name: str, *entries: Entry) -> Object:
    """Make an ARRAY; its sub-index 0 says how many entries follow."""
    return Object(index, name, Kind.ARRAY, (Entry(HIGHEST, U8, "const", len(entries)), *entries))


# What is the same in every node. Not here: 0x1005 and 0x1012, as SYNC and TIME would sit on identifiers of messages.

COMMON = (
    variable(0x1000, Entry("Device type", U32, "ro", 0)),  # 7.5.2.1: 0, no device profile
    variable(0x1001, Entry("Error register", U8, "ro", 0)),  # 7.5.2.2
    Object(  # 7.5.2.4: sub-index 0 counts the errors, 0 written to it clears them
        0x1003,
        "Pre-defined error field",
        Kind.ARRAY,
        (
            Entry("Number of errors", U8, "rw", 0),
            *(Entry(f"Standard error field {n}", U32, "ro", 0) for n in range(1, ERROR_HISTORY + 1)),
        ),
    ),
    # 7.5.2.13 and 7.5.2.14: all parameters at once; smaller portions are optional
    array(0x1010, "Store parameters", Entry("Save all parameters", U32, "rw", ON_COMMAND)),
    array(0x1011, "Restore default parameters", Entry("Restore all default parameters", U32, "rw", ON_COMMAND)),
    variable(0x1014, Entry("COB-ID EMCY", U32, "ro", f"{OWN_NODE_ID}+0x80")),  # 7.5.2.17
    variable(0x1015, Entry("Inhibit time EMCY", U16, "rw", 0)),  # 7.5.2.18
    array(  # 7.5.2.23: both 0, not configured
        0x1020,
        "Verify configuration",
        Entry("Configuration date", U32, "rw", 0),
        Entry("Configuration time", U32, "rw", 0),
    ),
    variable(0x1021, Entry("Store EDS", Type.DOMAIN, "ro", None)),  # 7.5.2.24
    variable(0x1022, Entry("Store format", U8, "ro", 0)),  # 7.5.2.25: 0, plain text
    record(  # 7.5.2.33
        0x1200,
        "SDO server parameter",
        Entry("COB-ID client to server (rx)", U32, "ro", f"{OWN_NODE_ID}+0x600"),
        Entry("COB-ID server to client (tx)", U32, "ro", f"{OWN_NODE_ID}+0x580"),
    ),
    variable(0x1F80, Entry("NMT startup", U32, "rw", SELF_STARTING)),  # CiA 302-2
)


def own_objects(table: Table, dialect: Dialect, node: Node) -> tuple[Object, ...]:
    """Give the communication objects whose values differ between nodes or come from the table."""
    return (
        # 7.5.2.8 to 7.5.2.10
        variable(0x1008, Entry("Manufacturer device name", Type.VISIBLE_STRING, "const", node.product_name)),
        variable(0x1009, Entry("Manufacturer hardware version", Type.VISIBLE_STRING, "const", table.hardware_version)),
        variable(0x100A, Entry("Manufacturer software version", Type.VISIBLE_STRING, "const", table.software_version)),
        array(0x1016, "Consumer heartbeat time", *watched(table, node)),  # 7.5.2.19
        variable(0x1017, Entry("Producer heartbeat time", U16, "rw", table.heartbeat)),  # 7.5.2.20
        record(  # 7.5.2.21
            0x1018,
            "Identity object",
            Entry("Vendor-ID", U32, "ro", table.vendor.number),
            Entry("Product code", U32, "ro", node.product_number),
            Entry("Revision number", U32, "ro", dialect.revision_number),
            Entry("Serial number", U32, "ro", table.serial_number),
        ),
        # 7.5.2.32
        array(0x1029, "Error behaviour", Entry("Communication error", U8, "rw", node.communication_error, 0, 2)),
    )


def watched(table: Table, node: Node) -> list[Entry]:
    """Give an entry for each other node: its Node-ID and the time to wait for it, or 0 if nobody waits."""
    times = [table.nodes[each].node_id << 16 | table.heartbeat_timeout for each in node.watches]
    unused = [0] * (len(table.nodes) - 1 - len(times))
    return [Entry(f"Consumer heartbeat time {n}", U32, "rw", time) for n, time in enumerate(times + unused, start=1)]


def clients(table: Table, node: Node) -> list[Object]:
    """Give an SDO client channel to each node that is watched, to read who it is (7.5.2.34)."""
    return [
        record(
            0x1280 + n,
            f"SDO client parameter {each}",
            Entry("COB-ID client to server (tx)", U32, "rw", 0x600 + table.nodes[each].node_id),
            Entry("COB-ID server to client (rx)", U32, "rw", 0x580 + table.nodes[each].node_id),
            Entry("Node-ID of the SDO server", U8, "rw", table.nodes[each].node_id, 1, 127),
        )
        for n, each in enumerate(node.watches)
    ]


# PDOs


class Pdo(NamedTuple):
    """One PDO of a node: its message, its COB-ID with the control bits, its mapping entries."""

    name: str
    cob_id: int
    mapping: tuple[int, ...]


def pdo_objects(base: PdoBase, pdos: list[Pdo], entries: int) -> list[Object]:
    """Give the communication and the mapping records of all PDOs of one direction, in the order of the list."""
    communication = [record(base.communication + n, pdo.name, *parameters(pdo)) for n, pdo in enumerate(pdos)]
    return communication + [mapping_record(base.mapping + n, pdo, entries) for n, pdo in enumerate(pdos)]


def parameters(pdo: Pdo) -> tuple[Entry, ...]:
    """Give the communication parameters of a PDO (7.5.2.35, 7.5.2.37)."""
    return (
        Entry("COB-ID used by PDO", U32, "rw", pdo.cob_id),
        Entry("Transmission type", U8, "rw", EVENT_DRIVEN),
        Entry("Inhibit time", U16, "rw", 0),
        Entry("Compatibility entry", U8, "rw", 0),
        Entry("Event timer", U16, "rw", 0),
    )


def mapping_record(index: int, pdo: Pdo, entries: int) -> Object:
    """Give the mapping of a PDO, padded to `entries` (7.5.2.36, 7.5.2.38)."""
    targets = [*pdo.mapping, *[0] * (entries - len(pdo.mapping))]
    return Object(
        index,
        f"{pdo.name} mapping",
        Kind.RECORD,
        (
            Entry("Number of mapped objects in PDO", U8, "rw", len(pdo.mapping), 0, entries),
            *(Entry(f"Application object {n}", U32, "rw", target) for n, target in enumerate(targets, start=1)),
        ),
    )


def sent(table: Table, name: Text) -> dict[Text, Message]:
    """Give the messages that the node sends, in the order of their COB-IDs."""
    return {key: each for key, each in by_identifier(table) if name in each.senders}


def received(table: Table, name: Text) -> dict[Text, Message]:
    """Give the messages for which the node has an RPDO, in the order of their COB-IDs."""
    return {key: each for key, each in by_identifier(table) if name in (*each.receivers, *each.listeners)}


def by_identifier(table: Table) -> list[tuple[Text, Message]]:
    """Give all messages in the order of their COB-IDs."""
    return sorted(table.messages.items(), key=lambda item: item[1].identifier)


def mapping_of(message: Message, data: dict[Text, Layout]) -> tuple[int, ...]:
    """Give the mapping entries of a message; none if it has no data."""
    return data[message.object].targets if message.object else ()


# Data and settings


def data_objects(layout: Layout, access: str) -> list[Object]:
    """Give a message's data: the object of its fields and, if the dialect cuts them, the object of their slices."""
    entries = (field_entry(name, each, access) for name, each in layout.fields.items())
    whole = record(layout.index, layout.name, *(each._replace(mappable=True) for each in entries))
    if not layout.cut:
        return [whole]
    slices = (slice_entry(each, layout.fields.get(each.field), access) for each in layout.cut)
    return [whole, record(layout.slices_index, f"{layout.name} slices", *slices)]


def slice_entry(part: Slice, whole: Field | None, access: str) -> Entry:
    """Give the entry of a slice of a field; padding is a slice of no field."""
    highest = (1 << part.bits) - 1
    default = default_of(whole) >> part.low & highest if whole else 0
    return Entry(part.name, unsigned(part.bits), access, default, 0, highest, mappable=True)


def settings(records: dict[Text, Record], node: Node) -> list[Object]:
    """Give the objects of a node's settings."""
    return [
        record(each.index, name, *(field_entry(key, entry, "rw", node) for key, entry in each.fields.items()))
        for name, each in records.items()
    ]


def field_entry(name: str, whole: Field, access: str, node: Node | None = None) -> Entry:
    """Give the entry of a whole field or of a setting."""
    return Entry(name, unsigned(whole.bits), access, default_of(whole, node), whole.low, whole.high)


def default_of(whole: Field, node: Node | None = None) -> int:
    """Give a field's default as a number; `node` is the one whose setting it is."""
    if isinstance(whole.default, Number):
        return whole.default
    return node.node_id if node and whole.default == OWN_NODE_ID else whole.codes[whole.default]


def unsigned(bits: int) -> Type:
    """Give the type of exactly as many bytes as the bits need, the only one that every tool accepts in a mapping."""
    return UNSIGNED[-(-bits // 8)]


# All of it


def object_dictionary(table: Table, dialect: Dialect, name: Text) -> list[Object]:
    """Give all objects of the node `name`, in the order of their indices."""
    node, data = table.nodes[name], layouts(table, dialect)
    objects = [*COMMON, *own_objects(table, dialect, node), *clients(table, node)]
    objects += [*pdos(table, name, data), *all_data(table, name, data)]
    objects += [*settings(table.settings, node), *settings(node.settings, node)]
    return sorted(objects, key=lambda each: each.index)


def pdos(table: Table, name: Text, data: dict[Text, Layout]) -> list[Object]:
    """Give the records of all PDOs of the node `name`."""
    entries = max(LEAST_ENTRIES, *(len(each.targets) for each in data.values()))
    receiving = [
        Pdo(key, each.identifier | (INVALID if name in each.listeners else 0), mapping_of(each, data))
        for key, each in received(table, name).items()
    ]
    sending = [Pdo(key, each.identifier | NO_RTR, mapping_of(each, data)) for key, each in sent(table, name).items()]
    return [*pdo_objects(RPDO, receiving, entries), *pdo_objects(TPDO, sending, entries)]


def all_data(table: Table, name: Text, data: dict[Text, Layout]) -> list[Object]:
    """Give the data objects that the PDOs of the node `name` map."""
    out = {each.object for each in sent(table, name).values()}
    come = {each.object for each in received(table, name).values()}
    mine = {key: ACCESS[key in out, key in come] for key in data if key in out | come}
    return [each for key, access in mine.items() for each in data_objects(data[key], access)]
