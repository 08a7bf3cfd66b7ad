"""TIME: the time of day that a network shares, heard and sent (CiA 301, 7.2.6, 7.1.6.6 and 7.5.2.15).

Rule of this file: there is no clock. The device's own time in seconds comes in; what is kept here is the difference.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from math import inf

from eurobot_od.device.timers import caught_up
from eurobot_od.od.time_of_day import DAY, EPOCH, TimeOfDay

CONSUMER, PRODUCER = 1 << 31, 1 << 30
"""Bits of 0x1012: the device sets its clock by TIME, or sends it."""

PERIOD = 1.0
"""Seconds from one TIME to the next: CiA 301 has no object for that."""

LENGTH = 6
MILLISECONDS = (1 << 28) - 1
"""Bits of the first four bytes that hold the milliseconds after midnight; the others are reserved."""

MOST_DAYS = 0xFFFF


class Clock:
    """The device's clock, at day 0 until it is set; `next` is when TIME is sent again, infinite if it is not."""

    def __init__(self) -> None:
        self.next = inf
        self._ahead = 0.0

    def at(self, now: float) -> datetime:
        """Return what the clock shows."""
        return EPOCH + timedelta(seconds=self._ahead + now)

    def set(self, time: datetime, now: float) -> None:
        """Set the clock."""
        self._ahead = (time - EPOCH).total_seconds() - now

    def hear(self, data: bytes, now: float) -> None:
        """Set the clock by a TIME message; one of another length, or of no time of a day, says nothing."""
        milliseconds = int.from_bytes(data[:4], "little") & MILLISECONDS
        if len(data) == LENGTH and milliseconds < DAY:
            self._ahead = int.from_bytes(data[4:], "little") * (DAY // 1000) + milliseconds / 1000 - now

    def told(self, now: float) -> bytes:
        """Return the data of a TIME message."""
        days, milliseconds = divmod(round((self._ahead + now) * 1000), DAY)
        return TimeOfDay(days & MOST_DAYS, milliseconds).data

    def produce(self, now: float) -> None:
        """Send the time from now on."""
        self.next = now + PERIOD

    def rest(self) -> None:
        """Stop sending the time."""
        self.next = inf

    def due(self, now: float) -> list[bytes]:
        """Return the data of what is to be sent now."""
        if now < self.next:
            return []
        self.next = caught_up(self.next, now) + PERIOD
        return [self.told(now)]
