"""python-can's CSV format, `1.5,0x8,0,0,0,8,0nQjWSwNlwI=`.

Its seven columns are those of python-can's CSVWriter, the data in base 64.
"""

from __future__ import annotations

from binascii import a2b_base64

from eurobot_od.frame import MOST_BYTES
from eurobot_od.logs.entries import Damage, Raw, frame_or_foreign, seconds
from eurobot_od.logs.lines import LineFormat

HEADER = b"timestamp,"
FLAGS: dict[tuple[bytes, ...], Damage | None] = {
    (b"0", b"0", b"0"): None,
    (b"1", b"0", b"0"): Damage.EXTENDED,
    **dict.fromkeys([(b"0", b"1", b"0"), (b"1", b"1", b"0")], Damage.REMOTE),
    **dict.fromkeys([(b"0", b"0", b"1"), (b"1", b"0", b"1")], Damage.ERROR_FRAME),
}
"""Damage by the columns `extended`, `remote` and `error`."""

CLASSIC = (None, Damage.EXTENDED)
"""Damage of a classic data frame."""


class CsvFormat(LineFormat):
    """Reads one CSV log; it has no channels."""

    def comment(self, line: bytes) -> bool:
        return not line.strip() or line.startswith(HEADER)

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, identifier, *flags, length, base64 = line.split(b",")
        base64 = base64.rstrip()
        damage, data = FLAGS[tuple(flags)], a2b_base64(base64)
        # a2b_base64 skips what is not base 64: the data is then shorter than the text says.
        if len(base64) != 4 * ((len(data) + 2) // 3):
            raise ValueError(base64)
        if len(data) != int(length) and damage in CLASSIC:  # a remote frame has a length without data
            raise ValueError(line)
        if len(data) > MOST_BYTES and damage in CLASSIC:  # no column says so
            damage = Damage.FD
        return seconds(stamp), "", frame_or_foreign(damage, int(identifier, 16), data)
