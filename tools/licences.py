"""Writes docs/licences.md: the packages of each extra and their licences, from the packages' own metadata.

Run it in an environment with all extras, which `python3 tools/wheel.py --licences` makes. A package names its licence
as an SPDX expression, by a classifier, or in its own words; the first of these counts.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageMetadata, PackageNotFoundError, distribution, metadata, requires
from pathlib import Path

PACKAGE = "eurobot-od"
FILE = Path(__file__).resolve().parents[1] / "docs" / "licences.md"
NAME = re.compile(r"[A-Za-z0-9._-]+")
EXTRA = re.compile(r"extra\s*==\s*['\"]([^'\"]+)['\"]")
CLASSIFIER = "License :: OSI Approved :: "
NONE = "says none"
MIT = "Permission is hereby granted, free of charge, to any person obtaining a copy"
LONGEST = 60
"""Characters of a licence in a package's own words; a longer one is its whole text."""

HEAD = """# Licences

For anybody who passes this package on: its own licence is MIT. What it needs, and what its extras bring, has its own
licences; some are copyleft. uPlot, which draws the plots of the page, is inside this package, under the MIT licence.
`REUSE.toml` gives the licence of each file by SPDX. A wheel may hold libraries of others: that of resvg-py names them
in its SBOM, all under permissive licences.

Made by `python3 tools/wheel.py --licences` from what the packages say; the versions are those of that day.
"""


def licence(said: PackageMetadata) -> str:
    """Return the licence that a package's metadata names."""
    classifiers = [each.removeprefix(CLASSIFIER) for each in said.get_all("Classifier", []) if CLASSIFIER in each]
    own = said.get_all("License", [""])[0].strip().split("\n")[0]
    expression = said.get_all("License-Expression", [""])[0]
    return expression or ", ".join(classifiers) or own[:LONGEST] or NONE


def licence_of(package: str, said: PackageMetadata) -> str:
    """Return the licence of a package; if its metadata names none, by the text in its files."""
    if licence(said) != NONE:
        return licence(said)
    texts = [each.read_text() for each in distribution(package).files or () if each.name.startswith("LICENSE")]
    return "MIT, by the text that it carries" if any(MIT in " ".join(each.split()) for each in texts) else NONE


def required(package: str, extras: Iterable[str]) -> Iterator[tuple[str, set[str]]]:
    """Yield the packages that a package needs with some extras, each with the extras asked of it."""
    for each in requires(package) or ():
        extra = EXTRA.search(each)
        found = NAME.match(each)
        if found and (extra is None or extra[1] in extras):
            inside = re.match(rf"{re.escape(found[0])}\s*\[([^\]]*)\]", each)
            yield found[0], set(inside[1].split(",")) if inside else set()


def brought(extra: str) -> dict[str, PackageMetadata]:
    """Return the packages of an extra, with those that they need; without an extra, those of this package."""
    found: dict[str, PackageMetadata] = {}
    asked = [each for each in required(PACKAGE, [extra]) if not extra or each not in list(required(PACKAGE, []))]
    while asked:
        name, extras = asked.pop()
        try:
            said = metadata(name)
        except PackageNotFoundError:  # for another system or Python
            continue
        if said["Name"] not in found:
            found[said["Name"]] = said
            asked.extend(required(name, extras))
    return found


def text(extras: Iterable[str]) -> str:
    """Return the page."""
    always = brought("")
    lines = [HEAD]
    for extra in ("", *extras):
        packages = {name: each for name, each in brought(extra).items() if not extra or name not in always}
        heading = f"Extra `{extra}`" if extra else "Always"
        lines += [f"## {heading}\n", "| package | version | licence |", "|---|---|---|"]
        rows = sorted(packages.items(), key=lambda item: item[0].lower())
        lines += [f"| {name} | {said['Version']} | {licence_of(name, said)} |" for name, said in rows]
        lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


if __name__ == "__main__":
    FILE.write_text(text(sys.argv[1:]), encoding="utf-8")
    print(FILE)
