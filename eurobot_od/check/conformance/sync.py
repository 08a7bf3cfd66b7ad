"""SYNC: the device as its producer and its consumer, the period and the counter (CiA 301, 7.2.5, 7.5.2.5, 7.5.2.22).

Rule of this file: whoever hears SYNC acts on it, so all but reading is destructive; a reset of the communication ends
each group.
"""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.check.conformance.storage import Kept, kept_over_reset
from eurobot_od.check.conformance.subject import (
    BUSY,
    OUTSIDE,
    Chapter,
    Subject,
    Tier,
    codes,
    expect,
    fresh,
    group,
    nmt,
    read,
    sent,
    skip,
    title,
    write,
)
from eurobot_od.check.conformance.writing import Data, hexadecimal
from eurobot_od.device.broadcasts import COUNTERS
from eurobot_od.od.objects import data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import TRANSMISSION_TYPE, PdoDirection
from eurobot_od.sdo.wire import AbortCode

CHAPTER = Chapter("sync", "SYNC")

PERIOD = 100_000
"""Time between two SYNCs of the device, us."""

OVERFLOW = 5
"""Up to which number they are counted."""

PRECISION = "20 ms"
"""By how much a SYNC may be off its time; the standard names no precision."""

SOON, QUIET = "300 ms", "300 ms"

NO_PRODUCER = (*OUTSIDE, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)
"""Aborts of a device that cannot send SYNC (CiA 301, 7.5.2.5)."""

NO_SYNC = "the file has no SYNC (0x1005) with an identifier"


@CHAPTER.clause("7.5.2.5", "SYNC", Tier.REVERSIBLE, "6.1")
def _identifier(subject: Subject) -> Iterator[Data]:
    found = subject.find(SYNC)
    if found is None or not found.readable:
        yield skip("its COB-ID", "the file has no SYNC (0x1005) that can be read")
    else:
        content = data_type(found).write(subject.number(SYNC)).hex(" ").upper()
        yield read(f"{title(found)} is the default", SYNC, data=content)


# Producer


def _sending(subject: Subject) -> int:
    """Return the value of 0x1005 that makes the device send SYNC."""
    return subject.number(SYNC) | SYNC_PRODUCER


