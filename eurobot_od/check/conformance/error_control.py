"""Error control: node guarding, the heartbeat consumer, and how they exclude each other (CiA 301, 7.2.8.2.2).

Rule of this file: life guarding begins with the first remote frame and ends with a reset of the communication. Whatever
may have begun it ends with one.
"""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.check.conformance.subject import (
    Chapter,
    Subject,
    Tier,
    codes,
    emcy,
    expect,
    fresh,
    group,
    never,
    nmt,
    read,
    remote,
    sent,
    skip,
    title,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data, hexadecimal
from eurobot_od.device.emergency import ErrorCode
from eurobot_od.device.nmt import TOGGLE, NmtState, error_control
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, GUARD_TIME, HEARTBEAT_TIME, LIFE_TIME_FACTOR
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address
from eurobot_od.sdo.wire import AbortCode

CHAPTER = Chapter("error-control", "node guarding and heartbeat consumer")

GUARD, FACTOR = 100, 3
"""A guard time in ms and a life time factor: the master is missed after 0.3 s."""

BEAT, SLOW = 100, 5000
"""Heartbeat times of the device, ms: one that is seen, and one that is not while a step looks."""

WATCHED = 200
"""How long the device waits for another node's heartbeat, ms."""

QUIET, ONCE = "300 ms", "500 ms"

NOT_GUARDED = "the file has no guard time (0x100C)"

FIRST, SECOND = (CONSUMED_HEARTBEATS, 1), (CONSUMED_HEARTBEATS, 2)


# Guarding


def _why_not_guarded(subject: Subject) -> str:
    """Say why the device cannot be guarded; nothing if it can be."""
    if subject.find(GUARD_TIME) is None:
        return NOT_GUARDED
    # Heartbeat and guarding exclude each other; if both are configured, the heartbeat wins (CiA 301, 7.2.8.2.2).
    ends = not subject.number(HEARTBEAT_TIME) or subject.may_be(HEARTBEAT_TIME, 0)
    return "" if ends else "the file's heartbeat (0x1017) cannot be ended, and a device that has one is not guarded"


@CHAPTER.clause("7.5.2.11", "Guard time", ctt="7.1, 7.201")
def _times(subject: Subject) -> Iterator[Data]:
    for address, lack in ((GUARD_TIME, NOT_GUARDED), (LIFE_TIME_FACTOR, "the file has no life time factor (0x100D)")):
        found = subject.find(address)
        if found is None or not found.readable:
            yield skip(f"0x{address[0]:04X}", lack if found is None else f"0x{address[0]:04X} cannot be read")
        else:
            yield read(title(found), address, data="any")


def _no_heartbeat(subject: Subject) -> Iterator[Data]:
    if subject.number(HEARTBEAT_TIME):
        yield write("no heartbeat", HEARTBEAT_TIME, value=0)
        yield wait("20 ms")


@CHAPTER.clause("7.2.8.3.2.1", "Node guarding", Tier.REVERSIBLE, "7.2, 7.3")
def _guarded(subject: Subject) -> Iterator[Data]:
    """Ask in every state; after a reset of the communication the toggle bit begins with 0."""
    why = _why_not_guarded(subject)
    if not why and subject.number(GUARD_TIME) * subject.number(LIFE_TIME_FACTOR):
        # A default above 0 in both: with the first remote frame the device begins to wait for the next one, and the
        # steps that follow are not made to keep up.
        why = "the file's life guarding is on: once it is asked, the device may leave OPERATIONAL by itself"
    if why:
        yield skip("a remote frame is answered", why)
        return
    asked = (
        (None, NmtState.PRE_OPERATIONAL),
        (None, NmtState.PRE_OPERATIONAL),
        ("start", NmtState.OPERATIONAL),
        ("stop", NmtState.STOPPED),
        ("pre-operational", NmtState.PRE_OPERATIONAL),
    )
    steps: list[Data] = [*fresh(subject), *_no_heartbeat(subject)]
    for number, (command, state) in enumerate(asked):
        steps += [] if command is None else [nmt(command), wait("50 ms")]
        # Bit 7 alternates from answer to answer, so that a master notices one that it has seen before (CiA 301,
        # 7.2.8.3.2.1).
        answer = state | TOGGLE * (number % 2)
        said = f"{number + 1}. {state.name.replace('_', '-')}, toggle bit {number % 2}"
        steps += [remote(_own(subject)), expect(said, _answer(subject, f"{answer:02X}"), QUIET)]
    yield group("each remote frame is answered with the state and the next toggle bit", *steps, *fresh(subject))


def _own(subject: Subject) -> int:
    return ERROR_CONTROL_BASE + subject.node_id


def _answer(subject: Subject, digits: str = "??") -> Data:
    return {"raw": f"{_own(subject):03X}#{digits}"}


@CHAPTER.clause("7.2.8.3.2.1", "Node guarding", Tier.DESTRUCTIVE, "7.4")
def _other_identifier(subject: Subject) -> Iterator[Data]:
    name, why = "another node's identifier is not answered", _why_not_guarded(subject)
    if why:
        yield skip(name, why)
        return
    # A device that compares only a part of the identifier would answer for its neighbours, and hide that one is
    # missing.
    asked = remote(ERROR_CONTROL_BASE + subject.another)
    yield group(name, *fresh(subject), *_no_heartbeat(subject), asked, never("no answer", _answer(subject), QUIET))


def _why_no_life(subject: Subject) -> str:
    """Say why life guarding cannot be looked at; nothing if it can be."""
    settable = subject.may_be(GUARD_TIME, GUARD) and subject.may_be(LIFE_TIME_FACTOR, FACTOR)
    lack = "" if settable else "the file has no 0x100C and 0x100D that can be written"
    return _why_not_guarded(subject) or lack or subject.why_no_emcy


def _life_times() -> Iterator[Data]:
    yield write(f"guard time {GUARD} ms", GUARD_TIME, value=GUARD)
    yield write(f"life time factor {FACTOR}", LIFE_TIME_FACTOR, value=FACTOR)


def _missed(name: str, span: str) -> Data:
    return never(name, {"emcy": hexadecimal(ErrorCode.HEARTBEAT_LOST)}, span)


@CHAPTER.clause("7.5.2.12", "Life guarding", Tier.DESTRUCTIVE, "7.5, 7.6")
def _life_guarding(subject: Subject) -> Iterator[Data]:
    why = _why_no_life(subject)
    if why:
        yield skip("both are written", why)
        yield skip("the master is missed", why)
        return
    # Reset first: life guarding that some earlier step began ends with nothing else.
    both = [*fresh(subject), *_no_heartbeat(subject), *_life_times()]
    seen = (read("guard time", GUARD_TIME, expect=GUARD), read("life time factor", LIFE_TIME_FACTOR, expect=FACTOR))
    yield group("both are written", *both, *seen, *fresh(subject))
    pause = _missed("the master is not missed", f"{GUARD} ms")
    asked = group("guarded", remote(_own(subject)), expect("answer", _answer(subject), f"{GUARD} ms"), pause)
    yield group(
        "the master is missed",
        *both,
        _missed("not before its first remote frame", ONCE),
        # Longer in all than the life time, so that it is the questions which keep the device from missing its master.
        {**asked, "repeat": 4},
        emcy("EMCY: the life time is over", ErrorCode.HEARTBEAT_LOST),
        _missed("it is reported once", ONCE),
        remote(_own(subject)),
        expect("a remote frame is answered again", _answer(subject), QUIET),
        *fresh(subject),
    )


# Guarding and heartbeat


@CHAPTER.clause("7.2.8.2.2", "Heartbeat or guarding", Tier.REVERSIBLE, "7.202, 7.203, 7.205")
def _one_of_both(subject: Subject) -> Iterator[Data]:
    name, why = "with a heartbeat it is not guarded", _why_not_guarded(subject)
    if not why and not (subject.may_be(HEARTBEAT_TIME, SLOW) and subject.may_be(HEARTBEAT_TIME, 0)):
        why = "the file has no heartbeat time (0x1017) that can be 0 and 5 s"
    if why:
        yield skip(name, why)
        return
    own = remote(_own(subject))
    yield group(
        name,
        *fresh(subject),
        write(f"a heartbeat every {SLOW} ms", HEARTBEAT_TIME, value=SLOW),
        wait("20 ms"),
        own,
        never("no answer to a remote frame", _answer(subject), QUIET),
        write("no heartbeat", HEARTBEAT_TIME, value=0),
        wait("20 ms"),
        own,
        expect("without one it is guarded again", _answer(subject), QUIET),
        *fresh(subject),
    )


@CHAPTER.clause("7.2.8.2.2", "Heartbeat or guarding", Tier.DESTRUCTIVE, "7.206, 7.207")
def _heartbeat_instead(subject: Subject) -> Iterator[Data]:
    """Change from guarding to the heartbeat: the heartbeat's bit 7 is 0, and the master is not missed."""
    name, why = "the heartbeat takes guarding's place", _why_no_life(subject)
    if not why and not (subject.may_be(HEARTBEAT_TIME, BEAT) and subject.may_be(HEARTBEAT_TIME, SLOW)):
        why = f"the file has no heartbeat time (0x1017) that can be {BEAT} and {SLOW} ms"
    if why:
        yield skip(name, why)
        return
    # A heartbeat has no toggle bit: bit 7 is reserved and 0 (CiA 301, 7.2.8.3.2.2).
    (state,) = error_control(subject.node_id, NmtState.PRE_OPERATIONAL).data
    guarded = group("guarded", remote(_own(subject)), expect("answer", _answer(subject), QUIET))
    beats = expect("a heartbeat, its toggle bit always 0", _answer(subject, f"{state:02X}"), QUIET)
    yield group(
        name,
        *fresh(subject),
        *_no_heartbeat(subject),
        *_life_times(),
        guarded,
        write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=BEAT),
        {**beats, "repeat": 4},
        _missed("the master is not missed", "1 s"),
        write(f"a heartbeat every {SLOW} ms", HEARTBEAT_TIME, value=SLOW),
        wait("20 ms"),
        remote(_own(subject)),
        never("no answer to a remote frame", _answer(subject), QUIET),
        *fresh(subject),
    )


