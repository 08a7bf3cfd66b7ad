"""Definitions of CiA 301 and 306 for every object dictionary: numbers, data types, access, COB-IDs, PDO numbering.

All modules import these bits, ranges and indices from here.
"""

from __future__ import annotations

import re
import struct
from datetime import datetime, timedelta
from enum import Enum, IntEnum
from functools import lru_cache
from numbers import Real
from typing import NamedTuple, TypeAlias, TypeVar, cast

from eurobot_od.errors import LocalError
from eurobot_od.frame import EXTENDED as EXTENDED
from eurobot_od.frame import HIGHEST_EXTENDED, HIGHEST_IDENTIFIER

Address: TypeAlias = tuple[int, int]
"""Index and sub-index of an object."""

Value: TypeAlias = "int | float | str | bytes | None"
"""Value of an object; None for no value."""

Scalar = TypeVar("Scalar", int, float, str, bytes)


def typed(value: object, kind: type[Scalar], name: str) -> Scalar:
    """Return a value with its Python type checked; an integer is accepted as a float. Raises LocalError for others."""
    if not isinstance(kind, type):
        raise LocalError(f"{kind!r} is not a type; write `int`, `float`, `str` or `bytes`")
    if kind is float and isinstance(value, int):
        value = float(value)
    if not isinstance(value, kind):
        raise LocalError(f"{name} is {value!r}, which is not of type {kind.__name__}")
    return value


ALL_NODES = 0
"""Node-ID of a command to all nodes."""

NODE_IDS = range(1, 128)
"""Valid node-IDs (CiA 301, 7.3.3)."""


BUS_BIT_RATES = range(1000, 1_000_001)
"""Bit rates of a bus, in bit/s; CiA 301 names those of which a device has some."""


def check_node_id(number: int) -> int:
    """Return the node-ID; raises LocalError if it is out of range."""
    if number not in NODE_IDS:
        raise LocalError(f"node-ID {number!r} is not in {NODE_IDS[0]}..{NODE_IDS[-1]}")
    return number


class Limits(NamedTuple):
    """LowLimit and HighLimit of an object in the EDS, both inclusive."""

    low: int
    high: int


# Numbers in files

NODE_ID = "$NODEID"
"""Placeholder in a file for the node-ID, which is added to a number."""

DIGITS = {8: "01234567", 10: "0123456789", 16: "0123456789ABCDEFabcdef"}
"""The digits of each base."""

LONGEST_NUMBER = 100
"""Most digits of a number: more than any type has, but not a megabyte of them."""


def typed_number(text: str) -> int:
    """Parse a number typed by a person: decimal, 0x hexadecimal, 0b binary; raises ValueError."""
    return int(_digits(text), 0)


def typed_real(text: str) -> float:
    """Parse a number typed by a person, with or without a fraction; raises ValueError."""
    return float(_digits(text))


def _digits(text: str) -> str:
    """Return a number's text; raises ValueError for forms that only Python accepts, such as `1_000`."""
    # The time of `int` grows with the square of the length.
    if len(text) > LONGEST_NUMBER or "_" in text or not text.isascii():
        raise ValueError(text)
    return text


REMEMBERED_NUMBERS = 4096
"""Number of cached results; a file repeats few different numbers."""


class Number(NamedTuple):
    """A number in a file: its value, and whether the node-ID is added."""

    value: int
    relative: bool = False

    def at(self, node_id: int) -> int:
        """Return the value for a node-ID."""
        return self.value + node_id if self.relative else self.value


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def label(address: Address, name: str = "") -> str:
    """Format an address and a name: `0x1017:0 Producer heartbeat time`."""
    return f"0x{address[0]:04X}:{address[1]} {name}".rstrip()


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def parse_number(text: str) -> Number | None:
    """Parse a number: decimal, 0x hexadecimal or 0 octal, with or without `$NODEID+`; None if it is invalid.

    Other forms of editors and compilers are accepted, too: `10h`, `0x10UL`, `$NodeID`, `0x80 + $NODEID`.
    """
    upper = text.strip().upper()
    value = _integer(upper)
    if value is not None:
        return Number(value)
    if NODE_ID in upper:
        return _relative(upper)
    match = _FOREIGN.fullmatch(upper)
    value = _integer(match["sign"] + (match["number"] or f"0X{match['hex']}")) if match else None
    return None if value is None else Number(value)


