"""The simulated bus alone: controllers that always have one more frame, without nodes.

As many frames are sent as have to end in a second; the row checks how many really did.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial

from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way, Wrong
from bench.process import PYTHON, run
from bench.rows.startup import ALL, LOADING, eds_files
from eurobot_od.bus.simulated.network import Bus, Transceiver
from eurobot_od.frame import Frame

BITRATE = 1_000_000
CONTROLLERS = 3
DIFFERENT = 256
"""Frames of each controller that differ in their data."""

FRAMES = 100_000


class Endless:
    """The source of a controller that sends its frames again and again, without an end."""

    def __init__(self, cob_id: int) -> None:
        self._frames = [Frame(cob_id, bytes([number]) * 8) for number in range(DIFFERENT)]
        self._sent = 0

    def urgent(self) -> Frame:
        """Return the next frame."""
        return self._frames[self._sent % DIFFERENT]

    def complete(self, _: Frame) -> None:
        """Go on to the next frame."""
        self._sent += 1


def carried(count: int) -> Figures:
    """Carry `count` frames over a bus; raises Wrong if there were fewer."""
    ended = 0

    def end(frame: Frame, senders: Sequence[Transceiver], _: Sequence[Transceiver]) -> None:
        nonlocal ended
        ended += 1
        for sender in senders:
            sender.source.complete(frame)

    bus = Bus(BITRATE, end)
    bus.transceivers += [Transceiver(Endless(0x100 + number)) for number in range(CONTROLLERS)]
    begin = time.perf_counter()
    now = 0.0
    while ended < count:
        bus.arbitrate(now)
        now = bus.next_event
        bus.advance(now)
    seconds = time.perf_counter() - begin
    if now * BITRATE < count * 111:  # the shortest frame of 8 bytes
        raise Wrong(f"{count} frames in {now:.3f} s of simulated time")
    return {Quantity.TIME: seconds}


@contextmanager
def bare(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield the bus, and canopen that reads three EDS files, as a measure of the machine."""
    count = scale.of(FRAMES, 100)
    yield {"peer": partial(run, [PYTHON, "-c", LOADING, *eds_files(ALL)]), "calm": partial(carried, count)}


SERIES = (
    Series(
        "bus",
        "simulated bus",
        bare,
        (Claim("100 000 frames on the simulated bus: canopen reading 3 EDS", "calm", "peer", Way.RATIO),),
    ),
)
