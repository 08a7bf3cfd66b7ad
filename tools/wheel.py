"""Builds sdist and wheel, and installs the wheel in empty environments, with and without extras.

`python3 tools/wheel.py [VERSION...]`: on these Pythons, by default on each that this machine has. The wheel is built
from the sdist, which proves that the sdist is complete. The exit status is 1 if something does not work. `--licences`
writes docs/licences.md instead, from what the extras bring now.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from environment import ROOT, call, ensure
from pythons import ROWS, find

VERSIONS = tuple(dict.fromkeys(row.version for row in ROWS.values()))
EXTRAS = ("remote", "monitor", "web", "png", "mf4", "dbc", "season", "mcap", "cluster")
"""Extras for users; the others are for developers."""


class Try(NamedTuple):
    """A command of an installed program, its expected output, and its exit status."""

    words: tuple[str, ...]
    says: str
    status: int = 0
    program: str = "eurobot-od"


LOG = "match.log"
ALWAYS = (
    Try(("--version",), "eurobot-od "),
    Try(("match", "--for", "10", "--log", LOG), "points: ours"),
    Try(("decode", LOG), "boot-up"),
    Try(("check", "bytes", "--simulate"), "ok"),
    Try(("decode", LOG), "node 1, boot-up", program="canopen-workbench"),
    Try(("new-robot", "wings", "--package"), "pip install"),
)
OF_NEW_ROBOT = (
    Try(("doctor",), "robot      wings loads: wings.robot:ROBOT"),
    Try(("match", "--for", "10"), "Lift State Response "),
    Try(("check", "--simulate"), "1 suite: 22 ok"),
    Try(("export", "c"), "lift_set"),
)
"""The tries once the robot that `new-robot --package` has written is installed beside it."""

TRIES = {
    "": (*ALWAYS, Try(("archive", LOG, "-o", "season"), "the extra `season` brings it", 2)),
    ",".join(EXTRAS): (
        *ALWAYS,
        Try(("archive", LOG, "-o", "season"), "0 defects"),
        Try(("query", "season", "SELECT count(*) AS n FROM frames"), "n"),
        Try(("export", "mcap", LOG, "-o", "match.mcap"), ""),
        Try(("field", LOG, "-o", "match.png"), ""),
    ),
}
"""The tries in an environment with some extras, none at first."""


def build(folder: Path) -> Path:
    """Build both, and return the wheel."""
    subprocess.run([sys.executable, "-m", "uv", "build", "--quiet", "--out-dir", str(folder), str(ROOT)], check=True)
    (wheel,) = folder.glob("*.whl")
    for each in sorted(folder.glob("eurobot_od*")):
        print(f"{each.name}  {each.stat().st_size / 1024:.0f} kB", flush=True)
    return wheel


def install(wheel: Path, python: str, extras: str, folder: Path) -> Path:
    """Install the wheel in an environment of its own, and return the folder of its programs."""
    subprocess.run([sys.executable, "-m", "uv", "venv", "--quiet", "--python", python, str(folder)], check=True)
    own = next(file for name in ("bin/python", "Scripts/python.exe") if (file := folder / name).exists())
    add(own.parent, f"{wheel}[{extras}]" if extras else str(wheel))
    return own.parent


def add(programs: Path, target: str) -> None:
    """Install something in the environment of some programs."""
    line = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--python", str(programs.parent), target]
    subprocess.run(line, check=True)


def wrong(programs: Path, tries: tuple[Try, ...], folder: Path) -> Iterator[str]:
    """Yield what does not work in an environment."""
    for each in tries:
        command = [str(programs / each.program), *each.words]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        said = done.stdout + done.stderr
        if done.returncode != each.status or each.says not in said:
            yield f"{' '.join(each.words)}: status {done.returncode}: {said.strip()[-200:]}"


def is_fine(wheel: Path, version: str, python: str, extras: str) -> bool:
    """Install the wheel on a Python, try it, and print the result."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        try:
            programs = install(wheel, python, extras, folder / "venv")
            found = list(wrong(programs, TRIES[extras], folder))
            add(programs, str(folder / "wings"))
            found += wrong(programs, OF_NEW_ROBOT, folder)
        except subprocess.CalledProcessError as error:
            found = [f"{' '.join(error.cmd)}: status {error.returncode}"]
    result = "; ".join(found) or "works"
    print(f"Python {version}, {'all extras' if extras else 'no extras'}: {result}", flush=True)
    return not found


def write_licences(wheel: Path) -> int:
    """Run `licences.py` in an environment with all extras; return its exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        programs = install(wheel, sys.executable, ",".join(EXTRAS), Path(scratch, "venv"))
        return call(programs / "python", ROOT / "tools" / "licences.py", *EXTRAS)


def main(versions: list[str]) -> int:
    """Build, and try on all Pythons, also after a failure; return 1 if any failed."""
    ensure("uv", "test")
    with tempfile.TemporaryDirectory() as scratch:
        wheel = build(Path(scratch))
        if versions == ["--licences"]:
            return write_licences(wheel)
        there = {each: python for each in versions or VERSIONS if (python := find(each))}
        for each in versions or VERSIONS:
            if each not in there:
                print(f"Python {each}: skipped: not on this machine", flush=True)
        results = [is_fine(wheel, each, python, extras) for each, python in there.items() for extras in TRIES]
    return int(not all(results))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
