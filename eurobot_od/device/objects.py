"""Objects of a running device: present values, access rights, values in SDOs, and stores for settings.

A value is checked before it is kept, and a refused one changes nothing. Access type, data type and limits come from the
file. Special behaviour of an object is a function in `readers` or `writers`.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

from eurobot_od.device.lss import Commissioning
from eurobot_od.errors import Cause, DamagedFile, DictionaryError, FieldError, Refused, UnknownName
from eurobot_od.od import dcf, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import COMMISSIONING, parse, read_bytes
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import data_type, initial, limits
from eurobot_od.od.pdos import Part, part_of
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.standard import (
    COMMANDS,
    EMCY,
    IDENTITY,
    SDO_ANSWERS,
    SDO_REQUESTS,
    SYNC,
    TIME,
    UNCONFIGURED,
    VERIFY_CONFIGURATION,
)
from eurobot_od.od.values import COB_ID, Address, Value, label, parse_number, pdo_of
from eurobot_od.sdo.wire import LARGEST, Abort, Reason
from eurobot_od.support.files import write_whole

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

COMMUNICATION_PROFILE = range(0x1000, 0x2000)
"""Indices of communication objects, which a reset of the communication restores (CiA 301, 7.3.2.2.3)."""

PARAMETERS = {*COMMUNICATION_PROFILE} - {*COMMANDS, *values.MAPPINGS}
"""Communication objects to which their present value may always be written, even where the file contradicts itself.
Mappings are not among them: CiA 301 asks for its procedure whatever is written."""

OnRead = Callable[[int], Value]
"""Function that returns the value of an object at a sub-index; may raise Abort."""

OnWrite = Callable[[Address, Value], None]
"""Function that writes an object; raises Abort for a refused value."""

OnTold = Callable[[Any], object]
"""Function that is called with each new value from an SDO or RPDO; raises Refused for one that must not be kept."""

REFUSAL: Mapping[Cause, Reason] = {Cause.STATE: Reason.REFUSED_NOW, Cause.VALUES: Reason.REFUSED_VALUE}
"""Abort reasons for writes that the application refuses, by its cause."""

LONGEST_TEXT = 1 << 16
"""Longest value of an object without a fixed length, except DOMAINs, in bytes."""

NO_VALUES: Mapping[Address, Value] = MappingProxyType({})
TELL_NOBODY: Mapping[Address, OnTold] = MappingProxyType({})


def is_stored(dictionary: Dictionary, address: Address) -> bool:
    """Return whether 0x1010 stores an object: every parameter, and 0x1020."""
    return address in VERIFY_CONFIGURATION or address in dictionary.parameters


def unrestricted(objects: Objects, write: OnWrite) -> OnWrite:
    """Return the writer of a COB-ID that refuses a new identifier of another service (CiA 301, 7.3.5)."""

    def written(address: Address, value: Value) -> None:
        cob_id = value & values.BASE_IDENTIFIER if isinstance(value, int) else 0
        is_new = cob_id and cob_id != objects.raw(address) & values.BASE_IDENTIFIER
        if is_new and values.owner(cob_id, values.RESTRICTED):
            raise Abort(Reason.COB_ID_TAKEN)
        write(address, value)

    return written


def out_of_limits(variable: ODVariable, value: Value) -> Reason | None:
    """Return why a number is outside the limits in the file; None if it is inside, or not a number."""
    range_ = limits(variable)
    if range_ is not None and isinstance(value, (int, float)):
        if value > range_.high:
            return Reason.ABOVE_LIMIT
        if value < range_.low:
            return Reason.BELOW_LIMIT
    return None


class Objects:
    """The values of a device by address; `values` has those that differ from the file's.

    A `given` value replaces the file's; functions in `told` are called with each new value.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        readers: Mapping[int, OnRead],
        writers: Mapping[int, OnWrite],
        given: Mapping[Address, Value] = NO_VALUES,
        told: Mapping[Address, OnTold] = TELL_NOBODY,
    ) -> None:
        self.dictionary = dictionary
        self.values: dict[Address, Value] = {}
        self._readers, self._writers, self._told = readers, writers, told
        self._defaults = dict(given)
        self._parts: dict[Address, Part | None] = {}
        self._mapped: tuple[dict[Address, Value], Dictionary] = {}, dictionary

    # For the device

    def value(self, address: Address) -> Value:
        """Return an object's present value, from its reader or as kept; raises Abort if the reader does."""
        part = self._part(address)
        if part is not None:
            return part.of(self.raw(part.whole))
        reader = self._readers.get(address[0])
        return self.kept(address) if reader is None else reader(address[1])

    def kept(self, address: Address) -> Value:
        """Return the value that was last written or received, else the given one, else the file's."""
        if address in self.values:
            return self.values[address]
        if address not in self._defaults:  # cached, because a PDO needs the same few at each SYNC
            self._defaults[address] = self.dictionary.default(address)
        return self._defaults[address]

    def raw(self, address: Address) -> int:
        """Return a value as the bits in a PDO; 0 without a value, or for one of a wrong type.

        A negative number is returned as such: its bits are those of its two's complement at any width.
        """
        try:
            value = self.value(address)
            if isinstance(value, int):
                return value
            variable = self.dictionary.variable(address)
            return 0 if variable is None else int.from_bytes(data_type(variable).write(value), "little")
        except (Abort, ValueError, OverflowError):  # a PDO cannot omit a value
            return 0

    def number(self, address: Address) -> int:
        """Return a value that must be a number; raises DictionaryError."""
        value = self.value(address)
        if not isinstance(value, int):
            raise DictionaryError(self.dictionary.file, address[0], f"sub {address[1]} has no number as its value")
        return value

    def quantity(self, address: Address) -> float:
        """Return a value that must be a number, a float for a REAL; raises DictionaryError."""
        value = self.value(address)
        return value if isinstance(value, float) else self.number(address)

    def cob_id(self, address: Address) -> int | None:
        """Return the 11-bit identifier in an object, None if it is not valid or missing."""
        return values.base_identifier(self.value(address))

    def put(self, address: Address, value: Value) -> None:
        """Keep a value without checks; a slice is put into the whole value.

        Raises Refused if the application does not accept it.
        """
        if address in self._told:  # first, because the application may refuse it
            self._told[address](value)
        part = self._part(address)
        if part is None or not isinstance(value, int):
            self.values[address] = value
        else:
            whole = self.kept(part.whole)
            self.values[part.whole] = part.put(whole if isinstance(whole, int) else 0, value)

    def _part(self, address: Address) -> Part | None:
        if address not in self._parts:
            self._parts[address] = part_of(self.dictionary.objects, self.dictionary.variable(address))
        return self._parts[address]

    def configuration(self) -> dict[Address, Value]:
        """Return the changed settings, for 0x1010 to store."""
        in_force = self._in_force()
        return {address: value for address, value in self.values.items() if is_stored(in_force, address)}

    def _in_force(self) -> Dictionary:
        """Return the dictionary with the present mappings."""
        present = {address: value for address, value in self.values.items() if pdo_of(address[0]) is not None}
        if present != self._mapped[0]:
            self._mapped = present, self.dictionary.configured(present)
        return self._mapped[1]

    # For the SDO server

    def read(self, address: Address) -> bytes:
        """Return an object's value as bytes for an SDO; raises Abort."""
        variable = self._variable(address)
        if not variable.readable:
            raise Abort(Reason.WRITE_ONLY if variable.writable else Reason.NO_ACCESS)
        type_ = data_type(variable)
        try:
            value = self.value(address)
            if type_ == values.VISIBLE_STRING and isinstance(value, str):
                return value.encode(self.dictionary.normal.encoding)
            if value is None and type_.size:  # a number always has a value
                return initial(variable) or bytes(type_.size)
            return type_.write(value)
        except (DictionaryError, ValueError, OverflowError) as error:
            # The file's default does not fit the data type.
            raise Abort(Reason.NO_VALUE, str(error)) from error

    def admit(self, address: Address, size: int | None) -> int:
        """Return the largest length of an object's value; raises Abort if it is read-only, or `size` does not fit."""
        variable = self._variable(address)
        if not variable.writable:
            raise Abort(Reason.READ_ONLY if variable.readable else Reason.NO_ACCESS)
        type_ = data_type(variable)
        room = type_.size or (LARGEST if type_ == values.DOMAIN else LONGEST_TEXT)
        if size is not None and size > room:
            # A text or a DOMAIN has no fixed size, and can only exceed the memory (CiA 301, Table 22).
            raise Abort(Reason.LONGER_THAN_TYPE if type_.size else Reason.OUT_OF_MEMORY)
        if size is not None and size < type_.size:
            raise Abort(Reason.SHORTER_THAN_TYPE)
        return room

    def write(self, address: Address, data: bytes) -> None:
        """Write an object's value from an SDO, with all effects; raises Abort."""
        self.admit(address, len(data))
        variable, before = self._variable(address), self.kept(address)
        value = data_type(variable).read(data)
        # The limits of a command apply only to its read value.
        if address[0] not in COMMANDS and (wrong := out_of_limits(variable, value)):
            raise Abort(wrong)
        if value == before and address[0] in PARAMETERS:
            return
        try:
            self._writers.get(address[0], self.put)(address, value)
        except Refused as refused:
            raise Abort(REFUSAL[refused.cause], str(refused)) from refused
        if self.kept(address) != before and address in self._in_force().parameters:
            # A changed configuration is no longer verified (CiA 301, 7.5.2.23).
            self.values |= {mark: 0 for mark in VERIFY_CONFIGURATION if self.dictionary.variable(mark)}

    def _variable(self, address: Address) -> ODVariable:
        variable = self.dictionary.variable(address)
        if variable is None:
            known = address[0] in self.dictionary.objects.indices
            raise Abort(Reason.NO_SUBINDEX if known else Reason.NO_OBJECT)
        return variable


