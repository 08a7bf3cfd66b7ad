#!/usr/bin/env python3
"""Breaks each promise on purpose, by a change of a line or two, and checks that its test fails.

    python3 tools/broken.py
    python3 tools/broken.py --only heartbeat

The changes are in `broken.yaml`. They are made one by one in copies of the repository. First all the tests run with
nothing broken, since a test that fails then proves nothing. The exit status is 0 if each change makes its test fail, 1
if not, and 2 if a change no longer fits the code.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from enum import Enum
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from typing import NamedTuple

from environment import ROOT, ensure

ensure("eurobot_od", "test")

import yaml  # noqa: E402  # found from here on

ROOT_TEXTS = ("README.md", "CONTRIBUTING.md", "SECURITY.md")
TABLE = Path(__file__).with_name("broken.yaml")
COPIED = ("eurobot_od", "eds", "tests", "tools", "docs", "pyproject.toml", *ROOT_TEXTS)
LONGEST = 90
"""Longest time for one test, in s; a change that makes it take longer counts as noticed."""

PYTEST = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider")
PASSED, FAILED = 0, 1
"""Exit statuses of pytest; any other one means that it has not run the test."""


class Change(NamedTuple):
    """A change that breaks a `promise`: in a `file`, `old` becomes `new`; `test` is the one that has to fail."""

    promise: str
    file: str
    old: str
    new: str
    test: str

    @property
    def fits(self) -> bool:
        """Whether the code still has the text to be changed, exactly once."""
        return (ROOT / self.file).read_text(encoding="utf-8").count(self.old) == 1


class Verdict(Enum):
    """Whether the test of a change failed."""

    NOTICED = "noticed"
    UNNOTICED = "NOT NOTICED"
    NOT_RUN = "TEST NOT RUN"


def read() -> list[Change]:
    """Return all changes of the table."""
    return [Change(**row) for row in yaml.safe_load(TABLE.read_text(encoding="utf-8"))]


def pytest(folder: Path, tests: Iterable[str], longest: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run tests in a copy of the repository and return the ended process; raises TimeoutExpired."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(folder / "tools")])}
    command = [sys.executable, *PYTEST, *tests]
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as running:
        try:
            said, _ = running.communicate(timeout=longest)
        finally:
            with suppress(ProcessLookupError):  # what a test has started would outlive it
                os.killpg(running.pid, signal.SIGKILL)
    return subprocess.CompletedProcess(command, running.returncode, said)


def judge(change: Change, folder: Path, moment: int) -> Verdict:
    """Make a change in a copy, run its test, and undo the change."""
    file = folder / change.file
    whole = file.read_text(encoding="utf-8")
    # Each state of a file gets a time of its own: Python knows compiled files by the second, and by their size.
    try:
        file.write_text(whole.replace(change.old, change.new), encoding="utf-8")
        os.utime(file, (moment, moment))
        status = pytest(folder, [change.test], LONGEST).returncode
    except subprocess.TimeoutExpired:
        return Verdict.NOTICED
    finally:
        file.write_text(whole, encoding="utf-8")
        os.utime(file, (moment + 1, moment + 1))
    return {PASSED: Verdict.UNNOTICED, FAILED: Verdict.NOTICED}.get(status, Verdict.NOT_RUN)


def judged(changes: list[Change], copies: list[Path]) -> Iterator[tuple[Change, Verdict]]:
    """Judge all changes, one at a time in each copy, and yield them in their order."""
    free: SimpleQueue[Path] = SimpleQueue()
    for each in copies:
        free.put(each)
    begun = int(time.time())

    def one(number: int) -> Verdict:
        folder = free.get()
        try:
            return judge(changes[number], folder, begun + 2 * number)
        finally:
            free.put(folder)

    with ThreadPoolExecutor(len(copies)) as threads:
        yield from zip(changes, threads.map(one, range(len(changes))))


def copy(folder: Path) -> Path:
    """Copy what the tests need."""
    folder.mkdir()
    for name in COPIED:
        how = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        how(ROOT / name, folder / name)
    return folder


def main(words: list[str]) -> int:
    """Judge the changes and report; see the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="TEXT", help="changes whose promise, file or test has this text")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="copies at work at once")
    given = parser.parse_args(words)
    changes = [each for each in read() if any(given.only in text for text in (each.promise, each.file, each.test))]
    if unfit := [each for each in changes if not each.fits]:
        for each in unfit:
            print(f"{each.file}: does not have once what is to be changed: {each.promise}\n{each.old}", file=sys.stderr)
        return 2
    begun = time.monotonic()
    with TemporaryDirectory() as scratch:
        copies = [copy(Path(scratch, str(number))) for number in range(given.jobs)]
        whole = pytest(copies[0], dict.fromkeys(each.test for each in changes))
        if whole.returncode:
            print(f"a test fails although nothing is broken:\n{whole.stdout}", file=sys.stderr)
            return 2
        count: Counter[Verdict] = Counter()
        for change, verdict in judged(changes, copies):
            count[verdict] += 1
            print(f"{verdict.value:<12}  {change.promise}\n{'':14}{change.test}", flush=True)
    took = time.monotonic() - begun
    noticed = count[Verdict.NOTICED]
    print(f"{noticed} of {len(changes)} changes noticed by the test that is named for them, {took:.0f} s")
    return int(noticed < len(changes))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
