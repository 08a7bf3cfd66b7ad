"""Makes the files that complete the command line in shells, `eurobot_od/completions/`, by shtab.

Run it when a command or an option has changed; tests/cli/test_completion.py says when that is.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from environment import ROOT, ensure

FOLDER = ROOT / "eurobot_od" / "completions"
FILES = re.compile(r"(^|_)(files?|logs?|robot|left|right|output|store|strategy|against|network|eds)$")
"""Arguments whose values are files, beside those that are read as paths."""


def parser() -> argparse.ArgumentParser:
    """Return the whole command line as one parser."""
    from eurobot_od.cli import COMMANDS, add_robot, find
    from eurobot_od.robot.plugin import ROBOT

    whole = argparse.ArgumentParser("eurobot-od")
    whole.add_argument("--version", action="store_true", help="print the version and exit")
    commands = whole.add_subparsers()
    for command, text in {**COMMANDS, **{name: own.text for name, own in ROBOT.commands.items()}}.items():
        each = commands.add_parser(command, help=text)
        find(command).add_arguments(each)
        add_robot(each)
        _prepare(each, sorted(name for rows in ROBOT.all_faults().values() for name in rows))
    return whole


def _prepare(parser: argparse.ArgumentParser, faults: list[str]) -> None:
    """Say which arguments are files and faults; shtab takes a dictionary of choices for sub-commands."""
    import shtab

    for action in parser._actions:  # there is no other way to them
        if isinstance(action, argparse._SubParsersAction):
            for each in action.choices.values():
                _prepare(each, faults)
        elif action.choices is not None:
            action.choices = list(action.choices)
        elif action.dest == "fault":  # no choices of the parser's: another robot has other faults
            action.choices = faults
        elif action.type is Path or FILES.search(action.dest):
            action.complete = shtab.FILE  # type: ignore[attr-defined]


def main() -> int:
    """Write the files."""
    ensure("shtab", "test")
    sys.path.insert(0, str(ROOT))
    import shtab

    from eurobot_od.cli.completion import SHELLS

    FOLDER.mkdir(exist_ok=True)
    for shell, name in SHELLS.items():
        (FOLDER / name).write_text(shtab.complete(parser(), shell=shell), encoding="utf-8")
        print(FOLDER / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