# Values that a file omits: default COB-IDs (CiA 301, 7.3.3), identity


BROADCASTS: Mapping[Address, int] = {SYNC: values.SYNC_COB_ID, TIME: values.TIME_COB_ID}

BASES: Mapping[Address, int] = {
    EMCY: values.EMCY_BASE,
    **{
        (direction.value + number, COB_ID): base
        for direction, bases in values.DEFAULT_PDO_BASES.items()
        for number, base in enumerate(bases)
    },
}
"""Default COB-IDs without the node-ID, by address."""


def predefined(dictionary: Dictionary) -> dict[Address, int]:
    """Return values for objects without a value in the file: default COB-IDs, and the identity."""
    identifiers = {**BROADCASTS, **{address: base + dictionary.node_id for address, base in BASES.items()}}
    # An identifier in the file is used even if it is not valid.
    silent = (each for each in identifiers if each[1] in dictionary.members.get(each[0], ()))
    identity = {(IDENTITY, sub): number for sub, number in enumerate(Identity.of(dictionary), start=1) if number}
    # Not for an identity object with another data type than CiA 301's.
    identity = {at: number for at, number in identity.items() if _fits(dictionary.variable(at), number)}
    given = {address: identifiers[address] for address in silent if dictionary.default(address) is None}
    # The real COB-IDs of the server, which may differ from the file's.
    server = zip((SDO_REQUESTS, SDO_ANSWERS), SdoChannel.of(dictionary), strict=True)
    return identity | given | {address: cob_id for address, cob_id in server if dictionary.variable(address)}


