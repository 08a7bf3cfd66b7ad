#!/usr/bin/env python3
"""Feeds the EDS checker random and mutated files: none may raise an exception or take longer than a limit.

An input follows from its number alone, so a failure can be repeated with `--first NUMBER` and a count of 1.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from eurobot_od.lint.diff import compare
from eurobot_od.lint.model import load
from eurobot_od.lint.network import LintedNetwork, NetworkNode, lint_network, nodes_of, overview
from eurobot_od.lint.rules import lint_device

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "tests" / "lint" / "samples"
LIMIT = 2.0
"""Longest time for an input, in seconds."""

KEYS = (
    b"ParameterName ObjectType DataType AccessType LowLimit HighLimit DefaultValue ParameterValue PDOMapping SubNumber "
    b"CompactSubObj ObjFlags NrOfEntries SupportedObjects Lines Granularity NodeID Baudrate UploadFile 1 2 0"
).split()
SECTIONS = (
    b"FileInfo DeviceInfo DummyUsage Comments MandatoryObjects OptionalObjects ManufacturerObjects DeviceComissioning "
    b"1000 1003 1005 1014 1016 1018 1018sub0 1018sub4 1200 1400 1400sub1 1600 1600sub0 1600sub1 1800 1A00 1F22sub1 "
    b"1F80 2000 2000Name 2000Value 2000subFF FFFF 0000"
).split()
VALUES = (
    b"0 1 2 7 8 9 -1 0x0007 0x0008 0x20000020 0xFFFFFFFF 0x80000180 254 255 256 018 $NODEID $NODEID+0x180 rw ro const "
    b"99999999999999999999999999999999 0x -- nan inf 1e999 \xff\xfe 0x1000 0x1400 0x1600 $NODEID+ 01000000 ; #"
).split()
LINE_ENDS = (b"\n", b"\r\n", b"\r", b"\n\n", b"")


def soup(dice: random.Random) -> bytes:
    """Return random bytes."""
    return dice.randbytes(dice.randrange(2000))


def grammar(dice: random.Random) -> bytes:
    """Return sections and entries, each of them plausible alone."""
    lines = []
    for _ in range(dice.randrange(120)):
        is_section = dice.random() < 0.3
        lines.append(b"[%s]" % dice.choice(SECTIONS) if is_section else dice.choice(KEYS) + b"=" + dice.choice(VALUES))
    return dice.choice(LINE_ENDS[:3]).join(lines)


def bytes_changed(dice: random.Random) -> bytes:
    """Return a sample with some bytes changed."""
    data = bytearray(_window(dice))
    for _ in range(dice.randrange(1, 20)):
        if data:
            data[dice.randrange(len(data))] = dice.choice((*range(256), 0, 10, 13, 61, 91, 93, 59))
    return bytes(data)


def lines_changed(dice: random.Random) -> bytes:
    """Return a sample with lines removed, doubled, moved or replaced."""
    lines = _window(dice).splitlines(keepends=True)
    for _ in range(dice.randrange(1, 20)):
        if lines:
            place, other = dice.randrange(len(lines)), dice.randrange(len(lines))
            lines[place : place + dice.randrange(3)] = dice.choice(
                ([], [lines[other]] * 2, [dice.choice(KEYS) + b"=" + dice.choice(VALUES) + b"\n"])
            )
    return b"".join(lines)


def _window(dice: random.Random) -> bytes:
    """Return a sample, or a part of one."""
    data = dice.choice(_samples())
    start = dice.randrange(len(data)) if dice.random() < 0.5 else 0
    return data[start : start + dice.choice((500, 3000, len(data)))]


@cache
def _samples() -> list[bytes]:
    return [each.read_bytes() for each in sorted(SAMPLES.iterdir())]


MAKERS: tuple[Callable[[random.Random], bytes], ...] = (soup, grammar, bytes_changed, lines_changed)


def make_input(number: int) -> bytes:
    """Return the input of a number."""
    dice = random.Random(number)
    return MAKERS[number % len(MAKERS)](dice)


def check(data: bytes) -> float:
    """Run each part of the checker on an input; return the seconds that took."""
    start = time.perf_counter()
    device = load(data, "fuzz.eds")
    lint_device(device, "fuzz.eds")
    network = LintedNetwork(nodes_of([NetworkNode("one", "fuzz.eds", device), NetworkNode("two", "fuzz.eds", device)]))
    lint_network(network)
    overview(network)
    compare(device, load(data[:-1], "fuzz.dcf"))
    return time.perf_counter() - start


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the inputs; exit status 0, or 1 with the numbers of those that failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=100_000, help="how many inputs (100000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first input (0)")
    options = parser.parse_args(arguments)
    failed = []
    slowest = 0.0
    for number in range(options.first, options.first + options.count):
        try:
            seconds = check(make_input(number))
        except Exception as error:  # no input may raise anything
            seconds = LIMIT + 1
            print(f"input {number}: {type(error).__name__}: {error}")
        slowest = max(slowest, seconds)
        failed += [number] if seconds > LIMIT else []
    print(f"{options.count} inputs, {len(failed)} failed, the slowest took {slowest:.3f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
