"""The objects of the communication profile: where they are, what they are for, their types and access (CiA 301, 302).

Whatever serves, reads or checks such an object imports it from here. A file is checked against the table, and a type
that a file leaves out is taken from it.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from enum import IntEnum
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.values import LSS_COB_IDS, UNSIGNED8, UNSIGNED16, UNSIGNED32, VISIBLE_STRING, Address, DataType

# Where they are: an object by index and sub-index, a record or array by its index

DEVICE_TYPE: Address = (0x1000, 0)
"""Device profile and its functions."""

ERROR_REGISTER: Address = (0x1001, 0)
"""Which classes of errors the device has now, a bit for each."""

ERROR_FIELD = 0x1003
ERRORS: Address = (ERROR_FIELD, 0)
"""The errors that the device remembers, newest first; sub-index 0 is their number, and 0 written there clears them."""

SYNC: Address = (0x1005, 0)
"""COB-ID of SYNC; a device without this object does not know SYNC."""

SYNC_PRODUCER = 1 << 30
"""Bit of 0x1005: the device itself sends SYNC."""

SYNC_PERIOD: Address = (0x1006, 0)
"""Microseconds from one SYNC to the next."""

DEVICE_NAME: Address = (0x1008, 0)
"""The manufacturer's name of the device."""

GUARD_TIME: Address = (0x100C, 0)
"""Milliseconds from one question of a guarding master to the next; a device without this object is not guarded."""

LIFE_TIME_FACTOR: Address = (0x100D, 0)
"""How many guard times the master may miss; 0: any number."""

STORE, RESTORE = 0x1010, 0x1011
"""What stores parameters, or restores their defaults, if it is written its signature; sub-index 1 stands for all."""

ALL_PARAMETERS = 1
"""Sub-index of 0x1010 and 0x1011."""

SIGNATURES: Mapping[int, bytes] = {STORE: b"save", RESTORE: b"load"}
"""What each wants to be written (CiA 301, 7.5.2.13 and 7.5.2.14)."""

COMMANDS = (ERROR_FIELD, STORE, RESTORE)
"""Objects of which a write is a command, and no value that is kept."""

TIME: Address = (0x1012, 0)
"""COB-ID of TIME; a device without this object does not know TIME."""

EMCY: Address = (0x1014, 0)
"""COB-ID of the device's own emergency messages."""

EMCY_INHIBIT_TIME: Address = (0x1015, 0)
"""The shortest time between two of them, in 100 us."""

CONSUMED_HEARTBEATS = 0x1016
"""The nodes whose heartbeats the device watches, and for how long each may be silent."""

HEARTBEAT_TIME: Address = (0x1017, 0)
"""Milliseconds from one heartbeat of the device to the next; 0: none."""

IDENTITY = 0x1018
"""Who the device is: vendor-ID, product code, revision number and serial number, from sub-index 1 on."""

REVISION: Address = (IDENTITY, 3)
SERIAL: Address = (IDENTITY, 4)
"""The revision number of the device."""

SYNC_COUNTER: Address = (0x1019, 0)
"""Up to which number SYNC is counted in its data; 0: it has no data."""

VERIFY_CONFIGURATION: tuple[Address, Address] = ((0x1020, 1), (0x1020, 2))
"""Date and time of the configuration, by which a master knows its own."""

STORED_EDS: Address = (0x1021, 0)
"""The device's own EDS."""

STORE_FORMAT: Address = (0x1022, 0)
"""How that is compressed; 0: not at all."""

MODULE_LIST = 0x1027
"""The modules that are connected to a modular device, by their numbers."""

COMMUNICATION_ERROR: Address = (0x1029, 1)
"""The state that the device enters if its communication fails."""

SDO_REQUESTS: Address = (0x1200, 1)
SDO_ANSWERS: Address = (0x1200, 2)
"""COB-IDs of the SDO server that every device has."""

SDO_SERVERS = range(0x1200, 0x1280)
"""Records of the device's SDO servers: COB-IDs of requests and answers."""

SDO_CLIENTS = range(0x1280, 0x1300)
"""Records of the SDO servers of others that the device uses: COB-IDs of requests and answers, and the node-ID."""

SRDOS = range(0x1301, 0x1341)
"""Records of safety-relevant data objects (CiA 304)."""

SRDO_DIRECTION, SRDO_DATA, SRDO_INVERTED = 1, 5, 6
"""Sub-indices of such a record: 0 for one that is not valid; the COB-IDs of its two frames."""

