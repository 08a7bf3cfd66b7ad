"""When TPDOs are sent: by event timer, by SYNC, by remote frame, one by one and all at once (CiA 301, 7.2.2, 7.5.2.37).

What an event is, is the maker's; no step waits for one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, StepsOf
from eurobot_od.check.conformance.step import BUSY, Data, Steps, codes
from eurobot_od.check.conformance.subject import Lacks, Subject, Tier, fresh, has, need, or_skipped
from eurobot_od.device.device import Device
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import COB_ID, EVENT_TIMER, NO_RTR, NOT_VALID, SYNC_START, TRANSMISSION_TYPE, PdoDirection
from eurobot_od.sdo.wire import Abort, AbortCode

CHAPTER: Chapter[Subject] = Chapter("transmission", "when TPDOs are sent")
"""A part of the chapter `pdo`."""

EVENT_TIME = 100
"""Event timer with which TPDOs are looked at, ms."""

OVERFLOW, START = 10, 3
"""SYNC counter, and the number of the SYNC with which TPDOs begin."""

SOON, QUIET = f"{3 * EVENT_TIME} ms", "300 ms"

NO_SYNC = "the file has no SYNC (0x1005) with an identifier"
NOT_SETTABLE = "cannot be read, written and put back"

NO_SUCH_TYPE = (AbortCode.VALUE, AbortCode.TOO_HIGH, AbortCode.TOO_LOW, *BUSY)
"""Aborts of a device that does not send a TPDO by SYNC."""

EVENT_TYPES, REMOTE_TYPES = (254, 255), (252, 253, 254, 255)

Pdos: TypeAlias = Sequence[Pdo]


def each_of(direction: PdoDirection, steps: Callable[[Subject, Pdo], Steps], name: str = "{}") -> StepsOf[Subject]:
    """Make steps for all PDOs of a direction that hold; where one lacks something, a skip of this name."""

    def of_each(subject: Subject) -> Steps:
        for each in need(subject.of(direction), f"the file has no {direction.name} whose parameters hold"):
            yield from or_skipped(name.format(each.title), steps, subject, each)

    return of_each


TpdoSteps: TypeAlias = "Callable[[Subject, Pdos], Data]"


def _sent_when(
    number: str,
    topic: str,
    alone: str,
    together: str,
    needed: Callable[[Subject, Pdo], object],
    tier: Tier = Tier.REVERSIBLE,
) -> Callable[[TpdoSteps], TpdoSteps]:
    """Enter a function as two clauses, with their numbers of CiA's tool: for each TPDO alone, and for all at once."""

    def seen(subject: Subject, pdo: Pdo) -> None:
        subject.need_seen(pdo)
        needed(subject, pdo)

    def enter(steps: TpdoSteps) -> TpdoSteps:
        def of_one(subject: Subject, pdo: Pdo) -> Steps:
            seen(subject, pdo)
            return [steps(subject, [pdo])]

        def of_all(subject: Subject) -> Steps:
            chosen = [each for each in subject.of(PdoDirection.TPDO) if has(seen, subject, each)]
            need(len(chosen) > 1, "the file has not two TPDOs that can be so")
            return [steps(subject, chosen)]

        CHAPTER.clause(number, topic, tier, alone, name="TPDO")(each_of(PdoDirection.TPDO, of_one))
        CHAPTER.clause(number, topic, tier, together, name="several TPDOs")(of_all)
        return steps

    return enter


def _named(pdos: Pdos) -> str:
    return " and ".join(each.title for each in pdos)


def frame_of(pdo: Pdo) -> Data:
    """Return the pattern of a PDO: whatever its data, but of its length."""
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


def _come(name: str, pdos: Pdos) -> Data:
    patterns = [frame_of(each) for each in pdos]
    return step.expect(name, patterns[0] if len(patterns) == 1 else {"all": patterns}, SOON)


def _none(name: str, pdos: Pdos) -> Steps:
    return (step.never(name, frame_of(each), QUIET) for each in pdos)


PARAMETERS: Mapping[int, tuple[str, Mapping[str, object]]] = {
    EVENT_TIMER: ("event timer", {}),
    TRANSMISSION_TYPE: ("transmission type", {"optional": codes(*NO_SUCH_TYPE)}),
}
"""What a parameter is called, and how it is written, by its sub-index."""


def _with(subject: Subject, pdos: Pdos, sub: int, value: int, *steps: Data) -> Steps:
    """Do some steps with another value of a parameter of each PDO, then put back the one it had."""
    what, more = PARAMETERS[sub]
    back: list[Data] = []
    for each in pdos:
        found, kept = need(subject.settable((each.index, sub)), NOT_SETTABLE), f"present_{each.number}"
        yield step.save(found, kept)
        yield step.write(f"{each.title}: {what} {value}", address_of(found), value=value, **more)
        back.append(step.put_back(found, kept))
    yield from (*steps, *step.undoing(step.nmt("pre-operational")), *back)


