"""A device's DCF: its EDS with configured values and commissioning (CiA 306-1, 4.6 and 5); and concise DCFs.

Every value is read back to the byte. Bytes that a line of the file cannot hold, and every DOMAIN, are written into a
file beside the DCF, named by DownloadFile and UploadFile.

In the DCF of one node for another node of the same type, values that follow the node-ID are changed. A value follows
the node-ID if it is the default for its node: the file's `$NODEID+...`, the identifier of the pre-defined connection
set (CiA 301, 7.3.3), or the device's setting of its node-ID. For any other COB-ID, the user must choose whether the
other node gets the same one.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od.errors import DictionaryError, FieldError, UnknownName
from eurobot_od.od import standard, values
from eurobot_od.od.description import DescribedDevice, DescribedVariable
from eurobot_od.od.document import COMMISSIONING, OBJECT_LISTS, Document, Rewriting, is_text, read_bytes
from eurobot_od.od.modules import CONNECTED, is_of_modules
from eurobot_od.od.objects import data_type, value_text
from eurobot_od.od.values import (
    DEFAULT_PDO_BASES,
    DOMAIN,
    TIMES,
    UNICODE_STRING,
    VISIBLE_STRING,
    Address,
    Number,
    PdoDirection,
    Value,
    label,
    parse_number,
)
from eurobot_od.support.files import write_whole

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary


class ChosenCobIds(Enum):
    """Treatment of COB-IDs that do not follow the node-ID: they stay, or move by the same distance."""

    KEEP = "keep"
    MOVE = "move"


PREDEFINED = {
    standard.EMCY: values.EMCY_BASE,
    standard.SDO_REQUESTS: values.SDO_REQUEST_BASE,
    standard.SDO_ANSWERS: values.SDO_RESPONSE_BASE,
    **{
        (direction.value + number, values.COB_ID): base
        for direction, bases in DEFAULT_PDO_BASES.items()
        for number, base in enumerate(bases)
    },
}
"""COB-IDs of the pre-defined connection set without the node-ID, by object."""

FLAGS = values.NOT_VALID | values.NO_RTR
"""Bits of a COB-ID entry beside its identifier; the second is reserved for SDO and EMCY."""


def is_own_cob_id(address: Address) -> bool:
    """Return whether an object is the COB-ID of a service of the device itself: PDO, EMCY, SDO server."""
    index, sub = address
    is_pdo = index in values.COMMUNICATIONS and sub == values.COB_ID
    return is_pdo or address == standard.EMCY or (index in standard.SDO_SERVERS and sub in (1, 2))


def relative_text(variable: DescribedVariable, value: int, node_id: int, is_node_id: bool = False) -> str | None:
    """Return the text for a value that follows the node-ID, such as `$NODEID+0x180`; None if it does not.

    `is_node_id` marks the device's setting of its node-ID.
    """
    address = variable.index, variable.sub
    text = variable.section.text("defaultvalue")
    default = variable.read(text) if text else None
    if default and default.relative and default.at(node_id) == value:
        return text
    if is_node_id and value == node_id:
        return f"{values.NODE_ID}+0x0"
    base = default.value if default and default.relative else PREDEFINED.get(address)
    if base is None or not is_own_cob_id(address):
        return None
    follows = (value ^ (base + node_id)) & ~FLAGS == 0
    return f"{values.NODE_ID}+0x{value - node_id:X}" if follows else None


class ChosenCobId(NamedTuple):
    """A COB-ID in a DCF that does not follow the node-ID."""

    variable: DescribedVariable
    value: int

    def moved(self, distance: int) -> int:
        """Return the COB-ID moved by a distance; raises DictionaryError if it leaves 11 bits."""
        value = self.value + distance
        if (value ^ self.value) & ~values.BASE_IDENTIFIER or not value & values.BASE_IDENTIFIER:
            what = f"0x{values.identifier(self.value):03X} cannot be moved by {distance}"
            raise DictionaryError(label((self.variable.index, self.variable.sub)), None, what)
        return value


def following(device: DescribedDevice, node_id: int) -> Iterator[tuple[DescribedVariable, str]]:
    """Yield the variables of a DCF whose values follow the node-ID, with their texts."""
    for variable, value in _own_values(device):
        if text := relative_text(variable, value, node_id, variable is device.own_node_id):
            yield variable, text


def chosen_cob_ids(device: DescribedDevice, node_id: int) -> list[ChosenCobId]:
    """Return the valid COB-IDs of a DCF that neither follow the node-ID nor equal the type's default."""
    follow = {(each.index, each.sub) for each, _ in following(device, node_id)}
    found = []
    for variable, value in _own_values(device):
        address = variable.index, variable.sub
        is_stock = parse_number(variable.section.text("defaultvalue")) == Number(value)
        if is_own_cob_id(address) and address not in follow and not (is_stock or value & values.NOT_VALID):
            found.append(ChosenCobId(variable, value))
    return found


