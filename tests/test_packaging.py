"""The wheel: it carries the EDS files where an installed package looks for them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import eurobot_od
from eurobot_od.robot import dialects

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    if sys.version_info >= (3, 11):
        import tomllib

        return tomllib.loads((ROOT / "pyproject.toml").read_text())
    pytest.skip("tomllib came with Python 3.11")


def test_the_wheel_has_the_eds_files_inside_the_package(project: dict[str, Any]) -> None:
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["packages"] == ["eurobot_od"]
    assert wheel["force-include"] == {"eds": "eurobot_od/eds"}
    assert sorted(file.stem for file in (ROOT / "eds").glob("*/*.eds")) == sorted(2 * ["core", "drive", "navigation"])


def test_an_installed_package_finds_its_eds_files_inside(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    inside = tmp_path / "eurobot_od" / "eds" / "mine"
    inside.mkdir(parents=True)
    inside.joinpath("core.eds").write_text((ROOT / "eds" / "canopen" / "core.eds").read_text())
    monkeypatch.setattr(dialects, "__file__", str(tmp_path / "eurobot_od" / "robot" / "dialects.py"))
    assert dialects.names() == ["mine"]


def test_the_command_is_installed(project: dict[str, Any]) -> None:
    module, _, function = project["project"]["scripts"]["eurobot-od"].partition(":")
    assert callable(getattr(__import__(module, fromlist=[function]), function))


def test_the_package_is_typed(project: dict[str, Any]) -> None:
    assert "Typing :: Typed" in project["project"]["classifiers"]
    assert Path(eurobot_od.__file__).with_name("py.typed").is_file()
