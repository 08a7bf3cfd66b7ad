"""Whole processes as contenders: wall time, CPU time and memory, from the start of the program to its end.

A process that fails, or does not end in time, raises Wrong with its last line of output.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bench.measure import Figures, Quantity, Wrong

PROGRAMS = Path(__file__).parent / "programs"
PYTHON = sys.executable
UNWANTED = ("PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED", "EUROBOT_OD_DIALECT", "CAN_INTERFACE", "CAN_CHANNEL")
"""Environment variables that would change the measurement: installed programs have their bytecode beside them."""

ENVIRONMENT = {name: value for name, value in os.environ.items() if name not in UNWANTED}
LONGEST = 300.0
"""Timeout of a program and its children, in s; the slowest row takes a tenth of it."""

Words = Sequence[str | Path]
NO_VARIABLES: Mapping[str, str] = MappingProxyType({})


def program(name: str, module: str) -> list[str]:
    """Return the command that starts an installed program, which is also a Python module."""
    script = Path(PYTHON).parent / name
    return [str(script)] if script.is_file() else [PYTHON, "-m", module]


OURS = program("eurobot-od", "eurobot_od")
CANTOOLS = program("cantools", "cantools")
DCFCHK = program("dcfchk", "dcf.dcfchk")


def run(
    command: Words,
    source: str | Path = os.devnull,
    target: str | Path = os.devnull,
    variables: Mapping[str, str] = NO_VARIABLES,
) -> Figures:
    """Run a command, with output `-` only until its first line; raises Wrong if it fails."""
    launcher = [PYTHON, "-I", "-S", str(PROGRAMS / "launch.py"), str(source), str(target)]
    with started([*launcher, *map(str, command)], {**ENVIRONMENT, **variables}) as process:
        out, said = process.communicate()
    told = json.loads(out) if process.returncode == 0 else {"status": process.returncode}
    if told["status"]:
        raise Wrong(_failure(command, told["status"], said))
    return {Quantity.TIME: told["seconds"], Quantity.CPU_TIME: told["cpu"], Quantity.MEMORY: told["memory"]}


@contextmanager
def started(command: Sequence[str], variables: Mapping[str, str]) -> Iterator[subprocess.Popen[str]]:
    """Start a command with pipes for its output; it is killed after LONGEST seconds."""
    with (
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=variables, start_new_session=True
        ) as process,
        limited(process),
    ):
        yield process


@contextmanager
def limited(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Kill a process that leads a session, and all its children, after LONGEST seconds."""
    timer = threading.Timer(LONGEST, os.killpg, (process.pid, signal.SIGKILL))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def until_first_line(command: Words) -> Figures:
    """Run a command until it has written its first line, then end it; raises Wrong if it writes none."""
    return run(command, target="-", variables={"PYTHONUNBUFFERED": "1"})  # else the first line came with the last one


def _failure(command: Words, status: int, said: str) -> str:
    if status == -signal.SIGKILL:
        return f"{Path(command[0]).name} {' '.join(map(str, command[1:]))}: not ended within {LONGEST:.0f} s"
    last = said.strip().rpartition("\n")[2]
    return f"{Path(command[0]).name} {' '.join(map(str, command[1:]))}: exit status {status}: {last}"
