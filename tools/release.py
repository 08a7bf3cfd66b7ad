"""Rehearses a release: `python3 tools/release.py --check` checks all that one needs, and prints what is missing.

Rows of its table: version, changelog, tag, sdist and wheel (byte-identical in two builds), README as a package index
shows it, metadata, licences of the shipped files, each extra in an empty environment, SBOM, and `canopen-workbench`.
`--quick` leaves out what downloads packages; `--tag` asks for the tag, as the workflow does. Results are in
build/release. `--version 1.0.1` writes a version, and today's date, wherever they stand.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import date
from fnmatch import fnmatchcase
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile

from environment import ROOT, ensure
from wheel import EXTRAS

FOLDER = ROOT / "build" / "release"
WORKBENCH = ROOT / "tools" / "canopen-workbench.toml"
URLS = ("Homepage", "Documentation", "Issues", "Changelog", "Source")
"""What a package index links to, beside the description."""

VERSION_PLACES = {"pyproject.toml": r'^version = "(.*)"$', "CITATION.cff": r"^version: (.*)$"}
UNRELEASED = "## Unreleased"


class Links(HTMLParser):
    """The links and pictures of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value or "" for name, value in attrs if (tag, name) in {("a", "href"), ("img", "src")}]


def read_toml(file: Path) -> dict[str, Any]:
    """Return the content of a TOML file."""
    return tomllib.loads(file.read_text(encoding="utf-8"))


def project() -> dict[str, Any]:
    """Return the table `project` of pyproject.toml."""
    found: dict[str, Any] = read_toml(ROOT / "pyproject.toml")["project"]
    return found


def output_of(*words: str | Path, **variables: str) -> str:
    """Run a command and return its output; raises CalledProcessError."""
    command = [str(word) for word in words]
    environment = {**os.environ, **variables}
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT, env=environment).stdout


def uv(*words: str | Path, **variables: str) -> str:
    """Run uv, as `output_of` does."""
    return output_of(sys.executable, "-m", "uv", *words, **variables)


# What a release needs: each yields what is wrong


def versions() -> Iterator[str]:
    """The version is the same everywhere."""
    found = {file: re.findall(at, (ROOT / file).read_text("utf-8"), re.M) for file, at in VERSION_PLACES.items()}
    if len({*map(tuple, found.values())}) != 1:
        yield f"not one version: {found}"


def changelog() -> Iterator[str]:
    """The changelog begins with the version."""
    first = next(line for line in (ROOT / "CHANGELOG.md").read_text("utf-8").splitlines() if line.startswith("## "))
    if not first.startswith(f"## {project()['version']} "):
        yield f"it begins with {first[3:]!r}: `tools/release.py --version` gives that a version"


def tag() -> Iterator[str]:
    """The commit has the version's tag, and nothing is uncommitted."""
    wanted = f"v{project()['version']}"
    there = output_of("git", "tag", "--points-at", "HEAD").split()
    if wanted not in there:
        yield f"HEAD has the tags {there}, and not {wanted}"
    if changed := output_of("git", "status", "--porcelain").strip():
        yield f"not committed: {changed.split()[1]} and others" if "\n" in changed else f"not committed: {changed}"


def builds() -> Iterator[str]:
    """Sdist and wheel are the same bytes in two builds."""
    epoch = output_of("git", "log", "-1", "--format=%ct").strip()
    digests = []
    for name in ("dist", "again"):
        shutil.rmtree(FOLDER / name, ignore_errors=True)
        uv("build", "--quiet", "--out-dir", FOLDER / name, ROOT, SOURCE_DATE_EPOCH=epoch)
        files = sorted((FOLDER / name).glob("eurobot_od*"))
        digests.append({file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files})
    shutil.rmtree(FOLDER / "again")
    if digests[0] != digests[1] or len(digests[0]) != 2:
        yield f"two builds differ: {digests}"


