"""Puts the chapters together: the suites of a device as the text of one file."""

from __future__ import annotations

from collections.abc import Sequence

from eurobot_od.check.conformance import emcy, error_control, nmt, objects, pdo, sdo, step, storage, sync
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter
from eurobot_od.check.conformance.step import Data
from eurobot_od.check.conformance.subject import Subject, Tier, awake
from eurobot_od.check.conformance.writing import documents
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import RESTORE
from eurobot_od.od.values import label

CHAPTERS = tuple(each.CHAPTER for each in (nmt, objects, sdo, storage, pdo, emcy, error_control, sync))
"""The suites, in the order in which they are run: what the later ones rely on comes first."""


def text(dictionary: Dictionary, tier: Tier = Tier.READING, restore: Sequence[int] = ()) -> str:
    """Return the conformance suites of a device, one for each chapter, with the steps up to a tier.

    `restore` names sub-indices of 0x1011 that are the maker's own; raises LocalError for one that the file lacks.
    """
    for each in restore:
        found = dictionary.variable((RESTORE, each))
        if found is None or not found.writable:
            raise LocalError(f"{dictionary.file} has no {label((RESTORE, each))} that can be written")
    subject = Subject(dictionary, tier, restore=tuple(restore))
    return documents(_suite(subject, chapter) for chapter in CHAPTERS)


def _suite(subject: Subject, chapter: Chapter[Subject]) -> Data:
    # The reading tier sends no NMT command: it is for a device at work, which a reset would stop.
    resets = subject.tier.allows(Tier.REVERSIBLE)
    # Of a destructive run it cannot hold: what is stored and restored may well differ from what was there before.
    proves = not subject.tier.allows(Tier.DESTRUCTIVE)
    reset = {**step.nmt("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on [reversible]"}
    pause = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [reversible]"}
    alive = awake(subject, ANSWERS)
    before = {"name": "7.4 Values: they are read, to be compared in the end [reading]", "dump": "before"}
    after = {"name": "7.4 Values: they are as they were [reading]", "dump": "equal"}
    return chapter.suite(
        subject,
        "conformance",
        [*([reset] * resets), alive, *([pause] * resets), *([before] * proves)],
        [*([reset] * resets), *([alive] * (resets and proves)), *([after] * proves)],
    )
