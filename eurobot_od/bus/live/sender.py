"""Sending in whatever thread has something to send: from the mailboxes to the driver, most urgent first.

Rule of this file: one thread at a time has the turn and sends what others submit meanwhile; no lock is held while the
driver has a frame; and the turn is given back however its owner leaves.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING

from eurobot_od.bus.live.buses import Driver
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

if TYPE_CHECKING:
    from eurobot_od.gatekeeper import Mailboxes

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.1
"""Seconds until a frame that the driver has not taken is tried again; doubled each time, as a full buffer empties
within a frame or two, but a dead adapter stays dead. The longest is what a stop waits at most when the driver is back.
"""


STUCK_AFTER = 1.0
"""Seconds without a frame that is taken, after which the driver has failed: a full buffer empties in milliseconds."""


class Sender:
    """Hands loaded frames to a driver. `lock` guards the mailboxes; `failed` is called when that fails or is stuck.

    `blocked` says that the driver has not taken the last frame. `wake` is called then: the thread that keeps the time
    has to call `retry` after `pause` seconds, and until then no other tries.
    """

    def __init__(
        self,
        driver: Driver,
        mailboxes: Mailboxes,
        lock: RLock,
        clock: Callable[[], float],
        failed: Callable[[BusError], object],
        wake: Callable[[], object],
    ) -> None:
        self.blocked = False
        self.pause = 0.0
        self._driver, self._mailboxes, self._lock = driver, mailboxes, lock
        self._clock, self._failed, self._wake = clock, failed, wake
        self._turn: object | None = None
        self._refused_since: float | None = None

    @property
    def busy(self) -> bool:
        """Whether a thread has the turn."""
        return self._turn is not None

    def retry(self) -> None:
        """Send although the driver has not taken the last frame."""
        self.blocked = False
        self.pump()

    def pump(self) -> None:
        """Send until no frame is left or the driver takes no more.

        Does nothing if another thread has the turn, which sends what is here as well.
        """
        # Ctrl-C may raise between any two lines. A token tells the owner by one assignment, within the `try`: there is
        # no moment in which the turn is taken and would never be given back.
        token = object()
        try:
            frame = self._begin(token)
            while frame is not None:
                frame = self._after(frame, self._hand_over(frame))
        finally:
            if self._turn is token:
                self._turn = None

    def _begin(self, token: object) -> Frame | None:
        with self._lock:
            if self._turn is not None or self.blocked:
                return None
            self._turn = token
            return self._next()

    def _hand_over(self, frame: Frame) -> bool:
        """Hand a frame to the driver; False if that has not taken it."""
        # Not written out in `pump`: CPython 3.11 does not guard the line of an inner `try` by the outer one.
        try:
            return self._driver.send(frame)
        except BusError as failure:
            self._failed(failure)
            return False

    def _after(self, frame: Frame, taken: bool) -> Frame | None:
        """Return the frame after one that the driver has `taken`; otherwise give up, and wait longer each time."""
        with self._lock:
            if taken:
                self._mailboxes.complete(frame)
                self.pause, self._refused_since = 0.0, None
                return self._next()
            self._turn, self.blocked = None, True  # the frame stays in its mailbox
            self.pause = min(max(2 * self.pause, FIRST_PAUSE), LONGEST_PAUSE)
            now = self._clock()
            since = self._refused_since = now if self._refused_since is None else self._refused_since
        if now - since >= STUCK_AFTER:
            self._refused_since = None
            self._failed(self._driver.stuck(now - since))
        self._wake()
        return None

    def _next(self) -> Frame | None:
        """Return the most urgent frame; without one, give the turn back before anyone can submit another."""
        frame = self._mailboxes.next(self._clock())
        if frame is None:
            self._turn = None
        return frame