PDO_SETTINGS = ("COB-ID", "Transmission type", "Inhibit time", "Compatibility entry", "Event timer", "SYNC start value")
"""Communication parameters of a PDO from sub-index 1 on; in CompactPDO a bit for each says that it is there."""

PROGRAM_DATA, PROGRAM_CONTROL, PROGRAM_IDENTIFICATION, FLASH_STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57
"""Program download (CiA 302-3): a program is a sub-index of each."""

NMT_STARTUP: Address = (0x1F80, 0)
"""What a device does after its boot-up, as a master or by itself (CiA 302-2)."""

NOT_PARAMETERS = frozenset(
    {ERROR_REGISTER[0], *COMMANDS, VERIFY_CONFIGURATION[0][0], 0x1023, 0x1024, PROGRAM_DATA, PROGRAM_CONTROL}
)
"""Objects that can be written and are not parameters: a state, a history, a command, a master's own mark."""

MANDATORY = (DEVICE_TYPE[0], ERROR_REGISTER[0], IDENTITY)
"""The objects of every device (CiA 301, 7.5.1)."""

# What they are

READ_ONLY = ("ro", "const")
DATA_SUBS = range(1, 255)


class Known(NamedTuple):
    """What the standard says about the variables at some indices and sub-indices; without `access` any is allowed."""

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
    """Return the type that the standard gives to a variable; None where it says nothing."""
    return next((each.type for each in KNOWN if index in each.indices and sub in each.subs), None)


class ErrorCode(IntEnum):
    """Emergency error codes that any of our devices reports (CiA 301, Table 26).

    CiA 301 has none for a PDO with a value out of range, so that code is one of the device's own.
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
"""Bytes of every LSS request and answer."""

UNCONFIGURED = 255
"""The node-ID of a device that has not been given one."""


def node_id_words(node_id: int) -> str:
    """Return what a node-ID of LSS says, in words."""
    return "no node-ID" if node_id == UNCONFIGURED else f"node-ID {node_id}"


BIT_RATES = {1000: 0, 800: 1, 500: 2, 250: 3, 125: 4, 50: 6, 20: 7, 10: 8}
"""Index in the standard table of bit timings, by kbit/s (CiA 305, Table 1)."""

AUTOMATIC = 9
"""The index in that table for a bit rate that the device finds out."""


class Lss(IntEnum):
    """Command specifiers; an answer has that of its request where no other one is named."""

    SWITCH_GLOBAL = 0x04
    CONFIGURE_NODE_ID = 0x11
    CONFIGURE_BIT_TIMING = 0x13
    ACTIVATE_BIT_TIMING = 0x15
    STORE = 0x17
    SELECT = 0x40
    """Selects by the vendor-ID; the next three by product code, revision and serial number."""
    SELECTED = 0x44
    IDENTIFY = 0x46
    """Identifies by the vendor-ID; the next five by product code, lowest and highest revision and serial number."""
    IDENTIFY_UNCONFIGURED = 0x4C
    IDENTIFY_SLAVE = 0x4F
    UNCONFIGURED_SLAVE = 0x50
    FASTSCAN = 0x51
    INQUIRE = 0x5A
    """Asks for the vendor-ID; the next three for product code, revision and serial number."""
    INQUIRE_NODE_ID = 0x5E


LSS_IDENTITY = ("vendor-ID", "product code", "revision number", "serial number")
"""The parts of an identity, as SELECT, FASTSCAN and INQUIRE count them."""

IDENTITY_RANGE = (
    "vendor-ID", "product code", "lowest revision number", "highest revision number", "lowest serial number",
    "highest serial number",
)  # fmt: skip
"""What IDENTIFY and the commands after it name."""


class LssState(IntEnum):
    """States of a device: it answers to its identity, or is being configured."""

    WAITING = 0
    CONFIGURATION = 1


REFUSALS: Mapping[Lss, Mapping[int, str]] = {
    Lss.CONFIGURE_NODE_ID: {1: "node-ID out of range"},
    Lss.CONFIGURE_BIT_TIMING: {1: "bit rate not supported"},
    Lss.STORE: {1: "storing is not supported", 2: "no access to the storage media"},
}
"""What the error codes of a service mean; 255 is an error of the device's own."""

OWN_ERROR = 255

ANY_BIT = 128
"""Bit number of a fastscan that asks whether any device is there."""


def refusal_words(command: Lss, error: int, own: int) -> str:
    """Say why a device refuses a command; `own` is its own code for that."""
    return f"error {own} of its own" if error == OWN_ERROR else REFUSALS[command].get(error, f"error {error}")
