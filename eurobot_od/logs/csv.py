"""python-can's CSV format, `1.5,0x8,0,0,0,8,0nQjWSwNlwI=`.

Rule of this file: the seven columns as python-can's CSVWriter writes them, the data in base 64.
"""

from __future__ import annotations

from base64 import b64decode

from eurobot_od.logs.lines import LineFormat, seconds
from eurobot_od.logs.raw import MAX_LENGTH, Damage, Foreign, Raw, frame, shortened

HEADER = b"timestamp,"
FLAGS = {(b"0", b"0"): None, (b"1", b"0"): Damage.REMOTE, (b"0", b"1"): Damage.ERROR_FRAME}
"""What the columns `remote` and `error` say together."""


class Csv(LineFormat):
    """Reads one CSV log; it has no channels."""

    def comment(self, line: bytes) -> bool:
        return not line.strip() or line.startswith(HEADER)

    def split(self, line: bytes) -> tuple[float, str, bytes]:
        stamp, _, rest = line.partition(b",")
        return seconds(stamp), "", rest

    def parse(self, rest: bytes) -> Raw:
        identifier, extended, remote, error, length, base64 = rest.strip().split(b",")
        damage = FLAGS.get((remote, error), Damage.UNREADABLE)
        data = b64decode(base64, validate=True)
        if damage is Damage.UNREADABLE or (damage is None and int(length) != len(data)):
            raise ValueError(rest)
        cob_id = int(identifier, 16)
        if damage is None and len(data) > MAX_LENGTH:
            damage = Damage.FD
        if damage is None and extended == b"1":
            damage = Damage.EXTENDED
        return Foreign(damage, shortened(f"{cob_id:X}#{data.hex().upper()}")) if damage else frame(cob_id, data)
