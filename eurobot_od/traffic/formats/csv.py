"""python-can's CSV format, `1.5,0x8,0,0,0,8,0nQjWSwNlwI=`.

Its seven columns are those of python-can's CSVWriter, the data in base 64.
"""

from __future__ import annotations

from binascii import a2b_base64

from eurobot_od.frame import MOST_BYTES
from eurobot_od.traffic.entries import Damage, Raw, foreign, frame, seconds
from eurobot_od.traffic.formats.lines import LineFormat

HEADER = b"timestamp,"
FLAGS = {b"0": False, b"1": True}
"""What the columns `extended`, `remote` and `error` may say."""


class CsvFormat(LineFormat):
    """Reads one CSV log; it has no channels."""

    def comment(self, line: bytes) -> bool:
        return not line.strip() or line.startswith(HEADER)

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, identifier, *flags, length, base64 = line.split(b",")
        base64 = base64.rstrip()
        (extended, remote, error), data = map(FLAGS.__getitem__, flags), a2b_base64(base64)
        # a2b_base64 skips what is not base 64: the data is then shorter than the text says.
        if len(base64) != 4 * ((len(data) + 2) // 3):
            raise ValueError(base64)
        if error:
            return seconds(stamp), "", foreign(Damage.ERROR_FRAME, int(identifier, 16), data)
        if remote:  # it has a length without data
            return seconds(stamp), "", frame(int(identifier, 16), b"", extended, int(length))
        if len(data) != int(length):
            raise ValueError(line)
        if len(data) > MOST_BYTES:  # no column says so
            return seconds(stamp), "", foreign(Damage.FD, int(identifier, 16), data)
        return seconds(stamp), "", frame(int(identifier, 16), data, extended)
