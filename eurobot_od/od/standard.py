"""Objects of the communication profile: addresses, meaning, types and access (CiA 301, 302); and LSS (CiA 305).

Every module that serves, reads or checks such an object imports it from here. lint checks files against the table, and
missing types are taken from it.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from enum import IntEnum
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.values import LSS_COB_IDS, UNSIGNED8, UNSIGNED16, UNSIGNED32, VISIBLE_STRING, Address, DataType

# Addresses: an object by index and sub-index, a record or array by its index

DEVICE_TYPE: Address = (0x1000, 0)
"""Device type: profile and functions."""

ERROR_REGISTER: Address = (0x1001, 0)
"""Error register: a bit for each class of present errors."""

ERROR_FIELD = 0x1003
ERRORS: Address = (ERROR_FIELD, 0)
"""Number of errors in the error history, newest first; writing 0 clears it."""

SYNC: Address = (0x1005, 0)
"""COB-ID of SYNC; a device without this object does not support SYNC."""

SYNC_PRODUCER = 1 << 30
"""Bit of 0x1005: the device sends SYNC."""

SYNC_PERIOD: Address = (0x1006, 0)
"""Communication cycle period in us."""

DEVICE_NAME: Address = (0x1008, 0)
"""The manufacturer's name of the device."""

GUARD_TIME: Address = (0x100C, 0)
"""Guard time in ms; a device without this object has no node guarding."""

LIFE_TIME_FACTOR: Address = (0x100D, 0)
"""Life time factor: life time in guard times; 0: not supervised."""

STORE, RESTORE = 0x1010, 0x1011
"""Objects that store parameters, or restore defaults, when their signature is written."""

ALL_PARAMETERS = 1
"""Sub-index of 0x1010 and 0x1011 for all parameters."""

SIGNATURES: Mapping[int, bytes] = {STORE: b"save", RESTORE: b"load"}
"""Signatures by object (CiA 301, 7.5.2.13 and 7.5.2.14)."""

COMMANDS = (ERROR_FIELD, STORE, RESTORE)
"""Objects for which a write is a command, and the value is not kept."""

TIME: Address = (0x1012, 0)
"""COB-ID of TIME; a device without this object does not support TIME."""

EMCY: Address = (0x1014, 0)
"""COB-ID of the device's EMCY messages."""

EMCY_INHIBIT_TIME: Address = (0x1015, 0)
"""Shortest time between two EMCY messages, in 100 us."""

CONSUMED_HEARTBEATS = 0x1016
"""Consumer heartbeat times: watched nodes and their time-outs."""

HEARTBEAT_TIME: Address = (0x1017, 0)
"""Producer heartbeat time in ms; 0: none."""

IDENTITY = 0x1018
"""Identity object: vendor-ID, product code, revision number and serial number, from sub-index 1 on."""

REVISION: Address = (IDENTITY, 3)
SERIAL: Address = (IDENTITY, 4)
"""Revision number and serial number of the device."""

SYNC_COUNTER: Address = (0x1019, 0)
"""Overflow value of the SYNC counter; 0: SYNC has no data."""

VERIFY_CONFIGURATION: tuple[Address, Address] = ((0x1020, 1), (0x1020, 2))
"""Date and time of the configuration, by which a master recognises its own."""

STORED_EDS: Address = (0x1021, 0)
"""The device's own EDS."""

STORE_FORMAT: Address = (0x1022, 0)
"""Compression of the stored EDS; 0: none."""

MODULE_LIST = 0x1027
"""Numbers of the connected modules of a modular device."""

COMMUNICATION_ERROR: Address = (0x1029, 1)
"""State that the device enters after a communication error."""

SDO_REQUESTS: Address = (0x1200, 1)
SDO_ANSWERS: Address = (0x1200, 2)
"""COB-IDs of the default SDO server."""

SDO_SERVERS = range(0x1200, 0x1280)
"""Records of SDO servers: COB-IDs of requests and answers."""

SDO_CLIENTS = range(0x1280, 0x1300)
"""Records of SDO clients: COB-IDs of requests and answers, and node-ID of the server."""

SRDOS = range(0x1301, 0x1341)
"""Records of safety-relevant data objects (CiA 304)."""

SRDO_DIRECTION, SRDO_DATA, SRDO_INVERTED = 1, 5, 6
"""Sub-indices of an SRDO record: direction (0: not valid), and the COB-IDs of its two frames."""

PDO_SETTINGS = ("COB-ID", "Transmission type", "Inhibit time", "Compatibility entry", "Event timer", "SYNC start value")
"""Communication parameters of a PDO from sub-index 1 on; CompactPDO has a bit for each."""

PROGRAM_DATA, PROGRAM_CONTROL, PROGRAM_IDENTIFICATION, FLASH_STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57
"""Program download (CiA 302-3): each program is a sub-index."""

NMT_STARTUP: Address = (0x1F80, 0)
"""NMT start-up behaviour (CiA 302-2)."""

NOT_PARAMETERS = frozenset(
    {ERROR_REGISTER[0], *COMMANDS, VERIFY_CONFIGURATION[0][0], 0x1023, 0x1024, PROGRAM_DATA, PROGRAM_CONTROL}
)
"""Writable objects that are not settings: states, histories, commands, a master's mark."""

MANDATORY = (DEVICE_TYPE[0], ERROR_REGISTER[0], IDENTITY)
"""The objects of every device (CiA 301, 7.5.1)."""

# Types and access

READ_ONLY = ("ro", "const")
DATA_SUBS = range(1, 255)


class Known(NamedTuple):
    """The standard's data type and access for variables at some indices; without `access` any is allowed."""

    indices: Container[int]
    subs: Container[int]
    type: DataType
    access: tuple[str, ...] = ()


