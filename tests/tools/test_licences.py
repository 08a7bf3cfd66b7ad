"""The licences of what the extras bring: how they are read, and that no package of pyproject.toml is missing."""

from __future__ import annotations

import re
import tomllib
from email.message import Message
from pathlib import Path
from typing import Any, cast

import licences
import pytest
import wheel

ROOT = Path(__file__).parents[2]
DEVELOPERS = {"test", "mutants", "docs", "bench", "release"}

SAID = [
    # (metadata, licence)
    ({"License-Expression": "MIT", "License": "see LICENSE"}, "MIT"),
    ({"Classifier": "License :: OSI Approved :: BSD License", "License": "BSD-3"}, "BSD License"),
    ({"License": "BSD-3\nCopyright ..."}, "BSD-3"),  # some have the whole text there
    ({"License": "x" * 200}, "x" * licences.LONGEST),
    ({"Classifier": "Typing :: Typed"}, "says none"),
    ({}, "says none"),
]


@pytest.mark.parametrize(("said", "licence"), SAID)
def test_a_licence_comes_from_the_package_s_metadata(said: dict[str, str], licence: str) -> None:
    metadata = Message()
    for name, value in said.items():
        metadata[name] = value
    assert licences.licence(cast(Any, metadata)) == licence


def test_an_extra_brings_what_its_packages_need() -> None:
    found = licences.brought("web")
    assert {"aiohttp", "yarl"} <= found.keys()  # asked for, and needed by that
    assert not {"canopen", "python-can"} & found.keys()  # which are needed always
    assert {"canopen", "python-can"} <= licences.brought("").keys()


def test_the_page_has_each_package_of_each_extra_for_users() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert set(wheel.EXTRAS) == extras.keys() - DEVELOPERS
    asked = {"Always": project["dependencies"], **{f"Extra `{name}`": extras[name] for name in wheel.EXTRAS}}
    parts = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8").split("\n## ")
    pages = {part.split("\n")[0]: part for part in parts}
    for heading, packages in asked.items():
        for each in packages:
            name = re.split(r"[\[><=;]", each)[0]
            inside = "asammdf" if "[mf4]" in each else name  # python-can itself stands under "Always"
            rows = pages[heading].lower().replace("_", "-")
            assert f"\n| {inside.lower().replace('_', '-')} |" in rows, (heading, each)
