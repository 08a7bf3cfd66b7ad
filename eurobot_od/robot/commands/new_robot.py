"""Write a robot of your own that works at once: its table, EDS files, a node, a strategy and checks, to be changed."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

from eurobot_od.cli import options
from eurobot_od.errors import LocalError

FILES = Path(__file__).parents[1] / "new_robot"
"""What a new robot is made of; each file has `.new` at the end of its name, as it is not a part of this package."""

SUFFIX = ".new"
NAME = "NAME"
"""What stands for the robot's name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where it goes: a new folder, or an empty one")
    parser.add_argument("--name", help="what the robot is called; left out: the folder's name")


def run(arguments: argparse.Namespace) -> None:
    """Write the files, and say what to do next; raises LocalError, OSError."""
    folder: Path = arguments.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LocalError(f"{folder}: it is there, and not empty")
    name = arguments.name or folder.resolve().name
    # It goes into YAML, Python and an EDS as it is: a quote would end a string there, and an EDS is ASCII.
    if not (name.isprintable() and name.isascii()) or set(name) & set("\"'\\"):
        raise LocalError(f"--name {name}: printable ASCII characters without quotes and backslashes")
    for file, text in _texts(name, options.robot(arguments).table):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
        print(folder / file)
    print(f"\ntry it:  cd {folder}{os.linesep}         eurobot-od match --field match.svg")


def _texts(name: str, table: Path | None) -> Iterator[tuple[str, str]]:
    """Give the files of a new robot, those that its table makes among them."""
    from eurobot_od import plugin
    from eurobot_od.od.make.files import make_files
    from eurobot_od.od.make.table import read_table

    for file in sorted(FILES.rglob(f"*{SUFFIX}")):
        text = file.read_text(encoding="utf-8").replace(NAME, name)
        yield str(file.relative_to(FILES)).removesuffix(SUFFIX), text
        if file.stem == "protocol.yaml":
            made = make_files(read_table(text, file, plugin.table_of))
            yield from ((f"eds/{path}", content) for path, content in made.items())
    facts = table.with_name("robot.yaml") if table else None
    if facts and facts.is_file():
        yield "eds/robot.yaml", facts.read_text(encoding="utf-8")
