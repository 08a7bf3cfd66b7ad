"""PEAK's TRC format in its versions 1.0 to 2.1, `  7)  103.250 DT 008 Rx 8 D2 74 23 59 2C 01 C3 A5`.

A version is the order of its columns; from version 2 on the header has it.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from eurobot_od.traffic.entries import LATEST, Damage, Foreign, Raw, frame, shortened
from eurobot_od.traffic.formats.lines import LineFormat

COLUMNS = {"1.0": "N,O,I,L,D", "1.1": "N,O,T,I,L,D", "1.2": "N,O,B,T,I,L,D", "1.3": "N,O,B,T,I,R,L,D"}
"""Columns of the versions that do not list theirs; letters as in version 2: number, offset, type, identifier, ..."""

FRAMES: dict[str, Damage | None] = {
    **dict.fromkeys(("DT", "Rx", "Tx")),
    **dict.fromkeys(("FD", "FB", "FE", "BI"), Damage.FD),
    **dict.fromkeys(("ER", "Error"), Damage.ERROR_FRAME),
    "RR": None,
}
EVENTS = ("ST", "EC", "EV", "Warng")
"""Types of entries that are frames, and what kind of; and those that are not."""

REMOTE, REMOTE_DATA = "RR", "RTR"
"""A remote frame, by its type in some versions, and in others by what stands in place of its data."""

EXTENDED_DIGITS = 5
"""Identifiers with this many digits or more have 29 bits."""

EPOCH = datetime(1899, 12, 30, tzinfo=UTC)
"""What $STARTTIME counts days from."""


class TrcFormat(LineFormat):
    """Reads one TRC log."""

    def __init__(self) -> None:
        self._start = 0.0
        self._set_columns(COLUMNS["1.0"])

    def _set_columns(self, columns: str) -> None:
        """Note where each column is after the number and the offset; the data is the last one."""
        letters = columns.strip().split(",")[2:]
        # `l` is the number of bytes, `L` the DLC; a version has one of them.
        self._identifier, self._length = letters.index("I"), letters.index("l" if "l" in letters else "L")
        self._data = len(letters) - 1
        self._bus, self._type = (letters.index(each) if each in letters else None for each in "BT")

    def comment(self, line: bytes) -> bool:
        text = line.decode("latin-1").strip()
        if not text.startswith(";"):
            return not text or any(word in EVENTS for word in text.split()[2:4])
        key, _, value = text.partition("=")
        if key == ";$STARTTIME":
            self._start = (EPOCH + timedelta(days=float(value))).timestamp()
        elif key == ";$COLUMNS":
            self._set_columns(value)
        elif key == ";$FILEVERSION" and value in COLUMNS:
            self._set_columns(COLUMNS[value])
        return True

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        _, offset, rest = line.split(None, 2)
        time = float(offset) / 1000 + self._start
        if line[:1] == b";" or not abs(time) < LATEST:
            raise ValueError(line)
        words = rest.decode("ascii").split(None, self._data)  # the data, last and with blanks in it, in one piece
        channel = "1" if self._bus is None else words[self._bus]  # versions without that column record one bus
        identifier, data = words[self._identifier], " ".join(words[self._data :]).rstrip()
        kind = None if self._type is None else words[self._type]
        damage = None if kind is None else FRAMES[kind]
        if damage is not None:
            return time, channel, Foreign(damage, shortened(rest))
        is_remote, length = kind == REMOTE or data == REMOTE_DATA, int(words[self._length])
        octets = b"" if is_remote else bytes.fromhex(data)
        if not is_remote and length != len(octets):
            raise ValueError(rest)
        extended = len(identifier) >= EXTENDED_DIGITS
        return time, channel, frame(int(identifier, 16), octets, extended, length if is_remote else None)
