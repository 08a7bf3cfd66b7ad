"""Write a robot of your own that works at once: its table, EDS files, a node, a strategy and checks, to be changed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from eurobot_od import plugin
from eurobot_od.cli import RobotName
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError

FILES = Path(__file__).parents[1] / "new_robot"
"""What a new robot is made of; each file has `.new` at the end of its name, as it is not a part of this package."""

SUFFIX = ".new"
NAME = "NAME"
"""What stands for the robot's name."""


def new_robot(
    folder: Annotated[Path, Option(metavar="FOLDER"), "where it goes: a new folder, or an empty one"],
    *,
    name: Annotated[str | None, "what the robot is called; left out: the folder's name"] = None,
    robot_name: RobotName = None,
) -> None:
    """Write a robot of your own that works at once: its table, EDS files, a node, a strategy and checks, to be changed.

    Raises LocalError, OSError.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LocalError(f"{folder}: it is there, and not empty")
    called = name or folder.resolve().name
    # It goes into YAML, Python and an EDS as it is: a quote would end a string there, and an EDS is ASCII.
    if not (called.isprintable() and called.isascii()) or set(called) & set("\"'\\"):
        raise LocalError(f"--name {called}: printable ASCII characters without quotes and backslashes")
    for file, text in _texts(called, plugin.find(robot_name).table):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
        print(folder / file)
    print(f"\ntry it:  cd {folder}{os.linesep}         eurobot-od match --field match.svg")


def _texts(name: str, table: Path | None) -> Iterator[tuple[str, str]]:
    """Give the files of a new robot, those that its table makes among them."""
    from eurobot_od.od.make.files import make_files  # with canopen
    from eurobot_od.od.make.table import read_table

    for file in sorted(FILES.rglob(f"*{SUFFIX}")):
        text = file.read_text(encoding="utf-8").replace(NAME, name)
        yield str(file.relative_to(FILES)).removesuffix(SUFFIX), text
        if file.stem == "protocol.yaml":
            made = make_files(read_table(text, file, lambda named: plugin.find(named).table))
            yield from ((f"eds/{path}", content) for path, content in made.items())
    facts = table.with_name("robot.yaml") if table else None
    if facts and facts.is_file():
        yield "eds/robot.yaml", facts.read_text(encoding="utf-8")
