"""What is installed: the EDS files where a package looks for them, the command, the plugin, the hooks."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import pytest
import yaml

import eurobot_od
from eurobot_od.cli import main
from eurobot_od.robot import dialects

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_the_wheel_has_the_eds_files_inside_the_package(project: dict[str, Any]) -> None:
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["packages"] == ["eurobot_od"]
    assert wheel["force-include"] == {"eds": "eurobot_od/eds"}
    assert sorted(file.stem for file in (ROOT / "eds").glob("*/*.eds")) == sorted(2 * ["core", "drive", "navigation"])


def test_an_installed_package_finds_its_eds_files_inside(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "eurobot_od" / "eds").mkdir(parents=True)
    monkeypatch.setattr(dialects, "__file__", str(tmp_path / "eurobot_od" / "robot" / "dialects.py"))
    assert dialects.eds_folder() == tmp_path / "eurobot_od" / "eds"


def test_every_module_can_be_imported() -> None:
    modules = {each.name for each in walk_packages(eurobot_od.__path__, "eurobot_od.")} - {"eurobot_od.__main__"}
    for name in modules:  # of those that they import only when used, no linter says whether they are there
        import_module(name)
    assert modules


def test_the_programs_are_installed_and_go_by_their_names(
    project: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for program, entry in project["project"]["scripts"].items():
        module, _, function = entry.partition(":")
        monkeypatch.setattr(sys, "argv", [f"/somewhere/{program}", "nonsense"])
        assert getattr(__import__(module, fromlist=[function]), function)() == 2
        assert capsys.readouterr().err.startswith(f"{program}: unknown command 'nonsense'")


def test_the_pytest_plugin_is_installed_under_its_module_s_name(project: dict[str, Any]) -> None:
    # or else `-p eurobot_od.pytest_plugin` would be a second plugin
    assert project["project"]["entry-points"]["pytest11"] == {"eurobot_od.pytest_plugin": "eurobot_od.pytest_plugin"}


GREEN = "spec: 1\nname: it is there\nnode: drive\nsteps:\n  - sdo: {read: 0x1000}\n"
HOOKS = [
    # (hook, a file that it takes, its text, exit status)
    ("eurobot-od-lint", "drive.EDS", (ROOT / "eds/canopen/drive.eds").read_text(), 0),
    ("eurobot-od-lint", "drive.dcf", "", 2),
    ("eurobot-od-check", "drive.check.yaml", GREEN, 0),
    ("eurobot-od-check", "drive.check.yml", GREEN.replace("0x1000", "0x5000"), 1),
    ("eurobot-od-check", "drive.check.yaml", "spec: 2", 2),
]


@pytest.mark.parametrize(("hook", "name", "text", "status"), HOOKS)
def test_a_pre_commit_hook_takes_its_files_and_fails_on_wrong_ones(
    hook: str, name: str, text: str, status: int, tmp_path: Path
) -> None:
    (said,) = (each for each in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text()) if each["id"] == hook)
    assert re.search(said["files"], name)
    assert not re.search(said["files"], "drive.yaml")
    file = tmp_path / name
    file.write_text(text)
    program, *words = said["entry"].split()
    assert (program, main([*words, str(file)])) == ("eurobot-od", status)


def test_the_package_is_typed(project: dict[str, Any]) -> None:
    assert "Typing :: Typed" in project["project"]["classifiers"]
    assert Path(eurobot_od.__file__).with_name("py.typed").is_file()


def test_the_first_version_of_the_changelog_has_one_screen() -> None:
    _, first, *others = re.split("^## .*$", (ROOT / "CHANGELOG.md").read_text("utf-8"), flags=re.MULTILINE)
    assert len(first.strip().splitlines()) <= 70
    assert others == []  # nothing was published before it


def lowest_versions(project: dict[str, Any]) -> dict[str, str]:
    """Return the lowest version of Python, and of what the package and its extras for seasons need, by name."""
    needed = [*project["project"]["dependencies"], *project["project"]["optional-dependencies"]["season"]]
    named = [re.match(r"([\w-]+).*?>=([\d.]+)", each) for each in needed]
    lowest = {each[1].casefold(): each[2] for each in named if each}
    return {"python": project["project"]["requires-python"].removeprefix(">="), **lowest}


def test_the_changelog_names_the_lowest_versions_of_pyproject(project: dict[str, Any]) -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    said = [(name.casefold(), version) for name, version in re.findall(r"([A-Za-z][\w-]*)\s+(\d+(?:\.\d+)*)", text)]
    lowest = lowest_versions(project)
    assert {each for each in said if each[0] in lowest} == {*lowest.items()}


@pytest.mark.parametrize("file", ["README.md", "CHANGELOG.md", "docs/api.md"], ids=lambda each: each)
def test_no_page_speaks_of_a_version_before_the_first(file: str, project: dict[str, Any]) -> None:
    text = (ROOT / file).read_text("utf-8").replace(project["project"]["version"], "")
    assert not re.search(r"\d\.\d\.\d\s*(rc|a|b)\d|come from rc", text)
