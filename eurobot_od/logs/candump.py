"""candump's log format, `(1396.123456) can0 008#D27423592C0D9702`, with or without ` R` or ` T` at the end.

Rule of this file: the format as can-utils' `candump -l` and python-can write it, and nothing more lenient.
"""

from __future__ import annotations

import re

from eurobot_od.frame import Frame
from eurobot_od.logs.lines import LATEST, LineFormat
from eurobot_od.logs.raw import Damage, Foreign, Raw, frame

OPENING, CLOSING = b"()"
"""What stands around a time."""

FOREIGN = (
    (Damage.ERROR_FRAME, rb"[2367ABEF][0-9A-F]{7}#([0-9A-F]{2})*"),
    (Damage.FD, rb"([0-9A-F]{3}|[0-9A-F]{8})##[0-9A-F]([0-9A-F]{2}){0,64}"),
    (Damage.REMOTE, rb"([0-9A-F]{3}|[0-9A-F]{8})#R[0-9A-F]?"),
    (Damage.EXTENDED, rb"[0-9A-F]{8}#([0-9A-F]{2}){0,8}"),
)
"""What is no classic base data frame, the first that fits; an error frame has bit 29 of its identifier set."""


class Candump(LineFormat):
    """Reads one log of candump."""

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, rest, *_ = line.split()
        time = float(stamp[1:-1])
        if 0 <= time < LATEST and stamp[0] == OPENING and stamp[-1] == CLOSING:
            return time, channel.decode(), parse(rest)
        raise ValueError(line)


def parse(rest: bytes) -> Raw:
    """Read what stands behind the channel, `008#D27423592C0D9702`; raises ValueError."""
    return _frame(rest) if rest[3:4] == b"#" and rest[4:5] not in (b"#", b"R", b"r") else _foreign(rest)


def _frame(rest: bytes) -> Frame:
    octets = bytes.fromhex("0" + rest.replace(b"#", b"", 1).decode())
    return frame(int.from_bytes(octets[:2], "big"), octets[2:])


def _foreign(rest: bytes) -> Foreign:
    for damage, pattern in FOREIGN:
        if re.fullmatch(pattern, rest, re.IGNORECASE):
            return Foreign(damage, rest.decode())
    raise ValueError(rest)
