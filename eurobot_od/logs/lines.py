"""Logs that consist of lines.

Rule of this file: a format makes an entry of a line or says why not. A line that cannot be read is an entry like any
other and costs no other line.
"""

from __future__ import annotations

from collections.abc import Iterable

from eurobot_od.logs.entries import Damage, Entries, Foreign, Raw, shortened

LATEST = 1e11
"""A time in s that no log has; it also sorts out `nan` and `inf`."""


class LineFormat:
    """A format of lines; `entry` raises ValueError or LookupError for what it cannot read.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Tell whether a line that cannot be split belongs to the format all the same; read a header from it."""
        return not line.strip()

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        """Return time in s, channel, and what stands there."""
        raise NotImplementedError


def read_lines(lines: Iterable[bytes], form: LineFormat) -> Entries:
    """Read a log of lines; what cannot be read is Foreign, with the time of the entry before."""
    entry, time = form.entry, 0.0
    for number, line in enumerate(lines, 1):
        try:
            time, channel, raw = entry(line)
        except (ValueError, LookupError):
            if form.comment(line):
                continue
            # only the last line may have no line end: then the log was cut off there
            damage = Damage.UNREADABLE if line.endswith(b"\n") else Damage.CUT_OFF
            yield number, time, "", Foreign(damage, shortened(line))
        else:
            yield number, time, channel, raw


def seconds(text: bytes) -> float:
    """Read a time in s; raises ValueError."""
    time = float(text)
    if not 0 <= time < LATEST:
        raise ValueError(text)
    return time
