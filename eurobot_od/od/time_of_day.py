"""The time as CANopen counts it: days since 1984, and milliseconds since midnight (CiA 301, 7.1.6.6)."""

from __future__ import annotations

import re
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


# Objects of the types TIME_OF_DAY and TIME_DIFFERENCE (CiA 301, 7.1.6.6 and 7.1.6.7)

SPAN = re.compile(
    r"(?:(?P<days>[0-9]{1,5})d )?(?P<h>[01]?[0-9]|2[0-3]):(?P<m>[0-5][0-9]):(?P<s>[0-5][0-9])(?:\.(?P<ms>[0-9]{1,3}))?"
)
"""A time span, `1d 02:03:04.567`."""

MOST_DAYS = 0xFFFF


def text(data: bytes, is_moment: bool) -> str | bytes:
    """Write a time for a person, a moment or a time span; bytes that are neither stay bytes."""
    days, milliseconds = int.from_bytes(data[4:], "little"), int.from_bytes(data[:4], "little")
    if milliseconds >= DAY:  # the field's 28 bits hold three days
        return data
    span = timedelta(milliseconds=milliseconds)
    if is_moment:
        return (EPOCH + timedelta(days) + span).isoformat(" ", "milliseconds")
    return f"{days}d {(EPOCH + span).time().isoformat('milliseconds')}"


def data(text: str, is_moment: bool) -> bytes:
    """Return the bytes of a time as `text` writes it; raises ValueError, OverflowError for what it cannot have."""
    if not is_moment:
        found = SPAN.fullmatch(text.strip())
        if found is None or int(found["days"] or 0) > MOST_DAYS:
            raise ValueError(f"{text!r} is not a time span such as 1d 02:03:04.567")
        seconds = int(found["h"]) * 3600 + int(found["m"]) * 60 + int(found["s"])
        # Digits after a point are a fraction: `.5` is 500 ms.
        return TimeOfDay(int(found["days"] or 0), seconds * 1000 + int((found["ms"] or "0").ljust(3, "0"))).data
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise ValueError(f"{text!r} is not a time such as 2014-05-28 12:00:00.000") from None
    # CANopen's time has no zone: what is written counts as it stands, whatever offset follows it.
    time = TimeOfDay.of(moment.replace(tzinfo=None))
    if time.days not in range(MOST_DAYS + 1):
        raise ValueError(f"{text!r} is not within 179 years from {EPOCH:%Y} on")
    return time.data