# Heartbeat consumer


def _why_not_watching(subject: Subject, *others: Address) -> str:
    """Say why the device cannot be made to watch another node; nothing if it can be."""
    for address in (FIRST, *others):
        used = subject.number((CONSUMED_HEARTBEATS, 0)) >= address[1]
        if not used or not subject.may_be(address, _entry(subject, WATCHED + len(others))):
            return f"the file has no consumer heartbeat time (0x1016:{address[1]}) that can be written"
    return ""


def _entry(subject: Subject, milliseconds: int = WATCHED) -> int:
    # Bits 16 to 23 are the node-ID, the lower half the time in ms; the highest byte is reserved (CiA 301, 7.5.2.19).
    return subject.another << 16 | milliseconds


def _watched(subject: Subject, milliseconds: int = WATCHED) -> Iterator[Data]:
    yield from fresh(subject)
    value = hexadecimal(_entry(subject, milliseconds), 8)
    yield write(f"watch node {subject.another}, {milliseconds} ms", FIRST, value=value)


def _beats(subject: Subject, state: NmtState = NmtState.OPERATIONAL) -> Data:
    # The tester plays that node, whose node-ID nobody on the bus has: whoever else watches nodes is not confused.
    return sent("heartbeat", *error_control(subject.another, state))


def _alive(subject: Subject) -> Data:
    """Send heartbeats faster than the device wants them."""
    beat = group("alive", _beats(subject), _missed("not missed", f"{WATCHED // 2} ms"))
    return {**beat, "repeat": 5}


