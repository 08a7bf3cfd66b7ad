"""What the frames of the layer setting services say: commands, identity, bit rates, refusals (CiA 305).

`client.lss` sends them, and the decoder of logs explains them.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from eurobot_od.od.values import LSS_COB_IDS

ANSWERS, REQUESTS = LSS_COB_IDS

LENGTH = 8
"""Bytes of every LSS request and answer."""

UNCONFIGURED = 255
"""The node-ID of a device that has not been given one."""

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


IDENTITY = ("vendor-ID", "product code", "revision number", "serial number")
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
