"""How time and memory grow with the input: the same command on 1, 10 and 100 times as much.

Whole processes are measured, in CPU seconds of all their threads, start included. Ten times the input may take at most
ten times as long, and likewise for memory.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from bench.eds import make_eds
from bench.measure import ONCE, Claim, Contender, NotHere, Quantity, Scale, Series, Way
from bench.process import OURS, run, until_first_line
from bench.traffic import random_traffic, write_candump

TIMES = (1, 10, 100)
STEP = 10
LINES, OBJECTS = 1000, 50

COMMANDS: Mapping[str, str] = {
    "decode": "decode {log}",
    "archive": "archive {log} -o",
    "serve": "serve --listen 127.0.0.1:0 {log}",
    "monitor": "monitor --plain --speed max {log}",
    "lint": "lint {eds}",
    "show --objects": "show --objects --eds 5={eds}",
    "match --seeds": "match --jobs 1 --for 1 --seeds {times}",
}
"""The commands; `{log}`, `{eds}` and `{times}` grow. `serve` reads all its input before it prints its address."""

NEEDED = {"archive": "polars", "serve": "aiohttp"}


@contextmanager
def opened(command: str, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Make the inputs, and yield the command on each."""
    if command in NEEDED and find_spec(NEEDED[command]) is None:
        raise NotHere(f"{NEEDED[command]} not installed")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = dict[str, Contender]()
        for times in TIMES:
            log, eds = folder / f"{times}.log", folder / f"{times}.eds"
            write_candump(log, random_traffic(scale.of(LINES, 3) * times))
            eds.write_text(make_eds(scale.of(OBJECTS, 4) * times, 0))
            files = {"log": log, "eds": eds, "times": min(times, scale.of(100, 2))}
            found[str(times)] = partial(once, command, [each.format(**files) for each in COMMANDS[command].split()])
        yield found


def once(command: str, words: Sequence[str]) -> Mapping[Quantity, float]:
    """Run a command; each archive goes into a folder of its own."""
    measure = until_first_line if command == "serve" else run
    with tempfile.TemporaryDirectory() as name:
        return measure([*OURS, *words, *[str(Path(name, "season"))] * (command == "archive")])


def _claims(command: str) -> Iterator[Claim]:
    for less, more in pairwise(TIMES):
        for what, quantity in (("CPU", Quantity.CPU_TIME), ("memory", Quantity.MEMORY)):
            name = f"{command}, {what}, {more} times the input: {less}"
            yield Claim(name, str(more), str(less), Way.RATIO, STEP, quantity)


SERIES = tuple(
    Series("growth", f"growth of {command}", partial(opened, command), tuple(_claims(command)), ONCE)
    for command in COMMANDS
)
