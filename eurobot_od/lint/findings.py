"""Findings of a check: how they are selected and written, as text and as SARIF.

The first letter of a code is its severity.
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
    """How bad a finding is; the value is the first letter of its code."""

    ERROR = "E"
    WARNING = "W"
    INFO = "I"


LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}
"""What a level is called, here and in SARIF."""


Located: TypeAlias = "Entry | Section | Oddity"
"""What has a line and a column, both from 1."""

Violations: TypeAlias = Iterator[tuple[Located, str]]
"""What a check of a file yields: the places where a rule does not hold, each with what is wrong there in a sentence."""


class Rule(NamedTuple):
    """A rule: `code` (E, W or I and three digits), what it demands, where that is written, and the check itself.

    `clause` names the standard by its section or object; where the text of the standard was not available, it names a
    public source that says the same. A check gets what it is for, a device or a network, and yields places with texts.
    """

    code: str
    demand: str
    clause: str
    check: Callable[..., Iterable[Any]]

    @property
    def severity(self) -> Severity:
        """How bad it is to break the rule."""
        return Severity(self.code[0])


CheckT = TypeVar("CheckT", bound=Callable[..., Iterable[Any]])


class Rules(list[Rule]):
    """The rules of one part, in the order of its file; those that differ only in data are added as rows."""

    def rule(self, code: str, clause: str) -> Callable[[CheckT], CheckT]:
        """Enter a function as a rule; its docstring is what the rule demands."""

        def enter(check: CheckT) -> CheckT:
            self.append(Rule(code, check.__doc__ or "", clause, check))
            return check

        return enter


class Finding(NamedTuple):
    """A finding: file, place (from 1), the rule's code and the message."""

    file: str
    line: int
    column: int
    code: str
    message: str

    @property
    def severity(self) -> Severity:
        """How bad it is."""
        return Severity(self.code[0])

    def __str__(self) -> str:
        return one_line(f"{self.file}:{self.line}:{self.column}: {self.code} {self.message}")


def chosen(findings: Iterable[Finding], select: Sequence[str], ignore: Sequence[str]) -> list[Finding]:
    """Keep findings whose code starts with one of `select` (all if empty) and with none of `ignore`."""
    wanted, unwanted = tuple(select) or ("",), tuple(ignore)
    return [each for each in findings if each.code.startswith(wanted) and not each.code.startswith(unwanted)]


def summed_up(findings: Iterable[Finding]) -> list[Finding]:
    """Keep the first finding of each code in a file, with the number of the others."""
    # One mistake of an editor is in every object of a file, and would hide all others.
    groups: dict[tuple[str, str], list[Finding]] = {}
    for each in findings:
        groups.setdefault((each.file, each.code), []).append(each)
    return [
        first._replace(message=f"{first.message} (and {len(others)} more; -v lists them)") if others else first
        for first, *others in groups.values()
    ]


def summary(findings: Sequence[Finding], files: int, hidden: bool) -> str:
    """Return the last line: how many findings of each severity there are in a number of files.

    If infos are `hidden`, it says how to see them.
    """
    counted = ((count(findings, each), each.name.lower()) for each in Severity)
    found = ", ".join(amount(number, word) for number, word in counted if number)
    more = " (-v lists infos)" if hidden and count(findings, Severity.INFO) else ""
    return f"{amount(files, 'file')}: {found or 'nothing found'}{more}"


def count(findings: Iterable[Finding], severity: Severity) -> int:
    """Count the findings of one severity."""
    return sum(each.severity is severity for each in findings)


# SARIF 2.1.0 (OASIS), which code scanning services and editors read; each function names its section


SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(findings: Iterable[Finding], rules: Sequence[Rule]) -> dict[str, Any]:
    """Return a log of one run (3.13, 3.14), `rules` are all that were checked."""
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
    """Describe a finding (3.27); `rule` is the number of its rule in the list."""
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
