"""When TPDOs are sent: by event timer, by SYNC, by remote frame, one by one and all at once (CiA 301, 7.2.2, 7.5.2.37).

Rule of this file: what an event is, is the maker's; no step waits for one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from eurobot_od.check.conformance.subject import (
    BUSY,
    Clause,
    StepsOf,
    Subject,
    Tier,
    codes,
    expect,
    fresh,
    group,
    never,
    nmt,
    put_back,
    remote,
    save,
    sent,
    skip,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data, hexadecimal
from eurobot_od.device.device import Device
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import (
    COB_ID,
    EVENT_TIMER,
    NO_RTR,
    NOT_VALID,
    SYNC_START,
    TRANSMISSION_TYPE,
    PdoDirection,
)
from eurobot_od.sdo.aborts import Abort
from eurobot_od.sdo.wire import AbortCode

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

EVENT_TIME = 100
"""Event timer with which TPDOs are looked at, ms."""

OVERFLOW, START = 10, 3
"""SYNC counter, and the number of the SYNC with which TPDOs begin."""

SOON, QUIET = f"{3 * EVENT_TIME} ms", "300 ms"

NOT_SETTABLE = "cannot be read, written and put back"

NO_SUCH_TYPE = (AbortCode.VALUE, AbortCode.TOO_HIGH, AbortCode.TOO_LOW, *BUSY)
"""Aborts of a device that does not send a TPDO by SYNC."""

EVENT_TYPES, REMOTE_TYPES = (254, 255), (252, 253, 254, 255)

Pdos = Sequence[Pdo]
WhyNot = Callable[[Subject, Pdo], str]


def each_of(direction: PdoDirection, steps: Callable[[Subject, Pdo], Iterator[Data]]) -> StepsOf:
    """Make steps for all PDOs of a direction that hold."""

    def all_of_them(subject: Subject) -> Iterator[Data]:
        chosen = [each for each in subject.pdos if each.direction is direction]
        for each in chosen:
            yield from steps(subject, each)
        if not chosen:
            yield skip(direction.name, f"the file has no {direction.name} whose parameters hold")

    return all_of_them


def _each(why_not: WhyNot, steps: Callable[[Subject, Pdos], Data]) -> StepsOf:
    """Make steps for each TPDO alone."""

    def one(subject: Subject, pdo: Pdo) -> Iterator[Data]:
        why = subject.why_not_seen(pdo) or why_not(subject, pdo)
        yield skip(pdo.title, why) if why else steps(subject, [pdo])

    return each_of(PdoDirection.TPDO, one)


def _together(why_not: WhyNot, steps: Callable[[Subject, Pdos], Data]) -> StepsOf:
    """Make steps for all TPDOs at once."""

    def all_of_them(subject: Subject) -> Iterator[Data]:
        tpdos = [each for each in subject.pdos if each.direction is PdoDirection.TPDO]
        chosen = [each for each in tpdos if not (subject.why_not_seen(each) or why_not(subject, each))]
        several = len(chosen) > 1
        yield steps(subject, chosen) if several else skip("several TPDOs", "the file has not two TPDOs that can be so")

    return all_of_them


def _named(pdos: Pdos) -> str:
    return " and ".join(each.title for each in pdos)


def _sent(pdo: Pdo) -> Data:
    """Return the pattern of a TPDO: whatever its data, but of its length."""
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


def _come(name: str, pdos: Pdos) -> Data:
    patterns = [_sent(each) for each in pdos]
    return expect(name, patterns[0] if len(patterns) == 1 else {"all": patterns}, SOON)


def _none(name: str, pdos: Pdos) -> Iterator[Data]:
    return (never(name, _sent(each), QUIET) for each in pdos)


def _set(subject: Subject, pdos: Pdos, sub: int, value: int, what: str, *refusals: AbortCode) -> Iterator[Data]:
    """Give a parameter of each PDO another value, for `_reset` to put back the one it had."""
    for each in pdos:
        found = subject.settable((each.index, sub))
        if found is not None:
            yield save(found, f"present_{each.number}")
            more = {"optional": codes(*refusals)} if refusals else {}
            yield write(f"{each.title}: {what} {value}", address_of(found), value=value, **more)


def _reset(subject: Subject, pdos: Pdos, sub: int) -> Iterator[Data]:
    for each in pdos:
        found = subject.settable((each.index, sub))
        if found is not None:
            yield put_back(found, f"present_{each.number}")


def off(subject: Subject, cob_id: ODVariable) -> Data:
    """Make a PDO not valid."""
    value = subject.number(address_of(cob_id)) | NOT_VALID
    return write("1. not valid", address_of(cob_id), value=hexadecimal(value, 8))


def why_not_off(subject: Subject, pdo: Pdo) -> str:
    """Say why a PDO cannot be made not valid and again what it was; nothing if a device that is its file lets it be."""
    cob_id = subject.settable((pdo.index, COB_ID))
    if cob_id is None:
        return f"the COB-ID of {pdo.title} {NOT_SETTABLE}"
    device, address = Device(subject.dictionary), address_of(cob_id)
    try:
        # Asked of a device that is its file: one whose own default breaks a rule could not be put back, and the suite
        # would leave it worse than it was.
        for value in (subject.number(address) | NOT_VALID, subject.number(address)):
            device.objects.write(address, data_type(cob_id).write(value))
    except Abort as refusal:
        return f"the file's own COB-ID of {pdo.title} is one that it does not take: {refusal}"
    return ""


# By the event timer


def _why_no_timer(subject: Subject, pdo: Pdo) -> str:
    settable = subject.may_be((pdo.index, EVENT_TIMER), EVENT_TIME)
    reasons = {
        # Types 254 and 255 alone have an event timer (CiA 301, 7.5.2.37).
        f"{pdo.title} is not event-driven by default": pdo.transmission_type not in EVENT_TYPES,
        f"the event timer of {pdo.title} {NOT_SETTABLE}": not settable,
        f"the inhibit time of {pdo.title} is longer than {EVENT_TIME} ms": pdo.inhibit_time >= 10 * EVENT_TIME,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _by_event_timer(subject: Subject, pdos: Pdos) -> Data:
    return group(
        f"{_named(pdos)} by event timer",
        *_set(subject, pdos, EVENT_TIMER, EVENT_TIME, "event timer"),
        wait("50 ms"),
        *_none("none in PRE-OPERATIONAL", pdos),
        nmt("start"),
        # At most: an event of the device's own may send it sooner, and begins the time anew.
        {**_come(f"again and again, {EVENT_TIME} ms apart at most", pdos), "repeat": 3},
        nmt("stop"),
        wait("50 ms"),
        *_none("none in STOPPED", pdos),
        nmt("pre-operational"),
        *_reset(subject, pdos, EVENT_TIMER),
    )


# By SYNC


def _why_no_sync(subject: Subject, pdo: Pdo) -> str:
    reasons = {
        "the file has no SYNC (0x1005) with an identifier": subject.model.sync_cob_id is None,
        "the device sends SYNC itself": bool(subject.number(SYNC) & SYNC_PRODUCER),
        "the file's SYNC has a counter": bool(subject.number(SYNC_COUNTER)),
        f"the transmission type of {pdo.title} {NOT_SETTABLE}": not subject.may_be((pdo.index, TRANSMISSION_TYPE), 1),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _sync(subject: Subject, data: bytes = b"") -> Data:
    name = f"SYNC {data[0]}" if data else "SYNC"
    return sent(name, subject.model.sync_cob_id or 0, data)


def _by_sync(subject: Subject, pdos: Pdos) -> Data:
    sync = _sync(subject)
    return group(
        f"{_named(pdos)} by SYNC",
        *_set(subject, pdos, TRANSMISSION_TYPE, 1, "transmission type", *NO_SUCH_TYPE),
        sync,
        *_none("none in PRE-OPERATIONAL", pdos),
        nmt("start"),
        wait("50 ms"),
        *_none("none without SYNC", pdos),
        # Twice: a device that sends once on a change of its parameters would pass with one.
        {**group("with each SYNC", sync, _come("it comes", pdos)), "repeat": 2},
        nmt("pre-operational"),
        *_reset(subject, pdos, TRANSMISSION_TYPE),
    )


def _why_not_acyclic(subject: Subject, pdo: Pdo) -> str:
    can = subject.may_be((pdo.index, TRANSMISSION_TYPE), 0)
    return _why_no_sync(subject, pdo) or ("" if can else f"the transmission type of {pdo.title} cannot be 0")


def _by_acyclic_sync(subject: Subject, pdos: Pdos) -> Data:
    """With type 0 a TPDO goes with the SYNC after an event: with none else, and without SYNC never."""
    return group(
        f"{_named(pdos)} by SYNC after an event",
        *_set(subject, pdos, TRANSMISSION_TYPE, 0, "transmission type", *NO_SUCH_TYPE),
        nmt("start"),
        *_none("none without SYNC", pdos),
        _sync(subject),
        wait("100 ms"),
        *_none("none until the next SYNC", pdos),
        nmt("pre-operational"),
        *_reset(subject, pdos, TRANSMISSION_TYPE),
    )


# By numbered SYNC


def _why_no_start(subject: Subject, pdo: Pdo) -> str:
    settable = ((TRANSMISSION_TYPE, 1), (SYNC_START, START))
    may = all(subject.may_be((pdo.index, sub), value) for sub, value in settable)
    period = subject.number(SYNC_PERIOD)
    reasons = {
        "the file has no SYNC (0x1005) with an identifier": subject.model.sync_cob_id is None,
        "the device sends SYNC itself": bool(subject.number(SYNC) & SYNC_PRODUCER),
        f"the file has no SYNC counter (0x1019) that can be {OVERFLOW}": not subject.may_be(SYNC_COUNTER, OVERFLOW),
        "the file's period of SYNC (0x1006) cannot be 0": bool(period) and not subject.may_be(SYNC_PERIOD, 0),
        f"the file has no SYNC start value of {pdo.title} that can be {START}": not may,
    }
    return next((reason for reason, holds in reasons.items() if holds), "") or why_not_off(subject, pdo)


def _numbered(subject: Subject, pdos: Pdos) -> Data:
    """Have TPDOs begin with the SYNC of a number, and then go with each one."""
    steps = [*fresh(subject), *([write("period 0", SYNC_PERIOD, value=0)] if subject.number(SYNC_PERIOD) else [])]
    steps.append(write(f"counter {OVERFLOW}", SYNC_COUNTER, value=OVERFLOW))
    for each in pdos:
        cob_id, type_, start = ((each.index, sub) for sub in (COB_ID, TRANSMISSION_TYPE, SYNC_START))
        value = subject.number(cob_id)
        steps += [
            # The start value must not be changed while the PDO exists (CiA 301, 7.5.2.37).
            write(f"{each.title} not valid", cob_id, value=hexadecimal(value | NOT_VALID, 8)),
            write("transmission type 1", type_, value=1, optional=codes(*NO_SUCH_TYPE)),
            write(f"SYNC start value {START}", start, value=START),
            write(f"{each.title} valid", cob_id, value=hexadecimal(value, 8)),
        ]
    steps += [nmt("start"), wait("50 ms")]
    for number in range(1, START + 3):
        # The counter is in SYNC's data byte: the tester plays the producer, and counts from 1 (CiA 301, 7.2.5).
        steps.append(_sync(subject, bytes([number])))
        steps += [_come("it comes", pdos)] if number >= START else _none(f"not before SYNC {START}", pdos)
    return group(f"{_named(pdos)} from SYNC {START} on", *steps, *fresh(subject))


# By remote frame


def _why_no_remote(subject: Subject, pdo: Pdo) -> str:
    # Bit 30 of a TPDO's COB-ID (CiA 301, 7.5.2.37).
    if subject.number((pdo.index, COB_ID)) & NO_RTR:
        return f"bit 30 of the COB-ID of {pdo.title} forbids remote frames"
    return "" if pdo.transmission_type in REMOTE_TYPES else f"{pdo.title} follows SYNC"


def _by_remote_frame(_: Subject, pdos: Pdos) -> Data:
    # With the length of its data: some controllers answer a remote frame only if the length code agrees.
    asked = [remote(each.cob_id, each.length) for each in pdos]
    return group(
        f"{_named(pdos)} by remote frame",
        *asked,
        *_none("none in PRE-OPERATIONAL", pdos),
        nmt("start"),
        wait("50 ms"),
        *asked,
        _come("it comes", pdos),
        nmt("stop"),
        wait("50 ms"),
        *asked,
        *_none("none in STOPPED", pdos),
        nmt("pre-operational"),
    )


TIMED = "7.5.2.37", "TPDO transmission"
BY_SYNC = "7.2.2.2", "TPDO transmission"
ASKED = "7.2.2.5.2", "TPDO by remote frame"
BEGUN = "7.5.2.37", "SYNC start value"

CLAUSES = (
    Clause(*TIMED, _each(_why_no_timer, _by_event_timer), Tier.REVERSIBLE, "3.4, 3.5"),
    Clause(*TIMED, _together(_why_no_timer, _by_event_timer), Tier.REVERSIBLE, "3.10, 3.11, 3.16, 3.17"),
    Clause(*BY_SYNC, _each(_why_no_sync, _by_sync), Tier.REVERSIBLE, "3.6"),
    Clause(*BY_SYNC, _together(_why_no_sync, _by_sync), Tier.REVERSIBLE, "3.12, 3.18"),
    Clause(*BY_SYNC, _each(_why_not_acyclic, _by_acyclic_sync), Tier.REVERSIBLE, "3.7"),
    Clause(*BY_SYNC, _together(_why_not_acyclic, _by_acyclic_sync), Tier.REVERSIBLE, "3.13, 3.19"),
    Clause(*ASKED, _each(_why_no_remote, _by_remote_frame), Tier.REVERSIBLE, "3.3, 3.9"),
    Clause(*ASKED, _together(_why_no_remote, _by_remote_frame), Tier.REVERSIBLE, "3.15"),
    Clause(*BEGUN, _each(_why_no_start, _numbered), Tier.DESTRUCTIVE, "3.8"),
    Clause(*BEGUN, _together(_why_no_start, _numbered), Tier.DESTRUCTIVE, "3.14, 3.20"),
)
