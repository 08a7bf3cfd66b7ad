"""The emergency producer: error codes, error register 0x1001 and error field 0x1003 (CiA 301, 7.2.7, 7.5.2.2, 7.5.2.4).

Rule of this file: an error is reported once when it comes and once when it goes, whatever happens in between.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from enum import IntEnum

from eurobot_od.frame import Frame

HISTORY = 8
"""How many errors 0x1003 remembers, the newest first."""

GENERIC = 1 << 0
COMMUNICATION = 1 << 4
MANUFACTURER = 1 << 7
"""Bits of the error register (CiA 301, Table 48)."""


class ErrorCode(IntEnum):
    """Emergency error codes of our nodes (CiA 301, Table 26; 0xFF.. are the device's own)."""

    NO_ERROR = 0x0000
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    EMERGENCY_SHUTDOWN = 0xFF01
    DRIVE_BLOCKED = 0xFF02


REGISTER_BIT = {0x8000: COMMUNICATION, 0xF000: MANUFACTURER}
"""Error register bit by the code's highest digit; every error sets the generic bit, too."""


class Emergencies:
    """The errors of one device: `raised` and `cleared` return the EMCY frames to send.

    `cob_id` gives the value of 0x1014 (None: the device sends no EMCY).
    """

    def __init__(self, cob_id: Callable[[], int | None]) -> None:
        self._cob_id = cob_id
        self._active: dict[Hashable, ErrorCode] = {}
        self.history: list[int] = []

    @property
    def active(self) -> tuple[ErrorCode, ...]:
        """The errors that are there now, oldest first."""
        return tuple(self._active.values())

    @property
    def register(self) -> int:
        """Value of the error register 0x1001."""
        register = 0
        for code in self._active.values():
            register |= GENERIC | REGISTER_BIT[code & 0xF000]
        return register

    def raised(self, code: ErrorCode, what: Hashable, info: bytes = b"") -> list[Frame]:
        """Note an error of `what` with up to 5 bytes of manufacturer `info`; nothing to send if it is known."""
        if self._active.get(what) == code:
            return []
        self._active[what] = code
        self.history = [code, *self.history][:HISTORY]
        return self._frames(code, info)

    def cleared(self, what: Hashable) -> list[Frame]:
        """Note that the error of `what` is gone; nothing to send if there was none."""
        if self._active.pop(what, None) is None:
            return []
        return self._frames(ErrorCode.NO_ERROR, b"")

    def _frames(self, code: ErrorCode, info: bytes) -> list[Frame]:
        cob_id = self._cob_id()
        if cob_id is None:
            return []
        return [Frame(cob_id, code.to_bytes(2, "little") + bytes([self.register]) + info[:5].ljust(5, b"\0"))]
