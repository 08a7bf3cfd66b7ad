#!/usr/bin/env python3
"""Makes docs/lint-rules.md: all rules of the EDS checker, and what dcfchk and odg report about the same defects.

The rules come from the rule tables, the defects from the tests. `odg` is the command of objdictgen. `make_pages.py`
asks the programs only about defects that the page does not have; this asks them about all, those that are installed.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from shutil import which
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))  # the defects are the tests'

from eurobot_od.lint import network, stack_rules  # noqa: E402
from eurobot_od.lint.findings import Rule, Severity  # noqa: E402
from eurobot_od.lint.rules import FILE_RULES, lint  # noqa: E402
from tests.lint.mutations import BASES, DEFECTS, Defect, broken_file  # noqa: E402

OUTPUT = ROOT / "docs" / "lint-rules.md"
NODE_ID = "5"
PARTS = {
    "1": "The file: how it is written",
    "2": "[FileInfo], [DeviceInfo], dummies, comments",
    "3": "Lists of objects",
    "4": "Objects and values",
    "5": "What CiA 301 and 302 say of single objects",
    "6": "PDOs",
    "7": "Device configuration files",
    "8": "The network",
    "9": "What CANopenNode asks for (`lint --for canopennode`)",
}
"""Titles by the first digit of the codes."""

HEAD = """# Rules of `eurobot-od lint`

For anybody with a finding of `lint`: every rule with its source, and which of the same defects other checkers find.

The letter of a code is the severity: E error, W warning, I info. "Public" names a source that anybody can read, for
rules that do not follow from the standard's text alone. Made by `tools/make_pages.py`.
"""
DEFECT_HEAD = """## The same defects in other checkers

Each row is a clean file into which `tests/lint/mutations.py` has put one defect. `eurobot-od lint` flags all of them at
their line, with the code in the first column. "flagged" means a message about the file, "traceback" a crash, "-" no
message; messages that a program also gives for the clean file do not count.
"""


class Verdict(NamedTuple):
    """A program's exit status for a file, and its output without the file's own name."""

    status: int
    words: str


Program = Callable[[Path], Verdict]


def program_of(*command: str) -> Program | None:
    """Return the function that checks a file with a program; None if that is not installed."""
    found = which(command[0]) or which(command[0], path=str(Path(sys.executable).parent))
    if found is None:
        return None

    def run(file: Path) -> Verdict:
        done = subprocess.run([found, *command[1:], str(file)], capture_output=True, text=True, errors="replace")
        text = done.stderr + (done.stdout if done.returncode else "")
        return Verdict(done.returncode, text.replace(str(file), "FILE"))

    return run


PROGRAMS = {"dcfchk": program_of("dcfchk", "-n", NODE_ID), "odg list": program_of("odg", "list")}


def verdict_of(program: Program | None, defect: Defect) -> str:
    """Return what a program reports about a defect, in a word or two."""
    if program is None:
        return "not installed"
    name = BASES[defect.base][0]
    clean, broken = _ask(program, name, BASES[defect.base][1].encode()), _ask(program, name, broken_file(defect))
    if "Traceback" in broken.words:
        return "traceback" if "Traceback" not in clean.words else "(cannot read the clean file)"
    if clean.status:
        return "(refuses the clean file)"
    return "flagged" if broken != clean else "-"


def _ask(program: Program, name: str, data: bytes) -> Verdict:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_bytes(data)
        return program(file)


Known = Mapping[tuple[str, str], Sequence[str]]
"""The programs' known verdicts, in their order, by a defect's code and description."""


def _known() -> Known:
    """Return the programs' verdicts in the page."""
    rows = re.findall(r"^\| ([EWI]\d{3}) \| (.*?) \| ([^|]*) \| ([^|]*) \|$", OUTPUT.read_text("utf-8"), re.MULTILINE)
    return {(code, what): verdicts for code, what, *verdicts in rows}


def all_verdicts(known: Known) -> dict[str, list[str]]:
    """Return all programs' verdicts on all defects; only the unknown ones are asked for."""
    with ThreadPoolExecutor() as pool:
        return {name: [*pool.map(partial(_verdict, known, place), DEFECTS)] for place, name in enumerate(PROGRAMS)}


def _verdict(known: Known, place: int, defect: Defect) -> str:
    said = known.get((defect.code, _cell(defect.what)))
    return said[place] if said else verdict_of([*PROGRAMS.values()][place], defect)


def page(known: Known | None = None) -> str:
    """Return the page; `known` are verdicts that are not asked for again, by default those of the page."""
    return rules_text() + "\n" + defects_text(all_verdicts(_known() if known is None else known))


def rule_table(rules: Iterable[Rule]) -> Iterator[str]:
    """Yield the lines of a table of rules."""
    yield "| code | rule | source |"
    yield "|---|---|---|"
    yield from (f"| {each.code} | {_cell(each.demand)} | {_cell(each.clause)} |" for each in rules)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def rules_text() -> str:
    """Return the rules, part by part."""
    rules = sorted([*FILE_RULES, *network.RULES, *stack_rules.RULES], key=lambda each: each.code[1:])
    counts = ", ".join(f"{sum(e.severity is s for e in rules)} {s.name.lower()}s" for s in Severity)
    lines = [HEAD, f"{len(rules)} rules: {counts}.", ""]
    for digit, title in PARTS.items():
        lines += [f"## {digit}xx {title}", "", *rule_table(e for e in rules if e.code[1] == digit), ""]
    return "\n".join(lines)


def defects_text(verdicts: dict[str, list[str]]) -> str:
    """Return the defects, with the programs' verdicts."""
    lines = [
        DEFECT_HEAD,
        "| | " + " | ".join(["eurobot-od lint", *verdicts]) + " |",
        "|---|" + "---|" * (len(verdicts) + 1),
    ]
    lines.append(
        f"| defects of {len(DEFECTS)} | {_flagged()} | " + " | ".join(_summary(v) for v in verdicts.values()) + " |"
    )
    lines += ["", "| code | defect | " + " | ".join(verdicts) + " |", "|---|---|" + "---|" * len(verdicts)]
    for number, each in enumerate(DEFECTS):
        cells = [each.code, _cell(each.what), *(column[number] for column in verdicts.values())]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _flagged() -> str:
    found = sum(each.code in {f.code for f in lint(broken_file(each), BASES[each.base][0])} for each in DEFECTS)
    return f"{found} flagged"


def _summary(verdicts: Sequence[str]) -> str:
    return f"{verdicts.count('flagged')} flagged, {verdicts.count('traceback')} tracebacks"


if __name__ == "__main__":
    OUTPUT.write_text(page({}), "utf-8")
