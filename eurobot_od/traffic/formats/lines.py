"""Logs that consist of lines.

A format turns a line into an entry or says why it cannot. A line that cannot be read is an entry like any other and
costs no other line.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import BinaryIO

from eurobot_od.traffic.entries import BAD, Damage, Entries, Foreign, Raw, shortened


class LineFormat:
    """A format of lines; `entry` and `comment` raise one of BAD for what they cannot read.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Return whether a line that is not an entry belongs to the format all the same; read a header from it."""
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
            # Asked only now: nearly every line is an entry.
            with suppress(*BAD):
                if form.comment(line):
                    continue
            rest = line
            while len(rest) == largest and not rest.endswith(b"\n"):  # too long: on to its end
                rest = file.readline(largest)
            # Only the last line may have no line end: then the log was cut off there.
            damage = Damage.UNREADABLE if rest.endswith(b"\n") else Damage.CUT_OFF
            yield number, time, "", Foreign(damage, shortened(line))
        else:
            yield number, time, channel, raw
