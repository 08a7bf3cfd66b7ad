"""Edits of an EDS or DCF, written as words such as `set 2100 DefaultValue=5`, and the findings that they cause.

The command `edit` and the page's view Files share this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from difflib import unified_diff
from typing import NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.lint.findings import Finding, Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od.editing import PROFILES, Change, edited, mapped, profile, removed, said
from eurobot_od.support.texts import one_line

NEW = {"ObjectType": "VAR", "DataType": "UNSIGNED32", "AccessType": "rw", "PDOMapping": "0"}
"""Default entries of a new object."""

SHORT = {
    "type": "DataType",
    "access": "AccessType",
    "default": "DefaultValue",
    "low": "LowLimit",
    "high": "HighLimit",
    "map": "PDOMapping",
    "kind": "ObjectType",
}
"""Short names of keys."""


class Verb(NamedTuple):
    """One kind of edit: its syntax, its least number of words, and the function that makes changes from them."""

    form: str
    needed: int
    read: Callable[[Sequence[str]], list[Change]]

    def changes(self, words: Sequence[str]) -> list[Change]:
        """Return the changes for the words; raises LocalError for invalid ones."""
        if len(words) < self.needed:
            raise LocalError(f"write {self.form}")
        return self.read(words)


def _entries(words: Sequence[str]) -> dict[str, str]:
    """Parse KEY=VALUE words; raises LocalError."""
    entries = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise LocalError(f"{word}: write KEY=VALUE, such as DefaultValue=5; an empty value removes the key")
        entries[SHORT.get(key.lower(), key)] = value
    return entries


def _add(words: Sequence[str]) -> list[Change]:
    target, name, *more = words
    if more and "=" not in more[0]:
        raise LocalError(f"{more[0]}: write KEY=VALUE; a name with spaces needs quotes: '{name} {more[0]}'")
    own = _entries(more)
    usual = {} if own.get("ObjectType", "").upper() in ("ARRAY", "RECORD") else NEW
    return [said(target, {"ParameterName": name, **usual, **own})]


def _insert(words: Sequence[str]) -> list[Change]:
    if words[0] != "profile":
        raise LocalError(f"insert {words[0]}: write insert profile and one of {', '.join(PROFILES)}")
    return [profile(each) for each in words[1:]]


VERBS: Mapping[str, Verb] = {
    "set": Verb("set OBJECT KEY=VALUE...", 2, lambda words: [said(words[0], _entries(words[1:]))]),
    "add": Verb("add OBJECT NAME [type=... access=... default=... KEY=VALUE...]", 2, _add),
    "rename": Verb("rename OBJECT NAME", 2, lambda words: [said(words[0], {"ParameterName": " ".join(words[1:])})]),
    "remove": Verb("remove OBJECT...", 1, lambda words: [removed(each) for each in words]),
    "map": Verb("map PDO OBJECT...", 2, lambda words: [mapped(words[0], words[1:])]),
    "insert": Verb("insert profile 301|401|402", 2, _insert),
}


class Edit(NamedTuple):
    """A file after an edit: its bytes, all its lint findings, and those that are new."""

    data: bytes
    findings: list[Finding]
    new: list[Finding]

    @property
    def errors(self) -> list[Finding]:
        """The new errors; an edit with one is refused."""
        return [each for each in self.new if each.severity is Severity.ERROR]

    @property
    def warnings(self) -> list[Finding]:
        """The new warnings."""
        return [each for each in self.new if each.severity is Severity.WARNING]


def make_edit(before: bytes, file: str, changes: Sequence[Change]) -> Edit:
    """Apply changes to an EDS or DCF; `file` is its name in errors and findings. Raises as `edited`."""
    after = edited(before, file, changes)
    found = lint(after, file)
    there = {(each.code, each.message) for each in lint(before, file)}  # an edit may change the line number
    return Edit(after, found, [each for each in found if (each.code, each.message) not in there])


def difference(before: bytes, after: bytes, file: str) -> list[str]:
    """Return a unified diff of two texts, with unprintable characters escaped."""
    old, new = (each.decode("utf-8", "replace").splitlines() for each in (before, after))
    return [one_line(line) for line in unified_diff(old, new, file, file, lineterm="")]
