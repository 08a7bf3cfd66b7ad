#!/usr/bin/env python3
"""Feeds the commands mutated files: each has to end with its result or with one line, never with a traceback.

The files are the shipped ones (EDS, the protocol table, the network, the suites), logs of a few frames in each format,
and stored parameters, all with bytes or lines changed, doubled or cut off. Each input goes to every command that reads
such a file, in this process. A failure is an exception, an exit status that is not one of ours, a line on standard
error that names no place, no line at all, more than LIMIT seconds, or GROWTH of memory. An input follows from its
number alone, but for the dates in a log: `--first NUMBER` and a count of 1 repeat it.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from multiprocessing import Pool
from pathlib import Path
from typing import NamedTuple

import can

from eurobot_od import cli
from eurobot_od.device.device import Device
from eurobot_od.device.objects import FileStore
from eurobot_od.robot import dialects

FINE, WRONG = 0, 1

EDS = dialects.eds_folder()
SUITES = Path(cli.__file__).parents[1] / "robot" / "check" / "suites"
LIMIT = 10.0
"""Longest time for all commands on one input, in s."""

GROWTH = 200 * 1024
"""KiB by which one input may raise the peak memory of the process."""

SAID = re.compile(r"eurobot-od: |(/[^:]+)+(:\d+)*: | *\d+ x | {11}\S")
"""Beginnings of lines on standard error: a message, a place in a file, a count of damaged entries, its reason."""

STATUSES = {status.value for status in cli.ExitStatus}


class Kind(NamedTuple):
    """A kind of file: its suffix, the files to mutate, and the commands that read it, with FILE for its name."""

    suffix: str
    samples: Callable[[], list[bytes]]
    commands: tuple[str, ...]


def shipped(*patterns: str) -> list[bytes]:
    """Return the shipped files that match a pattern."""
    return [file.read_bytes() for pattern in patterns for file in sorted(EDS.glob(pattern))]


def suites() -> list[bytes]:
    """Return the shipped check suites."""
    return [file.read_bytes() for file in sorted(SUITES.rglob("*.yaml"))]


@cache
def logs(suffix: str) -> list[bytes]:
    """Return a short log in a format of python-can's, of messages, SDO, EMCY, NMT and other frames."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f"log{suffix}")
        with can.Logger(file) as logger:
            for number, cob_id in enumerate(LOGGED):
                data = bytes(range(number % 9))
                logger(can.Message(timestamp=1e9 + number / 9, arbitration_id=cob_id, data=data, is_extended_id=False))
        return [file.read_bytes()]


LOGGED = (0x000, 0x008, 0x00C, 0x014, 0x081, 0x100, 0x180, 0x300, 0x581, 0x601, 0x701, 0x7F0) * 3


@cache
def stored() -> list[bytes]:
    """Return a file of stored parameters."""
    with tempfile.TemporaryDirectory() as folder:
        dictionary = dialects.load("core")
        store = FileStore(Path(folder, "core.dcf"), dictionary)
        store.save(Device(dictionary).objects.configuration() | {(0x2101, 1): 77}, 1)
        return [store.file.read_bytes()]


READING = (
    "decode FILE",
    "decode --statistics FILE",
    "monitor --plain --speed max FILE",
    "field FILE -o OUT.svg",
)

KINDS = {
    "EDS": Kind(
        ".eds",
        partial(shipped, "*/*.eds"),
        ("lint FILE", "show --eds 5=FILE", "diff FILE FILE", "export c --eds 5=FILE", "lint --fix FILE -o OUT.eds"),
    ),
    "protocol table": Kind(".yaml", partial(shipped, "protocol.yaml"), ("make-eds FILE -o OUT",)),
    "network": Kind(".yaml", partial(shipped, "network.yaml"), ("show --network FILE", "lint --network FILE")),
    "suite": Kind(".yaml", suites, ("check FILE --list",)),
    "stored parameters": Kind(".dcf", stored, ("node core --store FILE --for 0s",)),
    **{f"log {suffix}": Kind(suffix, partial(logs, suffix), READING) for suffix in (".log", ".asc", ".csv", ".trc")},
    **{f"log {suffix}": Kind(suffix, partial(logs, suffix), READING) for suffix in (".blf", ".db")},
}


# Mutations


def bytes_changed(dice: random.Random, data: bytes) -> bytes:
    """Change some bytes."""
    changed = bytearray(data)
    for _ in range(dice.randrange(1, 20)):
        changed[dice.randrange(len(changed))] = dice.choice((*range(256), *b"\n\r\0[]={}:#\"'&*!|>%@-"))
    return bytes(changed)


