"""What tools/release.py looks at, as far as nothing has to be built or downloaded."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import release
import yaml
from wheel import EXTRAS

ROOT = Path(__file__).parents[2]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the files that have the version."""
    for name in ("pyproject.toml", "CITATION.cff"):
        (tmp_path / name).write_text((ROOT / name).read_text("utf-8"), encoding="utf-8")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## Unreleased\n\n- News.\n\n## 0.9.0 (2025-01-01)\n")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    return tmp_path


def test_a_version_is_written_wherever_it_stands(tree: Path) -> None:
    assert [*release.versions()] == []
    assert "begins with 'Unreleased'" in next(release.changelog())
    release.write_version("7.8.9")
    assert [*release.versions(), *release.changelog()] == []
    assert release.project()["version"] == "7.8.9"
    assert (tree / "CHANGELOG.md").read_text().count("## 7.8.9 (") == 1


def test_versions_that_differ_are_found(tree: Path) -> None:
    (tree / "CITATION.cff").write_text("version: 0.0.1\n")
    assert "0.0.1" in next(release.versions())


def test_links_of_the_readme_become_absolute() -> None:
    hook = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["metadata"]["hooks"]
    text = (ROOT / "README.md").read_text("utf-8")
    for each in hook["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(each["pattern"], each["replacement"], text)
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert len(links) >= 13
    assert [each for each in links if not each.startswith(("https://", "#"))] == []
    assert release.Links('<a href="x"></a><img src="y"><a>z</a>').found == ["x", "y"]


def test_the_small_distribution_asks_for_this_one() -> None:
    said = tomllib.loads(release.small_project())["project"]
    ours = release.project()
    assert said["dependencies"] == [f"eurobot-od=={ours['version']}"]
    assert {*said["optional-dependencies"]} == {*EXTRAS}
    assert said["urls"]["Homepage"] == ours["urls"]["Homepage"]
    assert said["scripts"].items() <= ours["scripts"].items()
    assert (said["license"], said["requires-python"]) == (ours["license"], ours["requires-python"])


def test_the_address_of_the_repository_is_the_homepage_wherever_it_stands() -> None:
    owner, name = release.project()["urls"]["Homepage"].removeprefix("https://github.com/").split("/")
    files = [ROOT / "pyproject.toml", *ROOT.glob("*.md"), *(ROOT / ".github").rglob("*.yml"), *ROOT.glob("docs/*.md")]
    text = "\n".join(each.read_text("utf-8") for each in files)
    found = re.findall(r"https://(?:github\.com|raw\.githubusercontent\.com)/([\w-]*eurobot-od[\w-]*)/([\w.-]+)", text)
    assert len(found) >= 8
    assert {*found} == {(owner, name)}
    assert f"https://{owner}.github.io/{name}/" in text


def test_only_pinned_actions_run_and_only_one_job_may_publish() -> None:
    for file in (ROOT / ".github" / "workflows").glob("*.yml"):
        used = re.findall(r"uses: (\S+)", file.read_text("utf-8"))
        assert [each for each in used if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", each)] == []
    said = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text("utf-8"))
    assert [name for name, job in said["jobs"].items() if "environment" in job] == ["publish"]
    assert said["jobs"]["publish"]["permissions"] == {"id-token": "write"}