def _own_values(device: DescribedDevice) -> Iterator[tuple[DescribedVariable, int]]:
    """Yield the variables of a DCF with a number as ParameterValue."""
    for whole in device.objects.values():
        for variable in whole.variables():
            number = variable.read(variable.section.text("parametervalue"))
            if number and not number.relative:
                yield variable, number.value


def renumbered(dcf: Dictionary, node_id: int, chosen: ChosenCobIds | None = None) -> Dictionary:
    """Return a DCF for another node; a file that is not a DCF, or for this node already, is returned unchanged.

    `chosen` is the treatment of COB-IDs that do not follow the node-ID. Raises DictionaryError with a list of them if
    it is None, and for one that cannot be moved.
    """
    device = dcf.device
    former = dcf.device.commissioned_node_id
    if former in (None, node_id) or device.commissioning is None or former not in values.NODE_IDS:
        return dcf
    found = chosen_cob_ids(device, former)
    if found and chosen is None:
        raise DictionaryError(dcf.file, None, _question(found, former, node_id))
    rewriting = Rewriting(device.document)
    for variable, text in following(device, former):
        rewriting.set(variable.section, "ParameterValue", text)
    if chosen is ChosenCobIds.MOVE:
        for each in found:
            rewriting.set(each.variable.section, "ParameterValue", f"0x{each.moved(node_id - former):X}")
    rewriting.set(device.commissioning, "NodeID", node_id)
    return type(dcf).read(rewriting.text().encode(dcf.normal.encoding), dcf.file, node_id, dcf.name)


def _question(found: list[ChosenCobId], former: int, node_id: int) -> str:
    """Return the error about COB-IDs without a chosen treatment."""
    listed = ", ".join(
        f"{label((each.variable.index, each.variable.sub))} {_owner(each.variable.index)} "
        f"0x{values.identifier(each.value):03X}"
        for each in found
    )
    return (
        f"is of node {former}; these COB-IDs do not follow the node-ID: {listed}; for node {node_id} "
        f"keep them (--keep-cob-ids), or move them by {node_id - former} (--move-cob-ids)"
    )


def _owner(index: int) -> str:
    for direction in PdoDirection:
        if index in values.COMMUNICATION_RECORDS[direction]:
            return f"{direction.name}{index - direction.value + 1}"
    return "EMCY" if index == standard.EMCY[0] else "SDO"


NOT_SAID = {"NetNumber": 0, "NetworkName": "", "CANopenManager": 0, "LSS_SerialNumber": ""}
"""Other keys of the commissioning, with their values if unknown."""

COB_ID_DIGITS = 8
"""Hexadecimal digits of a COB-ID, which is an UNSIGNED32."""

UNICODE_BYTES = "utf-16-le"
"""Encoding of a UNICODE_STRING in an SDO (CiA 301, 7.1.6.5)."""


OF_ONE_DEVICE = ("ParameterValue", "UploadFile", "DownloadFile")
"""Keys of values that only a DCF has."""


class FileBeside(NamedTuple):
    """Stands for a value that is in the file `name` beside the DCF."""

    name: str


DcfValue: TypeAlias = "Value | FileBeside"


class Dcf(NamedTuple):
    """A DCF: its `content`, and the `files` beside it by name."""

    content: bytes
    files: dict[str, bytes]

    def write(self, file: Path) -> None:
        """Write the DCF after the files beside it, so that an existing DCF is complete; raises OSError."""
        for name, content in self.files.items():
            write_whole(file.with_name(name), content)
        write_whole(file, self.content)


# Bytes of objects


def with_contents(
    eds: Dictionary, contents: Mapping[Address, bytes], node_id: int, node_name: str, baudrate_kbit: int, stem: str
) -> Dcf:
    """Return the DCF of a device whose objects have these bytes, in the encoding of its EDS.

    The names of the files beside it begin with `stem`. Raises UnknownName for an object that the EDS does not describe,
    FieldError for bytes that do not fit its type.
    """
    values: dict[Address, DcfValue] = {}
    files: dict[str, bytes] = {}
    for (index, sub), data in contents.items():
        values[index, sub] = _value(eds, (index, sub), data)
        # An empty ParameterValue would mean "no value", and a line end would break the file.
        if values[index, sub] is None:
            values[index, sub] = beside = FileBeside(f"{stem}-{index:04X}-{sub}.bin")
            files[beside.name] = data
    name = node_name if is_text(node_name, eds.normal.encoding) else ""
    text = with_values(eds.device, values, node_id, name, baudrate_kbit)
    return Dcf(text.encode(eds.normal.encoding), files)