def _fits(variable: ODVariable | None, number: int) -> bool:
    return variable is not None and number <= data_type(variable).high


KIND: tuple[Address, ...] = tuple((IDENTITY, sub) for sub in (1, 2, 3))
"""Addresses of vendor-ID, product code and revision number, which must be equal in a configuration and its device."""

CHECKSUM = re.compile(rb"; CRC-32 of all that follows: 0x([0-9A-F]{8})\n")
"""Pattern of the first line of a stored file, which is a comment in a DCF."""


class Store(Protocol):
    """Keeps the values of a device's configuration that differ from its file."""

    def load(self) -> dict[Address, Value]:
        """Return the saved values, empty if none were saved.

        Raises DamagedFile for damaged values, DictionaryError for those of another device.
        """

    def save(self, values: Mapping[Address, Value], node_id: int, kbit: int | None = None) -> None:
        """Replace the saved values, node-ID (255: none) and bit rate in kbit/s (None: unchanged).

        Raises OSError or DictionaryError.
        """


class MemoryStore:
    """A store in memory, with initial `values`."""

    def __init__(self, values: Mapping[Address, Value]) -> None:
        self._values = dict(values)

    def load(self) -> dict[Address, Value]:
        """Return the settings."""
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], _node_id: int, _kbit: int | None = None) -> None:
        """Keep these settings."""
        self._values = dict(values)


