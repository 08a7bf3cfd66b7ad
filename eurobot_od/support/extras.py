"""Optional packages: a command that misses one reports in one line how to install it.

The list of extras is in `pyproject.toml`, and is read from the installed package's metadata. The line names the
packages, not `eurobot-od[EXTRA]`, because it has to work in a checkout, too.
"""

from __future__ import annotations

import inspect
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from importlib import import_module, reload
from pathlib import Path
from types import FrameType, ModuleType
from typing import NamedTuple

from eurobot_od.errors import LocalError, NodeClassError
from eurobot_od.support.texts import described

OF_AN_EXTRA = re.compile(r"(?P<package>[^;]+?)\s*;.*\bextra\s*==\s*['\"](?P<extra>[^'\"]+)['\"].*")
"""A requirement of an extra, as metadata write it: `polars>=1.20; extra == 'season'`."""

NAMED = re.compile(r"(?P<name>[A-Za-z0-9._-]+)(\[(?P<extra>[^\]]+)\])?")
"""The package that a requirement names, and the extra of that package."""


def put_off(module: str) -> None:
    """Make imports of a module fail until `caught_up`: a library imports it only because it is installed."""
    sys.modules.setdefault(module, None)  # type: ignore[arg-type]  # importing None raises ImportError


def caught_up(module: str, importer: str) -> None:
    """Allow the import of a module that `put_off` has blocked, and reload `importer`, which imports it."""
    if module in sys.modules and sys.modules[module] is None:
        del sys.modules[module]
        reload(import_module(importer))


@contextmanager
def needed(extra: str) -> Iterator[None]:
    """Convert a failed import inside the `with` block into a LocalError that names the extra to install."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("eurobot_od"):  # a missing module of this package is a bug
            raise
        raise LocalError(missing(error.name or "", extra)) from None


def missing(what: str, extra: str) -> str:
    """Return the error text for a missing module: what is missing, and the command that installs its extra."""
    packages = brought().get(extra, [])
    command = f": {install(packages)}" if packages else ""
    return f"{what} is not installed; the extra `{extra}` brings it{command}"


def install(packages: list[str]) -> str:
    """Return the command that installs packages for this Python."""
    quote = '"' if os.name == "nt" else "'"  # cmd.exe quotes by " only, and takes > for a redirection
    return " ".join([sys.executable, "-m pip install", *(f"{quote}{each}{quote}" for each in packages)])


def brought() -> dict[str, list[str]]:
    """Return the requirements of each extra; none if this package itself is not installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("eurobot-od") or []
    except PackageNotFoundError:
        return {}
    return of_extras(requirements)


class Package(NamedTuple):
    """A package and its installed version, which is empty if it is not installed."""

    name: str
    version: str


def installed(requirement: str) -> list[Package]:
    """Return the package that a requirement names; for `package[extra]` also those of the extra."""
    from importlib.metadata import PackageNotFoundError, requires, version

    match = NAMED.match(requirement)
    if match is None:
        return []
    name, extra = match["name"], match["extra"]
    try:
        found = [Package(name, version(name))]
    except PackageNotFoundError:
        return [Package(name, "")]
    for further in of_extras(requires(name) or []).get(extra, []):
        found += installed(further)
    return found


def of_extras(requirements: list[str]) -> dict[str, list[str]]:
    """Group requirements, as metadata write them, by their extra; those without an extra are left out."""
    extras: dict[str, list[str]] = {}
    for match in filter(None, map(OF_AN_EXTRA.fullmatch, requirements)):
        extras.setdefault(match["extra"], []).append(match["package"])
    return extras


def load(file: Path) -> ModuleType:
    """Run a file as a module; it may import the modules in its folder.

    What the file prints while it is loaded goes to standard error. Raises LocalError, with the line of the file, if it
    cannot be read, is not Python, or raises.
    """
    module = ModuleType(f"file {file.resolve()}")
    module.__file__ = str(file)
    try:
        source = file.read_bytes()
    except OSError as error:
        raise LocalError(f"{file}: {error.strerror}") from None
    folder = str(file.resolve().parent)
    if folder not in sys.path:  # last, so that a `random.py` in it does not hide Python's own
        sys.path.append(folder)
    sys.modules[module.__name__] = module  # dataclasses look up their module there
    try:
        with redirect_stdout(sys.stderr):  # standard output may be a document, such as --json
            exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit and `pytest.skip` included
        raise LocalError(complaint(error, f"{file}:1", partial(_stands_in, folder))) from None
    return module


def _stands_in(folder: str, frame: FrameType) -> bool:
    name = frame.f_code.co_filename  # of generated code it is `<...>`
    return not name.startswith("<") and Path(name).resolve().parent == Path(folder)


def complaint(error: BaseException, otherwise: str, is_theirs: Callable[[FrameType], bool]) -> str:
    """Return an exception as one line, with the last place in code that `is_theirs` accepts, else `otherwise`."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno or 1}: {type(error).__name__}: {error.msg}"
    if isinstance(error, NodeClassError):  # its text has the place
        return str(error)
    raised = [(frame.f_code.co_filename, n) for frame, n in traceback.walk_tb(error.__traceback__) if is_theirs(frame)]
    # Deeper frames belong to libraries, which are not to blame.
    where = "{}:{}".format(*raised[-1]) if raised else otherwise
    return f"{where}: {described(error)}"


def is_foreign(frame: FrameType) -> bool:
    """Return whether a traceback's frame is outside this package."""
    return not str(frame.f_globals.get("__name__")).startswith("eurobot_od.")


def place_of(thing: type) -> str:
    """Return `file:line` of a class, or its module's name if the source is not available."""
    try:
        return f"{inspect.getsourcefile(thing)}:{inspect.getsourcelines(thing)[1]}"
    except (OSError, TypeError):
        return thing.__module__
