"""Runs one of the robot's nodes for the soak, like `eurobot-od node`, and reports missing numbered frames.

Its lines are read by `soak.py`: the node's reports, `numbers A..B missing`, and every HALF_A_SECOND the last number it
has seen and its counters.

A last argument names one of BROKEN, which breaks the node on purpose, for the soak's self-test.
"""

from __future__ import annotations

import itertools
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.device.objects import FileStore
from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.od.values import Address, Value
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import ROLES, Core

NUMBERED = 0x7F0
"""Identifier of the numbered frames, which no node uses; their data is the number, 4 bytes, and 4 more."""

HALF_A_SECOND = 0.5

PLACES = ((500, 1600, 0), (600, 1600, 0), (600, 1500, 270))
"""The core's targets, again and again: x and y in mm, the angle in degrees."""

SPEED = 30


class Numbers:
    """The numbered frames that have come: the `last` number; `missing` is called with first and last of a gap."""

    def __init__(self, missing: Callable[[int, int], object]) -> None:
        self.last: int | None = None
        self._missing = missing

    def take(self, data: bytes) -> None:
        """Note the number in a frame's data."""
        number = int.from_bytes(data[:4], "little")
        if self.last is not None and number > self.last + 1:
            self._missing(self.last + 1, number - 1)
        self.last = number


def say(what: object) -> None:
    """Print a line at once."""
    print(what, flush=True)


def lead(core: Core) -> None:
    """Drive from place to place for ever; after any failure begin again with the node checks."""
    while True:
        try:
            core.check_nodes().result()
            core.configure_start(TeamColour.RED).result()
            for place in itertools.cycle(PLACES):
                outcome = core.goto(*place, SPEED).result().outcome
                say(outcome.name)
                if outcome is not Outcome.ARRIVED:  # somebody has stopped it, and wants to see it stand
                    time.sleep(HALF_A_SECOND)
        except EurobotError as error:
            say(f"core: {error}")
            time.sleep(HALF_A_SECOND)


# What is broken on purpose


class ForgetfulStore(FileStore):
    """Reports that it saved, and writes nothing."""

    def save(self, values: Mapping[Address, Value], node_id: int, kbit: int | None = None) -> None:
        """Drop the values."""


Receive = Callable[[Frame, float], object]


def deaf(receive: Receive) -> Receive:
    """Drop all frames for the first 6 s of a life."""
    born = time.monotonic()
    return lambda frame, now: receive(frame, now) if time.monotonic() - born > 6 else None


def skips(receive: Receive) -> Receive:
    """Drop every 40th numbered frame."""
    return lambda frame, now: None if frame.cob_id == NUMBERED and frame.data[0] % 40 == 0 else receive(frame, now)


def leaks(receive: Receive) -> Receive:
    """Keep 2.5 kB for each numbered frame."""
    kept: list[bytearray] = []

    def keep(frame: Frame, now: float) -> object:
        if frame.cob_id == NUMBERED:
            kept.append(bytearray(b"leak" * 625))
        return receive(frame, now)

    return keep


def opens(receive: Receive) -> Receive:
    """Open a file with each 20th numbered frame, and never close it."""
    files: list[object] = []

    def keep(frame: Frame, now: float) -> object:
        if frame.cob_id == NUMBERED and frame.data[0] % 20 == 0:
            files.append(Path(os.devnull).open())  # noqa: SIM115
        return receive(frame, now)

    return keep


BROKEN: dict[str, Callable[[Receive], Receive]] = {"deaf": deaf, "skips": skips, "leak": leaks, "descriptors": opens}
STORES = {"store": ForgetfulStore}


def run(name: str, interface: str, channel: str, folder: Path, broken: str = "") -> None:
    """Run a node until it is killed."""
    dictionary = dialects.load(name)
    numbers = Numbers(lambda first, last: say(f"numbers {first}..{last} missing"))
    store = STORES.get(broken, FileStore)(folder / f"{name}.dcf", dictionary)
    node = ROLES[name](dictionary, store=store)
    opener = partial(open_bus, interface, channel)
    live = Live.node(opener(), node, opener=opener, report=say)

    def take(frame: Frame, _: float) -> None:
        numbers.take(frame.data)

    live.controller.add_node(lambda: (NUMBERED,), BROKEN[broken](take) if broken in BROKEN else take, "numbers")
    with live:
        say("on the bus")
        if isinstance(node, Core):
            threading.Thread(target=lead, args=(node,), daemon=True).start()
        while live.failure is None:
            say(f"last {numbers.last}, overflow {live.overflow}, missed {live.missed}")
            time.sleep(HALF_A_SECOND)


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2], sys.argv[3], Path(sys.argv[4]), sys.argv[5])
