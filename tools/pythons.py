"""Runs the tests on other Pythons: the oldest with the lowest versions of all packages, and the newer ones.

`python3 tools/pythons.py [VERSION...]`. The tools, other people's programs and long simulations are run by
`tools/test.py` alone; what else hardly depends on the Python (the browser, many processes, random inputs) is run on the
oldest, too, with the oldest packages. A Python that this machine does not have is skipped, and that is said; it is
looked for as `python3.12`, and in pyenv. The exit status is 1 if tests failed, 2 for an unknown version.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import NamedTuple

from environment import ONCE_MORE, ROOT, SHORT, WORKERS, call, ensure, is_current, wanted

FINE, FAILED, WRONG_USAGE = 0, 1, 2

SIMULATION = ("tests/check/conformance", "tests/device/faults")
"""Many minutes of our own simulated devices."""

PROGRAMS = ("tests/interop", "tests/tools")
"""Other people's programs and our tools, which are no part of the package."""

LEFT_OUT = (*PROGRAMS, *SIMULATION, "tests/web", "tests/properties", "tests/test_packaging.py")
MARKED = "not live and not socketcan and not long"


class Row(NamedTuple):
    """A Python, which versions of the packages it gets, and pytest's arguments."""

    version: str
    resolution: str
    arguments: tuple[str, ...]


def without(folders: tuple[str, ...]) -> tuple[str, ...]:
    """Return pytest's arguments that leave tests out."""
    return tuple(f"--ignore={each}" for each in folders)


ROWS = (
    Row("3.11", "lowest-direct", (*without((*PROGRAMS, *SIMULATION)), *SHORT)),
    Row("3.12", "highest", (*without(LEFT_OUT), "-m", MARKED)),
    Row("3.13", "highest", (*without(LEFT_OUT), "-m", MARKED)),
)


def candidates(version: str) -> Iterator[str]:
    """Give the programs that may be a Python of a version."""
    yield which(f"python{version}") or ""
    pyenv = which("pyenv")
    if pyenv:
        installed = subprocess.run([pyenv, "versions", "--bare"], capture_output=True, text=True, check=False)
        for each in installed.stdout.split():
            if each.startswith(f"{version}."):
                prefix = subprocess.run([pyenv, "prefix", each], capture_output=True, text=True, check=False)
                yield str(Path(prefix.stdout.strip(), "bin", "python"))


def find(version: str) -> str | None:
    """Return the Python of a version, None if there is none that runs: pyenv has programs that only say so."""
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
        subprocess.run([python, "-m", "venv", "--clear", str(folder)], check=True)
        install = ["-m", "uv", "pip", "install", "--quiet", "--python", str(own), "--resolution", row.resolution]
        subprocess.run([sys.executable, *install, "--editable", f"{ROOT}[test]"], check=True)
        stamp.write_text(wanted())
    return own


def is_fine(row: Row) -> bool:
    """Run the tests of a row and say how it went; a Python that is missing is not a failure."""
    python = find(row.version)
    if python is None:
        print(f"== Python {row.version}: skipped: no Python {row.version} here", flush=True)
        return True
    begin = time.monotonic()
    print(f"== Python {row.version}, packages: {row.resolution}", flush=True)
    own = prepare(row, python)
    cache = ("-o", f"cache_dir={own.parents[1] / 'pytest_cache'}")
    status = call(own, "-m", "pytest", "-q", "-n", WORKERS, "--dist", "worksteal", *cache, *row.arguments)
    if status:
        status = call(own, *ONCE_MORE, *cache, *row.arguments)
    print(f"== Python {row.version}: {'failed' if status else 'passed'}, {time.monotonic() - begin:.0f} s", flush=True)
    return status == 0


def main(versions: list[str]) -> int:
    """Run the rows of these versions, all without any; go on after one that failed."""
    rows = {row.version: row for row in ROWS}
    unknown = [each for each in versions if each not in rows]
    if unknown:
        print(f"unknown Python {', '.join(unknown)}; known: {', '.join(rows)}", file=sys.stderr)
        return WRONG_USAGE
    ensure("uv", "test")
    os.chdir(ROOT)
    results = [is_fine(rows[each]) for each in versions or rows]
    return FINE if all(results) else FAILED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
