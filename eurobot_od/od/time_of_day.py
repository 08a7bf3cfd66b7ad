"""The time as CANopen counts it: days since 1984, and milliseconds since midnight (CiA 301, 7.1.6.6)."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import NamedTuple

EPOCH = datetime(1984, 1, 1)  # a time of day in the place where the network is
"""Day 0 of TIME_OF_DAY."""

DAY = 24 * 60 * 60 * 1000
"""Milliseconds."""


class TimeOfDay(NamedTuple):
    """`days` since the EPOCH, and `milliseconds` since midnight."""

    days: int
    milliseconds: int

    @classmethod
    def of(cls, now: datetime) -> TimeOfDay:
        """Return the time of day of a moment."""
        return cls(*divmod((now - EPOCH) // timedelta(milliseconds=1), DAY))

    @property
    def data(self) -> bytes:
        """The data of a time stamp message (CiA 301, 7.2.6)."""
        return self.milliseconds.to_bytes(4, "little") + self.days.to_bytes(2, "little")
