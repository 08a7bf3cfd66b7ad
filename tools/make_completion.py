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

SUITES_ARE_FILES = "_shtab_eurobot_od_check_pos_0_COMPGEN=_shtab_compgen_files"


def parser() -> argparse.ArgumentParser:
    """Return the whole command line as one parser."""
    from eurobot_od.cli import COMMANDS, add_robot, find
    from eurobot_od.robot.plugin import ROBOT

    whole = argparse.ArgumentParser("eurobot-od")
    whole.add_argument("--version", action="store_true", help="print the version and exit")
    commands, known = whole.add_subparsers(), values()
    for command, text in {**COMMANDS, **{name: own.text for name, own in ROBOT.commands.items()}}.items():
        each = commands.add_parser(command, help=text)
        find(command).add_arguments(each)
        add_robot(each)
        _prepare(each, command, known)
    return whole


def values() -> dict[tuple[str, ...], list[str]]:
    """Return what arguments may be, by their names, or by command and name.

    The parsers have no such choices: another robot has other ones, and a folder, a file or a node-ID will do as well.
    """
    from can.interfaces import BACKENDS

    from eurobot_od.lint.network import RULES
    from eurobot_od.lint.rules import FILE_RULES
    from eurobot_od.robot import dialects
    from eurobot_od.robot.plugin import ROBOT
    from eurobot_od.season.reports import REPORTS

    nodes, objects = sorted(ROBOT.nodes), sorted(_objects())
    return {
        ("fault",): sorted(name for rows in ROBOT.all_faults().values() for name in rows),
        ("node",): nodes,
        ("nodes",): nodes,
        ("dialect",): dialects.names(),
        ("interface",): sorted(BACKENDS),
        ("check", "files"): sorted(ROBOT.shipped_suites()),
        ("read", "objects"): objects,
        ("write", "name"): objects,
        ("pdo", "objects"): objects,
        ("show", "objects"): objects,
        ("query", "report"): sorted({**REPORTS, **ROBOT.reports()}),
        ("lint", "explain"): sorted(each.code for each in (*FILE_RULES, *RULES)),
    }


def _objects() -> set[str]:
    """Return the indices of the robot's objects, and the names of those that a shell takes without quotes."""
    from eurobot_od.od.objects import all_objects
    from eurobot_od.robot import dialects

    found = [each for node in dialects.load_all() for each in all_objects(node.objects)]
    return {f"0x{each.index:04X}" for each in found} | {
        name for each in found if re.fullmatch(r"[\w.-]+", name := each.qualname)
    }


def _prepare(parser: argparse.ArgumentParser, command: str, known: dict[tuple[str, ...], list[str]]) -> None:
    """Say which arguments are files, and what others may be; shtab takes a dictionary of choices for sub-commands."""
    import shtab

    for action in parser._actions:  # there is no other way to them
        if isinstance(action, argparse._SubParsersAction):
            for each in action.choices.values():
                _prepare(each, command, known)
            continue
        choices = action.choices or known.get((command, action.dest)) or known.get((action.dest,))
        if choices is not None and action.nargs != 0:
            action.choices = list(choices)
        if action.type is Path or FILES.search(action.dest):
            action.complete = shtab.FILE  # type: ignore[attr-defined]


def main() -> int:
    """Write the files."""
    ensure("shtab", "test")
    sys.path.insert(0, str(ROOT))
    import shtab

    from eurobot_od.cli.completion import SHELLS

    FOLDER.mkdir(exist_ok=True)
    for shell, name in SHELLS.items():
        text = shtab.complete(parser(), shell=shell)
        if shell == "bash":  # shtab writes files or choices, not both; a suite is either
            suites = " ".join(values()["check", "files"])
            text = text.replace(
                SUITES_ARE_FILES, f"{SUITES_ARE_FILES}\n_shtab_eurobot_od_check_pos_0_choices=({suites})"
            )
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(FOLDER / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
