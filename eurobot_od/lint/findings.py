"""Findings of a check: selecting them, and writing them as text and as SARIF.

The first letter of a finding's code is its severity.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

from eurobot_od.support.texts import amount, one_line

if TYPE_CHECKING:
    from eurobot_od.od.document import Entry, Oddity, Section


class Severity(Enum):
    """Severity of a finding; the value is the first letter of its code."""

    ERROR = "E"
    WARNING = "W"
    INFO = "I"


LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}
"""Name of each severity in SARIF."""


Located: TypeAlias = "Entry | Section | Oddity"
"""A part of the file with a line and a column, both from 1."""

Violations: TypeAlias = Iterator[tuple[Located, str]]
"""Places in a file that break a rule, each with a sentence about what is wrong."""


class Rule(NamedTuple):
    """A rule: `code` (E, W or I and three digits), `demand` (what it requires), `clause` (its source), and `check`.

    `clause` names the section or object of the standard, or a public source that says the same where the standard was
    not available. A check takes a device or a network, and yields places with texts.
    """

    code: str
    demand: str
    clause: str
    check: Callable[..., Iterable[Any]]

    @property
    def severity(self) -> Severity:
        """Severity of breaking the rule."""
        return Severity(self.code[0])


CheckT = TypeVar("CheckT", bound=Callable[..., Iterable[Any]])


class Rules(list[Rule]):
    """The rules of one module, in its order; rules that differ only in data are added as rows."""

    def rule(self, code: str, clause: str) -> Callable[[CheckT], CheckT]:
        """Register a function as a rule; its docstring is the rule's `demand`."""

        def enter(check: CheckT) -> CheckT:
            self.append(Rule(code, check.__doc__ or "", clause, check))
            return check

        return enter


class Finding(NamedTuple):
    """A finding: file, line and column from 1, the rule's code, and the message."""

    file: str
    line: int
    column: int
    code: str
    message: str

    @property
    def severity(self) -> Severity:
        """Severity, from the code."""
        return Severity(self.code[0])

    def __str__(self) -> str:
        return one_line(f"{self.file}:{self.line}:{self.column}: {self.code} {self.message}")


def chosen(findings: Iterable[Finding], select: Sequence[str], ignore: Sequence[str]) -> list[Finding]:
    """Return the findings whose code starts with one of `select` (all if empty) and with none of `ignore`."""
    wanted = tuple(select) or ("",)
    unwanted = tuple(ignore)
    return [each for each in findings if each.code.startswith(wanted) and not each.code.startswith(unwanted)]


def summed_up(findings: Iterable[Finding]) -> list[Finding]:
    """Return the first finding of each code in a file, with the number of the others."""
    # An editor repeats its mistake in every object, which would hide other findings.
    groups: dict[tuple[str, str], list[Finding]] = {}
    for each in findings:
        groups.setdefault((each.file, each.code), []).append(each)
    return [
        first._replace(message=f"{first.message} (and {len(others)} more; -v lists them)") if others else first
        for first, *others in groups.values()
    ]


def summary(findings: Sequence[Finding], files: int, hidden: bool) -> str:
    """Return the last line: number of findings by severity in `files` files, and whether infos are `hidden`."""
    counted = ((count(findings, each), each.name.lower()) for each in Severity)
    found = ", ".join(amount(number, word) for number, word in counted if number)
    more = " (-v lists infos)" if hidden and count(findings, Severity.INFO) else ""
    return f"{amount(files, 'file')}: {found or 'nothing found'}{more}"


def count(findings: Iterable[Finding], severity: Severity) -> int:
    """Return the number of findings of one severity."""
    return sum(each.severity is severity for each in findings)


# SARIF 2.1.0 (OASIS), which code scanning services and editors read; each function names its section


SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(findings: Iterable[Finding], rules: Sequence[Rule]) -> dict[str, Any]:
    """Return a SARIF log of one run (3.13, 3.14); `rules` are all rules that were checked."""
    numbers = {each.code: number for number, each in enumerate(rules)}
    described = [  # 3.49
        {
            "id": each.code,
            "shortDescription": {"text": each.demand},
            "help": {"text": f"Source: {each.clause}"},
            "defaultConfiguration": {"level": LEVELS[each.severity]},
        }
        for each in rules
    ]
    driver = {"name": "eurobot-od lint", "rules": described}
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",  # Python's characters, not UTF-16 units
        "results": [_result(each, numbers[each.code]) for each in findings],
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _result(finding: Finding, rule: int) -> dict[str, Any]:
    """Return the SARIF result of a finding (3.27); `rule` is the position of its rule."""
    from pathlib import Path  # `lint` starts without both
    from urllib.parse import quote_from_bytes

    file = Path(finding.file)  # a file named relative to the working folder has a relative URI (3.4.3)
    uri = file.as_uri() if file.is_absolute() else quote_from_bytes(os.fsencode(file.as_posix()))
    place = {"artifactLocation": {"uri": uri}, "region": {"startLine": finding.line, "startColumn": finding.column}}
    return {
        "ruleId": finding.code,
        "ruleIndex": rule,
        "level": LEVELS[finding.severity],
        "message": {"text": one_line(finding.message)},
        "locations": [{"physicalLocation": place}],
    }