def plain_number(text: str) -> int:
    """Parse a number as in an EDS, but not relative to the node-ID; raises LocalError."""
    number = parse_number(text)
    if number is None or number.relative:
        raise LocalError(f"{str(text)!r} is not a number")
    return number.value


def _relative(upper: str) -> Number | None:
    """Parse a sum of `$NODEID` and numbers, in any order."""
    parts = [each.strip() for each in upper.strip("()").split("+")]
    if parts.count(NODE_ID) != 1:
        return None
    parts.remove(NODE_ID)
    numbers = [parse_number(each) for each in parts]
    if any(each is None or each.relative or each.value < 0 for each in numbers):
        return None  # could be below 0 for some node-IDs
    return Number(sum(each.value for each in numbers if each), relative=True)


_FOREIGN = re.compile(r"(?P<sign>-?)(?:(?P<hex>[0-9][0-9A-F]*)H|(?P<number>(?:0X[0-9A-F]+|[0-9]+))[UL]{1,3})")
"""Pattern of numbers of other languages: hexadecimal with an h, and C's suffixes."""


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def is_standard_number(text: str) -> bool:
    """Return whether a number has a form of CiA 306, which every tool can read."""
    first, plus, rest = (each.strip() for each in text.partition("+"))
    if first == NODE_ID:
        return not plus or (rest[:1] != "-" and _integer(rest.upper()) is not None)
    return _integer(text.strip().upper()) is not None


def _integer(text: str) -> int | None:
    """Parse a whole number; its digits are checked, because `int` also accepts blanks, underscores and more signs."""
    digits = text.removeprefix("-")
    base = 10
    if digits.startswith("0X"):
        base = 16
        digits = digits.removeprefix("0X")
    elif digits.startswith("0"):
        base = 8  # in CiA 306; lint warns, because `010` may be meant as ten
    if not digits or digits.strip(DIGITS[base]) or len(digits) > LONGEST_NUMBER:
        return None
    return -int(digits, base) if text.startswith("-") else int(digits, base)


# Data types and access


class DataType(NamedTuple):
    """A data type: code, name, bits (0: no fixed length), and the lowest and highest value of an integer."""

    code: int
    name: str
    bits: int
    low: int = 0
    high: int = -1

    @property
    def is_integer(self) -> bool:
        """Whether values are whole numbers."""
        return self.low <= self.high

    @property
    def is_signed(self) -> bool:
        """Whether values may be negative."""
        return self.low < 0

    @property
    def allowed(self) -> str:
        """The name and, for an integer, the range."""
        return f"{self.name}, {self.low}..{self.high}" if self.is_integer else self.name

    def meant(self, value: int) -> int:
        """Return a number in a file as a value of this type; many editors write negative numbers as bits."""
        return value - (1 << self.bits) if self.is_signed and self.high < value < 1 << self.bits else value

    @property
    def size(self) -> int:
        """Length of a value in an SDO in bytes, 0 if it varies."""
        return (self.bits + 7) // 8

    def read(self, data: bytes) -> Value:
        """Return the value of bytes from an SDO; raises ValueError for a wrong length.

        Bytes that cannot be decoded as text stay bytes, so that `write` restores them.
        """
        if self.size not in (0, len(data)):
            raise ValueError(f"{len(data)} bytes are not {self.name}")
        if self.bits == 1:  # any other byte than 0 is true, as in C
            return data != b"\0"
        if self.is_integer:
            return int.from_bytes(data, "little", signed=self.is_signed)
        if self.code in _REAL_FORMATS:
            number: float = struct.unpack(_REAL_FORMATS[self.code], data)[0]
            return number
        if self.code in TIMES:
            return text(data, self.code == TIME_OF_DAY.code)
        encoding = _TEXT_ENCODINGS.get(self.code)
        try:
            return data.decode(encoding) if encoding else data
        except UnicodeDecodeError:
            return data

    def write(self, value: Value) -> bytes:
        """Return the bytes of a value for an SDO; bytes are returned unchanged.

        Raises ValueError for a value of another type, OverflowError for a number too large for a REAL.
        """
        if isinstance(value, bytes):  # such as those that `read` could not decode
            return value
        if isinstance(value, Real) and self.low <= value <= self.high and value % 1 == 0:
            return int(value).to_bytes(self.size, "little", signed=self.is_signed)
        if isinstance(value, Real) and self.code in _REAL_FORMATS:
            return struct.pack(_REAL_FORMATS[self.code], value)
        if isinstance(value, str) and self.code in _TEXT_ENCODINGS:
            return value.encode(_TEXT_ENCODINGS[self.code])
        if self.code in TIMES and isinstance(value, str):
            return data(value, self.code == TIME_OF_DAY.code)
        if self.code in TIMES and isinstance(value, int):  # a file has a time as one number
            return value.to_bytes(self.size, "little")
        raise ValueError(f"{value!r} is not {self.name}")


