"""Sending in whatever thread has something to send: from the mailboxes to the driver, most urgent first.

Rule of this file: one thread at a time is at it, and sends what others submit meanwhile; no lock is held while the
driver has a frame.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING

from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.live.buses import RETRY, Driver

if TYPE_CHECKING:
    from eurobot_od.gatekeeper import Mailboxes


class Sender:
    """Hands loaded frames to a driver. `lock` guards the mailboxes; `failed` is told when the driver fails.

    `busy` tells that a thread is at it, `blocked` that the driver has not taken the last frame.
    """

    def __init__(
        self,
        driver: Driver,
        mailboxes: Mailboxes,
        lock: RLock,
        clock: Callable[[], float],
        failed: Callable[[BusError], object],
    ) -> None:
        self.busy = self.blocked = False
        self._driver, self._mailboxes, self._lock = driver, mailboxes, lock
        self._clock, self._failed = clock, failed

    def pump(self, timeout: float = RETRY) -> None:
        """Send until no frame is left or the driver takes no more within `timeout` seconds."""
        with self._lock:
            frame = self.begin()
        self.go_on(frame, timeout)

    def begin(self) -> Frame | None:
        """Return the frame that this thread has to send with `go_on`, None if there is none; to be called locked.

        None, too, if another thread is at it, which sends what is here as well.
        """
        if self.busy:
            return None
        self.blocked = False
        return self._next()

    def go_on(self, frame: Frame | None, timeout: float) -> None:
        """Send the frame of `begin` and what comes behind it."""
        while frame is not None:
            try:
                sent = self._driver.send(frame, timeout)
            except BusError as failure:
                self._failed(failure)
                sent = False
            with self._lock:
                frame = self._next(frame) if sent else self._give_up()

    def _next(self, sent: Frame | None = None) -> Frame | None:
        """Return the most urgent frame; without one, this thread is done before anyone can submit another."""
        if sent is not None:
            self._mailboxes.complete(sent)
        frame = self._mailboxes.next(self._clock())
        self.busy = frame is not None
        return frame

    def _give_up(self) -> Frame | None:
        """Leave the frame that the driver has not taken in its mailbox."""
        self.busy, self.blocked = False, True
        return None
