"""The command `completion`: the script that completes the command line in a shell, made by shtab of the parsers."""

from __future__ import annotations

from argparse import ArgumentParser, _SubParsersAction
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Literal

from eurobot_od.cli import COMMANDS, RobotName, find, program, robot_of_help, with_robot
from eurobot_od.cli.signature import Parser, describe
from eurobot_od.plugin import NO_ROBOT, Plugin

BASH_BOTH = """\
{function}() {{
  compgen -W "{words}" -- "$1"
  compgen -f -- "$1"
}}"""
"""Offers words and files: a check is of a suite by its name, or of a file."""


def completion(shell: Literal["bash", "zsh", "fish", "tcsh"], *, robot_name: RobotName = None) -> None:
    """Print the script that completes the command line in a shell: commands, options, and the values that are known.

    shell: the shell; the first lines of its script say where it belongs
    """
    import shtab  # no other command needs it

    robot = robot_of_help(robot_name)
    print(shtab.complete(whole_parser(robot, "none" if robot is NO_ROBOT else robot_name), shell=shell))


def whole_parser(robot: Plugin, robot_name: str | None) -> ArgumentParser:
    """Return the whole command line as one parser, with what a shell offers for each option and argument."""
    whole = ArgumentParser(program())
    whole.add_argument("--version", action="store_true", help="print the version and exit")
    commands = whole.add_subparsers(parser_class=Parser)
    words = cache(lambda suggest: sorted(set(suggest(robot))))  # several commands have objects, which takes a while
    for name, text in {**COMMANDS, **{name: own.text for name, own in robot.commands.items()}}.items():
        parser = commands.add_parser(name, help=text, robot=robot_name)
        describe(parser, with_robot)
        describe(parser, find(name, robot_name))
        _offer(parser, words)
    return whole


def _offer(parser: Parser, words_of: Callable[[Callable[[Plugin], Iterable[str]]], list[str]]) -> None:
    """Tell shtab what may be given for each option and argument of a parser, and of its forms."""
    import shtab

    for action in parser._actions:  # there is no other way to them
        if isinstance(action, _SubParsersAction):
            for form in action.choices.values():
                _offer(form, words_of)
        elif option := parser.described.get(action.dest):
            # No choices for argparse: another robot has other ones, and a folder, a file or a node-ID will do as well.
            words = [*option.words] or (words_of(option.suggest) if option.suggest else [])
            if words and option.is_file:
                action.complete = _words_or_files(action.dest, words)  # type: ignore[attr-defined]
            elif words:
                action.choices = words
            elif option.is_file:
                action.complete = shtab.FILE  # type: ignore[attr-defined]


def _words_or_files(name: str, words: Iterable[str]) -> dict[str, Any]:
    """Return what shtab writes for words and files, of which it takes one."""
    joined, function = " ".join(words), f"_{program()}_{name}_or_file".replace("-", "_")
    return {
        "bash": function,
        "zsh": f"{{_files; compadd {joined}}}",
        "fish": f"{joined} (__fish_complete_path (commandline -ct))",
        "tcsh": f"({joined})",
        "preamble": {"bash": BASH_BOTH.format(function=function, words=joined)},
    }