_REAL_FORMATS = {0x08: "<f", 0x11: "<d"}
_TEXT_ENCODINGS = {0x09: "ascii", 0x0B: "utf-16-le"}


def _integers(bits_of: dict[int, int], name: str) -> list[DataType]:
    signed = name == "INTEGER"
    ends = ((code, bits, 1 << bits - signed) for code, bits in bits_of.items())
    return [DataType(code, f"{name}{bits}", bits, -end * signed, end - 1) for code, bits, end in ends]


BOOLEAN = DataType(0x01, "BOOLEAN", 1, 0, 1)
REAL32, REAL64 = DataType(0x08, "REAL32", 32), DataType(0x11, "REAL64", 64)
VISIBLE_STRING, OCTET_STRING = DataType(0x09, "VISIBLE_STRING", 0), DataType(0x0A, "OCTET_STRING", 0)
UNICODE_STRING, DOMAIN = DataType(0x0B, "UNICODE_STRING", 0), DataType(0x0F, "DOMAIN", 0)
TIME_OF_DAY, TIME_DIFFERENCE = DataType(0x0C, "TIME_OF_DAY", 48), DataType(0x0D, "TIME_DIFFERENCE", 48)

DATA_TYPES: dict[int, DataType] = {
    each.code: each
    for each in (
        *(BOOLEAN, REAL32, REAL64, VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, DOMAIN),
        *(TIME_OF_DAY, TIME_DIFFERENCE),
        *_integers({0x02: 8, 0x03: 16, 0x04: 32, 0x10: 24, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}, "INTEGER"),
        *_integers({0x05: 8, 0x06: 16, 0x07: 32, 0x16: 24, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}, "UNSIGNED"),
    )
}
"""The basic data types by code (CiA 301, Table 44)."""

TIMES = (TIME_OF_DAY.code, TIME_DIFFERENCE.code)
UNSIGNED8, UNSIGNED16, UNSIGNED32, UNSIGNED64 = (DATA_TYPES[code] for code in (0x05, 0x06, 0x07, 0x1B))
REALS = (REAL32, REAL64)

ACCESS_TYPES = ("ro", "wo", "rw", "rwr", "rww", "const")
"""AccessTypes of an EDS (CiA 306-1, 4.6.3.2); rwr and rww are rw, mappable into TPDOs, or into RPDOs."""

NO_ACCESS = "none"
"""Access of an object that only PDOs may carry: `noAccess` in an XDD (CiA 311)."""

NO_ACCESS_IN_EDS = "UNKNOWN"
"""CANopenEditor's AccessType for such an object; CiA 306 has none."""

WRITABLE = ("rw", "wo", "rwr", "rww")
"""Access types of objects that an SDO may write."""

DUMMIES = range(0x0001, 0x0008)
"""Indices of dummies: mapped data types 1 to 7, whose bits an RPDO skips (CiA 301, 7.4.8.2)."""

NOT_WRITTEN, NOT_SCANNED = 1, 2
"""Bits of ObjFlags (CiA 306): not written when a configuration is loaded, not read when a device is scanned."""

STRUCTURE = 0xFF
"""Sub-index with the structure of an object, which is not data (CiA 301, 7.4.9)."""

MOST_SUBS = 254
"""Highest sub-index of data."""

FIRST = 0x1000
"""First index of an object; lower ones are data types (CiA 301, 7.4.1)."""