def wheel() -> Path:
    """Return the built wheel."""
    (found,) = (FOLDER / "dist").glob("eurobot_od*.whl")
    return found


def described() -> tuple[dict[str, list[str]], str]:
    """Return the fields of the wheel's metadata, and the description."""
    with ZipFile(wheel()) as inside:
        name = next(each for each in inside.namelist() if each.endswith(".dist-info/METADATA"))
        head, _, text = inside.read(name).decode().partition("\n\n")
    fields: dict[str, list[str]] = {}
    for line in head.splitlines():
        key, _, value = line.partition(": ")
        fields.setdefault(key, []).append(value)
    return fields, text


def readme() -> Iterator[str]:
    """README is rendered as a package index does it, and links only to other hosts."""
    from readme_renderer import markdown

    page = markdown.render(described()[1])
    if page is None:
        yield "it cannot be rendered"
        return
    (FOLDER / "readme.html").write_text(f"<!doctype html><meta charset=utf-8>{STYLE}{page}", encoding="utf-8")
    yield from (f"{each} leads nowhere" for each in Links(page).found if not each.startswith(("https://", "#")))


STYLE = (
    "<style>body{max-width:50em;margin:2em auto;font:16px sans-serif}img{max-width:100%}pre{background:#eee}</style>"
)


def metadata() -> Iterator[str]:
    """The package index gets authors, a licence and links."""
    fields, _ = described()
    known = {each.partition(",")[0] for each in fields.get("Project-URL", [])}
    yield from (f"no [project.urls] {each}" for each in URLS if each not in known)
    yield from (
        f"no {each}" for each in ("Author", "License-Expression", "License-File", "Summary") if each not in fields
    )


def licences() -> Iterator[str]:
    """REUSE.toml has an SPDX licence for each shipped file, which is part of the package's expression."""
    rules = read_toml(ROOT / "REUSE.toml")["annotations"]
    expression = project()["license"].split(" AND ")
    with ZipFile(wheel()) as inside:
        names = {each.removeprefix("eurobot_od/eds/") for each in inside.namelist() if ".dist-info/" not in each}
    with tarfile.open(next((FOLDER / "dist").glob("eurobot_od*.tar.gz"))) as archive:
        names |= {each.name.partition("/")[2] for each in archive.getmembers() if each.isfile()}
    for name in sorted(names):
        said = [each["SPDX-License-Identifier"] for each in rules if any(fnmatchcase(name, at) for at in each["path"])]
        if not said or said[-1] not in expression:
            yield f"{name}: {said[-1] if said else 'no licence'}"


def extras() -> Iterator[str]:
    """Each extra can be installed in an empty environment, and its packages fit together."""
    for extra in ("", *EXTRAS):
        try:
            python = installed(f"{wheel()}[{extra}]" if extra else str(wheel()))
            uv("pip", "check", "--python", python)
        except subprocess.CalledProcessError as error:
            yield f"{extra or 'none'}: {error.stderr.strip()[-200:]}"
            continue
        size = sum(file.stat().st_size for file in (FOLDER / "venv").rglob("*") if file.is_file()) >> 20
        print(f"           {extra or 'no extra':9} {size:4d} MB", flush=True)


def installed(*targets: str | Path) -> Path:
    """Install something in an empty environment, and return its Python."""
    folder = FOLDER / "venv"
    shutil.rmtree(folder, ignore_errors=True)
    uv("venv", "--quiet", "--python", sys.executable, folder)
    python = next(file for name in ("bin/python", "Scripts/python.exe") if (file := folder / name).exists())
    uv("pip", "install", "--quiet", "--link-mode=copy", "--python", python, *targets)
    return python


def sbom() -> Iterator[str]:
    """A bill of materials (CycloneDX) lists the package and all that it needs."""
    python = installed(wheel())
    file = FOLDER / "sbom.json"
    output_of(sys.executable, "-m", "cyclonedx_py", "environment", "--output-file", file, python)
    text = file.read_text(encoding="utf-8")
    yield from (f"{each} is not in it" for each in ("eurobot-od", "canopen", "python-can") if f'"{each}"' not in text)


