"""`edit`: changes an EDS or DCF, and leaves every byte that is not asked about as it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from difflib import unified_diff
from pathlib import Path
from typing import Annotated, NamedTuple

from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.lint.findings import Finding, Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od.document import read_bytes
from eurobot_od.od.editing import PROFILES, Change, edited, mapped, profile, removed, said
from eurobot_od.support.files import write_whole
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


def edit(
    file: Annotated[str, Option(metavar="FILE", is_file=True)],
    verb: Annotated[Verb, Option(choices=VERBS)],
    words: Annotated[Sequence[str], Option(metavar="WORD")] = (),
    *,
    output: Annotated[Path | None, Option("-o", metavar="FILE")] = None,
    dry_run: bool = False,
) -> ExitStatus:
    """Change an EDS or DCF: comments, order, line ends and every other line stay as they are.

    A change that makes an error which `lint` finds is refused: an object twice, a value out of range, a PDO that maps
    what cannot be mapped or is longer than 8 bytes. Other new findings are printed, and the exit status is 1.

    file: an EDS or DCF; of an XDD `export eds` makes one
    verb: what to do
    words: an object, by 0x2001, 0x2001:3 or name, and what about it; type=, access=, default=, low=, high=, map=1 and
        kind=RECORD are short for the keys
    output: the file to write (default: the same file)
    dry_run: show the difference, and write nothing

    $ edit motor.eds set 0x1017 DefaultValue=500 HighLimit=5000
    $ edit motor.eds add 2102 "Filter time" type=UNSIGNED16 access=rw default=20
    $ edit motor.eds map TPDO1 "Motor.Speed" 0x6064
    $ edit motor.eds insert profile 301 --dry-run
    """
    if len(words) < verb.needed:
        raise LocalError(f"write {verb.form}")
    before = read_bytes(file)
    after = edited(before, file, verb.read(words))
    found = new_findings(before, after, file)
    wrong = [each for each in found if each.severity is Severity.ERROR]
    for each in wrong:
        complain(f"not changed: {each}")
    if wrong:
        return ExitStatus.WRONG_INPUT
    if dry_run:
        sys.stdout.write(difference(before, after, file))
    elif after != before or output:
        write_whole(output or Path(file), after)
    shown = [each for each in found if each.severity is Severity.WARNING]
    print("\n".join(map(str, shown)), end="\n" if shown else "")
    return ExitStatus.FOUND if shown else ExitStatus.FINE


def new_findings(before: bytes, after: bytes, file: str) -> list[Finding]:
    """Return what lint finds in a file after a change and did not find before, whatever the line."""
    there = {(each.code, each.message) for each in lint(before, file)}
    return [each for each in lint(after, file) if (each.code, each.message) not in there]


def difference(before: bytes, after: bytes, file: str) -> str:
    """Return the difference of two texts as `diff -u` writes it, with what cannot be printed replaced."""
    old, new = (each.decode("utf-8", "replace").splitlines() for each in (before, after))
    return "".join(f"{one_line(line)}\n" for line in unified_diff(old, new, file, file, lineterm=""))
