"""Findings as SARIF 2.1.0, which code scanning services and editors read.

Source: OASIS, "Static Analysis Results Interchange Format (SARIF) Version 2.1.0"; each function names its section.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from eurobot_od.lint.findings import Finding, Rule, Severity
from eurobot_od.support.texts import one_line

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "note"}


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
    file = Path(finding.file)  # a file named relative to the working folder has a relative URI (3.4.3)
    uri = file.as_uri() if file.is_absolute() else quote(file.as_posix())
    place = {
        "artifactLocation": {"uri": uri},
        "region": {"startLine": finding.line, "startColumn": finding.column},
    }
    return {
        "ruleId": finding.code,
        "ruleIndex": rule,
        "level": LEVELS[finding.severity],
        "message": {"text": one_line(finding.message)},
        "locations": [{"physicalLocation": place}],
    }
