"""Runs the tests on other Pythons: the oldest with the lowest versions of all packages, and the newer ones.

`python3 tools/pythons.py [ROW...]`. `lowest` is the part of the suite in which an old Python or an old package can make
a difference; `3.11` and the others are the whole suite on that Python. A Python that this machine does not have is
skipped with a message; it is looked for as `python3.12`, and in pyenv. The exit status is 1 if tests failed, 2 for an
unknown row.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import NamedTuple

from environment import OLDEST, ONCE_MORE, ROOT, SHORT, SUITE, call, ensure, is_current, wanted

FINE, FAILED, WRONG_USAGE = 0, 1, 2

OLD = ".".join(map(str, OLDEST))
PART = (
    "tests/test_packaging.py",  # all modules are imported
    "tests/od",
    "tests/pdo",
    "tests/client/test_canopen_names.py",
    "tests/bus/live",
    "tests/traffic/formats",
    "tests/season",
    "tests/cli/test_main.py",
    "tests/cli/test_season.py",
    "tests/cli/test_installation.py",
)
"""Tests that use other packages, and those that depend on threads, files and argparse; the nightly runs all."""


class Row(NamedTuple):
    """A Python, the versions of its packages, and the tests to run, all if none are named."""

    version: str
    resolution: str
    tests: tuple[str, ...] = ()


ROWS = {
    "lowest": Row(OLD, "lowest-direct", PART),
    OLD: Row(OLD, "lowest-direct"),
    **{version: Row(version, "highest") for version in ("3.12", "3.13", "3.14")},
}


def candidates(version: str) -> Iterator[str]:
    """Yield the programs that may be a Python of a version."""
    yield which(f"python{version}") or ""
    pyenv = which("pyenv")
    if pyenv:
        installed = subprocess.run([pyenv, "versions", "--bare"], capture_output=True, text=True, check=False)
        for each in installed.stdout.split():
            if each.startswith(f"{version}."):
                prefix = subprocess.run([pyenv, "prefix", each], capture_output=True, text=True, check=False)
                yield str(Path(prefix.stdout.strip(), "bin", "python"))


def find(version: str) -> str | None:
    """Return the Python of a version, None if none runs: pyenv has programs that only print that they are missing."""
    question = "import sys; print('.'.join(map(str, sys.version_info[:2])))"
    for each in filter(None, candidates(version)):
        said = subprocess.run([each, "-c", question], capture_output=True, text=True, check=False)
        if said.stdout.strip() == version:
            return each
    return None


def prepare(row: Row, python: str) -> Path:
    """Set up a Python's own environment, and return its Python."""
    folder = ROOT / f".venv-{row.version}"
    own, stamp = folder / "bin" / "python", folder / "installed"
    if not is_current(stamp):
        uv = [sys.executable, "-m", "uv"]
        subprocess.run([*uv, "venv", "--quiet", "--clear", "--python", python, str(folder)], check=True)
        install = ["pip", "install", "--quiet", "--python", str(own), "--resolution", row.resolution]
        subprocess.run([*uv, *install, "--editable", f"{ROOT}[test]"], check=True)
        stamp.write_text(wanted())
    return own


def is_fine(row: Row) -> bool:
    """Run the tests of a row and print the result; a missing Python is not a failure."""
    python = find(row.version)
    if python is None:
        print(f"Python {row.version}: skipped: not on this machine", flush=True)
        return True
    print(f"Python {row.version}, packages: {row.resolution}", flush=True)
    own = prepare(row, python)
    tests = (*SHORT, "-o", f"cache_dir={own.parents[1] / 'pytest_cache'}", *row.tests)
    return not (call(own, *SUITE, *tests) and call(own, *ONCE_MORE, *tests))


def main(words: list[str]) -> int:
    """Run the named rows, all without names; go on after a failure."""
    if unknown := [each for each in words if each not in ROWS]:
        print(f"unknown: {', '.join(unknown)}; known: {', '.join(ROWS)}", file=sys.stderr)
        return WRONG_USAGE
    ensure("uv", "test")
    os.chdir(ROOT)
    results = [is_fine(ROWS[each]) for each in words or ROWS]
    return FINE if all(results) else FAILED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
