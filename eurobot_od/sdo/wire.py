"""SDO frames: command bytes, requests and answers, and abort codes (CiA 301, 7.2.4.3).

Client and server use the same functions.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum, IntEnum
from typing import NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.od.values import MANUFACTURER, Address, pdo_of

LENGTH = 8
"""Length of every SDO request and answer, in bytes (CiA 301, 7.2.4.3.1)."""

EXPEDITED_SIZE, SEGMENT_SIZE, BLOCK_SEGMENTS = 4, 7, 127
"""Most bytes of an expedited transfer, most bytes of a segment, most segments of a block."""

LARGEST = 1 << 24
"""Size limit of an object in bytes: a few minutes at 1 Mbit/s."""

EXPEDITED, SIZE_GIVEN = 0x02, 0x01
TOGGLE, LAST = 0x10, 0x01
BLOCK_CRC, BLOCK_SIZE_GIVEN, BLOCK_LAST = 0x04, 0x02, 0x80
"""Bits of command bytes, in initiates, segments and blocks (CiA 301, Figures 23 to 36)."""


class ClientCommand(IntEnum):
    """Client command specifiers: the upper three bits of a request's command byte."""

    DOWNLOAD_SEGMENT = 0
    DOWNLOAD = 1
    UPLOAD = 2
    UPLOAD_SEGMENT = 3
    ABORT = 4
    BLOCK_UPLOAD = 5
    BLOCK_DOWNLOAD = 6


class ServerCommand(IntEnum):
    """Server command specifiers: the upper three bits of an answer's command byte; they differ from the client's."""

    UPLOAD_SEGMENT = 0
    DOWNLOAD_SEGMENT = 1
    UPLOAD = 2
    DOWNLOAD = 3
    ABORT = 4
    BLOCK_DOWNLOAD = 5
    BLOCK_UPLOAD = 6


class Block(IntEnum):
    """Sub-commands of block requests and answers."""

    INITIATE = 0
    END = 1
    ACKNOWLEDGE = 2
    START = 3


REQUEST_SUB_COMMAND: Mapping[int, int] = {ClientCommand.BLOCK_UPLOAD: 3, ClientCommand.BLOCK_DOWNLOAD: 1}
ANSWER_SUB_COMMAND: Mapping[int, int] = {ServerCommand.BLOCK_UPLOAD: 1, ServerCommand.BLOCK_DOWNLOAD: 3}
"""Mask of the sub-command in a command byte, by command."""

ABORT = ClientCommand.ABORT << 5
"""Command byte of an abort, from either end."""

NO_TRANSFER: Address = (0, 0)
"""Address in an abort outside a transfer."""


class AbortCode(IntEnum):
    """SDO abort codes, each with its `text` (CiA 301, Table 22)."""

    text: str

    def __new__(cls, code: int, text: str = "") -> AbortCode:
        """Create a member from its code and text."""
        member = int.__new__(cls, code)
        member._value_, member.text = code, text
        return member

    TOGGLE_BIT = 0x0503_0000, "SDO toggle bit error"
    TIMEOUT = 0x0504_0000, "Timeout of transfer communication detected"
    UNKNOWN_COMMAND = 0x0504_0001, "Unknown SDO command specified"
    BLOCK_SIZE = 0x0504_0002, "Invalid block size"
    SEQUENCE_NUMBER = 0x0504_0003, "Invalid sequence number"
    CRC = 0x0504_0004, "CRC error"
    OUT_OF_MEMORY = 0x0504_0005, "Out of memory"
    UNSUPPORTED_ACCESS = 0x0601_0000, "Unsupported access to an object"
    WRITE_ONLY = 0x0601_0001, "Attempt to read a write only object"
    READ_ONLY = 0x0601_0002, "Attempt to write a read only object"
    NO_OBJECT = 0x0602_0000, "Object does not exist"
    NOT_MAPPABLE = 0x0604_0041, "Object cannot be mapped to the PDO"
    MAPPING_TOO_LONG = 0x0604_0042, "PDO length exceeded"
    INCOMPATIBLE = 0x0604_0043, "General parameter incompatibility reason"
    INCOMPATIBLE_INSIDE = 0x0604_0047, "General internal incompatibility in the device"
    HARDWARE = 0x0606_0000, "Access failed due to a hardware error"
    LENGTH = 0x0607_0010, "Data type and length code do not match"
    TOO_LONG = 0x0607_0012, "Data type does not match, length of service parameter too high"
    TOO_SHORT = 0x0607_0013, "Data type does not match, length of service parameter too low"
    NO_SUBINDEX = 0x0609_0011, "Subindex does not exist"
    VALUE = 0x0609_0030, "Value range of parameter exceeded"
    TOO_HIGH = 0x0609_0031, "Value of parameter written too high"
    TOO_LOW = 0x0609_0032, "Value of parameter written too low"
    LIMITS_CROSSED = 0x0609_0036, "Maximum value is less than minimum value"
    NO_RESOURCE = 0x060A_0023, "Resource not available"
    GENERAL = 0x0800_0000, "General error"
    NOT_TRANSFERRED = 0x0800_0020, "Data cannot be transferred or stored to the application"
    LOCAL_CONTROL = 0x0800_0021, "Data cannot be transferred or stored to the application because of local control"
    STATE = 0x0800_0022, "Data cannot be transferred or stored to the application because of the present device state"
    NO_DICTIONARY = 0x0800_0023, "Object dictionary dynamic generation fails or no object dictionary is present"
    NO_DATA = 0x0800_0024, "No data available"


