"""The command `doctor`: what is installed, robots too, the CAN interfaces, and what fixes what is wrong."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterable, Iterator, Mapping

from eurobot_od import plugin
from eurobot_od.bus.live.adapters import drivers, here, plugged_in, refused
from eurobot_od.bus.live.links import INSTEAD, links, troubles, without_socketcan
from eurobot_od.cli import ExitStatus, version
from eurobot_od.errors import LocalError
from eurobot_od.plugin import Installed
from eurobot_od.support import extras
from eurobot_od.support.extras import Package
from eurobot_od.support.progress import folded
from eurobot_od.support.texts import one_line

INDENT = len("interface  ")
"""Where what is said begins in a line."""

FOR_DEVELOPERS = ("test", "bench")
"""Extras that are needed only to develop the program."""

NEEDED = ("canopen", "python-can", "PyYAML", "shtab")
"""What every installation has."""


def doctor() -> ExitStatus:
    """Print what is installed, robots too, the CAN interfaces and their state, and what fixes what is wrong.

    Exit status 1 if something is wrong; an extra that is not installed is not an error.
    """
    why = {each: broken(each) for each in plugin.installed().values()}
    unloaded = [(what, f"{sys.executable} -m pip uninstall {each.package}") for each, what in why.items() if what]
    wrong = [*unloaded, *(trouble for link in links() for trouble in troubles(link)), *denied(refused())]
    loaded = drivers()
    lacks = without_socketcan()
    buses = [f"interface  {each}" for each in [*map(str, here())] or ["none"]]
    buses += [f"socketcan  {lacks}; {INSTEAD}"] if lacks else []
    buses += [f"adapter    {each.name}: {each.advice(not lacks)}" for each in plugged_in()]
    buses.append(f"drivers    {', '.join(name for name, loads in loaded.items() if loads)}")
    buses.append(f"no driver  {', '.join(name for name, loads in loaded.items() if not loads)}")
    needed = packages(each for name in NEEDED for each in extras.installed(name))
    brought = extra_lines({name: each for name, each in extras.brought().items() if name not in FOR_DEVELOPERS})
    robots = [
        f"robot      {each.name} {'does not load' if what else 'loads'}: {each.target}, entered by {each.file}"
        for each, what in why.items()
    ]
    for line in (f"{version()}, {platform.platform()}", *needed, "", *brought, "", *robots, "", *buses, ""):
        print(folded(one_line(line), sys.stdout, INDENT))
    for what, fix in wrong:
        print(folded(one_line(f"wrong      {what}: {fix}"), sys.stdout, INDENT))
    if wrong:
        return ExitStatus.FOUND
    print("nothing is wrong")
    return ExitStatus.FINE


def broken(robot: Installed) -> str:
    """Say why a robot cannot be loaded, `` if it can."""
    try:
        robot.load()
    except LocalError as error:
        return str(error)
    return ""


def packages(found: Iterable[Package]) -> Iterator[str]:
    """Yield a line for each package."""
    for name, installed in found:
        yield f"package    {name} {installed or 'is not installed'}"


def extra_lines(brought: Mapping[str, list[str]]) -> Iterator[str]:
    """Yield a line for each extra: the versions that are installed, or what installs it."""
    width = max(map(len, brought), default=0)
    for name, requirements in brought.items():
        found = [package for each in requirements for package in extras.installed(each)]
        is_there = all(package.version for package in found)
        versions = ", ".join(" ".join(package) for package in found)
        yield f"extra      {name:{width}}  {versions if is_there else f'not installed: {extras.install(requirements)}'}"


def denied(ports: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with serial ports that this user may not open, and how to fix it."""
    for port in ports:
        # A group counts from the next log-in on: without the second half the advice seems not to help.
        yield f"{port} cannot be opened by this user", "sudo usermod -aG dialout $USER, and log in again"
