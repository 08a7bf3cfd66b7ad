"""Asks other people's programs about our files and nodes, and prints the matrix of their answers.

    python3 tools/interop.py            installs what is missing (pip, apt, npm), asks; exit status 1 if a row differs
    python3 tools/interop.py --install  installs only, and what the page's tests need: a browser, axe-core
    python3 tools/interop.py --local    installs nothing; names what is absent
    python3 tools/interop.py --write    writes docs/interop.md too

It installs, asks each row once, and prints; questions and judgements are in `interop_rows`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from environment import ROOT, ensure

ensure("cantools", "test")
ensure("eurobot_od", "test")

from interop_rows.row import Judgement, Verdict, judge  # noqa: E402  # after the environment is there
from interop_rows.table import ROWS  # noqa: E402
from interop_rows.tools import AXE_CORE, CHROMIUM  # noqa: E402

PAGE = ROOT / "docs" / "interop.md"
OPENING = """\
# Interop: what other people's programs say

For anybody who uses our files or nodes with another program: what it accepts, and where we disagree. Made by
`python3 tools/interop.py --write`; `.ci/run` asks the same. Every program gets the six EDS files as they are, unless a
row says otherwise.
"""
BY_HAND = "\n## "
"""Where the hand-written part of the page begins, which stays."""

HEAD = ("tool", "version", "asked", "judgement", "answer")


def install_missing() -> None:
    """Install each tool that is not here."""
    for tool in dict.fromkeys((*(row.tool for row in ROWS), CHROMIUM, AXE_CORE)):
        if not tool.present():
            print(f"installing {tool.name} ({tool.source}) ...", file=sys.stderr, flush=True)
            tool.install()


def ask_all() -> list[Verdict]:
    """Ask each row, in an empty folder of its own."""
    verdicts = []
    for row in ROWS:
        with tempfile.TemporaryDirectory() as folder:
            verdicts.append(judge(row, Path(folder)))
    return verdicts


def cells(verdict: Verdict) -> tuple[str, ...]:
    """Return a verdict as the columns of HEAD."""
    tool = verdict.row.tool
    version = tool.version() if tool.present() else "-"
    return f"{tool.name} ({tool.source})", version, verdict.row.asked, verdict.judgement.value, verdict.said


def page(verdicts: Iterable[Verdict]) -> str:
    """Return docs/interop.md."""
    rows = [HEAD, ("---",) * len(HEAD), *map(cells, verdicts)]
    lines = ["| " + " | ".join(each.replace("|", "\\|") for each in row) + " |" for row in rows]
    return "\n".join([OPENING, *lines, ""])


def text(verdicts: Iterable[Verdict]) -> str:
    """Return the matrix for a terminal."""
    rows = [cells(each) for each in verdicts]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return "\n".join("  ".join([*map(str.ljust, row[:4], widths), row[4]]) for row in rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Install, ask and print; return 1 if a row differs."""
    parser = argparse.ArgumentParser(description="Ask other people's programs about our files and nodes.")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--install", action="store_true", help="ask nothing")
    how.add_argument("--local", action="store_true", help="install nothing; skip what is absent by name")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.relative_to(ROOT)}")
    options = parser.parse_args(arguments)
    if not options.local:
        install_missing()
    if options.install:
        return 0
    verdicts = ask_all()
    print(text(verdicts))
    if options.write:
        _, begins, by_hand = PAGE.read_text(encoding="utf-8").partition(BY_HAND)
        PAGE.write_text(page(verdicts) + begins + by_hand, encoding="utf-8")
    return int(any(each.judgement is Judgement.DIFFERS for each in verdicts))


if __name__ == "__main__":
    sys.exit(main())