REMEDIES: Mapping[int, str] = {
    AbortCode.TOGGLE_BIT: "another client may use the same SDO channel: stop it, and try again",
    AbortCode.TIMEOUT: "try again; raise the time that is waited for an answer",
    AbortCode.UNKNOWN_COMMAND: "try again without block transfer; another client may use the same channel",
    AbortCode.BLOCK_SIZE: "ask for blocks of 1 to 127 segments",
    AbortCode.SEQUENCE_NUMBER: "try again: frames were lost",
    AbortCode.CRC: "try again: frames were lost or changed",
    AbortCode.OUT_OF_MEMORY: "send less at once",
    AbortCode.UNSUPPORTED_ACCESS: "look at the AccessType in the EDS",
    AbortCode.WRITE_ONLY: "write it only: its AccessType is wo",
    AbortCode.READ_ONLY: "read it only: its AccessType is ro or const",
    AbortCode.NO_OBJECT: "the device may be another version than its EDS: compare 0x1018",
    AbortCode.NOT_MAPPABLE: "map an object with PDOMapping=1, of the direction that its AccessType allows",
    AbortCode.MAPPING_TOO_LONG: "map at most 64 bits",
    AbortCode.INCOMPATIBLE: "look at what the device has in related objects",
    AbortCode.INCOMPATIBLE_INSIDE: "reset the node, and try again",
    AbortCode.HARDWARE: "look at the error register 0x1001, and at 0x1003",
    AbortCode.LENGTH: "write as many bytes as the DataType in the EDS has",
    AbortCode.TOO_LONG: "write fewer bytes: as many as the DataType in the EDS has",
    AbortCode.TOO_SHORT: "write more bytes: as many as the DataType in the EDS has",
    AbortCode.NO_SUBINDEX: "read sub-index 0 for how many there are",
    AbortCode.VALUE: "write a value between LowLimit and HighLimit of the EDS",
    AbortCode.TOO_HIGH: "write a lower value: at most HighLimit of the EDS",
    AbortCode.TOO_LOW: "write a higher value: at least LowLimit of the EDS",
    AbortCode.LIMITS_CROSSED: "write the limits in the other order",
    AbortCode.NO_RESOURCE: "wait until the device is free, and try again",
    AbortCode.GENERAL: "look at the error register 0x1001, and at the manual of the device",
    AbortCode.NOT_TRANSFERRED: "write what 0x1010 and 0x1011 ask for (`save`, `load`), in PRE-OPERATIONAL",
    AbortCode.LOCAL_CONTROL: "switch the device to remote control",
    AbortCode.STATE: "bring the node to PRE-OPERATIONAL, or switch the PDO off, first",
    AbortCode.NO_DICTIONARY: "reset the node",
    AbortCode.NO_DATA: "write the object first",
}
"""What a client may do about an abort code."""


def reason(code: int) -> str:
    """Return the text of an abort code; `unknown code` for a device's own."""
    return AbortCode(code).text if code in set(AbortCode) else "unknown code"


def code_and_reason(code: int) -> str:
    """Return an abort code with its text: `0x06020000 Object does not exist`."""
    return f"0x{code:08X} {reason(code)}"


