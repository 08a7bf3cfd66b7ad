"""`new-robot` writes a robot of your own that works at once: its table, EDS files, a node, a strategy and checks."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Annotated

from eurobot_od import loading
from eurobot_od.cli import PROGRAM, RobotName
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.support.files import check_new_folder, write_whole

FILES = Path(__file__).parents[1] / "new_robot"
"""Folder of the templates of a new robot; the suffix `.new` keeps them from being part of this package."""

SUFFIX = ".new"

OF_PACKAGE = ("pyproject.toml",)
"""Files of a package for pip."""

OF_ONE_LINE = {
    "__init__.py": '"""NAME, a robot for eurobot-od."""\n',
    "eurobot-od.yaml": "robot: PACKAGE  # an installed robot: commands here are about it, also beside others\n",
}
"""Further files of a package."""

OF_FOLDER = ("conftest.py",)
"""Files of a folder for `--robot`."""

AT_ROOT = {each: each for each in ("README.md", "pyproject.toml", "eurobot-od.yaml")}
AT_ROOT["test_robot.py"] = "tests/test_robot.py"
"""Files of a package outside the folder of its modules, with their paths."""


def new_robot(
    folder: Annotated[Path, Option(metavar="FOLDER")],
    *,
    name: str | None = None,
    package: bool = False,
    robot_name: RobotName = None,
) -> None:
    """Write a robot of your own that works at once: its table, EDS files, a node, a strategy and checks, to be changed.

    Raises LocalError, OSError.

    folder: where it goes: a new folder, or an empty one
    name: what the robot is called; left out: the folder's name
    package: a package, which `pip install .` makes an installed robot

    $ new-robot mine
    """
    check_new_folder(folder)
    called = name or folder.resolve().name
    # The name is inserted into YAML, Python and an EDS, which is ASCII, without escapes.
    if not (called.isprintable() and called.isascii()) or set(called) & set("\"'\\"):
        raise LocalError(f"--name {called}: printable ASCII characters without quotes and backslashes")
    module = _package(called) if package else ""
    for file, text in _texts(called, module, loading.find(robot_name).table):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        write_whole(folder / file, text.encode())
        print(folder / file)
    steps = [f"cd {folder}", *(["pip install -e ."] if package else [])]
    # Before pip installs the program, it may not be on the PATH.
    program = PROGRAM if package or shutil.which(PROGRAM) else shlex.join((sys.executable, "-m", "eurobot_od"))
    steps += [f"{program} match --field match.svg{'' if package else ' --robot .'}"]
    print("\ntry it:", *steps, sep="\n  ")


def _package(name: str) -> str:
    """Return the name of a robot's package; raises LocalError for a keyword or a module that exists."""
    package = re.sub(r"\W+", "_", name.lower()).strip("_")
    if not package.isidentifier() or iskeyword(package):
        raise LocalError(f"--name {name}: a package's name begins with a letter and is not a word of Python")
    if (found := find_spec(package)) and found.origin:  # an empty folder has no origin
        raise LocalError(f"--name {name}: there is a module {package} already: {found.origin}")
    return package


def _texts(name: str, package: str, table: Path | None) -> Iterator[tuple[str, str]]:
    """Yield the files of a new robot, including those made from its table; `package` is empty for a folder.

    In their texts NAME is the robot's name, FOLDER/ and TESTS/ the folders of its files, PACKAGE. the prefix of its
    modules, and SETUP the first command to type.
    """
    from eurobot_od.od.make import read_table
    from eurobot_od.od.make.text import make_files

    inside, at_root = (f"{package}/", AT_ROOT) if package else ("", {})
    words = {
        "PACKAGE.": f"{package}." if package else "",
        "PACKAGE": package,
        "FOLDER/": inside,
        "TESTS/": "tests/" if package else "",
        "SETUP": "pip install -e ." if package else 'export EUROBOT_OD_ROBOT="$PWD"',
        "NAME": name,
    }
    there = {file.relative_to(FILES).as_posix().removesuffix(SUFFIX): file for file in FILES.rglob(f"*{SUFFIX}")}
    templates = {path: file.read_text(encoding="utf-8") for path, file in there.items()} | OF_ONE_LINE
    for path, template in sorted(templates.items()):
        if path in (OF_FOLDER if package else (*OF_PACKAGE, *OF_ONE_LINE)):
            continue
        text = re.sub("|".join(map(re.escape, words)), lambda found: words[found[0]], template)
        yield at_root.get(path, f"{inside}{path}"), text
        if path == "eds/protocol.yaml":
            made = make_files(read_table(text, there[path], loading.table_of))
            yield from ((f"{inside}eds/{path}", content) for path, content in made.items())
    facts = table.with_name("robot.yaml") if table else None
    if facts and facts.is_file():
        yield f"{inside}eds/robot.yaml", facts.read_text(encoding="utf-8")