def content(dcf: Dictionary, address: Address) -> bytes | None:
    """Return the bytes that a DCF has for an object without a fixed length; None if it has none.

    Raises DictionaryError for a file beside it that cannot be read, and for a value that does not fit the object.
    """
    variable = dcf.members[address[0]][address[1]]
    type_ = data_type(variable)
    file: str = getattr(variable, "download_file", "")
    where = f"sub {address[1]} ({variable.name})"
    if file:
        try:
            return read_bytes(dcf.file.parent / file)
        except DictionaryError as error:
            raise DictionaryError(dcf.file, address[0], f"{where}: DownloadFile {error}") from error
    if variable.value is None and value_text(variable):  # canopen drops a value that does not fit
        raise DictionaryError(dcf.file, address[0], f"{where}: {value_text(variable)!r} is not {type_.name}")
    value = variable.value or None
    if not isinstance(value, str):
        return None if value is None else type_.write(value)
    return value.encode(dcf.normal.encoding if type_ == VISIBLE_STRING else UNICODE_BYTES)


def _value(eds: Dictionary, address: Address, data: bytes) -> Value:
    """Return the DCF's value for an object's bytes, or None if only a file can hold them."""
    variable = eds.variable(address)
    if variable is None:
        raise UnknownName("object", label(address))
    type_ = data_type(variable)
    encoding = eds.normal.encoding
    if type_.size:
        try:
            return type_.read(data)
        except ValueError as error:
            raise FieldError(label(address), variable.name, data.hex(), str(error)) from None
    text = data.hex().upper()
    if type_ in (VISIBLE_STRING, UNICODE_STRING):
        try:
            text = data.decode(encoding if type_ == VISIBLE_STRING else UNICODE_BYTES)
        except UnicodeDecodeError:
            return None
    # The encoding of a file is detected from bytes that are not UTF-8, which such a text might change.
    is_safe = type_ != UNICODE_STRING or text.isascii() or encoding == "utf-8"
    # In a file, `ParameterValue=` means that there is no value.
    return text if type_ != DOMAIN and text and is_safe and is_text(text, encoding) else None


# The file


def with_values(
    device: DescribedDevice, values: Mapping[Address, DcfValue], node_id: int, node_name: str, baudrate_kbit: int
) -> str:
    """Return the DCF of a device: its EDS (or DCF) with ParameterValues and a commissioning.

    `device` is read from the normal form of its file. Numbers are written in the form of the object's DefaultValue,
    bytes in hexadecimal digits, values that follow the node-ID as `$NODEID+...`; None leaves a value unchanged. The
    commissioning is last, so that a truncated file has none. Lines end in LF.
    Raises UnknownName for an address that the EDS does not describe, FieldError for a value that no line can hold.
    """
    rewriting = Rewriting(device.document)
    for (index, subindex), value in values.items():
        if value is not None:
            variable = device.variable(index, subindex) if subindex >= 0 else None
            if variable is None:
                raise UnknownName("object", label((index, subindex)))
            is_node_id = variable is device.own_node_id
            relative = relative_text(variable, value, node_id, is_node_id) if isinstance(value, int) else None
            _set(rewriting, variable, value, relative)
    _become_dcf(rewriting, device)
    own = {"NodeID": node_id, "NodeName": node_name if is_text(node_name, "utf-8") else "", "Baudrate": baudrate_kbit}
    rewriting.append(COMMISSIONING, own | NOT_SAID)
    return rewriting.text()


def _become_dcf(rewriting: Rewriting, device: DescribedDevice) -> None:
    """Set FileName and LastEDS, and drop the previous commissioning."""
    info = device.section("fileinfo")
    if info and not info.text("lasteds"):
        eds = info.text("filename")
        # LastEDS is the EDS that a DCF was made from (CiA 306); a DCF made from a DCF keeps it.
        rewriting.set(info, "LastEDS", eds)
        rewriting.set(info, "FileName", f"{eds.rpartition('.')[0]}.dcf")
    if device.commissioning:
        rewriting.drop(device.commissioning)