# Frames that name an object: the first request of a transfer, its answer, and aborts


class Initiate(NamedTuple):
    """A frame that names an object: command byte, the object's address, and the four bytes after it."""

    command: int
    address: Address
    rest: bytes

    @classmethod
    def of(cls, data: bytes) -> Initiate:
        """Read a frame of 8 bytes."""
        return cls(data[0], (data[1] | data[2] << 8, data[3]), data[4:])

    @property
    def number(self) -> int:
        """The four bytes as a number, which is usually a size."""
        return int.from_bytes(self.rest, "little")

    @property
    def size(self) -> int | None:
        """The number of bytes of an expedited or segmented transfer; None if the frame does not have it."""
        if not self.command & SIZE_GIVEN:
            return None
        # An expedited transfer has the number of unused bytes in two bits, others have the size in the four bytes (CiA
        # 301, 7.2.4.3.3).
        return EXPEDITED_SIZE - (self.command >> 2 & 3) if self.command & EXPEDITED else self.number

    @property
    def content(self) -> bytes | None:
        """The object's whole content, if the frame is the answer to an expedited upload; else None."""
        is_whole = self.command >> 5 == ServerCommand.UPLOAD and self.command & EXPEDITED
        return self.rest[: self.size or EXPEDITED_SIZE] if is_whole else None


def initiate(command: int, address: Address, rest: bytes = b"") -> bytes:
    """Return a frame that names an object."""
    index, subindex = address
    return bytes([command, index & 0xFF, index >> 8, subindex]) + rest.ljust(4, b"\0")


def carrying(specifier: int, address: Address, content: bytes) -> bytes:
    """Return an initiate with an object's content, or with its size if segments follow."""
    command = specifier << 5 | SIZE_GIVEN
    # Empty content cannot be expedited: two bits count at most three unused bytes.
    if 1 <= len(content) <= EXPEDITED_SIZE:
        return initiate(command | EXPEDITED | EXPEDITED_SIZE - len(content) << 2, address, content)
    return initiate(command, address, len(content).to_bytes(4, "little"))


def aborted(address: Address, code: AbortCode) -> bytes:
    """Return an abort."""
    return initiate(ABORT, address, code.to_bytes(4, "little"))


# Frames within a transfer


def plain(command: int, rest: bytes = b"") -> bytes:
    """Return a frame that does not name an object."""
    return bytes([command]) + rest.ljust(SEGMENT_SIZE, b"\0")


def segments_of(content: bytes) -> range:
    """Return the offset of each segment of a content; empty content has one segment."""
    return range(0, max(len(content), 1), SEGMENT_SIZE)


def segment(specifier: int, toggle: int, part: bytes, last: bool) -> bytes:
    """Return a segment of a segmented transfer."""
    return plain(specifier << 5 | toggle | SEGMENT_SIZE - len(part) << 1 | last * LAST, part)


