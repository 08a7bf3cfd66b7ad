"""The files that a protocol table makes: the EDS of each node, as every CANopen tool accepts it, and a network file.

The same table gives the same bytes: no clock, no random number, no order that may change. So a file in a repository
can be checked against its table, and a difference is a change of the protocol.

CiA 306 leaves room, and tools differ in what they take. They all take this: dcf-tools, objdictgen, EDSSharp, Lely,
CANopenNode, CanFestival, canmatrix and canopen.

- The number of PDOs as `NrOfRXPDO` and `NrOfTXPDO`, in that spelling.
- A value that depends on the node-ID begins with it: `$NODEID+0x80`.
- All of Dummy0001 to Dummy0007, and in [Comments] as many lines as `Lines` says.
- A DefaultValue in sub-index 0 of every record, too.
- No Unit, no Factor, no Description of an object and no section of our own: checkers refuse what they do not know.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml
from canopen.objectdictionary import ODArray, ODVariable

from eurobot_od.od.description import ObjectCode
from eurobot_od.od.document import BIT_RATES, OBJECT_LISTS
from eurobot_od.od.make import NodeRow, Table
from eurobot_od.od.make.objects import DictionaryObject, object_dictionary
from eurobot_od.od.normal import list_of
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import COMMUNICATION_RECORDS, DUMMIES, UNSIGNED32, PdoDirection
from eurobot_od.support.yaml_places import PlacedText

KeyValues = list[tuple[str, object]]
EdsSection = tuple[str, KeyValues]


def eds_text(table: Table, dialect_name: PlacedText, node_name: PlacedText) -> str:
    """Return the whole EDS file of a node in a dialect."""
    dialect = table.dialects[dialect_name]
    objects = object_dictionary(table, dialect, node_name)
    sections: list[EdsSection] = [
        file_info(table, dialect_name, node_name),
        device_info(table, dialect.revision_number, table.nodes[node_name], objects),
        ("DummyUsage", [(f"Dummy{each:04X}", 0) for each in DUMMIES]),
        ("Comments", [("Lines", 1), ("Line1", table.file.comment)]),
        *object_lists(objects),
        *(section for each in objects for section in object_sections(each)),
    ]
    return "\n".join(f"[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys) for name, keys in sections)


def file_info(table: Table, dialect_name: PlacedText, node_name: PlacedText) -> EdsSection:
    """Return [FileInfo]; creation and modification are the table's fixed date."""
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


def device_info(table: Table, revision: int, node: NodeRow, objects: Iterable[DictionaryObject]) -> EdsSection:
    """Return [DeviceInfo]. `RevisionNumber` is the dialect's: nodes compare it to find out whether they agree."""
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


def object_lists(objects: Iterable[DictionaryObject]) -> Iterator[EdsSection]:
    """Give the three lists of objects (CiA 306-1, 4.6.1)."""
    lists: dict[str, list[int]] = {name: [] for name in OBJECT_LISTS}
    for index in (each.index for each in objects):
        lists[list_of(index)].append(index)
    for name, indices in lists.items():
        numbered = ((str(n), f"0x{index:04X}") for n, index in enumerate(indices, start=1))
        yield name, [("SupportedObjects", len(indices)), *numbered]


def object_sections(whole: DictionaryObject) -> list[EdsSection]:
    """Return the section of an object, and those of its sub-indices."""
    if isinstance(whole, ODVariable):
        return [(f"{whole.index:04X}", entry_keys(whole))]
    code = ObjectCode.ARRAY if isinstance(whole, ODArray) else ObjectCode.RECORD
    head: KeyValues = [
        ("ParameterName", whole.name),
        ("ObjectType", f"0x{code.value:X}"),
        ("SubNumber", len(whole.subindices)),
    ]
    subs = [(f"{whole.index:04X}sub{sub:X}", entry_keys(each)) for sub, each in whole.subindices.items()]
    return [(f"{whole.index:04X}", head), *subs]


