"""Writes the suites of a device, from all chapters, as the text of one file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from eurobot_od.check.conformance import broadcasts, nmt, objects, pdo, sdo, step, storage
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter, DeviceUnderTest, Tier, awake
from eurobot_od.check.conformance.step import Data, hexadecimal, title
from eurobot_od.check.report import AS_THEY_WERE
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ERRORS, VERIFY_CONFIGURATION
from eurobot_od.od.values import NMT_COB_ID

BARE = re.compile(r"0x[0-9A-F]+|[0-9]+ ?(?:ms|s)|(?!yes|no|on|off|true|false|null)[a-z]+(?:[- ][a-z]+)*")
"""Texts that need no quotes: hexadecimal numbers, durations, the words of the format."""

QUOTED = ("name", "skip", "data")
"""Keys whose values are always texts."""


def documents(suites: Iterable[Data]) -> str:
    """Return suites as the YAML documents of one file."""
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
    """Yield a step on one line, a group with one line per step."""
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
"""The suites in the order in which they are run: later ones rely on services that earlier ones test."""


def text(dictionary: Dictionary, tier: Tier = Tier.READING) -> str:
    """Return the conformance suites of a device, one per chapter, with the steps up to a tier."""
    return documents(_suite(DeviceUnderTest(dictionary, tier), chapter) for chapter in CHAPTERS)


MARKS = {"7.5.2.4": (Tier.DESTRUCTIVE, [ERRORS]), "7.5.2.23": (Tier.READING, VERIFY_CONFIGURATION)}
"""Objects that the device itself changes during a run, by clause, with the first tier where it does.

They are restored: errors that it remembers, and the date of its configuration, which masters rely on.
"""


def _suite(device: DeviceUnderTest, chapter: Chapter[DeviceUnderTest]) -> Data:
    # The reading tier sends no NMT command, as a reset would stop a device at work.
    resets = device.tier.allows(Tier.REVERSIBLE)
    reset = {**step.nmt("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on [reversible]"}
    pause = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [reversible]", "needed": "no"}
    # Not needed, so that a device without boot-up is red for that only.
    up = {**step.booted("7.2.8.3.3 Boot-up: boot-up after reset [reversible]"), "needed": "no"}
    alive = awake(device, ANSWERS)
    marks = {clause: device.kept(each) for clause, (tier, each) in MARKS.items() if device.tier.allows(tier)}
    named = [(f"{clause} Values: {title(each[0])}", each) for clause, kept in marks.items() for each in kept]
    kept = [{**step.save(*each), "name": f"{name} [reading]", "needed": "no"} for name, each in named]
    back = [{**step.put_back(*each), "name": f"{name} is as it was [reading]"} for name, each in named]
    alone = {"name": "7.2.8.2.1 NMT: nobody else commands [reversible]", "unheard": hexadecimal(NMT_COB_ID, 3)}
    first = {"name": "7.4 Values: they are read, to be compared in the end [reading]", "dump": "before", "needed": "no"}
    last = {"name": AS_THEY_WERE, "dump": "equal"}
    return chapter.suite(
        device,
        "conformance",
        [*([reset, up] * resets), alive, *([pause] * resets), *kept, first],
        [*([reset, up, alive] * resets), *back, last, *([alone] * resets)],
    )
