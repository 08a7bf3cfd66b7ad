"""Every abort that our devices send, in one table: the code, when it is sent, and the clause that asks for it.

The SDO server and the objects behind it raise `Abort` with a row of this table. `docs/aborts.md` is made from it.
"""

from __future__ import annotations

from enum import Enum

from eurobot_od.errors import LocalError
from eurobot_od.sdo.wire import AbortCode, code_and_reason

TABLE_OF_CODES = "7.2.4.3.17"
"""The clause of CiA 301 that lists the abort codes; most reasons have no other."""


class Reason(Enum):
    """Why a device aborts: the abort `code`, `when` it is sent, and the `clause` of CiA 301."""

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
    PDO_COB_ID = AbortCode.VALUE, "the COB-ID of a PDO has more than 11 bits", "7.5.2.35, 7.5.2.37"
    COB_ID_TAKEN = AbortCode.VALUE, "the COB-ID of a PDO belongs to a CANopen service", "7.3.5"
    TRANSMISSION_TYPE = (
        AbortCode.VALUE,
        "the transmission type is reserved, or needs SYNC or remote frames that the PDO does not have",
        "7.5.2.35, 7.5.2.37",
    )
    RPDO_INHIBITED = AbortCode.VALUE, "an RPDO gets an inhibit time", "7.5.2.35"
    MAPPING_USED = AbortCode.STATE, "a mapping entry is written while sub-index 0 is not 0", "7.5.2.36, 7.5.2.38"
    MAPPED_MISSING = (
        AbortCode.NO_OBJECT,
        "a mapping entry names an object that the EDS does not have",
        "7.5.2.36, 7.5.2.38",
    )
    NOT_MAPPABLE = (
        AbortCode.NOT_MAPPABLE,
        "PDOMapping or the access type of a mapped object does not allow it",
        "7.5.2.36, 7.5.2.38",
    )
    MAPPED_BITS = AbortCode.NOT_MAPPABLE, "a mapping entry has no bits, or more than its object", "7.5.2.36, 7.5.2.38"
    MAPPING_TOO_LONG = AbortCode.MAPPING_TOO_LONG, "a PDO would have more than 64 bits", "7.5.2.36, 7.5.2.38"
    PDO_CONFLICT = (
        AbortCode.INCOMPATIBLE,
        "the PDO becomes valid with another PDO's COB-ID, or with a mapping that does not make up its message",
        "7.5.2.35, 7.5.2.37",
    )
    TOO_FEW_BITS = AbortCode.INCOMPATIBLE, "a TPDO becomes valid that cannot hold every value of its message"

    # The device's program
    WRONG_STATE = AbortCode.STATE, "the object is a command, and the device is not OPERATIONAL"
    COMMAND_VALUES = AbortCode.VALUE, "the object is a command, and its values are out of range"
    REFUSED_NOW = AbortCode.STATE, "the device's program does not accept the value now"
    REFUSED_VALUE = AbortCode.INCOMPATIBLE, "the device's program does not accept the value"
    NO_MESSAGE = AbortCode.INCOMPATIBLE_INSIDE, "the object belongs to a message for which the EDS has no PDO"
    MEASURED_VALUE = AbortCode.INCOMPATIBLE_INSIDE, "the device's program measures a value that does not fit"


class Abort(LocalError):
    """An access to an object that the device refuses; `reason` names the true cause, `detail` the values involved."""

    def __init__(self, reason: Reason, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{code_and_reason(reason.code)}: {detail or reason.when}")
