"""Checks before a push what most often makes CI fail, in under a minute.

`python3 tools/ready.py`: style, types, EDS files, what else is made from the code and committed, the links of the
documentation, and the tests that mirror the files changed since the branch left the published one.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import test
from environment import ONCE_MORE, ROOT, SHORT, SUITE
from steps import Step, python, run

MADE = (
    "tests/test_layers.py",
    "tests/cli/test_installation.py",
    "tests/tools/test_broken.py",
)
"""Tests of what has to follow a change anywhere: layers, generated lists, the places of broken.yaml."""

PUBLISHED = ("@{upstream}", "origin/main", "main")


def git(*words: str) -> list[str]:
    """Return the lines of git's output, none if it fails."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return [] if done.returncode else done.stdout.splitlines()


def changed() -> set[str]:
    """Return the files that differ from where this branch left the published one, and those new to git."""
    bases = (base for name in PUBLISHED for base in git("merge-base", "HEAD", name))
    return {*git("diff", "--name-only", next(bases, "HEAD")), *git("ls-files", "--others", "--exclude-standard")}


def mirrors(file: str) -> list[str]:
    """Return the files with the tests of a module: `test_NAME.py`, and `test_NAME_PART.py` of a part of it."""
    *folders, name = Path(file.removeprefix("eurobot_od/")).parts
    folder = ROOT.joinpath("tests", *folders)
    stem = Path(name).stem
    found = (*folder.glob(f"test_{stem}.py"), *folder.glob(f"test_{stem}_*.py"))
    return sorted(str(each.relative_to(ROOT)) for each in found) if name.endswith(".py") else []


def tests_of(files: Iterable[str]) -> tuple[str, ...]:
    """Return the tests among some files, and those that mirror them."""
    own = {each for each in files if Path(each).name.startswith("test_") and (ROOT / each).is_file()}
    return tuple(sorted(own.union(*map(mirrors, files))))


def main() -> int:
    """Run all steps, also after one that failed; return 1 if any did."""
    tests = (*SHORT, *dict.fromkeys((*filter(lambda each: (ROOT / each).is_file(), MADE), *tests_of(changed()))))
    return run(
        (
            *test.STEPS[:-1],
            Step("what is made from the code", python("tools/make_pages.py", "--check")),
            Step("links of the docs", python("tools/make_site.py")),
            Step("tests of what changed", python(*SUITE, *tests), python(*ONCE_MORE, *tests)),
        )
    )


if __name__ == "__main__":
    sys.exit(main())
