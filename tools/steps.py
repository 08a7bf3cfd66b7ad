"""Runs steps in the environment, one after the other, and prints at the end how long each took.

`test.py`, `ready.py`, `ci.py` and `nightly.py` are tables of steps. This runs before anything is installed, so it uses
the standard library only.
"""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from enum import Enum
from typing import NamedTuple

from environment import PYTHON, ROOT, prepare, variables

FINE, RED, INTERRUPTED = 0, 1, 130
TOO_LATE = 124
"""Status of a command that took too long, as in timeout(1)."""


class Step(NamedTuple):
    """A command by its name, and its longest time in seconds.

    If it ends with status 1, the command `again` decides. `absent` is the reason if it cannot be run on this machine.
    """

    name: str
    command: tuple[str, ...]
    again: tuple[str, ...] = ()
    longest: float = 1800.0
    absent: str = ""


def python(*words: str) -> tuple[str, ...]:
    """Return a command of the environment's Python."""
    return str(PYTHON), *words


class Verdict(Enum):
    """The result of a step."""

    PASSED = "passed"
    FAILED = "FAILED"
    SKIPPED = "skipped"


class Result(NamedTuple):
    """A step's result, its seconds, and a note on it."""

    name: str
    verdict: Verdict
    seconds: float = 0.0
    note: str = ""


def run(steps: Iterable[Step], extras: str = "test") -> int:
    """Set up the environment, run all steps, also after one that failed, and print the table; return 1 if any did."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # what a step has started would outlive this program
    begun = time.monotonic()
    prepare(extras)
    os.chdir(ROOT)
    results = [Result("set-up", Verdict.PASSED, time.monotonic() - begun)]
    try:
        for each in steps:
            print(f"== {each.name}: {shlex.join(each.command)}", flush=True)
            results.append(done(each))
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        print(table(results), flush=True)
    return RED if any(each.verdict is Verdict.FAILED for each in results) else FINE


def done(step: Step) -> Result:
    """Run a step and return its result."""
    if step.absent:
        return Result(step.name, Verdict.SKIPPED, note=step.absent)
    begun = time.monotonic()
    status = ended(step.command, step.longest)
    note = ""
    if status == RED and step.again:
        status = ended(step.again, step.longest)
        note = "what failed at first passed alone"
    seconds = time.monotonic() - begun
    if status:
        complaint = f"not ended within {step.longest:.0f} s" if status == TOO_LATE else f"exit status {status}"
        return Result(step.name, Verdict.FAILED, seconds, complaint)
    return Result(step.name, Verdict.PASSED, seconds, note)


def ended(words: Sequence[str], longest: float) -> int:
    """Run a command, and end it with all its children when it takes too long; return its exit status."""
    with subprocess.Popen(words, env=variables(), start_new_session=True) as process:
        try:
            return process.wait(longest)
        except subprocess.TimeoutExpired:
            return TOO_LATE
        finally:
            kill(process)


def kill(process: subprocess.Popen[bytes]) -> None:
    """End a process that leads a session, and the children it has left running."""
    if sys.platform == "win32":
        process.kill()
        return
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def table(results: Sequence[Result]) -> str:
    """Return a line for each result, and one for all."""
    failed = sum(each.verdict is Verdict.FAILED for each in results)
    summary = f"{failed} of {len(results)} failed" if failed else "all fine"
    rows = [(each.name, each.seconds, ": ".join(filter(None, (each.verdict.value, each.note)))) for each in results]
    rows.append(("total", sum(each.seconds for each in results), summary))
    width = max(len(name) for name, *_ in rows)
    return "\n".join(
        [f"\n{'step':<{width}}  seconds", *(f"{name:<{width}}  {s:7.1f}  {said}" for name, s, said in rows)]
    )