def _why_no_producer(subject: Subject, overflow: int = 0) -> str:
    """Say why the device cannot be made to send SYNC; nothing if it can be."""
    # Without 0x1019 there is no counter, which is the same as an overflow of 0.
    counted = subject.number(SYNC_COUNTER) == overflow or subject.may_be(SYNC_COUNTER, overflow)
    reasons = {
        NO_SYNC: subject.model.sync_cob_id is None,
        "the file's SYNC (0x1005) cannot be written": not subject.may_be(SYNC, _sending(subject)),
        "the file has no period of SYNC (0x1006) that can be written": not _has_period(subject),
        f"the file has no SYNC counter (0x1019) that can be {overflow}": not counted,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _has_period(subject: Subject) -> bool:
    return subject.may_be(SYNC_PERIOD, 0) and subject.may_be(SYNC_PERIOD, PERIOD)


def _configured(subject: Subject, overflow: int) -> Iterator[Data]:
    """Write period and counter, which may be changed only while the period is 0."""
    yield from fresh(subject)
    yield write("period 0", SYNC_PERIOD, value=0)
    # 0x1019 may be written only while 0x1006 is 0, else 0x08000022 (CiA 301, 7.5.2.22).
    if subject.find(SYNC_COUNTER) is not None and subject.number(SYNC_COUNTER) != overflow:
        yield write(f"counter {overflow}", SYNC_COUNTER, value=overflow)
    yield write(f"period {PERIOD} us", SYNC_PERIOD, value=PERIOD)


def _started(subject: Subject) -> Data:
    value = hexadecimal(_sending(subject), 8)
    # Bit 30, last of all: the first SYNC is to come with the period and the counter that were just written (CiA 301,
    # 7.5.2.5).
    return write("the device sends SYNC", SYNC, value=value, optional=codes(*NO_PRODUCER))


def _sync(subject: Subject, digits: str = "") -> Data:
    return {"raw": f"{subject.model.sync_cob_id or 0:03X}#{digits}"}


def every(message: Data, milliseconds: int, count: int) -> Data:
    """See that a frame comes again and again at its time."""
    period = {"message": message, "every": f"{milliseconds} ms", "tolerance": PRECISION, "count": count}
    return {"name": f"every {milliseconds} ms", "period": period}


@CHAPTER.clause("7.5.2.6", "SYNC producer", Tier.DESTRUCTIVE, "6.2, 6.6")
def _produced(subject: Subject) -> Iterator[Data]:
    name, why = "SYNC at its time, without data", _why_no_producer(subject)
    if why:
        yield skip(name, why)
    else:
        count = every(_sync(subject), PERIOD // 1000, 5)
        yield group(name, *_configured(subject, 0), _started(subject), count, *fresh(subject))


# PDOs


def _followed(subject: Subject, type_: int) -> tuple[Pdo | None, str]:
    """Return the first TPDO that may follow SYNC, and why there is none."""
    tpdos = (each for each in subject.pdos if each.direction is PdoDirection.TPDO and not subject.why_not_seen(each))
    found = next((each for each in tpdos if subject.may_be((each.index, TRANSMISSION_TYPE), type_)), None)
    return found, "" if found else f"the file has no valid TPDO whose transmission type can be {type_}"


def _sent(pdo: Pdo) -> Data:
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


@CHAPTER.clause("7.2.2.2", "SYNC producer", Tier.DESTRUCTIVE, "6.3")
def _every_second(subject: Subject) -> Iterator[Data]:
    """Have a TPDO follow the device's own SYNC: with every second one of them."""
    name, (tpdo, lack) = "a TPDO with every second SYNC of its own", _followed(subject, 2)
    why = _why_no_producer(subject) or lack
    if why or tpdo is None:
        yield skip(name, why)
        return
    yield group(
        name,
        *_configured(subject, 0),
        _typed(tpdo, 2),
        _started(subject),
        nmt("start"),
        every(_sent(tpdo), 2 * PERIOD // 1000, 3),
        *fresh(subject),
    )


def _typed(pdo: Pdo, type_: int) -> Data:
    name = f"{pdo.title}: transmission type {type_}"
    return write(name, (pdo.index, TRANSMISSION_TYPE), value=type_, optional=codes(*BUSY, *OUTSIDE))


@CHAPTER.clause("7.5.2.6", "SYNC consumer", Tier.DESTRUCTIVE, "6.4")
def _without_period(subject: Subject) -> Iterator[Data]:
    """Send SYNC to a device that has no period of it: it is a consumer all the same."""
    name, (tpdo, lack) = "a TPDO with each SYNC though the period is 0", _followed(subject, 1)
    reasons = {
        NO_SYNC: subject.model.sync_cob_id is None,
        "the device sends SYNC itself": bool(subject.number(SYNC) & SYNC_PRODUCER),
        "the file's SYNC has a counter": bool(subject.number(SYNC_COUNTER)),
        "the file has no period of SYNC (0x1006) that can be 0": not subject.may_be(SYNC_PERIOD, 0),
    }
    why = next((reason for reason, holds in reasons.items() if holds), "") or lack
    if why or tpdo is None:
        yield skip(name, why)
        return
    sync = sent("SYNC", subject.model.sync_cob_id or 0)
    # 0x1006 is the producer's period and the consumer's watch; a consumer without one follows each SYNC all the same.
    with_each = group("with each SYNC", sync, expect("it comes", _sent(tpdo), SOON))
    period = write("period 0", SYNC_PERIOD, value=0)
    steps = (period, _typed(tpdo, 1), nmt("start"), {**with_each, "repeat": 3})
    yield group(name, *fresh(subject), *steps, *fresh(subject))


# Counter


@CHAPTER.clause("7.5.2.22", "SYNC counter", Tier.DESTRUCTIVE, "6.5, 6.9")
def _numbers(subject: Subject) -> Iterator[Data]:
    """Write what the counter cannot be, and change it while SYNC has a period (CiA 301, 7.5.2.22)."""
    counter = subject.settable(SYNC_COUNTER)
    if counter is None:
        yield skip("its values", "the file has no SYNC counter (0x1019) that can be written")
        return
    steps: list[Data] = [write("period 0", SYNC_PERIOD, value=0)] if subject.may_be(SYNC_PERIOD, 0) else []
    refused = codes(*OUTSIDE, *(BUSY if subject.number(SYNC_PERIOD) and not steps else ()))
    # 1 would be the same number in each SYNC, and 241 to 255 are reserved (CiA 301, 7.5.2.22).
    for value in (1, COUNTERS[-1] + 1):
        if subject.number(SYNC_COUNTER) != value:
            steps.append(write(f"{value} is refused", SYNC_COUNTER, value=value, abort=refused))
    yield group("only 0 and 2 to 240", *fresh(subject), *steps, *fresh(subject))
    name, other = "not while SYNC has a period", OVERFLOW + (subject.number(SYNC_COUNTER) == OVERFLOW)
    if not (_has_period(subject) and subject.may_be(SYNC_COUNTER, other)):
        yield skip(name, "the file has no period of SYNC (0x1006) that can be written")
        return
    period = write(f"period {PERIOD} us", SYNC_PERIOD, value=PERIOD)
    changed = write(f"counter {other}", SYNC_COUNTER, value=other, abort=codes(AbortCode.STATE, AbortCode.GENERAL))
    yield group(name, *fresh(subject), period, changed, *fresh(subject))


@CHAPTER.clause("7.5.2.22", "SYNC counter", Tier.DESTRUCTIVE, "6.7")
def _counted(subject: Subject) -> Iterator[Data]:
    name, why = f"a counter up to {OVERFLOW}", _why_no_producer(subject, OVERFLOW)
    if why:
        yield skip(name, why)
        return
    # It begins with 1 and goes back to 1, never through 0 (CiA 301, 7.2.5): one more than the overflow is needed to see
    # it.
    numbers = [*range(1, OVERFLOW + 1), 1]
    counts = [expect(f"SYNC {number}", _sync(subject, f"{number:02X}"), SOON) for number in numbers]
    yield group(name, *_configured(subject, OVERFLOW), _started(subject), *counts, *fresh(subject))


# Stored


@CHAPTER.clause("7.5.2.13", "SYNC", Tier.DESTRUCTIVE, "6.8, 6.10")
def _stored(subject: Subject) -> Iterator[Data]:
    """Store the counter, then all of SYNC: after a reset the device sends it by itself."""
    counter, off = Kept(SYNC_COUNTER, OVERFLOW, 2), Kept(SYNC_PERIOD, 0)
    yield from kept_over_reset(subject, "the counter is stored", [off, counter])
    if subject.model.sync_cob_id is None:
        yield skip("all of it is stored", NO_SYNC)
        return
    values = [off, counter, Kept(SYNC_PERIOD, PERIOD), Kept(SYNC, _sending(subject))]
    # Any number: how many SYNCs came between the reset and the first look, nobody can say.
    goes_on = every(_sync(subject, "??"), PERIOD // 1000, 3)
    yield from kept_over_reset(subject, "all of it is stored", values, goes_on)
