"""Logs that consist of lines.

Rule of this file: a line is split into its time, its channel and the rest, and the rest is parsed once for each
distinct text. A line that cannot be read is an entry like any other and costs no other line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache

from eurobot_od.logs.raw import REMEMBERED, Damage, Entries, Foreign, Raw, Understand, Understood, shortened

LATEST = 1e11
"""A time in s that no log has; it also sorts out `nan` and `inf`."""


class LineFormat:
    """A format of lines; `split` and `parse` raise ValueError for what is no entry.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Tell whether a line that cannot be split belongs to the format all the same; read a header from it."""
        return not line.strip()

    def split(self, line: bytes) -> tuple[float, str, bytes]:
        """Return time in s, channel, and what of the line says which frame it is."""
        raise NotImplementedError

    def parse(self, rest: bytes) -> Raw:
        """Return the frame."""
        raise NotImplementedError


def read_lines(
    lines: Iterable[bytes],
    form: LineFormat,
    understand: Understand[Understood],
    before: int = 0,
    time: float = 0.0,
) -> Entries[Understood]:
    """Read a log of lines; what cannot be read is Foreign, with the time of the entry before.

    `before` is the number of lines before these, `time` that of the last entry among them.
    """
    split = form.split
    once: Callable[[bytes], Understood] = lru_cache(REMEMBERED)(lambda rest: understand(form.parse(rest)))
    for number, line in enumerate(lines, before + 1):
        try:
            time_read, channel, rest = split(line)
            what = once(rest)
        except (ValueError, LookupError):
            if form.comment(line):
                continue
            channel, what = "", understand(_unreadable(line))
        else:
            time = time_read
        yield number, time, channel, what


def _unreadable(line: bytes) -> Foreign:
    """Say what a line is that cannot be read: only the last one has no line end, if the log was cut off."""
    return Foreign(Damage.UNREADABLE if line.endswith(b"\n") else Damage.CUT_OFF, shortened(line))


def seconds(text: bytes) -> float:
    """Read a time in s; raises ValueError."""
    time = float(text)
    if not 0 <= time < LATEST:
        raise ValueError(text)
    return time