KNOWN = (
    Known((0x1000, 0x1002), (0,), UNSIGNED32, READ_ONLY),
    Known((0x1001,), (0,), UNSIGNED8, READ_ONLY),
    Known((0x1003,), DATA_SUBS, UNSIGNED32, READ_ONLY),
    Known((0x1005, 0x1006, 0x1007, 0x1012, 0x1013, 0x1014, 0x1F80), (0,), UNSIGNED32),
    Known((0x1008, 0x1009, 0x100A), (0,), VISIBLE_STRING, READ_ONLY),
    Known((0x100C, 0x1015, 0x1017), (0,), UNSIGNED16),
    Known((0x100D, 0x1019), (0,), UNSIGNED8),
    Known((0x1010, 0x1011, 0x1016, 0x1028), DATA_SUBS, UNSIGNED32),
    Known((0x1018,), range(1, 5), UNSIGNED32, READ_ONLY),
    Known((0x1020,), (1, 2), UNSIGNED32, ("rw",)),
    Known(range(0x1200, 0x1300), (1, 2), UNSIGNED32),
    Known(range(0x1200, 0x1300), (3,), UNSIGNED8),
    Known((0x1021,), (0,), values.DOMAIN, READ_ONLY),
    Known((0x1029,), DATA_SUBS, UNSIGNED8),
    *(
        Known(indices, (sub,), type_)
        for indices in values.COMMUNICATION_RECORDS.values()
        for sub, type_ in enumerate((UNSIGNED32, UNSIGNED8, UNSIGNED16, UNSIGNED8, UNSIGNED16, UNSIGNED8), start=1)
    ),
    *(Known(indices, DATA_SUBS, UNSIGNED32) for indices in values.MAPPING_RECORDS.values()),
)


def known_type(index: int, sub: int) -> DataType | None:
    """Return the standard's data type of a variable, or None."""
    return next((each.type for each in KNOWN if index in each.indices and sub in each.subs), None)


class ErrorCode(IntEnum):
    """Emergency error codes of our devices (CiA 301, Table 26).

    VALUE_OUT_OF_RANGE is device-specific, because CiA 301 has no code for a PDO with a value out of range.
    """

    NO_ERROR = 0x0000
    HARDWARE = 0x5000
    INTERNAL_SOFTWARE = 0x6100
    DATA_SET = 0x6300
    BUS_LOST = 0x8100
    OVERRUN = 0x8110
    ERROR_PASSIVE = 0x8120
    HEARTBEAT_LOST = 0x8130
    RECOVERED_FROM_BUS_OFF = 0x8140
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    PDO_MISSING = 0x8250
    VALUE_OUT_OF_RANGE = 0xFF00


ANSWERS, REQUESTS = LSS_COB_IDS

LENGTH = 8
"""Length of every LSS request and answer, in bytes."""

UNCONFIGURED = 255
"""Node-ID of an unconfigured device."""


def node_id_words(node_id: int) -> str:
    """Format a node-ID of LSS."""
    return "no node-ID" if node_id == UNCONFIGURED else f"node-ID {node_id}"


BIT_RATES = {1000: 0, 800: 1, 500: 2, 250: 3, 125: 4, 50: 6, 20: 7, 10: 8}
"""Index in the standard table of bit timings, by kbit/s (CiA 305, Table 1)."""

AUTOMATIC = 9
"""Index in that table for automatic bit rate detection."""


class Lss(IntEnum):
    """Command specifiers; an answer has that of its request unless another is listed."""

    SWITCH_GLOBAL = 0x04
    CONFIGURE_NODE_ID = 0x11
    CONFIGURE_BIT_TIMING = 0x13
    ACTIVATE_BIT_TIMING = 0x15
    STORE = 0x17
    SELECT = 0x40
    """Selects by vendor-ID; the next three select by product code, revision and serial number."""
    SELECTED = 0x44
    IDENTIFY = 0x46
    """Identifies by vendor-ID; the next five by product code, lowest and highest revision and serial number."""
    IDENTIFY_UNCONFIGURED = 0x4C
    IDENTIFY_SLAVE = 0x4F
    UNCONFIGURED_SLAVE = 0x50
    FASTSCAN = 0x51
    INQUIRE = 0x5A
    """Reads the vendor-ID; the next three read product code, revision and serial number."""
    INQUIRE_NODE_ID = 0x5E


LSS_IDENTITY = ("vendor-ID", "product code", "revision number", "serial number")
"""Parts of an identity in the order of SELECT, FASTSCAN and INQUIRE."""

IDENTITY_RANGE = (
    "vendor-ID", "product code", "lowest revision number", "highest revision number", "lowest serial number",
    "highest serial number",
)  # fmt: skip
"""Parts of an identity range in the order of IDENTIFY and its next commands."""


class LssState(IntEnum):
    """LSS states of a device."""

    WAITING = 0
    CONFIGURATION = 1


REFUSALS: Mapping[Lss, Mapping[int, str]] = {
    Lss.CONFIGURE_NODE_ID: {1: "node-ID out of range"},
    Lss.CONFIGURE_BIT_TIMING: {1: "bit rate not supported"},
    Lss.STORE: {1: "storing is not supported", 2: "no access to the storage media"},
}
"""Texts of a service's error codes; 255 is a device-specific error."""

OWN_ERROR = 255

ANY_BIT = 128
"""Bit number of a fastscan that asks for any device."""


def refusal_words(command: Lss, error: int, own: int) -> str:
    """Return why a device refuses a command; `own` is its device-specific code."""
    return f"error {own} of its own" if error == OWN_ERROR else REFUSALS[command].get(error, f"error {error}")
