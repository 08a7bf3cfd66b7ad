"""Commands about the installation: `doctor` reports what is installed and what is wrong, `completion` is for shells.

shtab writes the script of `completion` from the parsers of all commands.
"""

from __future__ import annotations

import os
import platform
import sys
from argparse import ArgumentParser, _SubParsersAction
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from typing import Literal

from eurobot_od import loading
from eurobot_od.bus.live import adapters
from eurobot_od.cli import COMMANDS, ExitStatus, RobotName, find, program, robot_of_help, version, with_robot
from eurobot_od.cli.signature import Parser, describe
from eurobot_od.errors import LocalError
from eurobot_od.loading import Installed
from eurobot_od.plugin import NOTHING, Plugin, Plugins
from eurobot_od.support import extras
from eurobot_od.support.extras import Package
from eurobot_od.support.progress import folded
from eurobot_od.support.texts import one_line

INDENT = len("interface  ")
"""Column of the text in each line."""

FOR_DEVELOPERS = ("test", "bench", "release")
"""Extras that are needed only to develop the program."""

WITHOUT = "`node NODE --share 54701` makes a bus that needs none (docs/hardware.md)"

KINDS = {loading.ROBOTS.what: "robot     ", loading.DEVICES.what: "device    "}
"""Heads of the lines about plug-ins, by their kind."""

NEEDED = ("canopen", "python-can", "PyYAML", "shtab")
"""Packages of every installation."""


def doctor() -> ExitStatus:
    """Print what is installed, plug-ins too, the CAN interfaces and their state, and what fixes what is wrong.

    Exit status 1 if something is wrong; an extra that is not installed is not an error.

    $ doctor
    """
    why = {
        each: unloadable(each.load) for kind in (loading.ROBOTS, loading.DEVICES) for each in kind.installed().values()
    }
    unloaded = [(what, f"{sys.executable} -m pip uninstall {each.package}") for each, what in why.items() if what]
    troubles = (trouble for link in adapters.links() for trouble in adapters.troubles(link))
    wrong = [*unloaded, *_lost_packages(), *troubles, *denied(adapters.refused())]
    loaded = adapters.drivers()
    lacks = adapters.without_socketcan()
    buses_here = adapters.here()
    buses = [f"interface  {each}" for each in [*map(str, buses_here)] or ["none"]]
    buses += [f"socketcan  {lacks}; {adapters.INSTEAD}"] if lacks else []
    buses += [f"adapter    {each.name}: {each.advice(not lacks)}" for each in adapters.plugged_in()]
    buses.append(f"drivers    {', '.join(name for name, loads in loaded.items() if loads)}")
    buses.append(f"no driver  {', '.join(name for name, loads in loaded.items() if not loads)}")
    needed = packages(each for name in NEEDED for each in extras.installed(name))
    brought = extra_lines({name: each for name, each in extras.brought().items() if name not in FOR_DEVELOPERS})
    plugins = [f"{KINDS[each.kind.what]} {loading_of(each, what)}" for each, what in why.items()]
    for line in (f"{version()}, {platform.platform()}", *needed, "", *brought, "", *plugins, "", *buses, ""):
        print(folded(one_line(line), sys.stdout, INDENT))
    for what, fix in wrong:
        print(folded(one_line(f"wrong      {what}: {fix}"), sys.stdout, INDENT))
    if wrong:
        return ExitStatus.FOUND
    print("nothing is wrong" if buses_here else f"nothing is wrong, but there is no CAN interface; {WITHOUT}")
    return ExitStatus.FINE


def loading_of(plugin: Installed, broken: str) -> str:
    """Return whether a plug-in loads, and where it is."""
    loads = "does not load" if broken else "loads"
    return f"{plugin.name} {loads}: {plugin.target}, entered by {plugin.file}"


def _lost_packages() -> Iterator[tuple[str, str]]:
    """Yield the problem and the fix for each device package of the environment that cannot be loaded."""
    kind = loading.DEVICES
    for each in filter(None, os.environ.get(kind.variable, "").split(os.pathsep)):
        if why := unloadable(partial(kind.load, each)):
            yield f"{kind.variable} names {each}: {why}", f"name a folder with {kind.file}"


def unloadable(load: Callable[[], Plugin]) -> str:
    """Return why a plug-in cannot be loaded, empty if it can."""
    try:
        load()
    except (LocalError, OSError) as error:
        return str(error)
    return ""


def packages(found: Iterable[Package]) -> Iterator[str]:
    """Yield one line per package."""
    for name, installed in found:
        yield f"package    {name} {installed or 'is not installed'}"


def extra_lines(brought: Mapping[str, list[str]]) -> Iterator[str]:
    """Yield one line per extra: the installed versions, or how to install it."""
    width = max(map(len, brought), default=0)
    for name, requirements in brought.items():
        found = [package for each in requirements for package in extras.installed(each)]
        is_there = all(package.version for package in found)
        versions = ", ".join(" ".join(package) for package in found)
        yield f"extra      {name:{width}}  {versions if is_there else f'not installed: {extras.install(requirements)}'}"


def denied(ports: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield the problem and the fix for each serial port that this user may not open."""
    for port in ports:
        # A new group takes effect at the next log-in.
        yield f"{port} cannot be opened by this user", "sudo usermod -aG dialout $USER, and log in again"


# Completion in a shell


def completion(shell: Literal["bash", "zsh", "fish", "tcsh"], *, robot_name: RobotName = None) -> None:
    """Print the script that completes the command line in a shell: commands, options, and the values that are known.

    shell: the shell; the first lines of its script say where it belongs

    $ completion bash
    """
    import shtab  # here, as no other command needs it

    robot = robot_of_help(robot_name)
    print(shtab.complete(whole_parser(Plugins(robot), "none" if robot is NOTHING else robot_name), shell=shell))


def whole_parser(plugins: Plugins, robot_name: str | None) -> ArgumentParser:
    """Return the whole command line as one parser, with the suggestions for options and arguments."""
    whole = ArgumentParser(program())
    whole.add_argument("--version", action="store_true", help="print the version and exit")
    commands = whole.add_subparsers(parser_class=Parser)
    words = cache(lambda suggest: sorted(set(suggest(plugins))))  # cached, as listing objects takes a while
    for name, text in {**COMMANDS, **{name: own.text for name, own in plugins.commands().items()}}.items():
        parser = commands.add_parser(name, help=text, robot=robot_name)
        describe(parser, with_robot)
        describe(parser, find(name, robot_name))
        _offer(parser, words)
    return whole


def _offer(parser: Parser, words_of: Callable[[Callable[[Plugins], Iterable[str]]], list[str]]) -> None:
    """Set shtab's suggestions for the options and arguments of a parser, and of its forms."""
    import shtab

    for action in parser._actions:  # argparse has no public access
        if isinstance(action, _SubParsersAction):
            for form in action.choices.values():
                _offer(form, words_of)
        elif option := parser.described.get(action.dest):
            # argparse must not check these choices: another robot has others, and a node-ID is valid, too.
            if option.is_file:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
            elif words := [*option.words] or (words_of(option.suggest) if option.suggest else []):
                action.choices = words