class FileStore:
    """A store in the DCF `file`, for the device described by `dictionary`."""

    def __init__(self, file: str | Path, dictionary: Dictionary, baudrate_kbit: int = 500) -> None:
        self.file = Path(file)
        self._dictionary, self._baudrate = dictionary, baudrate_kbit

    @property
    def commissioned(self) -> Commissioning | None:
        """Node-ID (255 for none) and bit rate in the file; None without a file, or without a node-ID in it."""
        if not self.file.exists():
            return None
        text = parse(read_bytes(self.file).decode("latin-1")).text
        node_id, kbit = (parse_number(text(COMMISSIONING.lower(), key)) for key in ("nodeid", "baudrate"))
        if node_id is None or node_id.value not in (*values.NODE_IDS, UNCONFIGURED):
            return None
        return Commissioning(node_id.value, kbit.value if kbit else self._baudrate)

    def load(self) -> dict[Address, Value]:
        """Return the settings in the file; empty without a file.

        A DCF from another program has no checksum, and is accepted. Raises DamagedFile for a wrong checksum,
        DictionaryError if the file is not a DCF, is incomplete, or is that of another device.
        """
        if not self.file.exists():
            return {}
        content = read_bytes(self.file)
        line = CHECKSUM.match(content)
        # Checked first, because a damaged file may still be a valid DCF.
        if line and int(line[1], 16) != zlib.crc32(content[line.end() :]):
            what = "damaged: the checksum in its first line is not that of the rest (changed by hand? delete that line)"
            raise DamagedFile(self.file, None, what)
        is_without = (said := self.commissioned) and said.node_id == UNCONFIGURED
        stored = Dictionary.load(self.file, self._dictionary.node_id if is_without else None)
        # Sections that the EDS lacks, too, are not missing.
        never_there = dcf.missing(self._dictionary.document)
        for section in dcf.missing(stored.document):
            if section not in never_there:
                raise DictionaryError(self.file, None, f"incomplete: [{section}] is missing")
        # Without the serial number, so that a replacement device can use the configuration.
        for index, sub in KIND:
            ours = self._dictionary.default((index, sub))
            theirs = stored.default((index, sub))
            if ours != theirs:
                what = f"sub {sub} is {theirs!r}, not {ours!r}: the configuration of another device"
                raise DictionaryError(self.file, index, what)
        variables = {each: stored.variable(each) for each in stored.addresses() if is_stored(stored, each)}
        # A DefaultValue is not a stored value, because a later EDS may have another one.
        return {a: v.value for a, v in variables.items() if v is not None and v.writable and v.value is not None}

    def save(self, values: Mapping[Address, Value], node_id: int, kbit: int | None = None) -> None:
        """Replace the file by one with these settings.

        Raises OSError, or DictionaryError if the EDS has no place for a value; the old file is then kept.
        """
        device = self._dictionary.device
        self._baudrate = kbit or self._baudrate
        try:
            content = dcf.with_values(device, values, node_id, self._dictionary.name, self._baudrate).encode()
        except (UnknownName, FieldError, UnicodeEncodeError) as error:
            raise DictionaryError(self._dictionary.file, None, f"no place in its DCF: {error}") from error
        write_whole(self.file, b"; CRC-32 of all that follows: 0x%08X\n" % zlib.crc32(content) + content)


def refused(dictionary: Dictionary, values: Mapping[Address, Value]) -> Iterator[tuple[Address, str]]:
    """Yield the stored values that a device cannot use: unknown objects, and values outside the limits."""
    for address, value in values.items():
        variable = dictionary.variable(address)
        if variable is None:
            yield address, f"{label(address)} is not an object of the device"
            continue
        try:
            data_type(variable).write(value)
            fits = out_of_limits(variable, value) is None
        except (ValueError, OverflowError):  # the object has another data type in this EDS
            fits = False
        if not fits:
            range_ = limits(variable)
            allowed = data_type(variable).name if range_ is None else f"{range_.low}..{range_.high}"
            what = f"{label(address, variable.name)} = {value!r}, allowed: {allowed}"
            yield address, f"{what}; the default is taken"
