"""The transmit side of a CAN controller: a few mailboxes, with an ordered queue in front of them (document section 6).

A frame is submitted, loaded when a mailbox is free, and done when the controller reports transmit-complete. Nothing
waits and nothing is polled. The lowest COB-ID leaves first, equal ones in the order submitted.

A frame that finds a mailbox free never expires, however late the driver takes it. Only a frame that has to wait for a
mailbox may be dropped, and its `Stay` says how long it waits. While the bus is away only LASTING frames are kept: an
old goto or heartbeat is of no use to anybody. `load` is ordered so that an exception between two lines (Ctrl-C) leaves
a frame in both places rather than in neither: a stop had better be sent twice than never.

It is not thread-safe: one owner calls it, or callers share a lock.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable
from enum import Enum, auto
from math import inf
from typing import NamedTuple

from eurobot_od.frame import Frame
from eurobot_od.gatekeeper.listeners import Event, Report, Reporter

MAILBOXES = 3
"""Transmit mailboxes of the 2014 robot's controller (document section 6)."""

MAILBOX_WAIT = 0.050
"""Seconds that a frame may wait for a mailbox (document section 6)."""


class Stay(Enum):
    """How long a frame waits for a mailbox."""

    SHORT = auto()
    """As long as the document says (section 6)."""
    PERIODIC = auto()
    """Until the next frame of its identifier takes its place: a heartbeat, of which only the newest counts."""
    TRANSFER = auto()
    """As long as it takes: part of an SDO transfer, which would fail without it. It lets a heartbeat go first."""
    LASTING = auto()
    """As long as it takes, even while the bus is away: a stop."""


class Waiting(NamedTuple):
    """A frame on its way; tuples compare from the left, so they sort in the order in which they leave.

    `sequence` counts the submitted frames: it keeps equal COB-IDs in order, and comparisons never go beyond it.
    """

    cob_id: int
    sequence: int
    deadline: float
    frame: Frame
    stay: Stay


class TransmitStatistics(NamedTuple):
    """Numbers of frames: submitted = completed + dropped + waiting + loaded.

    A periodic frame counts as dropped if the next one has come before a mailbox was free.
    """

    submitted: int
    completed: int
    dropped: int
    waiting: int
    loaded: int


