#!/usr/bin/env python3
"""Makes small changes in modules, one at a time, and reports for each module how many of them its tests noticed.

    python3 tools/mutants.py eurobot_od/bus/live/buses.py eurobot_od/sdo/wire.py --at-most 100

cosmic-ray makes the changes, in a copy of the repository; the tests are those that mirror the module. The worst module
comes last, with each unnoticed change as a diff: either a test is missing, or the line is not needed. A module of a
hundred lines takes about five minutes. The exit status is 0 if every change was noticed, 1 if not, 2 for a module that
does not exist.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from environment import ROOT, ensure
from ready import mirrors

ensure("cosmic_ray", "test,mutants")

from cosmic_ray.work_db import WorkDB, use_db  # noqa: E402  # found from here on
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult  # noqa: E402

ALL_NOTICED, SURVIVORS, WRONG_USAGE = 0, 1, 2

COPIED = ("eurobot_od", "eds", "tests", "tools", "docs", "pyproject.toml", "README.md", "CONTRIBUTING.md")
LONGEST, SLOWER = 60, 5
"""Time for the tests of one change in s, and how many times longer than without it they may take: whatever takes longer
than both was noticed. On a busy machine the seconds alone would call what was never tried noticed."""

TOGETHER = ("eurobot_od/lint", "eurobot_od/device/profiles")
"""Rooms whose modules are tested by all tests of the room: a rule by the file that breaks it, a mode by a master."""

ANNOTATION = "core/ReplaceBinaryOperator_BitOr_"
"""Changes of `int | None` in annotations, which are never run."""

CONFIGURATION = """[cosmic-ray]
module-path = {module}
timeout = {longest}
excluded-modules = []
test-command = {command}
[cosmic-ray.distributor]
name = "local"
"""


class Verdict(NamedTuple):
    """How many changes of a module were tried, and the diffs of the unnoticed ones."""

    module: str
    tried: int
    survivors: list[str]

    @property
    def share(self) -> float:
        """The noticed share, 0..1."""
        return 1 - len(self.survivors) / self.tried if self.tried else 1.0


def tests_of(module: str) -> str:
    """Return the tests that mirror a module: its own files, or the folder of its room."""
    folder = Path(module).parent
    own = "" if folder.as_posix() in TOGETHER else " ".join(mirrors(module))
    return own or Path("tests", folder.relative_to("eurobot_od")).as_posix()


def choose(session: Path, at_most: int, seed: int) -> None:
    """Mark all changes but a random choice as not to be tried."""
    with use_db(session, WorkDB.Mode.open) as database:
        running = {
            (each.operator_name, each.occurrence): item.job_id  # a job's name is another one in each session
            for item in database.work_items
            for each in item.mutations
            if not each.operator_name.startswith(ANNOTATION)
        }
        names = random.Random(seed).sample(sorted(running), min(at_most, len(running)))
        chosen = {running[name] for name in names}
        left_out = [item.job_id for item in database.work_items if item.job_id not in chosen]
        database.set_multiple_results(left_out, WorkResult(WorkerOutcome.SKIPPED))


def read(session: Path, module: str) -> Verdict:
    """Return the results of the changes that were tried."""
    with use_db(session, WorkDB.Mode.open) as database:
        tried = [result for _, result in database.completed_work_items if result.worker_outcome is WorkerOutcome.NORMAL]
    return Verdict(module, len(tried), [each.diff or "" for each in tried if each.test_outcome is TestOutcome.SURVIVED])


def judge(folder: Path, module: str, at_most: int, seed: int) -> Verdict:
    """Try the changes of a module in a copy of the repository, and restore the module."""
    configuration, session = folder / "cosmic-ray.toml", folder / f"{module.replace('/', '.')}.sqlite"
    tests = f"{sys.executable} -m pytest -x -q -p no:cacheprovider -m 'not long' {tests_of(module)}"
    # Without bytecode: a change made within the same second would be taken for the file as it was. With the path:
    # programs that a test starts elsewhere would be those of the environment, without the change.
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(folder)}
    begun = time.monotonic()
    if subprocess.run(
        shlex.split(tests), cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=False
    ).returncode:
        sys.exit(f"{module}: its tests fail without any change: {tests}")
    longest = max(LONGEST, SLOWER * (time.monotonic() - begun))
    configuration.write_text(
        CONFIGURATION.format(module=json.dumps(module), longest=longest, command=json.dumps(tests)), encoding="utf-8"
    )
    program = [sys.executable, "-m", "cosmic_ray.cli"]
    for command in ("init", "exec"):
        subprocess.run([*program, command, configuration.name, session.name], cwd=folder, check=True, env=environment)
        if command == "init":
            choose(session, at_most, seed)
    return read(session, module)


def main(words: list[str]) -> int:
    """Judge the modules and report; see the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="+", metavar="MODULE", help="such as eurobot_od/sdo/wire.py")
    parser.add_argument("--at-most", type=int, default=100, metavar="N", help="changes of a module (default: 100)")
    parser.add_argument("--seed", type=int, default=1, help="chooses them (default: 1)")
    given = parser.parse_args(words)
    missing = [each for each in given.modules if not (ROOT / each).is_file()]
    if missing:
        print(f"no such module: {', '.join(missing)}", file=sys.stderr)
        return WRONG_USAGE
    verdicts = []
    for module in given.modules:
        with TemporaryDirectory() as scratch:
            for name in COPIED:
                copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
                copy(ROOT / name, Path(scratch, name))
            verdicts.append(judge(Path(scratch), module, given.at_most, given.seed))
    for verdict in sorted(verdicts, key=lambda each: -each.share):
        print("\n".join(verdict.survivors))
        noticed = verdict.tried - len(verdict.survivors)
        print(f"{verdict.module}: {noticed} of {verdict.tried} changes noticed ({verdict.share:.0%})")
    return SURVIVORS if any(verdict.survivors for verdict in verdicts) else ALL_NOTICED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
