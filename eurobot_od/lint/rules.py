"""The table of all rules, and the check of one file.

A new rule is a function, or a row of a table, in one of the modules of rules, and a row with a defect in the tests.
"""

from __future__ import annotations

from collections.abc import Iterable

from eurobot_od.lint import file_rules, object_rules, pdo_rules
from eurobot_od.lint.findings import Finding, Rule
from eurobot_od.lint.model import LintedDevice, load

FILE_RULES = (*file_rules.RULES, *object_rules.RULES, *file_rules.MODULES, *pdo_rules.RULES, *file_rules.CONFIGURATION)
"""The rules for one file, by code."""


NOT_OF_XML = frozenset(
    ["E120", "E201", "E202", "W203", "W207", "W208", "W209", "W213", "W232", "E234", "E235", "W454", "W709"]
)
"""Codes of rules about keys of an EDS that an XDD does not have in the same form."""


def lint(data: bytes, file: str, stack: str = "") -> list[Finding]:
    """Check an EDS or DCF and return the findings in the file's order; `file` is its path in the findings."""
    return lint_device(load(data, file), file, stack)


def stack_rules(stack: str) -> Iterable[Rule]:
    """Return the rules for a stack."""
    from eurobot_od.lint.stack_rules import STACKS  # of which most files are not checked

    return STACKS[stack]


def stack_findings(data: bytes, file: str, stack: str) -> list[Finding]:
    """Return the findings of a stack's rules in a device's file, in the file's order."""
    return _findings(load(data, file), file, stack_rules(stack))


def lint_device(device: LintedDevice, file: str, stack: str = "") -> list[Finding]:
    """Check a device that has been read; `stack` adds the rules for a stack of STACKS."""
    rules = [each for each in FILE_RULES if not device.document.is_xml or each.code not in NOT_OF_XML]
    return _findings(device, file, [*rules, *(stack_rules(stack) if stack else ())])


def _findings(device: LintedDevice, file: str, rules: Iterable[Rule]) -> list[Finding]:
    found = {Finding(file, at.line, at.column, rule.code, text) for rule in rules for at, text in rule.check(device)}
    return sorted(found, key=lambda each: each[1:])
