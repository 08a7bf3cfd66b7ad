"""Sets up the repository's own virtual environment, for tools that a newcomer starts with a plain Python.

It runs before anything is installed, so it uses the standard library only. It does nothing while `pyproject.toml` is
unchanged since the last set-up.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / ".venv"
PYTHON = FOLDER / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
OLDEST = (3, 11)

LOCK = Path(__file__).resolve().parent / "constraints.txt"
"""The versions of all packages for CI and the nightly, on each system; CONTRIBUTING.md says how to renew them."""

UNFINISHED = "unfinished"
"""File in an environment that is being made; one that still has it was interrupted, and is made anew."""

WITHOUT_VENV = (
    "this Python has no {module}, which makes environments; Debian and Ubuntu: `sudo apt install python3-venv`; "
    "anywhere: `uv venv --seed --python 3.12 .venv`, and again"
)

UNREACHABLE = re.compile(r"NewConnectionError|ConnectTimeout|NameResolutionError|ProxyError|SSLError")
"""Texts in pip's output when it reaches no package index."""

STEPS = ("Collecting", "  Downloading", "Building", "Installing", "Successfully")
"""How lines of pip begin that say how far it is."""

ENSURED = "EUROBOT_OD_ENSURED"
"""Environment variable with the module for which a script was restarted; if that is still missing, the script ends."""

WORKERS = str((os.cpu_count() or 1) + 1)
"""Processes that run tests: one more than there are cores, as many tests wait for other processes."""

SHORT = ("-m", "not long")
"""Options that leave out tests of many seconds, which tools/nightly.py runs."""

SUITE = ("-m", "pytest", "-q", "-n", WORKERS, "--dist", "worksteal", "--durations=10")
"""Command of the tests on all cores; it lists the slowest."""

ONCE_MORE = ("-m", "pytest", "-q", "--last-failed", "--last-failed-no-failures", "none")
"""Options that run failed tests again, alone: a test in real time may be too late on a busy machine. One that fails
again has failed.
"""


def prepare(extras: str = "") -> Path:
    """Return the environment's Python; `extras` are those of pyproject.toml, comma-separated.

    Creates and fills the environment if it is missing or out of date; pip's output appears only if it fails.
    """
    if sys.version_info < OLDEST:
        sys.exit(f"Python {'.'.join(map(str, OLDEST))} or newer is needed, this is {sys.version.split()[0]}")
    stamp = FOLDER / f"installed-{extras or 'plain'}"
    if not is_current(stamp) or not PYTHON.is_file():
        try:
            _install(extras)
        except KeyboardInterrupt:  # the next run goes on with what is there, or anew
            sys.exit(130)
        for each in {stamp, FOLDER / "installed-plain"}:  # what has extras has all else
            each.write_text(wanted())
    return PYTHON


def has(module: str) -> bool:
    """Return whether the environment has a module."""
    return any(FOLDER.glob(f"[Ll]ib/site-packages/{module}")) or any(FOLDER.glob(f"lib/*/site-packages/{module}"))


def wanted() -> str:
    """Return a hash of the packages that `pyproject.toml` names, in CI with their versions."""
    files = [ROOT / "pyproject.toml", *([LOCK] if locked() else [])]
    return hashlib.sha256(b"".join(each.read_bytes() for each in files)).hexdigest()


def locked() -> list[str]:
    """Return pip's options for the versions with which CI passed; users get the newest."""
    return ["--constraint", str(LOCK)] if os.environ.get("CI") == "true" else []


def is_current(stamp: Path) -> bool:
    """Return whether the environment with this stamp was filled for what is `wanted` now."""
    return stamp.is_file() and stamp.read_text() == wanted()


def _install(extras: str) -> None:
    print(f"setting up {FOLDER.name}, once: what pip does follows ...", file=sys.stderr, flush=True)
    if not PYTHON.is_file() or (FOLDER / UNFINISHED).exists():
        _create()
    target = f"{ROOT}[{extras}]" if extras else str(ROOT)
    command = [str(PYTHON), "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar=off", *locked()]
    command += ["--editable", target]
    result = _told(command)
    if "No module named pip" in result.stderr:
        sys.exit(f"{FOLDER} has no pip; remove it and try again")
    if result.returncode and UNREACHABLE.search(result.stderr):
        sys.exit(f"pip reaches no package index, which it needs once to fill {FOLDER.name}: connect, and try again")
    if result.returncode:
        sys.exit(f"pip could not install what is needed:\n{result.stderr.strip()}")


def _told(command: list[str]) -> subprocess.CompletedProcess[str]:
    """Run pip, and say each step as it comes, to standard error; return its end with what it complains of."""
    with (
        tempfile.TemporaryFile("w+") as complaints,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=complaints, text=True) as pip,
    ):
        for line in pip.stdout or ():
            if line.startswith(STEPS):
                print(f"  {line.rstrip()}", file=sys.stderr, flush=True)
        status = pip.wait()
        complaints.seek(0)
        return subprocess.CompletedProcess(command, status, "", complaints.read())


def _create() -> None:
    """Make the environment, after removing the rest of an interrupted one."""
    missing = [module for module in ("venv", "ensurepip") if find_spec(module) is None]
    if missing:  # distributions leave out either
        sys.exit(WITHOUT_VENV.format(module=missing[0]))
    import venv

    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir()
    unfinished = FOLDER / UNFINISHED
    unfinished.touch()
    try:
        venv.create(FOLDER, with_pip=True)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"{FOLDER} could not be made: {error}")
    unfinished.unlink()


def ensure(module: str, extras: str = "") -> None:
    """Start the running script again in the environment if the Python that runs it lacks a module."""
    if find_spec(module) is not None:
        return
    if os.environ.get(ENSURED) == module:
        sys.exit(f"{FOLDER.name} was set up and still has no module {module!r}; remove {FOLDER} and try again")
    os.environ[ENSURED] = module
    sys.exit(call(prepare(extras), *sys.argv))


def call(*command: str | Path) -> int:
    """Run a command and return its exit status; 130 if it was interrupted."""
    try:
        return subprocess.run([str(word) for word in command], check=False, env=variables()).returncode
    except KeyboardInterrupt:
        return 130


def variables() -> dict[str, str]:
    """Return the environment variables for a started program.

    Without compiled files each of a thousand processes would compile what it imports, and each worker all tests.
    """
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
