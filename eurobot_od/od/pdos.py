"""PDOs of an object dictionary: communication parameters and mapping (CiA 301, 7.5.2.35).

They are read from canopen's records 0x1400 to 0x1BFF, with the values of a file or of a running device.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, NoReturn, TypeAlias

from eurobot_od.errors import MappingError
from eurobot_od.od import objects as od
from eurobot_od.od import values
from eurobot_od.od.meanings import NO_MEANING, ObjectMeaning
from eurobot_od.od.values import (
    Address,
    DataType,
    Limits,
    MappingEntry,
    Multiplex,
    PdoDirection,
    PdoRecords,
    UnknownEntry,
    Value,
)

if TYPE_CHECKING:
    from pathlib import Path

    from canopen.objectdictionary import ObjectDictionary, ODVariable

PADDING, RESERVED = "Padding", "Reserved"
"""ParameterNames, perhaps followed by a number, of mapped objects with unused bits."""


def carries_nothing(name: str) -> bool:
    """Return whether a ParameterName is that of unused bits: `Padding`, `Reserved 2`, `Reserved (5:2)`."""
    return re.fullmatch(rf"({PADDING}|{RESERVED})[\W\d_]*", name) is not None


SLICES = " slices"
"""End of the ParameterName of a record with slices of another record's values."""


