"""One of the robot's nodes for the soak: as `eurobot-od node`, and it says which of the numbered frames are missing.

Its lines are read by `soak.py`: the node's reports, `numbers A..B missing` when they are, and every HALF_A_SECOND the
number that it has seen last and its counters.
"""

from __future__ import annotations

import itertools
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from eurobot_od.device.storage import FileStore
from eurobot_od.errors import EurobotError
from eurobot_od.live import Live, open_bus
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import ROLES, Core

NUMBERED = 0x7F0
"""Identifier of the numbered frames, which no node uses; their data is the number, 4 bytes, and 4 more."""

HALF_A_SECOND = 0.5

PLACES = ((500, 1600, 0), (600, 1600, 0), (600, 1500, 270))
"""Where the core sends the drive, again and again: x and y in mm, the angle in degrees."""

SPEED = 30


class Numbers:
    """The numbered frames that have come: the `last` number; `missing` is told the first and last of those between."""

    def __init__(self, missing: Callable[[int, int], object]) -> None:
        self.last: int | None = None
        self._missing = missing

    def take(self, data: bytes) -> None:
        """Take in the data of a frame."""
        number = int.from_bytes(data[:4], "little")
        if self.last is not None and number > self.last + 1:
            self._missing(self.last + 1, number - 1)
        self.last = number


def say(what: object) -> None:
    """Print a line at once."""
    print(what, flush=True)


def lead(core: Core) -> None:
    """Drive from place to place for ever; whatever ends that, begin with the node checks again."""
    while True:
        try:
            core.check_nodes().result()
            core.configure_start(TeamColour.RED).result()
            for place in itertools.cycle(PLACES):
                say(core.goto(*place, SPEED).result().outcome.name)
        except EurobotError as error:
            say(f"core: {error}")
            time.sleep(HALF_A_SECOND)


def run(name: str, interface: str, channel: str, folder: Path) -> None:
    """Run a node until it is killed."""
    dictionary = dialects.load(name)
    numbers = Numbers(lambda first, last: say(f"numbers {first}..{last} missing"))
    node = ROLES[name](dictionary, store=FileStore(folder / f"{name}.dcf", dictionary))
    opener = partial(open_bus, interface, channel)
    live = Live.node(opener(), node, opener=opener, report=say)
    live.gatekeeper.add_node(lambda: (NUMBERED,), lambda frame, _: numbers.take(frame.data), "numbers")
    with live:
        say("on the bus")
        if isinstance(node, Core):
            threading.Thread(target=lead, args=(node,), daemon=True).start()
        while live.failure is None:
            say(f"last {numbers.last}, overflow {live.overflow}, missed {live.missed}")
            time.sleep(HALF_A_SECOND)


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2], sys.argv[3], Path(sys.argv[4]))
