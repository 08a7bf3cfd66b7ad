"""Logs that consist of lines.

A format turns a line into an entry or says why it cannot. A line that cannot be read is an entry like any other and
costs no other line.
"""

from __future__ import annotations

from functools import partial
from typing import BinaryIO

from eurobot_od.logs.entries import BAD, Damage, Entries, Foreign, Raw, shortened


class LineFormat:
    """A format of lines; `entry` and `comment` raise one of BAD for what they cannot read.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Return whether a line that is no entry belongs to the format all the same; read a header from it."""
        return not line.strip()

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        """Return time in s, channel, and what stands there."""
        raise NotImplementedError


def read_lines(file: BinaryIO, form: LineFormat, largest: int) -> Entries:
    """Read a log of lines; what cannot be read is Foreign, with the time of the entry before.

    Of a line longer than `largest` bytes the start is kept and the rest skipped.
    """
    entry, time, read = form.entry, 0.0, partial(file.readline, largest)
    for number, line in enumerate(iter(read, b""), 1):
        try:
            time, channel, raw = entry(line)
        except BAD:
            if _is_comment(form, line):
                continue
            # only the last line may have no line end: then the log was cut off there
            damage = Damage.UNREADABLE if _ends(line, file, largest) else Damage.CUT_OFF
            yield number, time, "", Foreign(damage, shortened(line))
        else:
            yield number, time, channel, raw


def _is_comment(form: LineFormat, line: bytes) -> bool:
    try:
        return form.comment(line)
    except BAD:
        return False


def _ends(line: bytes, file: BinaryIO, largest: int) -> bool:
    """Return whether a line has an end; a line that is too long is read to its end."""
    while len(line) == largest and not line.endswith(b"\n"):
        line = file.readline(largest)
    return line.endswith(b"\n")
