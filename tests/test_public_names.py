"""What programs may rely on: the names in `__all__` of a few modules, with their signatures, as a file has them.

A change of the file is a change of what docs/api.md promises. `python -m tests.test_public_names` writes it anew.
"""

from __future__ import annotations

import inspect
import pydoc
import re
import subprocess
import sys
import warnings
from collections.abc import Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import eurobot_od

MODULES = ("eurobot_od", "eurobot_od.errors", "eurobot_od.robot", "eurobot_od.robot.model.messages")
FILE = Path(__file__).with_name("public_names.txt")
API = Path(__file__).parents[1] / "docs" / "api.md"


def lines() -> Iterator[str]:
    """Give a line for each public name, and for each public member of a public class."""
    for module in map(import_module, MODULES):
        for name in sorted({*module.__all__, *getattr(module, "_EXTRAS", ())}):
            if inspect.ismodule(thing := getattr(module, name)):
                continue
            yield described(f"{module.__name__}.{name}", thing)
            if inspect.isclass(thing):
                yield from members(f"{module.__name__}.{name}", thing)


def members(name: str, kind: type) -> Iterator[str]:
    """Give the members that a class has from this package, private ones and Python's own left out."""
    for member in sorted(each for each in dir(kind) if not each.startswith("_")):
        home = next(base for base in kind.__mro__ if member in vars(base))
        if home.__module__.startswith("eurobot_od"):
            yield described(f"{name}.{member}", inspect.getattr_static(kind, member))


def described(name: str, thing: Any) -> str:
    """Return a name with its signature, or with what it is."""
    if isinstance(thing, (classmethod, staticmethod)):
        thing = thing.__func__
    if isinstance(thing, property):
        return f"{name}: property"
    if isinstance(thing, type) and issubclass(thing, Enum):  # whose own signature is another with each Python
        return f"{name}: enumeration"
    if not callable(thing) or not (inspect.isroutine(thing) or inspect.isclass(thing)):
        return f"{name}: attribute"
    try:
        signature = str(inspect.signature(thing))
    except ValueError:
        return name
    # Types of named tuples that nobody has looked up yet: Python 3.14 has them as they are written.
    signature = re.sub(r"""ForwardRef\((['"])(.*?)\1\)""", r"\2", signature)
    return name + re.sub(" at 0x[0-9a-f]+", "", signature)


def test_no_public_name_or_signature_changes_unnoticed() -> None:
    assert [*lines()] == FILE.read_text(encoding="utf-8").splitlines()


def test_every_public_name_is_listed() -> None:
    text = API.read_text(encoding="utf-8")
    assert {*import_module("eurobot_od").__all__} - set(re.findall(r"`(\w+)`", text)) == set()


def test_at_most_five_modules_are_promised() -> None:
    assert len(MODULES) <= 5
    assert set(re.findall(r"^\| `(eurobot_od[\w.]*)` \|", API.read_text(encoding="utf-8"), re.MULTILINE)) == {*MODULES}


def test_the_robot_s_messages_under_their_former_name_warn() -> None:
    with pytest.warns(DeprecationWarning, match=r"eurobot_od\.robot\.Protocol\.load"):
        protocol = eurobot_od.Protocol.load()  # type: ignore[attr-defined]  # which is how a type checker says so
    assert protocol.names() == import_module("eurobot_od.robot").Protocol.load().names()
    assert not hasattr(import_module("eurobot_od.pdo.protocol").Protocol, "load")  # nobody else's class has changed
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        import_module("eurobot_od.robot").Protocol.load()


def test_help_explains_every_public_name() -> None:
    for name in import_module("eurobot_od").__all__:
        assert len(pydoc.render_doc(getattr(eurobot_od, name)).splitlines()) > 3


def test_dir_has_the_names_that_are_loaded_when_they_are_asked_for() -> None:
    assert {"Network", "Season", "Dictionary", "messages"} <= {*dir(eurobot_od)}


WITHOUT_POLARS = """
import sys
sys.modules["polars"] = None
from eurobot_od import *
print(Network.__name__, "Season" in globals())
import eurobot_od
eurobot_od.Season
"""


def test_without_an_extra_all_names_but_those_that_need_it_are_there_and_the_others_name_it() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_POLARS], capture_output=True, text=True, timeout=60)
    assert done.stdout == "Network False\n"
    said = done.stderr.splitlines()[-1]
    assert said.startswith("eurobot_od.errors.LocalError: polars is not installed; the extra `season` brings it: ")
    assert "-m pip install" in said


if __name__ == "__main__":
    FILE.write_text("\n".join(lines()) + "\n", encoding="utf-8")