def entry_keys(variable: ODVariable) -> KeyValues:
    """Return the keys of a VAR or a sub-index; limits and default only where there are any."""
    type_ = data_type(variable)
    form = "0x{:08X}" if type_ is UNSIGNED32 else "{}"  # COB-IDs, mappings and identities are read in hexadecimal
    values = {"LowLimit": variable.min, "HighLimit": variable.max, "DefaultValue": variable.default}
    given = ((key, value) for key, value in values.items() if value is not None)
    return [
        ("ParameterName", variable.name),
        ("ObjectType", f"0x{ObjectCode.VAR.value:X}"),
        ("DataType", f"0x{type_.code:04X}"),
        ("AccessType", variable.access_type),
        *((key, value if isinstance(value, str) else form.format(value)) for key, value in given),
        ("PDOMapping", int(variable.pdo_mappable)),
    ]


# The files: written into a folder, or compared with what is there


NETWORK = "network.yaml"
HEAD = """\
# {}
# The network of dialect {} for `eurobot-od lint --network` and `load`: files and node-IDs of the nodes, messages that
# several of them send, the order of priorities, the most urgent first, and how often what is sent.
"""
LINE = 120
"""No text of the network file is broken before this column."""
Texts = dict[str, str]
"""What the files say, by their paths below the folder."""


def make_files(table: Table) -> Texts:
    """Return the text of every file: `DIALECT/NODE.eds`, and the network file."""
    pairs = product(table.dialects, table.nodes)
    texts = {f"{dialect}/{node}.eds": eds_text(table, dialect, node) for dialect, node in pairs}
    return {**texts, NETWORK: network_text(table)}


def network_text(table: Table) -> str:
    """Return the network of the table's first dialect, for `eurobot-od lint --network` and `load`.

    Identifiers are priorities on a CAN bus, so the order of the messages is the order of their identifiers.
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
        network["traffic"] = {  # as plain texts: PyYAML's safe_dump refuses a `Text`
            str(name): {key: str(value) for key, value in vars(row).items() if value}
            for name, row in table.traffic.items()
        }
    return HEAD.format(table.file.comment, dialect) + yaml.safe_dump(network, sort_keys=False, width=LINE)


def write_files(texts: Texts, folder: Path) -> None:
    """Write every file below `folder`; what was there before is whole until all new files are. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in texts:
        (folder / path).parent.mkdir(exist_ok=True)
    with TemporaryDirectory(dir=folder, prefix=".make-eds-") as scratch:  # a full disk is met here
        for number, text in enumerate(texts.values()):
            Path(scratch, str(number)).write_bytes(text.encode("ascii"))  # bytes: no line ends of the system's own
        for number, path in enumerate(texts):
            Path(scratch, str(number)).replace(folder / path)


def differences(texts: Texts, folder: Path) -> list[str]:
    """Say in one line each which files below `folder` differ, are missing, or should not be there.

    Only an EDS file in a dialect's folder can be too many: it would be loaded as a node. Raises OSError.
    """
    dialects = {path.partition("/")[0] for path in texts if path != NETWORK}
    there = {each.relative_to(folder).as_posix() for name in dialects for each in (folder / name).glob("*.eds")}
    lines = {path: difference(text, folder / path) for path, text in texts.items()}
    lines |= dict.fromkeys(there - texts.keys(), "should not be there")
    return [f"{folder / path}: {what}" for path, what in sorted(lines.items()) if what]


def difference(text: str, file: Path) -> str:
    """Say in which line a file first differs from `text`; nothing if it does not."""
    try:
        pairs = zip_longest(text.encode("ascii").split(b"\n"), file.read_bytes().split(b"\n"))
    except FileNotFoundError:
        return "is missing"
    return next((f"differs first in line {n}" for n, (new, old) in enumerate(pairs, start=1) if new != old), "")
