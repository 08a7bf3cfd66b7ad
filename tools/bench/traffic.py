"""Frames as the robot's bus carries them, with random values: the mix of a simulated match, made from a seed.

Identifiers, bits and ranges come from the loaded dialect. Each value is within its range and new for each frame, so
that no program can reuse what it has decoded before.
"""

from __future__ import annotations

import random
import tempfile
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import can

from bench.process import OURS, run
from eurobot_od.frame import Frame
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import OutOfRange
from eurobot_od.robot.protocol import EurobotProtocol

SEED = 2014
BEGIN, PERIOD = 1396.123456, 0.000217
"""Time of the first frame and from one to the next, s: close together, as on a full bus of 1 Mbit/s."""


class Timed(NamedTuple):
    """A frame and its time in seconds."""

    time: float
    frame: Frame


@cache
def mix() -> tuple[Frame, ...]:
    """Return all frames of a simulated match, as they were sent."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "match.log")
        run([*OURS, "match", "--log", log])
        with can.LogReader(log) as messages:
            return tuple(Frame(each.arbitration_id, bytes(each.data)) for each in messages)


def recorded_traffic(count: int) -> Iterator[Timed]:
    """Yield the frames of a match unchanged, again and again."""
    for number, frame in zip(range(count), cycle(mix())):
        yield Timed(BEGIN + PERIOD * number, frame)


def random_traffic(count: int) -> Iterator[Timed]:
    """Yield frames in the order of a match, again and again, with new values in each message."""
    chance = random.Random(SEED)
    makers = {binding.cob_id: maker(binding) for binding in EurobotProtocol.load().bindings}
    for time, frame in recorded_traffic(count):
        make = makers.get(frame.cob_id)
        yield Timed(time, Frame(frame.cob_id, make(chance)) if make else frame)


def maker(binding: Binding) -> Callable[[random.Random], bytes]:
    """Return the function that makes a message's data with random values in their ranges."""
    layout = binding.layout
    ranges = [(field, values(binding, field)) for field in layout.fields]

    def make(chance: random.Random) -> bytes:
        word = sum(layout.place(field, chance.choice(raws)) for field, raws in ranges)
        return word.to_bytes(layout.length, layout.byte_order)

    return make


def values(binding: Binding, field: str) -> range:
    """Return the raw values, from the lowest on, that a field's kind accepts as in range.

    Codes above them are left out.
    """
    limits = binding.limits[field]
    kind = binding.kinds[field]
    raws = range(limits.low, limits.high + 1)
    return raws[: bisect_left(raws, True, key=lambda raw: isinstance(kind.read(raw, limits), OutOfRange))]


def write_candump(file: Path, traffic: Iterable[Timed]) -> None:
    """Write frames as a candump log."""
    with file.open("w") as log:
        log.writelines(map(_line, traffic))


def _line(timed: Timed) -> str:
    return f"({timed.time:.6f}) can0 {timed.frame.cob_id:03X}#{timed.frame.data.hex().upper()}\n"
