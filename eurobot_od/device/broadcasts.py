"""Broadcast services of a device, sending and receiving: SYNC, TIME and EMCY (CiA 301, 7.2.5 to 7.2.7).

There is no clock in this module. The device's time comes in, in s; for TIME only the difference is kept. If several
frames of a PDO wait for a SYNC, the newest is used, and none is kept beyond the next SYNC.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable
from datetime import datetime, timedelta
from math import inf
from typing import NamedTuple

from eurobot_od.device.timers import caught_up
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import DAY, EPOCH, MOST_DAYS, Address, TimeOfDay, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message
from eurobot_od.sdo.wire import Abort, Reason

# SYNC: producer, synchronous TPDOs and RPDOs (7.2.2.3, 7.5.2.5, 7.5.2.22)


COUNTERS = (0, *range(2, 241))
"""Valid values of 0x1019; others are reserved (CiA 301, 7.5.2.22)."""

ACYCLIC = 0
"""Transmission type of a TPDO that is sent at the SYNC after a change (CiA 301, Tables 68 and 72)."""


class SyncProducer:
    """Sends SYNC; `next` is the time of the next one, infinite if none is sent."""

    def __init__(self) -> None:
        self.next = inf
        self._period = 0.0
        self._overflow = self._count = 0

    def restart(self, period: float, overflow: int, now: float) -> None:
        """Start over: the first SYNC comes after `period` s (0.0: none), and the counter starts at 1."""
        self.next = now + period if period else inf  # within one period (CiA 301, 7.5.2.5)
        self._period = period
        self._overflow = overflow
        self._count = 0

    def due(self, now: float) -> list[bytes]:
        """Return the data of a SYNC if it is due, in a list."""
        if now < self.next:
            return []
        self.next = caught_up(self.next, now) + self._period
        if not self._overflow:
            return [b""]
        self._count = self._count % self._overflow + 1
        return [bytes([self._count])]


class Arrival(NamedTuple):
    """A received PDO that waits for SYNC."""

    binding: Binding
    data: bytes
    message: Message


class Synchronous:
    """The synchronous PDOs.

    `type_of` returns the transmission type of a PDO, None if it is not synchronous. `start_of` returns the SYNC start
    value of a TPDO, 0 for any.
    """

    def __init__(self, type_of: Callable[[Binding], int | None], start_of: Callable[[Binding], int]) -> None:
        self._type_of, self._start_of = type_of, start_of
        self._types: dict[Binding, int] = {}
        self._counts: dict[Binding, int] = {}
        self._starts: dict[Binding, int] = {}
        self._asked: set[Binding] = set()
        self._arrived: dict[Binding, Arrival] = {}

    def restart(self, sent: Iterable[Binding], received: Iterable[Binding]) -> None:
        """Start over with these PDOs and their present types; waiting PDOs are dropped."""
        self._types = {each: n for each in (*sent, *received) if (n := self._type_of(each)) is not None}
        self._counts = {each: 0 for each in sent if each in self._types}
        self._starts = {each: start for each in self._counts if (start := self._start_of(each))}
        self._asked.clear()
        self._arrived.clear()

    def __contains__(self, binding: Binding) -> bool:
        return binding in self._types

    def ask(self, binding: Binding) -> None:
        """Note that the application has sent a TPDO; with transmission type 0 it is sent at the next SYNC."""
        self._asked.add(binding)

    def hold(self, arrival: Arrival) -> None:
        """Keep a received PDO until the next SYNC."""
        self._arrived[arrival.binding] = arrival

    def due(self, number: int | None) -> list[Binding]:
        """Count a SYNC, and return the TPDOs to be sent with it; `number` is its counter, or None."""
        self._starts = {binding: start for binding, start in self._starts.items() if start != number}
        started = [each for each in self._counts if each not in self._starts]
        self._counts |= {each: self._counts[each] + 1 for each in started}
        asked = self._asked
        self._asked = set()

        def is_due(binding: Binding) -> bool:
            type_ = self._types[binding]
            return binding in asked if type_ == ACYCLIC else self._counts[binding] % type_ == 0

        return list(filter(is_due, started))

    def arrived(self) -> list[Arrival]:
        """Return the PDOs that take effect now, and remove them."""
        arrived = self._arrived
        self._arrived = {}
        return list(arrived.values())


# TIME (7.1.6.6, 7.5.2.15)


TIME_CONSUMER, TIME_PRODUCER = 1 << 31, 1 << 30
"""Bits of 0x1012: the device receives TIME, or sends it."""

TIME_PERIOD = 1.0
"""Period of TIME in s; CiA 301 has no object for it."""

TIME_LENGTH = 6
MILLISECONDS = (1 << 28) - 1
"""Mask of the milliseconds after midnight in the first four bytes; other bits are reserved."""


class Clock:
    """The device's clock, at day 0 until it is set. `next` is the time of the next TIME, infinite if it sends none."""

    def __init__(self) -> None:
        self.next = inf
        self._ahead = 0.0

    def at(self, now: float) -> datetime:
        """Return the clock's time."""
        return EPOCH + timedelta(seconds=self._ahead + now)

    def set(self, time: datetime, now: float) -> None:
        """Set the clock."""
        self._ahead = (time - EPOCH).total_seconds() - now

    def receive(self, data: bytes, now: float) -> None:
        """Set the clock by a TIME message; one with a wrong length or an invalid time is ignored."""
        milliseconds = int.from_bytes(data[:4], "little") & MILLISECONDS
        if len(data) == TIME_LENGTH and milliseconds < DAY:
            self._ahead = int.from_bytes(data[4:], "little") * (DAY // 1000) + milliseconds / 1000 - now

    def told(self, now: float) -> bytes:
        """Return the data of a TIME message."""
        days, milliseconds = divmod(round((self._ahead + now) * 1000), DAY)
        return TimeOfDay(days & MOST_DAYS, milliseconds).data

    def restart(self, period: float, now: float) -> None:
        """Start over: the first TIME is sent after `period` s (0.0: never)."""
        self.next = now + period if period else inf

    def due(self, now: float) -> list[bytes]:
        """Return the data of a TIME message if it is due, in a list."""
        if now < self.next:
            return []
        self.next = caught_up(self.next, now) + TIME_PERIOD
        return [self.told(now)]


HISTORY = 8
"""Number of errors in 0x1003, newest first."""

WAITING = 16
"""Most EMCY messages that wait for the inhibit time; 0x1003 has the errors of dropped ones."""

PASSING = 1.0
"""Time for which a momentary error, such as an overrun, is present after its last occurrence, in s."""

GENERIC, COMMUNICATION, MANUFACTURER = 1 << 0, 1 << 4, 1 << 7
"""Bits of the error register (CiA 301, Table 48)."""

REGISTER_BITS = (
    "generic error", "current", "voltage", "temperature",
    "communication", "device profile", "reserved bit 6", "manufacturer specific",
)  # fmt: skip
"""Names of the bits of the error register, bit 0 first (CiA 301, 7.5.2.2)."""


REGISTER_BIT = {0x5000: 0, 0x6000: 0, 0x8000: COMMUNICATION, 0xF000: MANUFACTURER}
"""Bit of the error register by the highest digit of the code; every error also sets the generic bit."""


class Emergencies:
    """The errors of a device; `due` returns the EMCY frames to send.

    `cob_id` returns the identifier in 0x1014 (None: no EMCY is sent), `inhibit` the time in 0x1015 in s. `quiet` is set
    if there is nothing to report, now or later. `errors` are the present errors, by subject.
    """

    def __init__(self, cob_id: Callable[[], int | None], inhibit: Callable[[], float]) -> None:
        self._cob_id, self._inhibit = cob_id, inhibit
        self.errors: dict[Hashable, int] = {}
        self._passing: dict[int, float] = {}
        self._waiting: deque[bytes] = deque(maxlen=WAITING)
        self._free = float("-inf")
        self.quiet = True
        self.history: list[int] = []

    @property
    def register(self) -> int:
        """Value of the error register 0x1001."""
        register = 0
        for code in self.errors.values():
            register |= GENERIC | REGISTER_BIT.get(code & 0xF000, 0)
        return register

    # Errors

    def raised(self, code: int, what: Hashable, info: bytes = b"") -> None:
        """Note an error of `what`, with up to 5 bytes of `info`; a present error is not reported again."""
        if self.errors.get(what) != code:
            self.errors[what] = code
            self.history = [code, *self.history][:HISTORY]
            self._report(code, info)

    def cleared(self, what: Hashable) -> None:
        """Note that the error of `what` is gone, if it was present."""
        if self.errors.pop(what, None) is not None:  # first, because the report has the new error register
            self._report(ErrorCode.NO_ERROR, b"")

    def happened(self, code: int, now: float) -> None:
        """Note a momentary error, which is cleared if it does not happen again for a while."""
        self._passing[code] = now + PASSING
        self._free = max(self._free, now)
        self.quiet = False
        self.raised(code, code)

    def _report(self, code: int, info: bytes) -> None:
        self.quiet = False
        # With the present register, which belongs to this error.
        self._waiting.append(code.to_bytes(2, "little") + bytes([self.register]) + info[:5].ljust(5, b"\0"))

    # The error field

    def read_field(self, subindex: int) -> int:
        """Return 0x1003 at a sub-index: the number of errors, or an error; raises Abort if there is none."""
        if subindex > len(self.history):
            raise Abort(Reason.NO_SUCH_ERROR)
        return self.history[subindex - 1] if subindex else len(self.history)

    def clear_field(self, _: Address, value: Value) -> None:
        """Clear 0x1003; only 0 may be written (CiA 301, 7.5.2.4)."""
        if value != 0:
            raise Abort(Reason.ERRORS_NOT_CLEARED)
        # Only the history: present errors and the error register stay.
        self.history.clear()

    # Sending

    @property
    def next(self) -> float:
        """Time of the next report, infinite if none is planned."""
        if self.quiet:
            return inf
        return min([*self._passing.values(), self._free if self._waiting else inf])

    def due(self, now: float) -> list[Frame]:
        """Return the frames that the inhibit time allows by now."""
        for code in [code for code, end in self._passing.items() if end <= now]:
            del self._passing[code]
            self.cleared(code)
        frames: list[Frame] = []
        while self._waiting and self._free <= now:
            # Dropped if EMCY is not valid, so that old reports are not sent later.
            data = self._waiting.popleft()
            cob_id = self._cob_id()
            frames += [] if cob_id is None else [Frame(cob_id, data)]
            self._free = now + inhibit if (inhibit := self._inhibit()) else self._free
        self.quiet = not self._waiting and not self._passing
        return frames
