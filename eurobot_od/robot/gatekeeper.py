"""The CAN gatekeeper (document sections 4 and 6): which listeners get a message, and which frame is sent next.

How it meets the document's requirements:

- *Listeners* (section 4.1). `setQueueCANListener` is `Gatekeeper.add_queue`, `setFunctionCANListener` is
  `add_function`. Listeners are registered before the start, in a table that may be bounded as in the 2014 robot; a
  listener that does not fit is an error with its name, and not lost silently.
- *Hardware filters* (section 6). The 2014 robot could never change its table of listeners, as its filters were indices
  into it. Here `Gatekeeper.filters` makes the filters from the routes when a bus needs them.
- *Transmit-complete interrupt* (section 6). Nothing waits for a mailbox or polls one: frames are submitted to
  `Mailboxes`, and `complete`, which an interrupt would call, makes room for the next one.

Any device's controller has listeners and receive filters (`controller`). The robot of 2014 adds a bounded table of
listeners, and a few mailboxes, for which a frame waits 50 ms.
"""

from __future__ import annotations

import time
from bisect import insort
from collections.abc import Callable
from math import inf

from eurobot_od.controller import (
    SLOW_AFTER,
    Controller,
    Event,
    Registration,
    Report,
    Reporter,
    Stay,
    TransmitQueue,
    TransmitStatistics,
    Waiting,
)
from eurobot_od.errors import ListenerError
from eurobot_od.frame import Frame
from eurobot_od.pdo.protocol import Protocol

MAILBOXES = 3
"""Number of transmit mailboxes of the 2014 robot's controller (document section 6)."""

MAILBOX_WAIT = 0.050
"""Maximum time that a frame waits for a mailbox, in s (document section 6)."""


class Mailboxes(TransmitQueue):
    """`count` mailboxes; a frame that has waited `wait` s for one is dropped.

    `waiting` has the waiting frames, the most urgent first.
    """

    def __init__(self, report: Reporter, count: int = MAILBOXES, wait: float = MAILBOX_WAIT) -> None:
        super().__init__()
        self.count = count
        self.wait = wait
        self._report = report
        self._loaded: list[Waiting] = []

    def _placed(self, frame: Frame, sequence: int, stay: Stay, now: float) -> Waiting:
        """Return a frame with its deadline; it has none if a mailbox is free."""
        # Waiting frames count, too, as they will take the free mailboxes. If one is free for this frame, the controller
        # has it from now on, without a time limit (document section 6).
        full = len(self._loaded) + len(self.waiting) >= self.count
        deadline = now + self.wait if full and stay is Stay.SHORT else inf
        return Waiting(frame.cob_id, sequence, frame, stay, deadline)

    def load(self, now: float) -> list[Frame]:
        """Move the most urgent frames into free mailboxes and return them, for the controller to send."""
        loaded: list[Frame] = []
        while self.waiting and len(self._loaded) < self.count and not self._waits_for_heartbeat():
            # A heartbeat has the highest COB-ID and waits last, but is sent before the segments of a transfer.
            place = -1 if self.waiting[0].stay is Stay.TRANSFER and self.waiting[-1].stay is Stay.PERIODIC else 0
            first = self.waiting[place]
            if first.deadline <= now:
                self._drop(first.frame, now)
            else:
                insort(self._loaded, first)
                loaded.append(first.frame)
            del self.waiting[place]  # last, so that an exception loses no frame
        if self.waiting:
            self.expire(now)
            # Frames that were submitted while a mailbox was free have no deadline; if more urgent ones have taken their
            # place, their time begins now.
            late = now + self.wait
            self.waiting = [
                w._replace(deadline=late) if w.stay is Stay.SHORT and w.deadline > late else w for w in self.waiting
            ]
        return loaded

    def _waits_for_heartbeat(self) -> bool:
        """Return whether a transfer has to wait because a heartbeat is in a mailbox."""
        # A heartbeat has the highest COB-ID of a device. It would lose the arbitration to each segment of a block,
        # until its consumers report it lost.
        return self.waiting[0].stay is Stay.TRANSFER and any(each.stay is Stay.PERIODIC for each in self._loaded)

    def leave(self) -> None:
        super().leave()
        before = len(self._loaded)
        # Loaded frames, too: an old goto must not be sent when the bus is back.
        self._loaded = [each for each in self._loaded if each.stay is Stay.LASTING]
        self._dropped += before - len(self._loaded)

    def holds(self, frame: Frame) -> bool:
        return any(each.frame == frame for each in (*self._loaded, *self.waiting))

    def urgent(self) -> Frame | None:
        return self._loaded[0].frame if self._loaded else None

    def complete(self, frame: Frame) -> bool:
        """Free the mailbox of a frame that was sent (transmit-complete); return whether a mailbox had it."""
        return self._taken(self._loaded, frame)

    @property
    def next_expiry(self) -> float:
        return min((each.deadline for each in self.waiting), default=inf)

    def expire(self, now: float) -> None:
        """Drop the frames that have waited too long; frames in a mailbox stay."""
        expired = [each for each in self.waiting if each.deadline <= now]
        for each in expired:
            self.waiting.remove(each)
            self._drop(each.frame, now)

    def _drop(self, frame: Frame, now: float) -> None:
        self._dropped += 1
        text = f"{frame} found no mailbox for {self.wait * 1000:.0f} ms, {self._dropped} dropped so far"
        self._report(Report(Event.FRAME_DROPPED, f"0x{frame.cob_id:03X}", text, now))

    def statistics(self) -> TransmitStatistics:
        return super().statistics()._replace(loaded=len(self._loaded))


class Gatekeeper(Controller):
    """A controller with a table of listeners and a few mailboxes.

    `table_size` is the maximum number of listeners (0: no limit; 20 in the 2014 robot), `mailboxes` the number of
    frames in the controller; a frame that has waited `mailbox_wait` s for a mailbox is dropped. The other parameters
    are those of `Controller`.
    """

    def __init__(
        self,
        protocol: Protocol,
        *,
        table_size: int = 0,
        mailboxes: int = MAILBOXES,
        mailbox_wait: float = MAILBOX_WAIT,
        slow_after: float = SLOW_AFTER,
        report: Reporter | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        super().__init__(protocol, slow_after=slow_after, report=report, clock=clock)
        self.queue = self.mailboxes = Mailboxes(self.report, mailboxes, mailbox_wait)
        self._table_size = table_size

    def _register(self, registration: Registration) -> None:
        # The limit finds an application that registers listeners in a loop at its start.
        if 0 < self._table_size <= len(self._registrations):
            name = registration.listener.name
            raise ListenerError(f"{name}: the listener table is full, it has {self._table_size} places")
        super()._register(registration)