def eds_text(dictionary: Dictionary, file_name: str) -> str:
    """Return the EDS of a device: its file in normal form, without values of a single device.

    Objects of connected modules become its own. Lines end in LF.
    """
    device = dictionary.device
    rewriting = Rewriting(device.document)
    left_out = {COMMISSIONING.lower(), "devicecommissioning", CONNECTED}
    for name, section in device.document.sections.items():
        if name in left_out or (dictionary.normal.has_modules and is_of_modules(name)):
            rewriting.drop(section)
    for _, section in device.object_sections:
        for key in OF_ONE_DEVICE:
            rewriting.unset(section, key)
    info = device.section("fileinfo")
    if info:
        rewriting.set(info, "FileName", file_name)
        rewriting.unset(info, "LastEDS")
    return rewriting.text()


def missing(document: Document) -> list[str]:
    """Return the sections that a file announces and lacks: listed objects, and counted sub-indices."""
    members = Counter(name.partition("sub")[0] for name in document.sections if "sub" in name)
    wanted = [name for each in OBJECT_LISTS for name in _listed(document, each)]
    counts = [(name, parse_number(document.text(name.lower(), "subnumber"))) for name in wanted]
    absent = [name for name in wanted if name.lower() not in document.sections]
    return absent + [f"{name}sub" for name, count in counts if count and members[name.lower()] < count.value]


def _listed(document: Document, name: str) -> Iterator[str]:
    """Yield the section names in a list of objects; the list's own name if a required list is missing."""
    section = document.sections.get(name.lower())
    if section is None:
        if name == OBJECT_LISTS[0]:  # a device need not have any other objects (CiA 306-1, 4.6.1)
            yield name
        return
    yield from (entry.value.lower().removeprefix("0x").zfill(4).upper() for entry in section.numbered())


def _set(rewriting: Rewriting, variable: DescribedVariable, value: Value | FileBeside, relative: str | None) -> None:
    """Set a variable's value, or `relative` in its place, and remove other keys of values."""
    if isinstance(value, FileBeside):
        entries = {"UploadFile": value.name, "DownloadFile": value.name}
    else:
        entries = {"ParameterValue": relative or _written(variable, value)}
    for key in OF_ONE_DEVICE:
        # With both a value and a file, tools would disagree.
        if key in entries:
            rewriting.set(variable.section, key, entries[key])
        else:
            rewriting.unset(variable.section, key)


def _written(variable: DescribedVariable, value: DcfValue) -> str:
    if variable.type and variable.type.code in TIMES:  # a file has a time as one number
        value = int.from_bytes(variable.type.write(value if isinstance(value, (str, int, bytes)) else ""), "little")
    if isinstance(value, bytes) and variable.type not in (VISIBLE_STRING, UNICODE_STRING):
        return value.hex().upper()
    if isinstance(value, int):
        like = variable.section.text("defaultvalue").lower()
        if value < 0 or not like.startswith(("0x", "$nodeid")):
            return str(int(value))  # not `True`
        return f"0x{value:0{len(like) - 2 if like.startswith('0x') else COB_ID_DIGITS}X}"
    text = str(value)
    if isinstance(value, (bytes, FileBeside)) or not is_text(text, "utf-8"):
        raise FieldError(label((variable.index, variable.sub)), variable.name, value, "what a line of a DCF can hold")
    return text


COUNT = struct.Struct("<I")
HEAD = struct.Struct("<HBI")
"""Formats of the number of entries, and of index, sub-index and length of an entry."""


class Truncated(ValueError):
    """A concise DCF that ends too early, or has bytes after its end."""


class Write(NamedTuple):
    """One write: an object's address and its new bytes."""

    address: Address
    data: bytes


def pack(entries: Iterable[tuple[Address, bytes]]) -> bytes:
    """Return the concise DCF of writes, in order."""
    packed = [HEAD.pack(*address, len(data)) + data for address, data in entries]
    return COUNT.pack(len(packed)) + b"".join(packed)


def unpack(data: bytes) -> list[Write]:
    """Return the writes of a concise DCF; raises Truncated."""
    (count,) = COUNT.unpack(_part(data, 0, COUNT.size))
    place = COUNT.size
    entries = list[Write]()
    for _ in range(count):
        index, subindex, length = HEAD.unpack(_part(data, place, HEAD.size))
        entries.append(Write((index, subindex), _part(data, place + HEAD.size, length)))
        place += HEAD.size + length
    if place != len(data):  # an earlier length was wrong
        raise Truncated(f"{len(data) - place} bytes after the last of {count} entries")
    return entries


def _part(data: bytes, place: int, length: int) -> bytes:
    part = data[place : place + length]
    if len(part) < length:
        raise Truncated(f"ends at byte {len(data)}, {length} bytes expected at byte {place}")
    return part
