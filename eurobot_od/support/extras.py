"""Packages that only some commands need. A missing one is reported in one line, which says what installs it.

Only `pyproject.toml` says which packages an extra brings; the installed package's metadata have it. The line names the
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
"""A requirement that an extra brings, as metadata have it: `polars>=1.20; extra == 'season'`."""

NAMED = re.compile(r"(?P<name>[A-Za-z0-9._-]+)(\[(?P<extra>[^\]]+)\])?")
"""Which package a requirement is about, and which extra of it."""


def put_off(module: str) -> None:
    """Let a module be imported by nobody until `caught_up`: a library imports it only because it is there."""
    sys.modules.setdefault(module, None)  # type: ignore[arg-type]  # of which an import is an ImportError


def caught_up(module: str, importer: str) -> None:
    """Let a module be imported that was put off, by the library's module that does it."""
    if module in sys.modules and sys.modules[module] is None:
        del sys.modules[module]
        reload(import_module(importer))


@contextmanager
def needed(extra: str) -> Iterator[None]:
    """Import something inside that the extra brings; raises LocalError if it is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("eurobot_od"):  # a module of ours that is missing is a bug, and no extra
            raise
        raise LocalError(missing(error.name or "", extra)) from None


def missing(what: str, extra: str) -> str:
    """Say that a module is not installed, and what installs the extra that brings it."""
    packages = brought().get(extra, [])
    command = f": {install(packages)}" if packages else ""
    return f"{what} is not installed; the extra `{extra}` brings it{command}"


def install(packages: list[str]) -> str:
    """Return the command that installs packages for this Python."""
    quote = '"' if os.name == "nt" else "'"  # to cmd.exe a single quote is a letter, and > a redirection
    return " ".join([sys.executable, "-m pip install", *(f"{quote}{each}{quote}" for each in packages)])


def brought() -> dict[str, list[str]]:
    """Return the packages that each extra brings, with their versions; none if this package itself is not installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("eurobot-od") or []
    except PackageNotFoundError:
        return {}
    return of_extras(requirements)


class Package(NamedTuple):
    """A package, and the version that is installed, empty if none is."""

    name: str
    version: str


def installed(requirement: str) -> list[Package]:
    """Return the package that a requirement names and, of `package[extra]`, what that extra brings."""
    from importlib.metadata import PackageNotFoundError, requires, version

    match = NAMED.match(requirement)
    if match is None:
        return []
    name, extra = match["name"], match["extra"]
    try:
        found = [Package(name, version(name))]
    except PackageNotFoundError:
        return [Package(name, "")]
    inside = of_extras(requires(name) or []).get(extra, []) if extra else []
    return found + [each for further in inside for each in installed(further)]


def of_extras(requirements: list[str]) -> dict[str, list[str]]:
    """Sort requirements, as metadata write them, by the extra that brings them; the others are passed over."""
    extras: dict[str, list[str]] = {}
    for match in filter(None, map(OF_AN_EXTRA.fullmatch, requirements)):
        extras.setdefault(match["extra"], []).append(match["package"])
    return extras


def load(file: Path) -> ModuleType:
    """Run a file as a module of its own, which may import what stands beside it.

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
    if folder not in sys.path:  # last, so that a `random.py` beside it cannot take the place of Python's own
        sys.path.append(folder)
    sys.modules[module.__name__] = module  # where dataclasses look for the module that they are in
    try:
        with redirect_stdout(sys.stderr):  # standard output may be a document, such as --json
            exec(compile(source, str(file), "exec", dont_inherit=True), module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, and what `pytest.skip` raises, too
        raise LocalError(complaint(error, f"{file}:1", partial(_stands_in, folder))) from None
    return module


def _stands_in(folder: str, frame: FrameType) -> bool:
    name = frame.f_code.co_filename  # of generated code it is `<...>`
    return not name.startswith("<") and Path(name).resolve().parent == Path(folder)


def complaint(error: BaseException, otherwise: str, is_theirs: Callable[[FrameType], bool]) -> str:
    """Say on one line what somebody's code raised, and in which line of theirs; `otherwise` stands for none."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno or 1}: {type(error).__name__}: {error.msg}"
    if isinstance(error, NodeClassError):  # it has its place
        return str(error)
    raised = [(frame.f_code.co_filename, n) for frame, n in traceback.walk_tb(error.__traceback__) if is_theirs(frame)]
    # The last place of theirs: further in, the traceback goes through libraries that are not to blame.
    where = "{}:{}".format(*raised[-1]) if raised else otherwise
    return f"{where}: {described(error)}"


def is_foreign(frame: FrameType) -> bool:
    """Return whether a line of a traceback is not of this package."""
    return not str(frame.f_globals.get("__name__")).startswith("eurobot_od.")


def place_of(thing: type) -> str:
    """Return `file:line` of a class, or the name of its module if that is not to be found."""
    try:
        return f"{inspect.getsourcefile(thing)}:{inspect.getsourcelines(thing)[1]}"
    except (OSError, TypeError):
        return thing.__module__