def small_project() -> str:
    """Return the pyproject.toml of the small distribution, made from this one's."""
    version = project()["version"]
    text = WORKBENCH.read_text(encoding="utf-8")
    extras = "\n".join(f'{each} = ["eurobot-od[{each}]=={version}"]' for each in EXTRAS)
    for place, said in {"VERSION": version, "EXTRAS": extras, "HOMEPAGE": project()["urls"]["Homepage"]}.items():
        text = text.replace(f"@{place}@", said)
    return text


def workbench() -> Iterator[str]:
    """`canopen-workbench` is a distribution that brings this one and its program."""
    source = FOLDER / "canopen-workbench"
    source.mkdir(parents=True, exist_ok=True)
    (source / "pyproject.toml").write_text(small_project(), encoding="utf-8")
    shutil.copy(ROOT / "LICENSE", source)
    uv("build", "--quiet", "--out-dir", FOLDER / "dist", source)
    (small,) = (FOLDER / "dist").glob("canopen_workbench*.whl")
    python = installed(small, wheel())
    said = output_of(python.parent / "canopen-workbench", "--version")
    if f"canopen-workbench {project()['version']}" not in said:
        yield f"its program says {said!r}"


ROWS: Mapping[str, Callable[[], Iterable[str]]] = {
    "version": versions,
    "changelog": changelog,
    "tag": tag,
    "builds": builds,
    "readme": readme,
    "metadata": metadata,
    "licences": licences,
    "workbench": workbench,
    "sbom": sbom,
    "extras": extras,
}
DOWNLOADS = ("workbench", "sbom", "extras")


class Result(NamedTuple):
    """A row of the table, and what is wrong."""

    row: str
    wrong: list[str]


def checked(rows: Iterable[str]) -> Iterator[Result]:
    """Check some rows, and print each as soon as it is done."""
    for row in rows:
        try:
            wrong = [*ROWS[row]()]
        except subprocess.CalledProcessError as error:
            wrong = [f"{' '.join(error.cmd)}: {(error.stderr or '').strip()[-300:]}"]
        text = (ROWS[row].__doc__ or "").split("\n")[0]
        print(f"{'NO' if wrong else 'ok':3} {row:10} {'; '.join(wrong[:5]) or text}", flush=True)
        yield Result(row, wrong)


def write_version(version: str) -> None:
    """Write a version wherever it stands, and give the changelog's first section its number and date."""
    for name, place in VERSION_PLACES.items():
        file = ROOT / name
        text = re.sub(place, lambda found: found[0].replace(found[1], version), file.read_text("utf-8"), flags=re.M)
        file.write_text(text, encoding="utf-8")
    news = ROOT / "CHANGELOG.md"
    heading = f"## {version} ({date.today().isoformat()})"
    news.write_text(news.read_text("utf-8").replace(UNRELEASED, heading, 1), encoding="utf-8")


def main() -> int:
    """Run the command line; return 1 if something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="look at all that a release needs")
    parser.add_argument("--quick", action="store_true", help="without what downloads packages")
    parser.add_argument("--tag", action="store_true", help="ask for the version's tag, too")
    parser.add_argument("--version", metavar="VERSION", help="write a version where it stands")
    given = parser.parse_args()
    if given.version:
        write_version(given.version)
    if not given.check:
        return 0
    ensure("readme_renderer", "test,release")
    left_out = {*(DOWNLOADS if given.quick else ()), *(() if given.tag else ("tag",))}
    FOLDER.mkdir(parents=True, exist_ok=True)
    results = [*checked(row for row in ROWS if row not in left_out)]
    return int(any(each.wrong for each in results))


if __name__ == "__main__":
    sys.exit(main())
