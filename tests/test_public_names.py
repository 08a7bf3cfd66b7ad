"""What programs may rely on: the names in `__all__` of a few modules, with their signatures, as a file has them.

A change of the file is a change of what docs/api.md promises. `tools/make_pages.py` writes it anew.
"""

from __future__ import annotations

import pydoc
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from make_pages import MODULES, NAMES, public_names

import eurobot_od

ROOT = Path(__file__).parents[1]
API = ROOT / "docs" / "api.md"


def test_no_public_name_or_signature_changes_unnoticed() -> None:
    assert NAMES.read_text("utf-8") == public_names(), "run .venv/bin/python tools/make_pages.py"


@pytest.mark.parametrize("module", ["eurobot_od", "eurobot_od.robot"])
def test_every_public_name_is_listed(module: str) -> None:
    text = API.read_text(encoding="utf-8")
    assert {*import_module(module).__all__} - set(re.findall(r"`(\w+)`", text)) == set()


def imports(text: str) -> Iterator[tuple[str, str]]:
    """Yield module and name of all that a text imports from this package."""
    for module, names in re.findall(r"^ *from (eurobot_od[\w.]*) import ([\w, ]+)", text, re.MULTILINE):
        yield from ((module, name.strip()) for name in names.split(","))


TAUGHT = [*ROOT.glob("docs/*.md"), ROOT / "README.md", *(ROOT / "eurobot_od" / "robot" / "new_robot").rglob("*.new")]


@pytest.mark.parametrize("file", TAUGHT, ids=lambda each: each.name)
def test_examples_import_only_public_names(file: Path) -> None:
    promised = {module: {*import_module(module).__all__} for module in MODULES}
    promised["eurobot_od"] |= {"Season"}  # of an extra
    odd = [(m, n) for m, n in imports(file.read_text(encoding="utf-8")) if n not in promised.get(m, ())]
    assert odd == []


def test_at_most_five_modules_are_promised() -> None:
    assert len(MODULES) <= 5
    assert set(re.findall(r"^\| `(eurobot_od[\w.]*)` \|", API.read_text(encoding="utf-8"), re.MULTILINE)) == {*MODULES}


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
