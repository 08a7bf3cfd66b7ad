"""candump's log format, `(1396.123456) can0 008#D27423592C01C3A5`, with or without ` R` or ` T` at the end.

Rule of this file: the format as can-utils' `candump -l` and python-can write it, and nothing more lenient.
"""

from __future__ import annotations

import re
from binascii import a2b_hex
from functools import cache

from eurobot_od.frame import MOST_BYTES, Frame
from eurobot_od.traffic.entries import LATEST, Damage, Foreign, Raw, frame
from eurobot_od.traffic.formats.lines import LineFormat

OPENING, CLOSING = b"()"
"""The brackets around a time."""

EXTENDED_DIGITS = 8

DIRECTIONS = (b"R", b"T")
"""Received or sent. Any other word belongs to a next entry: the line end between them is lost."""

COB_ID = re.compile(rb"([0-7][0-9A-F]{2})#", re.IGNORECASE)

OTHER_FRAME = re.compile(
    rb"(?P<identifier>[0-7][0-9A-F]{2}|[01][0-9A-F]{7})#(?:R(?P<length>[0-9A-F]?)|(?P<data>(?:[0-9A-F]{2}){0,8}))",
    re.IGNORECASE,
)
"""Frames that are remote, or have 29-bit identifiers, which are written with eight digits."""

FOREIGN = (
    (Damage.ERROR_FRAME, rb"[2367ABEF][0-9A-F]{7}#([0-9A-F]{2})*"),
    (Damage.FD, rb"([0-9A-F]{3}|[0-9A-F]{8})##[0-9A-F]([0-9A-F]{2}){0,64}"),
)
"""What is not a classic frame, the first that fits; an error frame has bit 29 of its identifier set."""


class CandumpFormat(LineFormat):
    """Reads one log of candump."""

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        words = line.split()
        if len(words) > 3 and words.pop() not in DIRECTIONS:
            raise ValueError(line)
        stamp, channel, rest = words
        time = float(stamp[1:-1])
        if not 0 <= time < LATEST or stamp[0] != OPENING or stamp[-1] != CLOSING:
            raise ValueError(line)
        try:
            cob_id, data = _cob_id(rest[:4]), a2b_hex(rest[4:])
        except ValueError:
            return time, channel.decode(), _other(rest)
        if len(data) > MOST_BYTES:
            raise ValueError(line)
        # Without the named tuple's own constructor, which is Python code: a log may have millions of lines.
        return time, channel.decode(), tuple.__new__(Frame, (cob_id, data))


def _other(rest: bytes) -> Raw:
    """Read what is not a classic base data frame; raises ValueError."""
    if found := OTHER_FRAME.fullmatch(rest):
        remote = None if found["length"] is None else int(found["length"] or b"0", 16)
        data = a2b_hex(found["data"] or b"")
        return frame(int(found["identifier"], 16), data, len(found["identifier"]) == EXTENDED_DIGITS, remote)
    for damage, pattern in FOREIGN:
        if re.fullmatch(pattern, rest, re.IGNORECASE):
            return Foreign(damage, rest.decode())
    raise ValueError(rest)


@cache  # int() alone would also read `0_8` and `+08`; there are few identifiers, so that each is checked once
def _cob_id(text: bytes) -> int:
    found = COB_ID.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return int(found[1], 16)