def next_segment(specifier: int, content: bytes, at: int) -> bytes:
    """Return the segment at an offset in a content, with the toggle bit for its number."""
    end = at + SEGMENT_SIZE
    toggle = TOGGLE * (at // SEGMENT_SIZE & 1)
    if end < len(content):  # inlined for speed: most segments are full
        return bytes((specifier << 5 | toggle,)) + content[at:end]
    return segment(specifier, toggle, content[at:end], last=True)


def part_in(data: bytes) -> bytes:
    """Return the content of a segment of a segmented transfer."""
    return data[1 : LENGTH - (data[0] >> 1 & 7)]


def block(content: bytes, at: int, segments: int) -> list[bytes]:
    """Return the segments of the block at an offset in a content, numbered from 1."""
    places = segments_of(content)[at // SEGMENT_SIZE :][:segments]
    # Only the last segment of the content is marked as last, not that of each block.
    last = places[-1] + SEGMENT_SIZE >= len(content)
    return [
        plain(number | BLOCK_LAST * (last and number == len(places)), content[place : place + SEGMENT_SIZE])
        for number, place in enumerate(places, 1)
    ]


def block_end(specifier: int, content: bytes, crc: int) -> bytes:
    """Return the end of a block transfer, with the number of unused bytes in the last segment."""
    # Empty content has one segment with seven unused bytes.
    unused = len(segments_of(content)) * SEGMENT_SIZE - len(content)
    return plain(specifier << 5 | unused << 2 | Block.END, crc.to_bytes(2, "little"))


def unused_in(data: bytes) -> int:
    """Return the number of unused bytes in the last segment, from the end of a block transfer."""
    return data[0] >> 2 & 7


def crc_in(data: bytes) -> int:
    """Return the CRC at the end of a block transfer."""
    return int.from_bytes(data[1:3], "little")


TABLE_OF_CODES = "7.2.4.3.17"
"""Clause of CiA 301 with the table of abort codes; most reasons have no other."""


OF_RECORDS, OF_MAPPINGS = "7.5.2.35, 7.5.2.37", "7.5.2.36, 7.5.2.38"
"""Clauses on the communication records of RPDOs and TPDOs, and on their mappings."""


class Reason(Enum):
    """Reason of a device's abort: its `code`, `when` it is sent, and the `clause` of CiA 301."""

    def __init__(self, code: AbortCode, when: str, clause: str = TABLE_OF_CODES) -> None:
        self.code, self.when, self.clause = code, when, clause

    # The transfer
    TOGGLE_BIT = AbortCode.TOGGLE_BIT, "a segment has the wrong toggle bit", "7.2.4.3.4, 7.2.4.3.7"
    CLIENT_SILENT = AbortCode.TIMEOUT, "the client sends nothing for 1 s in the middle of a transfer"
    OUT_OF_STEP = AbortCode.UNKNOWN_COMMAND, "the request neither continues the transfer nor begins a new one"
    BLOCK_SIZE = AbortCode.BLOCK_SIZE, "the client asks for blocks of 0 segments, or of more than 127", "7.2.4.3.13"
    SEGMENT_ZERO = AbortCode.SEQUENCE_NUMBER, "a segment of a block has the number 0", "7.2.4.3.10"
    NEVER_SENT = AbortCode.SEQUENCE_NUMBER, "the client acknowledges a segment that was not sent", "7.2.4.3.14"
    CRC = AbortCode.CRC, "the CRC at the end of a block download does not match the data", "7.2.4.3.16"
    MORE_BYTES = AbortCode.TOO_LONG, "more bytes come than the client announced, or than the object can hold"
    FEWER_BYTES = AbortCode.TOO_SHORT, "fewer bytes come than the client announced"

    # Any object
    NO_OBJECT = AbortCode.NO_OBJECT, "the EDS has no object with this index"
    NO_SUBINDEX = AbortCode.NO_SUBINDEX, "the object has no such sub-index"
    WRITE_ONLY = AbortCode.WRITE_ONLY, "the object cannot be read: its access type is wo"
    READ_ONLY = AbortCode.READ_ONLY, "the object cannot be written: its access type is ro or const"
    NO_ACCESS = AbortCode.UNSUPPORTED_ACCESS, "only PDOs carry the object: its access is `noAccess` in the XDD"
    LONGER_THAN_TYPE = AbortCode.TOO_LONG, "the value has more bytes than the object's data type"
    SHORTER_THAN_TYPE = AbortCode.TOO_SHORT, "the value has fewer bytes than the object's data type"
    OUT_OF_MEMORY = AbortCode.OUT_OF_MEMORY, "the client announces a text over 64 KiB, or a DOMAIN over 16 MiB"
    ABOVE_LIMIT = AbortCode.TOO_HIGH, "the value is above the object's HighLimit"
    BELOW_LIMIT = AbortCode.TOO_LOW, "the value is below the object's LowLimit"
    NO_VALUE = AbortCode.NO_DATA, "the EDS gives the object a default that does not fit its data type"

    # Objects that do something
    NO_SUCH_ERROR = AbortCode.NO_DATA, "0x1003 holds fewer errors than this sub-index", "7.5.2.4"
    ERRORS_NOT_CLEARED = AbortCode.VALUE, "a number other than 0 is written to 0x1003:00", "7.5.2.4"
    SIGNATURE = (
        AbortCode.NOT_TRANSFERRED,
        "0x1010 is written without `save`, or 0x1011 without `load`",
        "7.5.2.13, 7.5.2.14",
    )
    NOT_STORED = (
        AbortCode.HARDWARE,
        "the settings cannot be stored: no DCF holds them, or its file cannot be written",
        "7.5.2.13",
    )
    WATCHED_TWICE = AbortCode.INCOMPATIBLE, "another entry of 0x1016 watches the same node", "7.5.2.19"

    # SYNC and PDOs
    SYNC_COB_ID = AbortCode.VALUE, "0x1005 gets a 29-bit COB-ID, or is to send SYNC without a 0x1006", "7.5.2.5"
    SYNC_SENT = AbortCode.STATE, "0x1005 is changed while the device sends SYNC", "7.5.2.5"
    SYNC_COUNTER = AbortCode.VALUE, "0x1019 gets a value other than 0 and 2 to 240", "7.5.2.22"
    SYNC_PERIOD = AbortCode.STATE, "0x1019 is written while 0x1006 is not 0", "7.5.2.22"
    PDO_VALID = AbortCode.STATE, "the PDO is valid: set bit 31 of its COB-ID first", "7.5.2.35 to 7.5.2.38"
    PDO_COB_ID = AbortCode.VALUE, "the COB-ID of a PDO has more than 11 bits", OF_RECORDS
    COB_ID_TAKEN = AbortCode.VALUE, "the COB-ID belongs to another CANopen service", "7.3.5"
    TRANSMISSION_TYPE = (
        AbortCode.VALUE,
        "the transmission type is reserved, or needs SYNC or remote frames that the PDO does not have",
        OF_RECORDS,
    )
    RPDO_INHIBITED = AbortCode.VALUE, "an RPDO gets an inhibit time", "7.5.2.35"
    MAPPING_USED = AbortCode.STATE, "a mapping entry is written while sub-index 0 is not 0", OF_MAPPINGS
    MAPPED_MISSING = AbortCode.NO_OBJECT, "a mapping entry names an object that the EDS does not have", OF_MAPPINGS
    NOT_MAPPABLE = (
        AbortCode.NOT_MAPPABLE,
        "PDOMapping or the access type of a mapped object does not allow it",
        OF_MAPPINGS,
    )
    MAPPED_BITS = AbortCode.NOT_MAPPABLE, "a mapping entry has no bits, or more than its object", OF_MAPPINGS
    MAPPING_TOO_LONG = AbortCode.MAPPING_TOO_LONG, "a PDO would have more than 64 bits", OF_MAPPINGS
    PDO_CONFLICT = (
        AbortCode.INCOMPATIBLE,
        "the PDO becomes valid with another PDO's COB-ID, or with a mapping that does not make up its message",
        OF_RECORDS,
    )
    TOO_FEW_BITS = AbortCode.INCOMPATIBLE, "a TPDO becomes valid that cannot hold every value of its message"

    # The device's program
    WRONG_STATE = AbortCode.STATE, "the object is a command, and the device is not OPERATIONAL"
    COMMAND_VALUES = AbortCode.VALUE, "the object is a command, and its values are out of range"
    REFUSED_NOW = AbortCode.STATE, "the device's program does not accept the value now"
    REFUSED_VALUE = AbortCode.INCOMPATIBLE, "the device's program does not accept the value"
    NO_MESSAGE = AbortCode.INCOMPATIBLE_INSIDE, "the object belongs to a message for which the EDS has no PDO"
    MEASURED_VALUE = AbortCode.INCOMPATIBLE_INSIDE, "the device's program measures a value that does not fit"


_OF_PDOS = re.compile(r"7\.5\.2\.3[5-8]")
"""Pattern of the clauses on the records of PDOs."""


def when_sent(code: int, index: int) -> str:
    """Return the reasons of our devices for an abort code at an object; empty for a code that they never send.

    Reasons for this object, or for records of PDOs, replace those for any object.
    """
    of_any, of_this = [], []
    # Only communication objects have a COB-ID.
    excluded = {Reason.COB_ID_TAKEN} if index >= MANUFACTURER[0] else set[Reason]()
    for each in (reason for reason in Reason if reason.code == code and reason not in excluded):
        named = re.findall("0x([0-9A-F]{4})", each.when)
        if not named and not _OF_PDOS.search(each.clause):
            of_any.append(each.when)
        elif f"{index:04X}" in named or (not named and pdo_of(index) is not None):
            of_this.append(each.when)
    return ", or ".join(of_this or of_any)


class Abort(LocalError):
    """A refused access to an object; `reason` is the cause, `detail` describes the values involved."""

    def __init__(self, reason: Reason, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{code_and_reason(reason.code)}: {detail or reason.when}")
