"""Kills a device with SIGKILL while it stores its settings, again and again, and checks what a restart finds.

A child process stores one generation of settings after the other and reports each that is done. After the kill, the
settings on the disk must all be of one generation: the last one reported, or the one after it, whose report was lost.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from eurobot_od.device.device import Device
from eurobot_od.device.objects import FileStore
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import SIGNATURES, STORE
from eurobot_od.od.values import Address
from eurobot_od.robot import dialects

SETTINGS: tuple[Address, ...] = tuple((index, 1) for index in (0x2101, 0x2102, 0x2103, 0x2104, 0x2105))
"""Settings of the core that all take the generation as their value: UNSIGNED16, 1..65535."""

FIRST = 1
"""The generation that is on the disk before the first kill."""

LONGEST = 0.02
"""Longest life of a child in seconds, from its first report."""


def store_once(device: Device, generation: int) -> None:
    """Set all settings to this generation and store them."""
    for address in SETTINGS:
        device.objects.write(address, generation.to_bytes(2, "little"))
    device.objects.write((STORE, 1), SIGNATURES[STORE])


def store_for_ever(store: FileStore, dictionary: Dictionary, generation: int, told: int) -> None:
    """Store one generation after the other from this one on, and report each to the pipe `told`."""
    device = Device(dictionary, store)
    os.write(told, b"\n")
    while True:
        store_once(device, generation)
        os.write(told, f"{generation}\n".encode())
        generation += 1


def killed(store: FileStore, dictionary: Dictionary, generation: int, after: float) -> int:
    """Kill a child that stores from `generation` on, `after` seconds, and return the last generation it reported.

    That is `generation` - 1 if it reported none.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        store_for_ever(store, dictionary, generation, write)
    os.close(write)
    os.read(read, 1)
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(read) as told:
        done = told.read().split()
    return int(done[-1]) if done else generation - 1


def restarted(store: FileStore, dictionary: Dictionary) -> set[int]:
    """Return the generations that a restarted device finds in its settings."""
    device = Device(dictionary, store)
    return {device.objects.number(address) for address in SETTINGS}


def run(times: int, seed: int, folder: Path) -> list[str]:
    """Kill a child `times` times; return what was wrong, one line each."""
    random_number = random.Random(seed)
    dictionary = dialects.load("core")
    store = FileStore(folder / "core.dcf", dictionary)
    store_once(Device(dictionary, store), FIRST)
    generation = FIRST + 1
    faults = []
    for kill in range(times):
        told = killed(store, dictionary, generation, random_number.uniform(0.0, LONGEST))
        found = restarted(store, dictionary)
        if len(found) != 1 or not found <= {told, told + 1}:
            faults.append(f"kill {kill + 1}: reported {told}, found {sorted(found)}")
        generation = max(found) + 1
    return faults


def main() -> int:
    """Run the tool; exit status 1 if a restart found anything but one whole generation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--times", type=int, default=1000, help="how often to kill (default 1000)")
    parser.add_argument("--seed", type=int, default=1, help="when to kill (default 1)")
    arguments = parser.parse_args()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        faults = run(arguments.times, arguments.seed, Path(folder))
    print(*faults, sep="\n", end="\n" if faults else "")
    took = time.perf_counter() - started
    print(f"{arguments.times} kills, {len(faults)} restarts without a whole configuration, {took:.0f} s")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