@CHAPTER.clause("7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE, "7.104")
def _twice(subject: Subject) -> Iterator[Data]:
    why = _why_not_watching(subject, SECOND)
    if why:
        yield skip("a node is watched once", why)
        return
    again = hexadecimal(_entry(subject, WATCHED + 1), 8)
    # CiA 301 names 0x06040043 (7.5.2.19); the other codes refuse it as well, and are in use.
    refused = codes(AbortCode.INCOMPATIBLE, AbortCode.VALUE, AbortCode.GENERAL, AbortCode.STATE)
    second = write("the same node in the second entry", SECOND, value=again, abort=refused)
    yield group("a node is watched once", *_watched(subject), second, *fresh(subject))


@CHAPTER.clause("7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE, "7.105")
def _faster(subject: Subject) -> Iterator[Data]:
    yield from _watching(subject, "heartbeats in time", _missed("not before the first", ONCE), _alive(subject))


@CHAPTER.clause("7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE, "7.106")
def _slower(subject: Subject) -> Iterator[Data]:
    yield from _watching(subject, "heartbeats too late", *_lost(subject), _missed("it is reported once", ONCE))


@CHAPTER.clause("7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE, "7.107")
def _restarted(subject: Subject) -> Iterator[Data]:
    # A boot-up shows that the node was away: its consumer begins anew with the heartbeats that follow.
    boot = sent("boot-up of that node", *error_control(subject.another, NmtState.INITIALISING))
    yield from _watching(subject, "a node that boots", *_lost(subject), boot, _alive(subject), *_lost(subject))


def _lost(subject: Subject) -> Iterator[Data]:
    yield _beats(subject)
    # Missed can only be who was heard: the time begins with the first heartbeat (CiA 301, 7.2.8.3.2.2).
    yield emcy("EMCY: its heartbeat is missed", ErrorCode.HEARTBEAT_LOST)


def _watching(subject: Subject, name: str, *steps: Data) -> Iterator[Data]:
    why = _why_not_watching(subject) or subject.why_no_emcy
    if why:
        yield skip(name, why)
    else:
        yield group(name, *_watched(subject), *steps, *fresh(subject))