def off(cob_id: ODVariable, kept: str = "present") -> Data:
    """Make a PDO not valid: the COB-ID that it has, which need not be the file's, with bit 31 set."""
    return step.rewritten("1. not valid", cob_id, kept, NOT_VALID)


def need_off(subject: Subject, pdo: Pdo) -> ODVariable:
    """Return the COB-ID of a PDO that can be made not valid and again what it was; raises Lacks."""
    cob_id = need(subject.settable((pdo.index, COB_ID)), f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    device, address = Device(subject.dictionary), address_of(cob_id)
    try:
        # Asked of a device that is its file: one whose own default breaks a rule could not be put back, and the suite
        # would leave it worse than it was.
        for value in (subject.number(address) | NOT_VALID, subject.number(address)):
            device.objects.write(address, data_type(cob_id).write(value))
    except Abort as refusal:
        why = f"the file's own COB-ID of {pdo.title} is one that it does not take: {refusal}"
        raise Lacks(why) from None
    return cob_id


# By the event timer


def _timer(subject: Subject, pdo: Pdo) -> None:
    # Types 254 and 255 alone have an event timer (CiA 301, 7.5.2.37).
    need(pdo.transmission_type in EVENT_TYPES, f"{pdo.title} is not event-driven by default")
    settable = subject.may_be((pdo.index, EVENT_TIMER), EVENT_TIME)
    need(settable, f"the event timer of {pdo.title} {NOT_SETTABLE}")
    short = pdo.inhibit_time < 10 * EVENT_TIME
    need(short, f"the inhibit time of {pdo.title} is longer than {EVENT_TIME} ms")


@_sent_when("7.5.2.37", "TPDO transmission", "3.4, 3.5", "3.10, 3.11, 3.16, 3.17", _timer)
def _by_event_timer(subject: Subject, pdos: Pdos) -> Data:
    steps = (
        step.wait("50 ms"),
        *_none("none in PRE-OPERATIONAL", pdos),
        step.nmt("start"),
        # At most: an event of the device's own may send it sooner, and begins the time anew.
        {**_come(f"again and again, {EVENT_TIME} ms apart at most", pdos), "repeat": 3},
        step.nmt("stop"),
        step.wait("50 ms"),
        *_none("none in STOPPED", pdos),
    )
    group = step.group(f"{_named(pdos)} by event timer", *_with(subject, pdos, EVENT_TIMER, EVENT_TIME, *steps))
    # CiA's tool asks for type 254 as an event; with another default only the timer is asked.
    only_timer = "3.5" if len(pdos) == 1 else "3.11, 3.17"
    return step.asking("" if all(each.transmission_type == EVENT_TYPES[0] for each in pdos) else only_timer, group)


# By SYNC


def need_sync(subject: Subject) -> None:
    """Need a SYNC that the tester can send; raises Lacks."""
    need(subject.model.pdos.sync_cob_id is not None, NO_SYNC)
    need(not subject.number(SYNC) & SYNC_PRODUCER, "the device sends SYNC itself")


def need_uncounted_sync(subject: Subject) -> None:
    """Need one without a counter; raises Lacks."""
    need_sync(subject)
    need(not subject.number(SYNC_COUNTER), "the file's SYNC has a counter")


def sync(subject: Subject, data: bytes = b"") -> Data:
    """Send SYNC."""
    return step.sent(f"SYNC {data[0]}" if data else "SYNC", subject.model.pdos.sync_cob_id or 0, data)


def _synchronous(subject: Subject, pdo: Pdo) -> None:
    need_uncounted_sync(subject)
    settable = subject.may_be((pdo.index, TRANSMISSION_TYPE), 1)
    need(settable, f"the transmission type of {pdo.title} {NOT_SETTABLE}")


@_sent_when("7.2.2.2", "TPDO transmission", "3.6", "3.12, 3.18", _synchronous)
def _by_sync(subject: Subject, pdos: Pdos) -> Data:
    steps = (
        sync(subject),
        *_none("none in PRE-OPERATIONAL", pdos),
        step.nmt("start"),
        step.wait("50 ms"),
        *_none("none without SYNC", pdos),
        # Twice: a device that sends once on a change of its parameters would pass with one.
        {**step.group("with each SYNC", sync(subject), _come("it comes", pdos)), "repeat": 2},
    )
    return step.group(f"{_named(pdos)} by SYNC", *_with(subject, pdos, TRANSMISSION_TYPE, 1, *steps))


def _acyclic(subject: Subject, pdo: Pdo) -> None:
    _synchronous(subject, pdo)
    need(subject.may_be((pdo.index, TRANSMISSION_TYPE), 0), f"the transmission type of {pdo.title} cannot be 0")


@_sent_when("7.2.2.2", "TPDO transmission", "", "", _acyclic)
def _by_acyclic_sync(subject: Subject, pdos: Pdos) -> Data:
    """With type 0 a TPDO goes with the SYNC after an event: with none else, and without SYNC never."""
    steps = (
        step.nmt("start"),
        *_none("none without SYNC", pdos),
        sync(subject),
        step.wait("100 ms"),
        *_none("none until the next SYNC", pdos),
    )
    return step.group(f"{_named(pdos)} by SYNC after an event", *_with(subject, pdos, TRANSMISSION_TYPE, 0, *steps))


# By remote frame


def _asked(subject: Subject, pdo: Pdo) -> None:
    # Bit 30 of a TPDO's COB-ID (CiA 301, 7.5.2.37).
    forbidden = subject.number((pdo.index, COB_ID)) & NO_RTR
    need(not forbidden, f"bit 30 of the COB-ID of {pdo.title} forbids remote frames")
    need(pdo.transmission_type in REMOTE_TYPES, f"{pdo.title} follows SYNC")


@_sent_when("7.2.2.5.2", "TPDO by remote frame", "3.3, 3.9", "3.15", _asked)
def _by_remote_frame(_: Subject, pdos: Pdos) -> Data:
    # With the length of its data: some controllers answer a remote frame only if the length code agrees.
    asked = [step.remote(each.cob_id, each.length) for each in pdos]
    return step.group(
        f"{_named(pdos)} by remote frame",
        *asked,
        *_none("none in PRE-OPERATIONAL", pdos),
        step.nmt("start"),
        step.wait("50 ms"),
        *asked,
        _come("it comes", pdos),
        step.nmt("stop"),
        step.wait("50 ms"),
        *asked,
        *_none("none in STOPPED", pdos),
        *step.undoing(step.nmt("pre-operational")),
    )


# By numbered SYNC


def _numbered(subject: Subject, pdo: Pdo) -> None:
    need_sync(subject)
    counts = subject.may_be(SYNC_COUNTER, OVERFLOW)
    need(counts, f"the file has no SYNC counter (0x1019) that can be {OVERFLOW}")
    no_period = not subject.number(SYNC_PERIOD) or subject.may_be(SYNC_PERIOD, 0)
    need(no_period, "the file's period of SYNC (0x1006) cannot be 0")
    may = all(subject.may_be((pdo.index, sub), value) for sub, value in ((TRANSMISSION_TYPE, 1), (SYNC_START, START)))
    need(may, f"the file has no SYNC start value of {pdo.title} that can be {START}")
    need_off(subject, pdo)


@_sent_when("7.5.2.37", "SYNC start value", "3.8", "3.14, 3.20", _numbered, Tier.DESTRUCTIVE)
def _from_start_value(subject: Subject, pdos: Pdos) -> Data:
    """Have TPDOs begin with the SYNC of a number, and then go with each one."""
    kept = subject.kept((SYNC_COUNTER, SYNC_PERIOD))
    steps = [*fresh(), *(step.save(*each) for each in kept)]
    steps += [step.write("period 0", SYNC_PERIOD, value=0)] if subject.number(SYNC_PERIOD) else []
    steps.append(step.write(f"counter {OVERFLOW}", SYNC_COUNTER, value=OVERFLOW))
    back: list[Data] = [*step.undoing(*fresh())]
    for each in pdos:
        parameters = subject.kept((each.index, sub) for sub in (COB_ID, TRANSMISSION_TYPE, SYNC_START))
        (cob_id, present), (type_, _), (start, _) = parameters
        steps += [
            *(step.save(*parameter) for parameter in parameters),
            # The start value must not be changed while the PDO exists (CiA 301, 7.5.2.37).
            off(cob_id, present),
            step.write("transmission type 1", address_of(type_), value=1, optional=codes(*NO_SUCH_TYPE)),
            step.write(f"SYNC start value {START}", address_of(start), value=START),
            step.rewritten(f"{each.title} valid", cob_id, present),
        ]
        back += [step.put_back(*parameter) for parameter in reversed(parameters)]
    steps += [step.nmt("start"), step.wait("50 ms")]
    for number in range(1, START + 3):
        # The counter is in SYNC's data byte: the tester plays the producer, and counts from 1 (CiA 301, 7.2.5).
        steps.append(sync(subject, bytes([number])))
        steps += [_come("it comes", pdos)] if number >= START else _none(f"not before SYNC {START}", pdos)
    back += [step.put_back(*each) for each in kept]
    return step.group(f"{_named(pdos)} from SYNC {START} on", *steps, *back)