PDO_PARAMETERS = range(0x1400, 0x1C00)
"""Indices of the communication and mapping parameters of PDOs (CiA 301, Table 39)."""

MANUFACTURER = range(0x2000, 0x6000)
"""Indices of manufacturer-specific objects (CiA 301, 7.4.1)."""

NODE_ID_NAMES = ("node-id", "node id", "nodeid", "node_id")
"""ParameterNames, in lower case, of a manufacturer-specific object with the device's node-ID."""

# PDOs


class PdoDirection(Enum):
    """RPDO or TPDO, seen from the device; the value is the index of its first communication record (CiA 301)."""

    RPDO = 0x1400
    TPDO = 0x1800


MAPPING_OFFSET = 0x200
"""Distance from a PDO's communication record to its mapping record (CiA 301, 7.5.2.35)."""

MAX_BITS = 64
"""Largest number of bits of a PDO (CiA 301, 7.4.8.2)."""

PDO_COUNT = 0x200
"""Largest number of RPDOs, or of TPDOs, of a device (CiA 301)."""

COMMUNICATION_RECORDS = {each: range(each.value, each.value + PDO_COUNT) for each in PdoDirection}
MAPPING_RECORDS = {
    each: range(records[0] + MAPPING_OFFSET, records[-1] + MAPPING_OFFSET + 1)
    for each, records in COMMUNICATION_RECORDS.items()
}
"""Indices of the records of all possible PDOs, by direction."""

COMMUNICATIONS = frozenset(index for records in COMMUNICATION_RECORDS.values() for index in records)
MAPPINGS = frozenset(index for records in MAPPING_RECORDS.values() for index in records)
"""Indices of the records of all possible PDOs."""

COB_ID, TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER, SYNC_START = 1, 2, 3, 5, 6
"""Sub-indices of a communication record (CiA 301, Tables 66 and 70)."""

SYNCHRONOUS = range(241)
EVENT_DRIVEN = 255
"""Transmission types of synchronous PDOs, and the event-driven one of device profiles (CiA 301, Table 68)."""

MAPPABLE = {
    PdoDirection.RPDO: ("wo", "rww", "rw", NO_ACCESS),
    PdoDirection.TPDO: ("ro", "const", "rwr", "rw", NO_ACCESS),
}
"""Access types of objects that a PDO may write, or read (CiA 301, Table 42)."""

SLICE = re.compile(r"(?P<name>.+) [(\[](?P<high>\d{1,3}):(?P<low>\d{1,3})[)\]]$")
"""Pattern of the ParameterName of a slice: `X position (11:4)` or `[11:4]` is bits 11 down to 4 of the value."""


class Multiplex(IntEnum):
    """Addressing of a multiplexed PDO: the value of sub-index 0 of its mapping (CiA 301, 7.5.2.36)."""

    SOURCE = 0xFE
    DESTINATION = 0xFF


class MappingEntry(NamedTuple):
    """An entry of a mapping: an object, and the number of its bits in the PDO (CiA 301, 7.5.2.36)."""

    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple
    sub: int
    bits: int

    @classmethod
    def of(cls, number: int) -> MappingEntry:
        """Return the entry for its UNSIGNED32 value."""
        return cls(number >> 16 & 0xFFFF, number >> 8 & 0xFF, number & 0xFF)

    @property
    def number(self) -> int:
        """The entry as a number."""
        return self.index << 16 | self.sub << 8 | self.bits

    @property
    def address(self) -> Address:
        """The address of the object."""
        return self.index, self.sub

    @property
    def where(self) -> str:
        """Address such as `0x2000 sub 1`."""
        return f"0x{self.index:04X} sub {self.sub}"


class UnknownEntry(int):
    """A mapping entry that was written with unknown data: a MappingEntry's number without an index.

    Its length is that of the previous entry; 0 if there was none.
    """

    @classmethod
    def of(cls, sub: int, bits: int) -> UnknownEntry:
        """Return the entry at a sub-index of a mapping record, with a length in bits."""
        return cls(MappingEntry(0, sub, bits).number)


def pdo_of(index: int) -> int | None:
    """Return the index of the communication record for a record of a PDO; None for other objects."""
    # The two indices differ in one bit.
    return index & ~MAPPING_OFFSET if index in COMMUNICATIONS or index in MAPPINGS else None


