"""Write a robot of your own that works at once: its table, EDS files, a node, a strategy and checks, to be changed."""

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

FILES = Path(__file__).parents[1] / "new_robot"
"""What a new robot is made of; each file has `.new` at the end of its name, as it is not a part of this package."""

SUFFIX = ".new"

OF_PACKAGE = ("pyproject.toml",)
"""Files of a package, which pip installs."""

OF_ONE_LINE = {
    "__init__.py": '"""NAME, a robot for eurobot-od."""\n',
    "eurobot-od.yaml": "robot: PACKAGE  # an installed robot: commands here are about it, also beside others\n",
}
"""More files of a package."""

OF_FOLDER = ("conftest.py",)
"""Files of a folder, which `--robot` names."""

AT_ROOT = {each: each for each in ("README.md", "pyproject.toml", "eurobot-od.yaml")}
AT_ROOT["test_robot.py"] = "tests/test_robot.py"
"""Files of a package that are not in the folder of its modules, and where they are."""


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
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LocalError(f"{folder}: it is there, and not empty")
    called = name or folder.resolve().name
    # It goes into YAML, Python and an EDS as it is: a quote would end a string there, and an EDS is ASCII.
    if not (called.isprintable() and called.isascii()) or set(called) & set("\"'\\"):
        raise LocalError(f"--name {called}: printable ASCII characters without quotes and backslashes")
    module = _package(called) if package else ""
    for file, text in _texts(called, module, loading.find(robot_name).table):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
        print(folder / file)
    steps = [f"cd {folder}", *(["pip install -e ."] if package else [])]
    # pip puts the program on the PATH; before, it may be nowhere but in this Python.
    program = PROGRAM if package or shutil.which(PROGRAM) else shlex.join((sys.executable, "-m", "eurobot_od"))
    steps += [f"{program} match --field match.svg{'' if package else ' --robot .'}"]
    print("\ntry it:", *steps, sep="\n  ")


def _package(name: str) -> str:
    """Return what a robot's package is called; raises LocalError for a name that Python, or a module, has already."""
    package = re.sub(r"\W+", "_", name.lower()).strip("_")
    if not package.isidentifier() or iskeyword(package):
        raise LocalError(f"--name {name}: a package's name begins with a letter and is not a word of Python")
    if (found := find_spec(package)) and found.origin:  # an empty folder has none
        raise LocalError(f"--name {name}: there is a module {package} already: {found.origin}")
    return package


def _texts(name: str, package: str, table: Path | None) -> Iterator[tuple[str, str]]:
    """Yield the files of a new robot, those that its table makes among them; `package` is `` for a folder.

    In them NAME is what the robot is called, FOLDER/ and TESTS/ where its files are, PACKAGE. what its modules are
    imported from, and SETUP what is typed first.
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
