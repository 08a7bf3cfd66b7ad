"""Vector's ASC format, `   2.501010 1  222  Rx   d 8 0C 00 00 00 00 00 00 00`.

Frames are read; the events between them (statistics, chip state, measurement start) count as comments.
"""

from __future__ import annotations

import re
from functools import cache

from eurobot_od.frame import MOST_BYTES
from eurobot_od.traffic.entries import Damage, Foreign, Raw, frame, seconds, shortened
from eurobot_od.traffic.formats.lines import LineFormat

BASE = re.compile(rb"base\s+(hex|dec)", re.IGNORECASE)
NUMBER = {b"hex": 16, b"dec": 10}
HEADER = re.compile(rb"(//|date\s|base\s|(no\s+)?internal\s|begin\s|end\s|previous\s)|$", re.IGNORECASE)
EVENT = re.compile(rb"\d+\.\d+\s+((?!CANFD|\d)\S+|\d+\s+(Statistic|Status|J1939|TxTrc|Trigger))", re.IGNORECASE)
"""A line with a time that is not a frame: a word in place of the channel, or after it."""

DIRECTIONS = (b"Rx", b"Tx", b"TxRq")
ERROR_FRAME, CANFD, DATA, REMOTE, EXTENDED = b"errorframe", b"CANFD", b"d", (b"r", b"R"), (b"x", b"X")


class AscFormat(LineFormat):
    """Reads one ASC log; numbers are hexadecimal unless its header says `base dec`."""

    def __init__(self) -> None:
        self._base = NUMBER[b"hex"]

    def comment(self, line: bytes) -> bool:
        text = line.strip()
        if base := BASE.match(text):
            self._base = NUMBER[base[1].lower()]
        return bool(HEADER.match(text) or EVENT.match(text))

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, *words = line.split()
        is_fd = channel.upper() == CANFD
        foreign = Damage.ERROR_FRAME if ERROR_FRAME in line.lower() else Damage.FD if is_fd else None
        if foreign:
            channel = words[0] if is_fd else channel  # the word stands before the channel
            return seconds(stamp), _channel(channel), Foreign(foreign, shortened(line.split(None, 2)[2]))
        identifier, direction, kind, *rest = words
        extended, number = identifier[-1:] in EXTENDED, int(identifier.rstrip(b"xX"), self._base)
        if direction not in DIRECTIONS or kind not in (*REMOTE, DATA):
            raise ValueError(line)
        if kind in REMOTE:  # CANalyzer leaves the length out
            made = frame(number, b"", extended, int(rest[0], self._base) if rest else 0)
        else:
            made = frame(number, self._data(*rest), extended)
        return seconds(stamp), _channel(channel), made

    def _data(self, length: bytes, *octets: bytes) -> bytes:
        count = min(int(length, self._base), MOST_BYTES)  # a DLC of 9 to 15 means 8 bytes, too (ISO 11898-1)
        data = bytes([int(octet, self._base) for octet in octets[:count]])
        if len(data) != count:
            raise ValueError(octets)
        return data


@cache
def _channel(channel: bytes) -> str:
    """Return a channel as python-can counts them, from 0."""
    return str(int(channel) - 1)