class PdoRecords:
    """A PDO by direction and `index` of its communication record."""

    direction: PdoDirection
    index: int

    @property
    def number(self) -> int:
        """Number of the PDO in its direction, from 1 (CiA 301: TPDO 1 has its records at 0x1800 and 0x1A00)."""
        return self.index - self.direction.value + 1

    @property
    def title(self) -> str:
        """Direction and number, such as `TPDO 1`."""
        return f"{self.direction.name} {self.number}"

    @property
    def key(self) -> str:
        """Direction and number as one word, such as `TPDO1`."""
        return f"{self.direction.name}{self.number}"

    @property
    def mapping_index(self) -> int:
        """Index of the mapping record."""
        return self.index + MAPPING_OFFSET

    @property
    def default_base(self) -> int | None:
        """Its default identifier without the node-ID; None from the fifth PDO on."""
        return next(iter(DEFAULT_PDO_BASES[self.direction][self.number - 1 : self.number]), None)


# COB-IDs

NOT_VALID, NO_RTR = 1 << 31, 1 << 30
"""Bits of a COB-ID entry: not valid, no remote frames (CiA 301, Tables 67 and 71); EXTENDED is the third."""

BASE_IDENTIFIER = HIGHEST_IDENTIFIER
"""Bits of a COB-ID entry for an 11-bit identifier."""


def base_identifier(entry: Value) -> int | None:
    """Return the 11-bit identifier in a COB-ID entry; None if it is not valid, or NMT's 0."""
    usable = isinstance(entry, int) and not entry & (NOT_VALID | EXTENDED)
    return (cast(int, entry) & BASE_IDENTIFIER or None) if usable else None


def identifier(entry: int) -> int:
    """Return the identifier in a COB-ID entry, valid or not; with EXTENDED if it has 29 bits."""
    return entry & (EXTENDED | HIGHEST_EXTENDED if entry & EXTENDED else BASE_IDENTIFIER)


NMT_COB_ID, SYNC_COB_ID, TIME_COB_ID = 0x000, 0x080, 0x100
"""Broadcast services of the pre-defined connection set (CiA 301, 7.3.3)."""

EMCY_BASE, SDO_RESPONSE_BASE, SDO_REQUEST_BASE, ERROR_CONTROL_BASE = 0x080, 0x580, 0x600, 0x700
"""Default COB-IDs of a node's services without the node-ID (CiA 301, 7.3.3)."""

LSS_COB_IDS = (0x7E4, 0x7E5)
"""Identifiers of LSS answers and requests (CiA 305)."""

DEFAULT_PDOS = 4
"""Number of PDOs of a node, in each direction, with a default COB-ID."""

DEFAULT_PDO_BASES = {PdoDirection.TPDO: range(0x180, 0x580, 0x100), PdoDirection.RPDO: range(0x200, 0x600, 0x100)}
"""Default COB-IDs of a node's first four PDOs without the node-ID."""


class IdentifierRange(NamedTuple):
    """A range of identifiers, both ends included, and its owner."""

    low: int
    high: int
    owner: str
    is_per_node: bool = False

    def whose(self, identifier: int) -> str:
        """Return the owner of an identifier in the range: SYNC, or EMCY of node 64."""
        return f"{self.owner} of node {self.node_id(identifier)}" if self.is_per_node else self.owner

    def node_id(self, identifier: int) -> int | None:
        """Return the node-ID for an identifier in the range; None if the range is not split by nodes."""
        return identifier - self.low + 1 if self.is_per_node else None


def _per_node(base: int, owner: str) -> IdentifierRange:
    return IdentifierRange(base + NODE_IDS[0], base + NODE_IDS[-1], owner, is_per_node=True)


RESTRICTED = (
    IdentifierRange(NMT_COB_ID, NMT_COB_ID, "NMT"),
    _per_node(SDO_RESPONSE_BASE, "the SDO answer"),
    _per_node(SDO_REQUEST_BASE, "the SDO request"),
    _per_node(ERROR_CONTROL_BASE, "the heartbeat"),
    IdentifierRange(0x780, HIGHEST_IDENTIFIER, "LSS and further services"),
)
"""Restricted identifiers of services of every network (CiA 301, 7.3.5)."""

