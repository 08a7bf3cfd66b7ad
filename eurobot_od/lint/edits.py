"""One edit of an EDS or DCF, as words say it: `set 2100 DefaultValue=5`; and whether the file that it makes may be.

The command `edit` and the view Files of the page make the same edits here.
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
"""What a new object is if nothing else is said."""

SHORT = {
    "type": "DataType",
    "access": "AccessType",
    "default": "DefaultValue",
    "low": "LowLimit",
    "high": "HighLimit",
    "map": "PDOMapping",
    "kind": "ObjectType",
}
"""Short words for keys."""


class Verb(NamedTuple):
    """One kind of change: the form of its words, how many it needs at least, and what makes changes of them."""

    form: str
    needed: int
    read: Callable[[Sequence[str]], list[Change]]

    def changes(self, words: Sequence[str]) -> list[Change]:
        """Return the changes that words ask for; raises LocalError for words that it does not understand."""
        if len(words) < self.needed:
            raise LocalError(f"write {self.form}")
        return self.read(words)


def _entries(words: Sequence[str]) -> dict[str, str]:
    """Read KEY=VALUE words; raises LocalError."""
    entries = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise LocalError(f"{word}: write KEY=VALUE, such as DefaultValue=5; an empty value takes the key away")
        entries[SHORT.get(key.lower(), key)] = value
    return entries


def _add(words: Sequence[str]) -> list[Change]:
    target, name, *more = words
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
    "map": Verb("map PDO OBJECT...", 1, lambda words: [mapped(words[0], words[1:])]),
    "insert": Verb("insert profile 301|401|402", 2, _insert),
}


class Edit(NamedTuple):
    """A file after an edit: its bytes, all that lint finds in it, and what of that it did not find before."""

    data: bytes
    findings: list[Finding]
    new: list[Finding]

    @property
    def errors(self) -> list[Finding]:
        """The new errors; with one of them the edit is refused."""
        return [each for each in self.new if each.severity is Severity.ERROR]

    @property
    def warnings(self) -> list[Finding]:
        """The new warnings."""
        return [each for each in self.new if each.severity is Severity.WARNING]


def make_edit(before: bytes, file: str, changes: Sequence[Change]) -> Edit:
    """Make changes to the bytes of an EDS or DCF; `file` is what errors and findings call it. Raises as `edited`."""
    after = edited(before, file, changes)
    found = lint(after, file)
    there = {(each.code, each.message) for each in lint(before, file)}  # a line may be another one afterwards
    return Edit(after, found, [each for each in found if (each.code, each.message) not in there])


def difference(before: bytes, after: bytes, file: str) -> list[str]:
    """Return the difference of two texts as `diff -u` writes it, with what cannot be printed replaced."""
    old, new = (each.decode("utf-8", "replace").splitlines() for each in (before, after))
    return [one_line(line) for line in unified_diff(old, new, file, file, lineterm="")]
