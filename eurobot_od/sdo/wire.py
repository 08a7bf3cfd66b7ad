"""Why an SDO access is refused: the abort codes of CiA 301 (7.2.4.3.17, Table 22) and the error that carries one.

Rule of this file: the code names the true cause; there is no code for "something went wrong".
"""

from __future__ import annotations

from enum import IntEnum

from eurobot_od.errors import LocalError


class AbortCode(IntEnum):
    """SDO abort codes that a device of ours sends or understands."""

    TOGGLE_BIT = 0x0503_0000
    TIMEOUT = 0x0504_0000
    UNKNOWN_COMMAND = 0x0504_0001
    BLOCK_SIZE = 0x0504_0002
    SEQUENCE_NUMBER = 0x0504_0003
    CRC = 0x0504_0004
    OUT_OF_MEMORY = 0x0504_0005
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    MAPPING_TOO_LONG = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    HARDWARE = 0x0606_0000
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    NOT_TRANSFERRED = 0x0800_0020
    DEVICE_STATE = 0x0800_0022
    NO_DATA = 0x0800_0024


class Abort(LocalError):
    """An access to an object that the device refuses, and its `code`."""

    def __init__(self, code: AbortCode, why: str = "") -> None:
        self.code = code
        text = f"0x{code:08X} {code.name.lower().replace('_', ' ')}"
        super().__init__(f"{text}: {why}" if why else text)
