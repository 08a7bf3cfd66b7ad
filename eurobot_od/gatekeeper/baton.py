"""The baton: which of two threads goes on behind a call of a listener that does not return.

Rule of this file: exactly one goes on, and the one in the call takes no lock unless the other reaches for its baton at
that moment. Each writes first and looks afterwards: whoever finds that the other has written asks under the lock.
"""

from __future__ import annotations

from threading import Lock
from typing import Any, TypeAlias

Call: TypeAlias = tuple[Any, ...]
"""A call under way; what it has in it is its owner's business."""


class Baton:
    """Held by the thread that receives, until another thread takes it out of a call.

    The holder sets `call` before each call and to None behind it, and then, if the baton is `claimed`, asks whether it
    is `lost`.
    """

    __slots__ = ("_lock", "call", "claimed")

    def __init__(self) -> None:
        self.call: Call | None = None
        self.claimed = False
        self._lock = Lock()

    def take(self, call: Call) -> bool:
        """Take the baton out of a call, in another thread; False if that has returned, or has lost it already."""
        with self._lock:
            if self.claimed:
                return False
            self.claimed = True  # before the look at the call: one that ends from here on finds it
            self.claimed = self.call is call
            return self.claimed

    def lost(self) -> bool:
        """Tell the holder, behind a call, whether another thread has the baton's work from now on."""
        with self._lock:
            return self.claimed
