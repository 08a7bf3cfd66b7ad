"""Bit errors: at a rate, and at chosen places of chosen frames.

Rule of this file: a bit error is asked for when an attempt to send begins, and the same seed gives the same ones. What
becomes of it is the controllers' business. The idle bus has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import log, log1p
from random import Random
from typing import NamedTuple, TypeAlias

from eurobot_od.bus.simulated.controller import Controller
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame

LAST_BUT_ONE = -2
"""The bit of the end of frame before its last: a receiver that sees an error there
discards a frame that the others have already accepted."""

MOST = 0.5
"""The highest bit error rate: with it, bits mean nothing any more."""


class Attempt(NamedTuple):
    """An attempt to send `frame`, which begins at `time`, s, and takes `bits` to its end of frame.

    Without errors it is `frame` that goes out: it has won the arbitration. All `senders` begin, also those that lose.
    """

    time: float
    frame: Frame
    bits: int
    senders: tuple[Controller, ...]


class Flip(NamedTuple):
    """A bit that is seen the other way round, counted from the start of frame, 0: by everyone, or by one controller."""

    bit: int
    at: Controller | None = None


BitErrors: TypeAlias = Callable[[Attempt], Iterable[Flip]]
"""Gives the bit errors of an attempt in the order of their bits; there may be no end to them."""


class Noise:
    """Bit errors of chance: each bit with a probability of `rate`, for everyone or for one controller.

    Raises LocalError for a rate that is not a probability, or above MOST.
    """

    def __init__(self, rate: float, seed: int = 1, at: Controller | None = None) -> None:
        if not 0 <= rate <= MOST:
            raise LocalError(f"a bit error rate is a probability from 0 to {MOST}, not {rate}")
        self._random, self._at = Random(f"{seed} bit errors"), at
        # The distance to the next error has a geometric distribution: one random number per error instead of one per
        # bit, of which a match of 90 s at 500 kbit/s has 45 million.
        self._per_bit = log1p(-rate)

    def __call__(self, _: Attempt) -> Iterator[Flip]:
        """Draw the bits up to each next error, rather than each bit."""
        bit = -1
        while self._per_bit:
            bit += 1 + int(log(1.0 - self._random.random()) / self._per_bit)
            yield Flip(bit, self._at)


def any_frame(_: Attempt) -> bool:
    """Choose every frame."""
    return True


@dataclass
class Strike:
    """An error in one bit of the frames that `which` chooses, for everyone or for one controller.

    A negative `bit` counts from the end of frame; -1 is its last bit. Of the frames that are chosen, the
    first `skip` are left alone, and the next `times` get the error.
    """

    bit: int
    which: Callable[[Attempt], bool] = any_frame
    at: Controller | None = None
    skip: int = 0
    times: float = 1

    def __call__(self, attempt: Attempt) -> Iterator[Flip]:
        """Strike if it is the turn of this attempt."""
        if not self.times or not self.which(attempt):
            return
        # An attempt that is let through counts as skipped, whatever becomes of it on the wire.
        if self.skip:
            self.skip -= 1
            return
        self.times -= 1
        yield Flip(self.bit % attempt.bits if self.bit < 0 else self.bit, self.at)
