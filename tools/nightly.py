"""Runs all checks that take longer than CI may.

`python3 tools/nightly.py [--list] [ROW...]` takes rows by parts of their names. It goes on after a row that fails, and
ends with a table; the exit status is 1 if a row failed, 2 for a name of no row. Random rows have another seed each day;
the line above a row's output repeats it.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from datetime import date

import pythons
from environment import ONCE_MORE, SUITE
from interop_rows.tools import VCAN
from steps import Step, python, run

SEED = str(date.today().toordinal())
LONG = ("-m", "long")
CAMPAIGN = ("--hypothesis-profile=campaign", "tests/properties", "tests/robot/properties")
"""Properties on 300 inputs each instead of 16; the profile is in tests/conftest.py."""

SAMPLED = (
    "--hypothesis-profile=campaign",
    "tests/check/conformance/test_faults.py",
    "tests/robot/test_every_number.py",
    "tests/robot/test_faults.py",
    "tests/robot/check/test_shipped.py",
)
"""The tests that otherwise try a sample of their rows (tests/rows.py), on all rows."""

SOCKETCAN = ("-p", "no:cacheprovider", "-m", "socketcan", "tests/bus/live/test_socketcan.py")


def rows() -> tuple[Step, ...]:
    """Return all rows; those that this machine cannot run are marked as absent."""
    return (
        Step("long tests", python(*SUITE, *LONG), python(*ONCE_MORE, *LONG)),
        Step("properties", python(*SUITE, *CAMPAIGN), python(*ONCE_MORE, *CAMPAIGN)),
        Step("samples", python(*SUITE, *SAMPLED), python(*ONCE_MORE, *SAMPLED), longest=3600),
        *map(_suite, (each for each in pythons.ROWS if each != "lowest")),
        _socketcan(),
        Step("broken", python("tools/broken.py"), longest=2400),
        Step("soak", python("tools/soak.py", "--self-test", "--remote")),
        Step("fuzz files", python("tools/file_fuzz.py", "1000", "--first", f"{SEED}000")),
        Step("fuzz frames", python("tools/frame_fuzz.py", "--frames", "2000000", "--seed", SEED)),
        Step("fuzz sdo", python("tools/sdo_fuzz.py", "--requests", "50000", "--seed", SEED)),
        Step("fuzz lint", python("tools/lint_fuzz.py", "20000", "--first", f"{SEED}00000")),
        Step("kills", python("tools/kill_store.py", "--seed", SEED)),
        Step("faults", python("tools/fault_matrix.py")),
        Step("losses", python("tools/loss_matrix.py", "--seed", SEED), longest=3600),
        Step("losses live", python("tools/loss_matrix.py", "--live", "--times", "3", "--jobs", "12", "--seed", SEED)),
        Step("bus", python("tools/bus_crosscheck.py")),
        Step("wheel", python("tools/wheel.py")),
        Step("bench", python("tools/bench", "--strict")),
    )


def _suite(name: str) -> Step:
    version = pythons.ROWS[name].version
    absent = "" if pythons.find(version) else "not on this machine"
    return Step(f"suite on {name}", python("tools/pythons.py", name), absent=absent)


def _socketcan() -> Step:
    """Return the step of the tests marked socketcan, by the command of VCAN_RUN (a kernel of its own) if set."""
    before = shlex.split(os.environ.get("VCAN_RUN", ""))
    absent = "" if before or VCAN.exists() else "no vcan0, and VCAN_RUN names no command with one"
    return Step("socketcan", (*before, *python("-m", "pytest", *SOCKETCAN)), absent=absent)


def chosen(words: Sequence[str]) -> list[Step]:
    """Return the rows with a word in their name, all without words; raises ValueError for a word of no row."""
    every = rows()
    if unknown := [word for word in words if not any(word in each.name for each in every)]:
        raise ValueError(f"no row is called {unknown[0]!r}; rows: {', '.join(each.name for each in every)}")
    return [each for each in every if not words or any(word in each.name for word in words)]


def main(words: Sequence[str] | None = None) -> int:
    """Run the chosen rows."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="parts of names; left out: all")
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    options = parser.parse_args(words)
    try:
        steps = chosen(options.rows)
    except ValueError as error:
        parser.error(str(error))
    if options.list:
        print("\n".join(f"{each.name:<16}{shlex.join(each.command)}" for each in steps))
        return 0
    return run(steps)


if __name__ == "__main__":
    sys.exit(main())