class Mapped(NamedTuple):
    """An entry of a mapping: canopen's variable, and the number of its bits in the PDO.

    `type` and `limits` are the variable's, or those of the whole value for a slice; the limits of a value that is not
    an integer are those of its bits. `is_padding` marks unused bits, `meaning` has unit and codes, `is_unknown` marks
    an unknown object, whose bits may be 0 for an unknown length.
    """

    variable: ODVariable
    bits: int
    type: DataType
    limits: Limits
    is_padding: bool
    meaning: ObjectMeaning = NO_MEANING
    is_unknown: bool = False

    @classmethod
    def unknown(cls, entry: MappingEntry) -> Mapped:
        """Return the entry for an unknown object."""
        variable = od.changed(od.undescribed(entry.address), name=f"Mapped object {entry.sub}")
        limits = Limits(values.UNSIGNED64.low, values.UNSIGNED64.high)
        return cls(variable, entry.bits, values.UNSIGNED64, limits, is_padding=False, is_unknown=True)

    @classmethod
    def of(cls, variable: ODVariable, bits: int, whole: ODVariable, meaning: ObjectMeaning = NO_MEANING) -> Mapped:
        """Return the entry of a variable, which may be a slice of `whole`."""
        type_ = od.data_type(whole)
        range_ = type_ if type_.is_integer else values.UNSIGNED64
        limits = (whole.min, whole.max) if type_.is_integer else (None, None)
        low, high = (most if limit is None else limit for limit, most in zip(limits, (range_.low, range_.high)))
        padding = variable.index in values.DUMMIES or carries_nothing(variable.name)
        return cls(variable, bits, type_, Limits(0, 0) if padding else Limits(low, high), padding, meaning)

    def meant(self, raw: int) -> Value:
        """Return the value of the entry's bits; a number if only a part is mapped."""
        type_ = self.type
        if type_.is_signed:
            sign = 1 << self.bits - 1  # of the entry, because an INTEGER16 may be mapped with 12 bits
            return (raw ^ sign) - sign
        whole = not type_.is_integer and (self.bits == type_.bits if type_.bits else self.bits % 8 == 0)
        return type_.read(raw.to_bytes(self.bits // 8, "little")) if whole else raw

    @property
    def name(self) -> str:
        """The variable's ParameterName."""
        name: str = self.variable.name
        return name

    @property
    def address(self) -> Address:
        """The variable's index and sub-index."""
        return od.address_of(self.variable)


@dataclass(frozen=True)
class Pdo(PdoRecords):
    """A PDO of a device: `index` of the communication record, its ParameterName, COB-ID and mapping.

    `inhibit_time` is in 100 us, `event_timer` in ms: the longest time between two TPDOs, or the deadline of an RPDO; 0
    for none (CiA 301, Tables 66 and 70). A `multiplex`ed PDO maps nothing: each frame names its object.
    """

    direction: PdoDirection
    index: int
    name: str
    cob_id: int
    valid: bool
    transmission_type: int
    mapping: tuple[Mapped, ...]
    inhibit_time: int = 0
    event_timer: int = 0
    multiplex: Multiplex | None = None

    @property
    def is_synchronous(self) -> bool:
        """Whether it is sent, or processed, at SYNC."""
        return self.transmission_type in values.SYNCHRONOUS

    @property
    def length(self) -> int:
        """Length of its frames in bytes."""
        return -(-sum(each.bits for each in self.mapping) // 8)


class Part(NamedTuple):
    """Bits of a slice in the object at `whole`: `bits` bits from bit `low` on."""

    whole: Address
    low: int
    bits: int

    @property
    def _mask(self) -> int:
        return (1 << self.bits) - 1

    def of(self, whole: int) -> int:
        """Return the slice of a whole value."""
        return whole >> self.low & self._mask

    def put(self, whole: int, value: int) -> int:
        """Return the whole value with another slice."""
        return whole & ~(self._mask << self.low) | (value & self._mask) << self.low


def part_of(objects: ObjectDictionary, variable: ODVariable | None) -> Part | None:
    """Return which bits of which object a slice is: of the same name, in the record without ` slices`.

    None for a variable that is not a slice, and for a slice without a whole value.
    """
    match = None if variable is None else values.SLICE.match(variable.name)
    if variable is None or match is None:
        return None
    record = objects.indices[variable.index].name.removesuffix(SLICES)
    name = match["name"]
    # Slices and their values are manufacturer-specific.
    named = (i for i, each in objects.indices.items() if each.name == record and i >= values.MANUFACTURER[0])
    whole = next((each for index in named for each in od.members(objects, index) if each.name == name), None)
    high, low = int(match["high"]), int(match["low"])
    return None if whole is None else Part(od.address_of(whole), low, high - low + 1)


OnRefused: TypeAlias = Callable[[MappingError], object]
"""Called with the error about an unusable PDO, which is left out."""


def fatal(error: MappingError) -> NoReturn:
    """Refuse to leave out a PDO: raises the error."""
    raise error


def unheard(_: MappingError) -> None:
    """Ignore the error; for PDOs whose errors are reported elsewhere."""


class PdoReader:
    """Reads the PDOs of a device from the parameter values that `value` returns; errors name its `file`.

    `meanings` are those of its objects.
    """

    def __init__(
        self,
        file: Path,
        objects: ObjectDictionary,
        node_id: int,
        value: Callable[[Address], Value],
        meanings: Mapping[Address, ObjectMeaning] = MappingProxyType({}),
    ) -> None:
        self._file, self._objects, self._node_id, self._value = file, objects, node_id, value
        self._meanings = meanings

    def pdos(self, refused: OnRefused = fatal, listening: bool = False) -> tuple[Pdo, ...]:
        """Return RPDOs, then TPDOs.

        `refused` is called with the MappingError of an unusable PDO; by default it is raised. Multiplexed PDOs, and
        those with 29-bit identifiers, are usable only for `listening`.
        """
        pdos = []
        for direction, records in values.COMMUNICATION_RECORDS.items():
            for index in sorted(each for each in self._objects.indices if each in records):
                try:
                    pdo = self._pdo(direction, index)
                    if not listening:
                        self._refuse_unusual(pdo)
                    pdos.append(pdo)
                except MappingError as error:
                    refused(error)
        return tuple(pdos)

    def _pdo(self, direction: PdoDirection, index: int) -> Pdo:
        entry = self._cob_id(direction, index)
        record = index + values.MAPPING_OFFSET
        count = self._parameter((record, 0))
        multiplex = Multiplex(count) if count in set(Multiplex) else None
        if multiplex is None and count > values.MAX_BITS:
            what = f"{direction.name}: sub 0 says that it maps {count} objects; a PDO has {values.MAX_BITS} bits"
            raise MappingError(self._file, record, what)
        subs = range(1, 1 if multiplex else count + 1)
        return Pdo(
            direction=direction,
            index=index,
            name=self._objects.indices[index].name,
            cob_id=values.identifier(entry),
            valid=not entry & values.NOT_VALID and values.identifier(entry) != values.NMT_COB_ID,
            transmission_type=self._setting((index, values.TRANSMISSION_TYPE), values.EVENT_DRIVEN),
            mapping=tuple(self.mapped(record, self._parameter((record, sub))) for sub in subs),
            inhibit_time=self._setting((index, values.INHIBIT_TIME), 0),
            event_timer=self._setting((index, values.EVENT_TIMER), 0),
            multiplex=multiplex,
        )

    def _refuse_unusual(self, pdo: Pdo) -> None:
        """Check that a PDO is usable not only for listening; raises MappingError."""
        if pdo.cob_id & values.EXTENDED:  # 11 bits of it may be another message's identifier
            raise MappingError(self._file, pdo.index, f"COB-ID 0x{pdo.cob_id:08X} asks for a 29-bit identifier")
        if pdo.multiplex is not None:
            kind = f"{pdo.multiplex.name.lower()} address mode"
            raise MappingError(self._file, pdo.mapping_index, f"{pdo.title} is a multiplexed PDO ({kind})")

    def _cob_id(self, direction: PdoDirection, index: int) -> int:
        """Return the COB-ID entry; the first four PDOs have a default one (CiA 301, 7.3.3)."""
        number = index - direction.value
        base = values.DEFAULT_PDO_BASES[direction][number : number + 1]
        address = index, values.COB_ID
        return self._setting(address, base[0] + self._node_id) if base else self._parameter(address)

    def _setting(self, address: Address, default: int) -> int:
        """Return a communication parameter that a file may omit."""
        number = self._value(address)
        return number if isinstance(number, int) else default

    def _parameter(self, address: Address) -> int:
        number = self._value(address)
        if not isinstance(number, int):
            raise MappingError(self._file, address[0], f"sub {address[1]} is missing or has no number as its value")
        return number

    def mapped(self, mapping_index: int, number: int) -> Mapped:
        """Return the object of a mapping entry; raises MappingError if it is missing, or too short."""
        entry = MappingEntry.of(number)
        if isinstance(number, UnknownEntry):
            return Mapped.unknown(entry)
        if entry.index in values.DUMMIES:  # need not be in the file
            dummy = self._objects.indices.get(entry.index) or od.undescribed(entry.address)
            return Mapped.of(dummy, entry.bits, dummy)
        variable = od.variable_at(self._objects, entry.address)
        if variable is None:
            raise MappingError(self._file, mapping_index, f"maps {entry.where}, which is missing")
        # Size 0 is a text or a DOMAIN, which may be mapped in part; a BOOLEAN may be mapped as a whole byte.
        most = od.data_type(variable).size * 8 or values.MAX_BITS
        if not 1 <= entry.bits <= most:
            what = f"maps {entry.where} with {entry.bits} bits, its type has {most}"
            raise MappingError(self._file, mapping_index, what)
        part = part_of(self._objects, variable)
        whole = od.at(part.whole, self._objects) if part else variable
        return Mapped.of(variable, entry.bits, whole, self._meanings.get(od.address_of(whole), NO_MEANING))
