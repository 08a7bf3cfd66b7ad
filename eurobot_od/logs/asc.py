"""Vector's ASC format, `   2.501010 1  222  Rx   d 8 0C 00 00 00 00 00 00 00`.

Rule of this file: frames are read, the events around them (statistics, chip state, measurement start) are comments.
"""

from __future__ import annotations

import re

from eurobot_od.logs.lines import LineFormat, seconds
from eurobot_od.logs.raw import MAX_LENGTH, Damage, Foreign, Raw, frame, shortened

BASE = re.compile(rb"base\s+(hex|dec)", re.IGNORECASE)
NUMBER = {b"hex": 16, b"dec": 10}
HEADER = re.compile(rb"(//|date\s|base\s|(no\s+)?internal\s|begin\s|end\s|previous\s)|$", re.IGNORECASE)
EVENT = re.compile(rb"\d+\.\d+\s+((?!CANFD|\d)\S+|\d+\s+(Statistic|Status|J1939|TxTrc|Trigger))", re.IGNORECASE)
"""A time and something else than a frame: a word where the channel would be, or behind it."""

DIRECTIONS = (b"Rx", b"Tx", b"TxRq")


class Asc(LineFormat):
    """Reads one ASC log; numbers are hexadecimal unless its header says `base dec`."""

    def __init__(self) -> None:
        self._base = NUMBER[b"hex"]

    def comment(self, line: bytes) -> bool:
        text = line.strip()
        if base := BASE.match(text):
            self._base = NUMBER[base[1].lower()]
        return bool(HEADER.match(text) or EVENT.match(text))

    def split(self, line: bytes) -> tuple[float, str, bytes]:
        stamp, channel, rest = line.split(None, 2)
        if channel.upper() == b"CANFD":
            return seconds(stamp), str(int(rest.split(None, 1)[0]) - 1), b"CANFD " + rest
        return seconds(stamp), str(int(channel) - 1), rest

    def parse(self, rest: bytes) -> Raw:
        words = rest.split()
        foreign = self._foreign(words)
        if foreign:
            return Foreign(foreign, shortened(rest))
        identifier, direction, kind, length, *octets = words
        count = min(int(length, self._base), MAX_LENGTH)
        if direction not in DIRECTIONS or kind != b"d" or len(octets) < count:
            raise ValueError(rest)
        return frame(int(identifier, self._base), bytes(int(octet, self._base) for octet in octets[:count]))

    def _foreign(self, words: list[bytes]) -> Damage | None:
        if b"errorframe" in (word.lower() for word in words[:4]):
            return Damage.ERROR_FRAME
        if words[0] == b"CANFD":
            return Damage.FD
        if words[2] in (b"r", b"R"):
            return Damage.REMOTE
        return Damage.EXTENDED if words[0][-1:] in (b"x", b"X") else None
