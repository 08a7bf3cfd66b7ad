"""Runs the tests that come by a change, on a copy of the repository that has it.

The nearest come first: the test file that mirrors the module, then those that import it, then those that import one
that imports it, and so on, the quick before the slow. Last comes what else stands in these files, as their functions
may share what one of them has made. A few seconds of tests are a run of their own, as most changes are noticed there.
"""

from __future__ import annotations

import compileall
import contextlib
import enum
import math
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from multiprocessing.process import BaseProcess
from pathlib import Path, PurePosixPath
from py_compile import PycInvalidationMode
from typing import NamedTuple, NoReturn

import pytest

from mutation.changes import Change
from mutation.reach import MARKED, WITHOUT_OURS, Measured, digest

NEAR = 3.0
"""Seconds of tests in the first run."""

WHOLE = 3.0
"""Seconds that a test file may take to be run whole at once."""

TABLES_WITHIN = 2
"""Imports over which a test file may use what a module makes when it is imported, such as a table of its cases."""

MEMORY = 16 << 30
"""Bytes of address space that a run may have: a change can make a loop without an end."""

OPTIONS = (
    "-W",
    "ignore::pytest.PytestAssertRewriteWarning",
    "-x",
    "-q",
    "--tb=no",
    "-p",
    "no:cacheprovider",
    *WITHOUT_OURS,
    "-m",
    MARKED,
    "--hypothesis-seed=0",
)

PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["pytest", "hypothesis", "can", "canopen", "yaml"])
"""A run is a fork of a process that has imported what is slow to import."""

LEFT_BEHIND = shutil.ignore_patterns(".*", "build", "dist", "__pycache__", "*.egg-info")


class Outcome(enum.Enum):
    """What came of a change."""

    NOTICED = "noticed"
    TIMED_OUT = "timed out"
    SURVIVED = "survived"
    UNREACHED = "no test comes by"

    @property
    def is_noticed(self) -> bool:
        """Tell whether a test failed, or did not end."""
        return self in (Outcome.NOTICED, Outcome.TIMED_OUT)


class Portion(NamedTuple):
    """Tests for one run: pytest's arguments, and the seconds that they take unchanged."""

    arguments: tuple[str, ...]
    seconds: float


class Verdict(NamedTuple):
    """What came of a change, and the test that noticed it."""

    outcome: Outcome
    by: str = ""


def mirror(module: str) -> str:
    """Return the path of the test file that mirrors a module."""
    path = PurePosixPath(module)
    return str(PurePosixPath("tests", *path.parts[1:-1], f"test_{path.name}"))


class Source(NamedTuple):
    """A module's text, and its lines that are executed when it is imported."""

    text: bytes
    at_import: frozenset[int]


def portions(change: Change, files: Sequence[Measured], source: Source, budget: float) -> Iterator[Portion]:
    """Choose the tests for a change of a module; `budget` in seconds, but for the test file that mirrors the module.

    For what is executed when the module is imported, and in a module that was changed since a test file was measured,
    these are the tests that come by the module anywhere; for the former also all that are near. The test file that
    mirrors the module is asked in any case: it may come by in processes of its own.
    """
    functions = partial(_functions, change, not source.at_import.isdisjoint(change.lines), digest(source.text))
    tests = [test for file in files for test in _tests(change, file, functions(file))]
    spent, run = 0.0, Portion((), 0.0)
    for test in sorted(tests):
        if not test.is_owed and spent and spent + test.seconds > budget:
            continue
        if spent < NEAR <= spent + test.seconds and run.arguments:
            yield run
            run = Portion((), 0.0)
        spent += test.seconds
        run = Portion((*run.arguments, test.argument), run.seconds + test.seconds)
    if run.arguments:
        yield run


class _Test(NamedTuple):
    """A test file or a function of it, by how soon it is run; it `is_late` if only others of its file come by."""

    is_late: bool
    is_elsewhere: bool
    distance: float
    seconds: float
    argument: str

    @property
    def is_owed(self) -> bool:
        """Tell whether it is run whatever it takes."""
        return not (self.is_late or self.is_elsewhere)


def _functions(change: Change, at_import: bool, today: str, file: Measured) -> frozenset[str]:
    if at_import and file.distances.get(change.module, math.inf) <= TABLES_WITHIN:
        return frozenset(file.functions)
    is_measured = not at_import and file.digests.get(change.module) == today
    found = file.functions_at(change.module, change.lines if is_measured else None)
    return found if found or file.path != mirror(change.module) else frozenset(file.functions)


def _tests(change: Change, file: Measured, functions: frozenset[str]) -> Iterator[_Test]:
    place = file.path != mirror(change.module), file.distances.get(change.module, math.inf)
    if functions and file.seconds <= WHOLE:
        yield _Test(False, *place, file.seconds, file.path)
    elif functions:
        for name, passage in file.functions.items():
            yield _Test(name not in functions, *place, passage.seconds, f"{file.path}::{name}")


class Copy:
    """A copy of the repository to change, in a temporary folder that `close` removes."""

    def __init__(self, root: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="mutants-")
        self._root = Path(self._folder.name) / "repository"
        shutil.copytree(root, self._root, ignore=LEFT_BEHIND)
        # Compiled files that go by a digest of the source: two changes within a second may well have one length.
        compileall.compile_dir(self._root, quiet=2, invalidation_mode=PycInvalidationMode.CHECKED_HASH)

    def close(self) -> None:
        """Remove the copy."""
        self._folder.cleanup()

    def check(self, tests: Portion) -> None:
        """Run tests without a change; raises RuntimeError if they fail."""
        verdict = self._run(tests)
        if verdict.outcome.is_noticed:
            raise RuntimeError(f"without a change: {verdict.outcome.value} by {verdict.by}")

    def judge(self, change: Change, runs: Sequence[Portion]) -> Verdict:
        """Run tests with a change until one notices it."""
        module = self._root / change.module
        unchanged = module.read_bytes()
        module.write_bytes(change.applied(unchanged))
        try:
            verdicts = map(self._run, runs)
            first = Verdict(Outcome.SURVIVED if runs else Outcome.UNREACHED)
            return next((each for each in verdicts if each.outcome.is_noticed), first)
        finally:
            module.write_bytes(unchanged)

    def _run(self, tests: Portion) -> Verdict:
        output = self._root.with_name("output.txt")
        process = PROCESSES.Process(target=_run_pytest, args=(self._root, tests.arguments, output))
        process.start()
        process.join(20.0 + 5.0 * tests.seconds)
        status = process.exitcode
        _end(process)
        return Verdict(Outcome.TIMED_OUT) if status is None else _verdict(status, output.read_text(errors="replace"))


def _run_pytest(root: Path, arguments: Sequence[str], output: Path) -> NoReturn:
    """Run tests in this process, the first of a session of its own."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.chdir(root)
    sys.path.insert(0, str(root))
    os.environ["PYTHONPATH"] = str(root)  # for the tests' own processes
    with output.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    status = pytest.main([*OPTIONS, *arguments])
    sys.stdout.flush()
    os._exit(status)


def _end(process: BaseProcess) -> None:
    """End a test run with all processes that it has started."""
    if process.pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.join()
    process.close()


def _verdict(status: int, output: str) -> Verdict:
    if status in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        return Verdict(Outcome.SURVIVED)
    by = re.search(r"^(?:FAILED|ERROR) (\S+)", output, flags=re.MULTILINE)
    if by is None and status in (pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERNAL_ERROR):
        raise RuntimeError(f"no test has failed, but the run:\n{output}")
    return Verdict(Outcome.NOTICED, by[1] if by else f"pytest's exit status {status}")
