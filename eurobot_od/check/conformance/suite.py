"""Puts the chapters together: the suites of a device as the text of one file."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.check.conformance import emcy, nmt, objects, pdo, sdo, storage
from eurobot_od.check.conformance.subject import Chapter, Subject, awake
from eurobot_od.check.conformance.subject import nmt as command
from eurobot_od.check.conformance.writing import Data, documents
from eurobot_od.check.format import VERSION
from eurobot_od.od.dictionary import Dictionary

CHAPTERS = (nmt.CHAPTER, objects.CHAPTER, sdo.CHAPTER, pdo.CHAPTER, emcy.CHAPTER, storage.CHAPTER)
"""The suites, in the order in which they are run: what the later ones rely on comes first."""

TAG = "conformance"


def text(dictionary: Dictionary, *, destructive: bool = False) -> str:
    """Return the conformance suites of a device, one for each chapter.

    With `destructive` they write other values to configuration objects, store, and restore the defaults.
    """
    subject = Subject(dictionary, destructive)
    return documents(_suite(subject, chapter) for chapter in CHAPTERS)


def _suite(subject: Subject, chapter: Chapter) -> Data:
    return {
        "spec": VERSION,
        "name": f"CiA 301, {chapter.about}",
        "node": subject.dictionary.name,
        "tags": [TAG, chapter.word],
        "setup": list(_power_on(subject)),
        "steps": [step for clause in chapter.clauses for step in clause.named(subject)],
        "teardown": [{**command("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on"}],
    }


def _power_on(subject: Subject) -> Iterator[Data]:
    """Begin each suite alike: just switched on, and in PRE-OPERATIONAL."""
    yield {**command("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on"}
    yield {**awake(subject), "name": "7.2.4.3.5 SDO: the device answers after a reset"}
    yield {**command("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL"}
