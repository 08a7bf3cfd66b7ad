"""Measures two axes and an I/O module under SYNC of 1 ms on a simulated bus: frames a second, bus load, CPU, lag.

The frames are those of a real bus of 1 Mbit/s; all settings are objects that a master could write.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from math import pi, sin
from pathlib import Path
from typing import NamedTuple

from eurobot_od.bus import frame_bits
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.node import Node
from eurobot_od.device.profiles import SimulatedDrive, SimulatedModule
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.frame import Frame
from eurobot_od.od.cia402 import DriveCommand, Mode
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID, SYNC_COB_ID

DOCS = Path(__file__).parents[1] / "docs"
BITRATE, PERIOD = 1_000_000, 0.001
MASTER, AXES, MODULE = 1, (5, 6), 7
"""Node-IDs."""

WAY, WAVE = 20_000, 1.0
"""What the axes swing by, in position units, and how long that takes, in seconds."""

OFF = 1 << 31
"""Bit of a COB-ID: the PDO is not valid (CiA 301, 7.5.2.35)."""


class Figures(NamedTuple):
    """The figures of a run: frames and load in a second of the bus, seconds of CPU for one, the lag; and the axes."""

    frames: float
    load: float
    cpu: float
    lag: int
    axes: tuple[DriveAxis, ...]


class CyclicMaster(Node):
    """Sends SYNC, then targets to both axes and outputs to the module, each millisecond."""

    def start(self, now: float) -> list[Frame]:
        self.now = now
        self._cycle = 0
        self.at(now + 0.1, self._begin)
        return []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return []

    def _begin(self, now: float) -> None:
        self.put(Frame(NMT_COB_ID, bytes([NmtCommand.START, 0])))
        self.at(now + PERIOD, self._next_cycle)

    def _next_cycle(self, now: float) -> None:
        ways = (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE)
        word = ways[min(self._cycle // 10, 2)].bits
        target = round(WAY * (1 - sin(2 * pi * self._cycle * PERIOD / WAVE + pi / 2)) / 2) if self._cycle >= 50 else 0
        self.put(Frame(SYNC_COB_ID, b""))
        for axis, sign in zip(AXES, (1, -1)):
            content = word.to_bytes(2, "little") + (sign * target).to_bytes(4, "little", signed=True)
            self.put(Frame(0x300 + axis, content))
        self.put(Frame(0x200 + MODULE, (self._cycle & 0xFFFF).to_bytes(2, "little")))
        self._cycle += 1
        self.at(now + PERIOD, self._next_cycle)


def _axis(node_id: int) -> SimulatedDrive:
    """Return a drive in cyclic synchronous position, with statusword and position by SYNC and no other TPDO."""
    off = {(index, 1): OFF | base + node_id for index, base in ((0x1800, 0x180), (0x1802, 0x380), (0x1803, 0x480))}
    given = {(0x6060, 0): Mode.CYCLIC_POSITION, (0x1006, 0): 1000, (0x1401, 2): 1, (0x1801, 2): 1, **off}
    return SimulatedDrive(Dictionary.load(DOCS / "servo.eds", node_id), given=given)


def _module() -> SimulatedModule:
    given = {(0x1400, 2): 1, (0x1800, 2): 1, (0x1801, 1): OFF | 0x280 + MODULE}
    return SimulatedModule(Dictionary.load(DOCS / "io.eds", MODULE), given=given)


def run(seconds: float) -> Figures:
    """Run all of them for some seconds, after the axes are enabled."""
    bus = Simulation(BITRATE)
    axes = [_axis(each) for each in AXES]
    for node in (CyclicMaster(Dictionary.load(DOCS / "motor.eds", MASTER)), *axes, _module()):
        bus.attach(node)
    bus.run(0.25)
    seen: list[Frame] = []
    bus.observers.append(lambda _, frame: seen.append(frame))
    begun = time.process_time()
    lag = 0.0
    moved = tuple(axis for drive in axes for axis in drive.axes)
    for _ in range(round(seconds / 0.01)):
        bus.run(bus.now + 0.01)
        lag = max(lag, *(abs(axis.demand.position - axis.motor.position) for axis in moved))
    cpu = time.process_time() - begun
    bits = sum(frame_bits(each) for each in seen)
    return Figures(len(seen) / seconds, bits / BITRATE / seconds, cpu / seconds, round(lag), moved)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, and print the figures."""
    parser = argparse.ArgumentParser(description="Run two axes and an I/O module under SYNC of 1 ms.")
    parser.add_argument("--seconds", type=float, default=10.0, help="of the simulated bus (default: 10)")
    figures = run(parser.parse_args(arguments).seconds)
    print(f"{figures.frames:.0f} frames/s, bus load {figures.load:.0%}, lag at most {figures.lag} position units")
    print(f"{figures.cpu:.2f} s of CPU for a second of the bus")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