def lines_moved(dice: random.Random, data: bytes) -> bytes:
    """Remove, double and move lines."""
    lines = data.splitlines(keepends=True)
    for _ in range(dice.randrange(1, 10)):
        place, other = dice.randrange(len(lines)), dice.randrange(len(lines))
        lines[place : place + dice.randrange(3)] = dice.choice(([], [lines[other]] * 2))
        lines = lines or [b""]
    return b"".join(lines)


def cut_off(dice: random.Random, data: bytes) -> bytes:
    """Keep only the beginning, or only the end."""
    place = dice.randrange(len(data))
    return dice.choice((data[:place], data[place:]))


def numbers_changed(dice: random.Random, data: bytes) -> bytes:
    """Replace some digits by numbers that fit no field."""
    changed = bytearray(data)
    places = [place for place, byte in enumerate(changed) if byte in b"0123456789"]
    for _ in range(dice.randrange(1, 4)):
        place = dice.choice(places or [0])
        changed[place : place + 1] = dice.choice((b"-1", b"9" * 30, b"0x", b"1e999", b"nan", b"", b"4294967296", b".."))
        places = [each for each in places if each < place]
    return bytes(changed)


def repeated(dice: random.Random, data: bytes) -> bytes:
    """Repeat a part a hundred times."""
    begin = dice.randrange(len(data))
    end = begin + dice.randrange(1, 200)
    return data[:end] + data[begin:end] * 100 + data[end:]


Mutation = Callable[[random.Random, bytes], bytes]

MUTATIONS: tuple[Mutation, ...] = (bytes_changed, lines_moved, cut_off, numbers_changed, repeated)


def make_input(number: int) -> tuple[str, bytes]:
    """Return the kind of an input and its content."""
    dice = random.Random(number)
    name = tuple(KINDS)[number % len(KINDS)]
    return name, dice.choice(MUTATIONS)(dice, dice.choice(KINDS[name].samples()))


# Judging


def check(number: int) -> list[str]:
    """Run the commands on an input; return what is wrong, one line each."""
    name, content = make_input(number)
    kind = KINDS[name]
    before = most_memory()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f"input{kind.suffix}")
        wrong = []
        for command in kind.commands:
            file.write_bytes(content)
            words = [word.replace("FILE", str(file)).replace("OUT", f"{folder}/out") for word in command.split()]
            wrong += [f"input {number} ({name}): {command}: {what}" for what in judge(words)]
    took, grown = time.perf_counter() - started, most_memory() - before
    wrong += [f"input {number} ({name}): {took:.1f} s"] if took > LIMIT else []
    return wrong + ([f"input {number} ({name}): {grown} KiB more"] if grown > GROWTH else [])


def most_memory() -> int:
    """Return the peak memory of this process, in KiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def judge(words: Sequence[str]) -> list[str]:
    """Run a command, and return what is wrong with its end."""
    said = io.StringIO()
    on_sigterm = signal.getsignal(signal.SIGTERM)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        try:
            status = cli.main(words)
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException as error:
            return [f"{type(error).__name__}: {error}"]
        finally:
            signal.signal(signal.SIGTERM, on_sigterm)
            gc.unfreeze()  # the command line freezes what there is, as a program runs one command only
    lines = said.getvalue().splitlines()
    wrong = [f"says {line!r}" for line in lines if not SAID.match(line)]
    wrong += [] if status in STATUSES else [f"exit status {status}"]
    return wrong + (["says nothing"] if status == cli.ExitStatus.WRONG_INPUT and not lines else [])


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    command.add_argument("count", nargs="?", type=int, default=10_000, help="how many inputs (default: %(default)s)")
    command.add_argument("--first", type=int, default=0, metavar="NUMBER", help="number of the first (default: 0)")
    command.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes")
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the inputs and print what is wrong; exit status 1 if anything is."""
    options = parser().parse_args(arguments)
    started = time.perf_counter()
    failed = 0
    with Pool(options.jobs, maxtasksperchild=500) as pool:
        for wrong in pool.imap(check, range(options.first, options.first + options.count)):
            failed += bool(wrong)
            print("".join(f"{line}\n" for line in wrong), end="", flush=True)
    print(f"{options.count} inputs, {failed} failed, {time.perf_counter() - started:.0f} s")
    return WRONG if failed else FINE


if __name__ == "__main__":
    sys.exit(main())