CIA_EXTENSIONS = IdentifierRange(0x6E0, 0x6FF, "extensions of CiA")

SRDO_RANGE = IdentifierRange(0x101, 0x180, "safety (SRDO)")
RESERVED = (IdentifierRange(0x001, 0x07F, "safety (GFC) and flying NMT masters"), SRDO_RANGE, CIA_EXTENSIONS)
"""Restricted identifiers of optional services (CiA 301, 7.3.5)."""

PREDEFINED = (
    IdentifierRange(SYNC_COB_ID, SYNC_COB_ID, "SYNC"),
    _per_node(EMCY_BASE, "EMCY"),
    IdentifierRange(TIME_COB_ID, TIME_COB_ID, "TIME"),
    *(
        _per_node(base, f"{direction.name} {number}")
        for direction, bases in DEFAULT_PDO_BASES.items()
        for number, base in enumerate(bases, start=1)
    ),
)
"""Identifiers of the pre-defined connection set that are not restricted (CiA 301, 7.3.3)."""


def owner(identifier: int, ranges: tuple[IdentifierRange, ...]) -> IdentifierRange | None:
    """Return the range that contains an identifier, or None."""
    return next((each for each in ranges if each.low <= identifier <= each.high), None)


EPOCH = datetime(1984, 1, 1)  # local time of the network
"""Day 0 of TIME_OF_DAY."""

DAY = 24 * 60 * 60 * 1000
"""Length of a day in ms."""


class TimeOfDay(NamedTuple):
    """A time: `days` since EPOCH, and `milliseconds` since midnight."""

    days: int
    milliseconds: int

    @classmethod
    def of(cls, now: datetime) -> TimeOfDay:
        """Return the TIME_OF_DAY for a date and time."""
        return cls(*divmod((now - EPOCH) // timedelta(milliseconds=1), DAY))

    @property
    def data(self) -> bytes:
        """Data of a time stamp message (CiA 301, 7.2.6)."""
        return self.milliseconds.to_bytes(4, "little") + self.days.to_bytes(2, "little")


# Objects of the types TIME_OF_DAY and TIME_DIFFERENCE (CiA 301, 7.1.6.6 and 7.1.6.7)

SPAN = re.compile(
    r"(?:(?P<days>[0-9]{1,5})d )?(?P<h>[01]?[0-9]|2[0-3]):(?P<m>[0-5][0-9]):(?P<s>[0-5][0-9])(?:\.(?P<ms>[0-9]{1,3}))?"
)
"""Pattern of a time span, such as `1d 02:03:04.567`."""

MOST_DAYS = 0xFFFF


def text(data: bytes, is_moment: bool) -> str | bytes:
    """Format a time or, unless `is_moment`, a time span; invalid bytes are returned unchanged."""
    days = int.from_bytes(data[4:], "little")
    milliseconds = int.from_bytes(data[:4], "little")
    if milliseconds >= DAY:  # possible, because the field has 28 bits
        return data
    span = timedelta(milliseconds=milliseconds)
    if is_moment:
        return (EPOCH + timedelta(days) + span).isoformat(" ", "milliseconds")
    return f"{days}d {(EPOCH + span).time().isoformat('milliseconds')}"


def data(text: str, is_moment: bool) -> bytes:
    """Parse a time in the form of `text`; raises ValueError, OverflowError."""
    if not is_moment:
        found = SPAN.fullmatch(text.strip())
        if found is None or int(found["days"] or 0) > MOST_DAYS:
            raise ValueError(f"{text!r} is not a time span such as 1d 02:03:04.567")
        seconds = int(found["h"]) * 3600 + int(found["m"]) * 60 + int(found["s"])
        # Digits after a point are a fraction: `.5` is 500 ms.
        return TimeOfDay(int(found["days"] or 0), seconds * 1000 + int((found["ms"] or "0").ljust(3, "0"))).data
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise ValueError(f"{text!r} is not a time such as 2014-05-28 12:00:00.000") from None
    # CANopen's time has no zone, so an offset is ignored.
    time = TimeOfDay.of(moment.replace(tzinfo=None))
    if time.days not in range(MOST_DAYS + 1):
        raise ValueError(f"{text!r} is not within 179 years from {EPOCH:%Y} on")
    return time.data
