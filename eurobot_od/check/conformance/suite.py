"""Puts the chapters together: the suites of a device as the text of one file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from eurobot_od.check.conformance import broadcasts, nmt, objects, pdo, sdo, step, storage
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter, Subject, Tier, awake
from eurobot_od.check.conformance.step import Data, hexadecimal, title
from eurobot_od.check.report import AS_THEY_WERE
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ERRORS, VERIFY_CONFIGURATION
from eurobot_od.od.values import NMT_COB_ID

BARE = re.compile(r"0x[0-9A-F]+|[0-9]+ ?(?:ms|s)|(?!yes|no|on|off|true|false|null)[a-z]+(?:[- ][a-z]+)*")
"""Texts that need no quotes: hexadecimal numbers, durations, the words of the format."""

QUOTED = ("name", "skip", "data")
"""Keys whose values are texts, whatever they look like."""


def documents(suites: Iterable[Data]) -> str:
    """Write suites as documents of one file."""
    lines: list[str] = []
    for suite in suites:
        lines.append("---")
        for key, value in suite.items():
            if key in ("setup", "steps", "teardown"):
                lines.append(f"{key}:")
                lines += [line for step in value for line in _step_lines(step, "  ")]
            else:
                lines.append(f"{key}: {_inline(value, key)}")
    return "".join(f"{line}\n" for line in lines)


def _step_lines(data: Data, indent: str) -> Iterator[str]:
    """Write a step on one line, a group with a line for each of its steps."""
    if "steps" not in data:
        yield f"{indent}- {_inline(data)}"
        return
    yield f"{indent}- name: {_inline(data['name'], 'name')}"
    yield f"{indent}  steps:"
    for each in data["steps"]:
        yield from _step_lines(each, indent + "    ")


def _inline(value: Any, key: str = "") -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_inline(each, name)}" for name, each in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_inline(each, key) for each in value) + "]"
    text = str(value)
    bare = isinstance(value, int) or (key not in QUOTED and BARE.fullmatch(text))
    return text if bare else json.dumps(text, ensure_ascii=False)


CHAPTERS = (
    *(each.CHAPTER for each in (nmt, objects, sdo, storage, pdo)),
    broadcasts.EMCY_CHAPTER,
    nmt.GUARDED,
    broadcasts.SYNC_CHAPTER,
)
"""The suites, in the order in which they are run: what the later ones rely on comes first."""


def text(dictionary: Dictionary, tier: Tier = Tier.READING) -> str:
    """Return the conformance suites of a device, one for each chapter, with the steps up to a tier."""
    return documents(_suite(Subject(dictionary, tier), chapter) for chapter in CHAPTERS)


MARKS = {"7.5.2.4": (Tier.DESTRUCTIVE, [ERRORS]), "7.5.2.23": (Tier.READING, VERIFY_CONFIGURATION)}
"""What a device itself changes when it is asked, by clause, and from which tier on: errors that it remembers, and the
date of its configuration, without which a master would take it for one that has not been configured."""


def _suite(subject: Subject, chapter: Chapter[Subject]) -> Data:
    # The reading tier sends no NMT command: it is for a device at work, which a reset would stop.
    resets = subject.tier.allows(Tier.REVERSIBLE)
    reset = {**step.nmt("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on [reversible]"}
    pause = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [reversible]", "needed": "no"}
    # One that sends no boot-up is red for that, and asked for all the rest.
    up = {**step.booted("7.2.8.3.3 Boot-up: boot-up after reset [reversible]"), "needed": "no"}
    alive = awake(subject, ANSWERS)
    marks = {clause: subject.kept(each) for clause, (tier, each) in MARKS.items() if subject.tier.allows(tier)}
    named = [(f"{clause} Values: {title(each[0])}", each) for clause, kept in marks.items() for each in kept]
    kept = [{**step.save(*each), "name": f"{name} [reading]", "needed": "no"} for name, each in named]
    back = [{**step.put_back(*each), "name": f"{name} is as it was [reading]"} for name, each in named]
    alone = {"name": "7.2.8.2.1 NMT: nobody else commands [reversible]", "unheard": hexadecimal(NMT_COB_ID, 3)}
    first = {"name": "7.4 Values: they are read, to be compared in the end [reading]", "dump": "before", "needed": "no"}
    last = {"name": AS_THEY_WERE, "dump": "equal"}
    return chapter.suite(
        subject,
        "conformance",
        [*([reset, up] * resets), alive, *([pause] * resets), *kept, first],
        [*([reset, up, alive] * resets), *back, last, *([alone] * resets)],
    )