class Mailboxes:
    """`count` mailboxes; a frame that has waited for one for `wait` seconds since its submission is dropped."""

    def __init__(self, report: Reporter, count: int = MAILBOXES, wait: float = MAILBOX_WAIT) -> None:
        self.count, self.wait = count, wait
        self._report = report
        self._submitted = self._completed = self._dropped = 0
        self._waiting: list[Waiting] = []
        self._loaded: list[Waiting] = []
        self._away: int | None = None
        """How many frames had been dropped when the bus was lost; None while the bus is there."""

    def submit(self, frame: Frame, now: float, stay: Stay = Stay.SHORT) -> None:
        """Put a frame in its place among those that wait for a mailbox.

        If a mailbox is free now, the frame cannot be too late, however late the bus is served.
        """
        if self._away is not None and stay is not Stay.LASTING:
            self._submitted += 1
            self._dropped += 1
            return
        if stay is Stay.PERIODIC:
            # A waiting heartbeat is outdated once the next one comes, and must not take up a mailbox of its own.
            self._withdraw(lambda each: each.stay is Stay.PERIODIC and each.cob_id == frame.cob_id)
        # Frames that already wait count too: they will take the free mailboxes, unless this one is more urgent.
        full = len(self._loaded) + len(self._waiting) >= self.count
        # With a mailbox free, the frame belongs to the controller from now on, which has no time limit (document
        # section 6).
        deadline = now + self.wait if full and stay is Stay.SHORT else inf
        # Sorted when submitted: frames come one at a time, and each transmit-complete asks for the most urgent one.
        insort(self._waiting, Waiting(frame.cob_id, self._submitted, deadline, frame, stay))
        self._submitted += 1

    def load(self, now: float) -> list[Frame]:
        """Move the most urgent frames into free mailboxes and return them, for the controller to send."""
        loaded: list[Frame] = []
        while self._waiting and len(self._loaded) < self.count and not self._lets_go_first():
            # A heartbeat has the highest identifier and so waits last; it overtakes the segments of a transfer.
            place = -1 if self._waiting[0].stay is Stay.TRANSFER and self._waiting[-1].stay is Stay.PERIODIC else 0
            first = self._waiting[place]
            if first.deadline <= now:
                self._drop(first.frame, now)
            else:
                insort(self._loaded, first)
                loaded.append(first.frame)
            del self._waiting[place]  # only now: an exception before leaves it in both places
        if self._waiting:
            self.expire(now)
            # Frames that were submitted while a mailbox was free had no deadline; if more urgent ones have taken their
            # place, they may wait from now on as long as any other.
            late = now + self.wait
            self._waiting = [
                w._replace(deadline=late) if w.stay is Stay.SHORT and w.deadline > late else w for w in self._waiting
            ]
        return loaded

    def _lets_go_first(self) -> bool:
        """Tell whether a transfer has to wait because a heartbeat is in a mailbox."""
        # A heartbeat's identifier is the greatest that a device sends: it would lose the arbitration to one segment of
        # a block after the other, until its consumers take the device for dead.
        return self._waiting[0].stay is Stay.TRANSFER and any(each.stay is Stay.PERIODIC for each in self._loaded)

    def leave(self) -> None:
        """Note that the bus is away: what waits, or is submitted from now on, is dropped unless it is LASTING.

        It is counted and not reported: `come_back` returns the number.
        """
        if self._away is None:
            self._away = self._dropped
        self._withdraw(lambda each: each.stay is not Stay.LASTING)
        before = len(self._loaded)
        # Loaded frames as well: a goto from before the gap must not leave when the bus is back.
        self._loaded = [each for each in self._loaded if each.stay is Stay.LASTING]
        self._dropped += before - len(self._loaded)

    def come_back(self) -> int:
        """Note that the bus is back; return how many frames were dropped meanwhile."""
        # They make one report, not one each: a second without a bus at full load would make thousands.
        before, self._away = self._away, None
        return 0 if before is None else self._dropped - before

    def withdraw(self, cob_id: int) -> None:
        """Drop the waiting frames of an identifier, as whatever they answer is over."""
        if self._waiting:
            self._withdraw(lambda each: each.cob_id == cob_id)

    def _withdraw(self, over: Callable[[Waiting], bool]) -> None:
        before = len(self._waiting)
        self._waiting = [each for each in self._waiting if not over(each)]
        self._dropped += before - len(self._waiting)

    def holds(self, frame: Frame) -> bool:
        """Tell whether an equal frame waits or is in a mailbox."""
        return any(each.frame == frame for each in (*self._loaded, *self._waiting))

    def next(self, now: float) -> Frame | None:
        """Load frames into free mailboxes, and return the one to send first, None without any.

        For a caller that plays the controller, as the sender of a live bus does.
        """
        if self._waiting:
            self.load(now)
        return self.urgent()

    def urgent(self) -> Frame | None:
        """Return the loaded frame that the controller sends first, None without any."""
        return self._loaded[0].frame if self._loaded else None

    def complete(self, frame: Frame) -> bool:
        """Free the mailbox of a frame that was sent (transmit-complete); False if no mailbox holds it."""
        # The first of equal frames: they are kept in order, so it is the one that left first.
        for place, each in enumerate(self._loaded):
            if each.frame == frame:
                del self._loaded[place]
                self._completed += 1
                return True
        return False

    @property
    def waits(self) -> bool:
        """Whether any frame waits for a mailbox."""
        return bool(self._waiting)

    @property
    def next_expiry(self) -> float | None:
        """Time in seconds when the first waiting frame will have waited too long; None if none waits."""
        return min((each.deadline for each in self._waiting), default=None)

    def expire(self, now: float) -> None:
        """Drop the frames that have waited too long; frames in a mailbox belong to the controller and stay."""
        expired = [each for each in self._waiting if each.deadline <= now]
        for each in expired:
            self._waiting.remove(each)
            self._drop(each.frame, now)

    def _drop(self, frame: Frame, now: float) -> None:
        self._dropped += 1
        text = f"{frame} found no mailbox for {self.wait * 1000:.0f} ms, {self._dropped} dropped so far"
        self._report(Report(Event.FRAME_DROPPED, f"0x{frame.cob_id:03X}", text, now))

    def statistics(self) -> TransmitStatistics:
        """Return the counts so far."""
        counts = self._submitted, self._completed, self._dropped
        return TransmitStatistics(*counts, waiting=len(self._waiting), loaded=len(self._loaded))
