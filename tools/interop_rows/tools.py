"""The programs that judge us: where each comes from, whether it is here, and its version.

Rule of this file: only the standard library is used; only `install` installs anything, and only below `.venv` or by
apt.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Callable, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from environment import FOLDER, ROOT

OWN = FOLDER / "interop"
"""Folder of the programs that have an environment of their own."""

ODG_HOME = OWN / "objdictgen"
ODG = ODG_HOME / "bin" / "odg"
NODE_MODULES = OWN / "npm" / "node_modules"
VCAN = Path("/sys/class/net/vcan0")


class Tool(NamedTuple):
    """A program: its name and source, and the functions that find it, return its version and install it."""

    name: str
    source: str
    present: Callable[[], bool]
    version: Callable[[], str]
    install: Callable[[], None]
    remedy: str


def run(*command: str | Path, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program and return its status and its two outputs."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, errors="replace", cwd=folder, check=False)


def _required(*command: str | Path) -> None:
    """Run a program that must succeed; if it fails, this program ends."""
    words = " ".join(map(str, command))
    if shutil.which(command[0]) is None:
        sys.exit(f"{command[0]} is not here, so this cannot run: {words}\n--local asks only the programs that are here")
    done = run(*command)
    if done.returncode:
        sys.exit(f"{words} failed:\n{done.stderr.strip()}")


# From PyPI into the repository's own environment


def _installed(package: str) -> bool:
    return any(metadata.distributions(name=package))


def _nothing() -> None:
    """Install nothing: the extra `test` brings it."""


def of_python(package: str) -> Tool:
    """Return a package that the extra `test` of pyproject.toml brings."""
    present = partial(_installed, package)
    version = partial(metadata.version, package)
    return Tool(package, "pip", present, version, _nothing, f"pip install {package}")


# objdictgen in an environment of its own


def _install_objdictgen() -> None:
    venv.create(ODG_HOME, with_pip=True)
    _required(ODG_HOME / "bin" / "python", "-m", "pip", "install", "--quiet", "objdictgen")


def _objdictgen_version() -> str:
    return run(ODG, "--version").stdout.split()[-1]


# From Debian


def _on_path(programs: Sequence[str]) -> bool:
    return all(shutil.which(each) for each in programs)


def _install_debian(package: str, programs: Sequence[str]) -> None:
    if _on_path(programs):
        return
    before = ["env" if os.geteuid() == 0 else "sudo", "DEBIAN_FRONTEND=noninteractive", "apt-get"]
    _required(*before, "update", "-qq")
    _required(*before, "install", "--yes", "-qq", "--no-install-recommends", package)


def _debian_version(package: str) -> str:
    return run("dpkg-query", "--show", "--showformat=${Version}", package).stdout


def _of_debian(package: str, *programs: str) -> Tool:
    install, version = partial(_install_debian, package, programs), partial(_debian_version, package)
    return Tool(package, "apt", partial(_on_path, programs), version, install, f"apt-get install {package}")


# From npm


def _npm_present(package: str) -> bool:
    return _on_path(["node"]) and (NODE_MODULES / package).is_dir()


def _install_npm(package: str) -> None:
    NODE_MODULES.mkdir(parents=True, exist_ok=True)
    _required("npm", "install", "--prefix", NODE_MODULES.parent, "--no-audit", "--no-fund", package)


def _npm_version(package: str) -> str:
    said = json.loads((NODE_MODULES / package / "package.json").read_text())
    return f"{said['version']} on node {run('node', '--version').stdout.strip()}"


def _of_npm(package: str) -> Tool:
    present, version = partial(_npm_present, package), partial(_npm_version, package)
    remedy = f"python3 tools/interop.py installs it below {OWN.relative_to(ROOT)}, if node and npm are here"
    return Tool(f"npm {package}", "npm", present, version, partial(_install_npm, package), remedy)


CANOPEN, CAN, REMOTE = of_python("canopen"), of_python("python-can"), of_python("python-can-remote")
DCF_TOOLS, CANMATRIX, CANTOOLS = of_python("dcf-tools"), of_python("canmatrix"), of_python("cantools")
OBJDICTGEN = Tool(
    "objdictgen",
    "pip",
    ODG.is_file,
    _objdictgen_version,
    _install_objdictgen,
    f"python3 tools/interop.py installs it below {OWN.relative_to(ROOT)}",
)
TSHARK = _of_debian("tshark", "tshark")
GCC = _of_debian("gcc", "cc")
NPM_CANOPEN, AXE_CORE = _of_npm("canopen"), _of_npm("axe-core")
CAN_UTILS = _of_debian("can-utils", "candump", "cansend")._replace(
    present=lambda: _on_path(["candump", "cansend"]) and VCAN.exists(),
    remedy="apt-get install can-utils, on a kernel with SocketCAN: ip link add vcan0 type vcan; ip link set vcan0 up",
)
"""can-utils, present only where the kernel has SocketCAN, which many lack."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = _of_debian("chromium", "chromium")._replace(present=lambda: any(map(shutil.which, BROWSERS)))
"""Runs the tests of the page, as axe-core does; the matrix has no question for either."""
