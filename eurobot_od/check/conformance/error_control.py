"""Error control: node guarding, the heartbeat consumer, and how they exclude each other (CiA 301, 7.2.8.2.2)."""

from __future__ import annotations

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Need, Subject, Tier, need, settable
from eurobot_od.check.conformance.step import Data, Steps, codes, hexadecimal, title
from eurobot_od.device.nmt import TOGGLE, NmtState, error_control
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, GUARD_TIME, HEARTBEAT_TIME, LIFE_TIME_FACTOR, ErrorCode
from eurobot_od.od.values import ERROR_CONTROL_BASE, label
from eurobot_od.sdo.wire import AbortCode

CHANGED = (HEARTBEAT_TIME, GUARD_TIME, LIFE_TIME_FACTOR, *((CONSUMED_HEARTBEATS, sub) for sub in (1, 2)))

# Whatever may have begun life guarding, which begins with the first remote frame, ends with a reset of the
# communication: hence one around each group.
CHAPTER: Chapter[Subject] = Chapter("error-control", "node guarding and heartbeat consumer", fresh=True, change=CHANGED)

GUARD, FACTOR = 100, 3
"""A guard time in ms and a life time factor: the master is missed after 0.3 s."""

BEAT, SLOW = 100, 5000
"""Heartbeat times of the device, ms: one that is seen, and one that is not while a step looks."""

WATCHED = 200
"""How long the device waits for another node's heartbeat, ms."""

QUIET, ONCE = "300 ms", "500 ms"

NOT_GUARDED = "the file has no guard time (0x100C)"
NOT_WRITTEN = "the file has no 0x100C and 0x100D that can be written"


# Guarding


@CHAPTER.clause("7.5.2.11", "Guard time", ctt="7.1, 7.201")
def _times(subject: Subject) -> Steps:
    for address, lack in ((GUARD_TIME, NOT_GUARDED), (LIFE_TIME_FACTOR, "the file has no life time factor (0x100D)")):
        found, name = subject.find(address), f"0x{address[0]:04X}"
        if found is None or not found.readable:
            yield step.skip(name, lack if found is None else f"{name} cannot be read")
        else:
            yield step.read(title(found), address, data="any")


def _guarding(subject: Subject) -> None:
    """Need a device that can be guarded."""
    need(subject.find(GUARD_TIME), NOT_GUARDED)
    # Heartbeat and guarding exclude each other; if both are configured, the heartbeat wins (CiA 301, 7.2.8.2.2).
    ends = not subject.number(HEARTBEAT_TIME) or subject.may_be(HEARTBEAT_TIME, 0)
    need(ends, "the file's heartbeat (0x1017) cannot be ended, and a device that has one is not guarded")


def _patient(subject: Subject) -> None:
    """Need a device that does not wait for the next remote frame: the steps are not made to keep up."""
    waits = subject.number(GUARD_TIME) and subject.number(LIFE_TIME_FACTOR)
    need(not waits, "the file's life guarding is on: once it is asked, the device may leave OPERATIONAL by itself")


def _own(subject: Subject) -> int:
    return ERROR_CONTROL_BASE + subject.dictionary.node_id


def _answer(subject: Subject, digits: str = "??") -> Data:
    return {"raw": f"{_own(subject):03X}#{digits}"}


def _no_heartbeat(subject: Subject) -> Steps:
    return _heartbeat("no heartbeat", 0) if subject.number(HEARTBEAT_TIME) else []


def _heartbeat(name: str, milliseconds: int) -> Steps:
    return [step.write(name, HEARTBEAT_TIME, value=milliseconds), step.wait("20 ms")]


ASKED = (
    ("", NmtState.PRE_OPERATIONAL),
    ("", NmtState.PRE_OPERATIONAL),
    ("start", NmtState.OPERATIONAL),
    ("stop", NmtState.STOPPED),
    ("pre-operational", NmtState.PRE_OPERATIONAL),
)
"""NMT commands, each before a remote frame, and the state in which that finds the device."""

GUARDING = "7.2.8.3.2.1", "Node guarding"
NOT_ITS_OWN = "another node's identifier is not answered"


@CHAPTER.clause(*GUARDING, Tier.REVERSIBLE, "7.2, 7.3", name="a remote frame is answered", needs=[_guarding, _patient])
def _guarded(subject: Subject) -> Steps:
    """Ask in every state; after a reset of the communication the toggle bit begins with 0."""
    steps = [*_no_heartbeat(subject)]
    for number, (command, state) in enumerate(ASKED):
        steps += [step.nmt(command), step.wait("50 ms")] if command else []
        # Bit 7 alternates from answer to answer, so that a master notices one that it has seen before (CiA 301,
        # 7.2.8.3.2.1).
        answer = _answer(subject, f"{state | TOGGLE * (number % 2):02X}")
        said = f"{number + 1}. {state.name.replace('_', '-')}, toggle bit {number % 2}"
        steps += [step.remote(_own(subject)), step.expect(said, answer, QUIET)]
    yield CHAPTER.group(subject, "each remote frame is answered with the state and the next toggle bit", steps)


@CHAPTER.clause(*GUARDING, Tier.DESTRUCTIVE, "7.4", name=NOT_ITS_OWN, needs=[_guarding])
def _other_identifier(subject: Subject) -> Steps:
    # A device that compares only a part of the identifier would answer for its neighbours, and hide that one is
    # missing.
    asked = step.remote(ERROR_CONTROL_BASE + subject.another)
    silent = step.never("no answer", _answer(subject), QUIET)
    return [CHAPTER.group(subject, NOT_ITS_OWN, [*_no_heartbeat(subject), asked, silent])]


LIFE_GUARDING = "7.5.2.12", "Life guarding", Tier.DESTRUCTIVE
GUARDING_FOR_LIFE = (
    _guarding,
    settable(GUARD_TIME, GUARD, lack=NOT_WRITTEN),
    settable(LIFE_TIME_FACTOR, FACTOR, lack=NOT_WRITTEN),
    Subject.need_prompt_emcy,
)


def _life_times(subject: Subject) -> Steps:
    guard = step.write(f"guard time {GUARD} ms", GUARD_TIME, value=GUARD)
    return [*_no_heartbeat(subject), guard, step.write(f"life time factor {FACTOR}", LIFE_TIME_FACTOR, value=FACTOR)]


def _missed(name: str, span: str) -> Data:
    return step.never(name, {"emcy": hexadecimal(ErrorCode.HEARTBEAT_LOST)}, span)


@CHAPTER.clause(*LIFE_GUARDING, "7.5", group="both are written", needs=GUARDING_FOR_LIFE)
def _both_times(subject: Subject) -> Steps:
    yield from _life_times(subject)
    yield step.read("guard time", GUARD_TIME, expect=GUARD)
    yield step.read("life time factor", LIFE_TIME_FACTOR, expect=FACTOR)


@CHAPTER.clause(*LIFE_GUARDING, "7.6", group="the master is missed", needs=GUARDING_FOR_LIFE)
def _life_guarding(subject: Subject) -> Steps:
    yield from _life_times(subject)
    yield _missed("not before its first remote frame", ONCE)
    # Longer in all than the life time, so that it is the questions which keep the device from missing its master.
    yield {**_asked(subject, f"{GUARD} ms", _missed("the master is not missed", f"{GUARD} ms")), "repeat": 4}
    yield step.emcy("EMCY: the life time is over", ErrorCode.HEARTBEAT_LOST)
    yield _missed("it is reported once", ONCE)
    yield step.remote(_own(subject))
    yield step.expect("a remote frame is answered again", _answer(subject), QUIET)


def _asked(subject: Subject, within: str, *more: Data) -> Data:
    answer = step.expect("answer", _answer(subject), within)
    return step.group("guarded", step.remote(_own(subject)), answer, *more)


# Guarding and heartbeat

ONE = "7.2.8.2.2", "Heartbeat or guarding", Tier.REVERSIBLE
OTHER = "7.2.8.2.2", "Heartbeat or guarding", Tier.DESTRUCTIVE
SLOW_OR_NONE = settable(HEARTBEAT_TIME, SLOW, 0, lack="the file has no heartbeat time (0x1017) that can be 0 and 5 s")
BEATS = f"the file has no heartbeat time (0x1017) that can be {BEAT} and {SLOW} ms"


EITHER_MAY_BE = [_guarding, SLOW_OR_NONE]
INSTEAD = [*GUARDING_FOR_LIFE, settable(HEARTBEAT_TIME, BEAT, SLOW, lack=BEATS)]


@CHAPTER.clause(*ONE, "7.202, 7.203, 7.205", group="with a heartbeat it is not guarded", needs=EITHER_MAY_BE)
def _one_of_both(subject: Subject) -> Steps:
    yield from _not_guarded(subject)
    yield from _heartbeat("no heartbeat", 0)
    yield step.remote(_own(subject))
    yield step.expect("without one it is guarded again", _answer(subject), QUIET)


def _not_guarded(subject: Subject) -> Steps:
    """See that the device is not guarded, with a heartbeat so slow that none is taken for an answer."""
    yield from _heartbeat(f"a heartbeat every {SLOW} ms", SLOW)
    yield step.remote(_own(subject))
    yield step.never("no answer to a remote frame", _answer(subject), QUIET)


@CHAPTER.clause(*OTHER, "7.206, 7.207", group="the heartbeat takes guarding's place", needs=INSTEAD)
def _heartbeat_instead(subject: Subject) -> Steps:
    """Change from guarding to the heartbeat: the heartbeat's bit 7 is 0, and the master is not missed."""
    yield from _life_times(subject)
    yield _asked(subject, QUIET)
    yield step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=BEAT)
    # A heartbeat has no toggle bit: bit 7 is reserved and 0 (CiA 301, 7.2.8.3.2.2).
    beat = _answer(subject, f"{NmtState.PRE_OPERATIONAL:02X}")
    yield {**step.expect("a heartbeat, its toggle bit always 0", beat, QUIET), "repeat": 4}
    yield _missed("the master is not missed", "1 s")
    yield from _not_guarded(subject)


# Heartbeat consumer

CONSUMER = "7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE


def _watching(count: int) -> Need[Subject]:
    """Need a device that can be made to watch another node with each of its first entries."""

    def watching(subject: Subject) -> None:
        for address in ((CONSUMED_HEARTBEATS, sub) for sub in range(1, count + 1)):
            used = subject.number((CONSUMED_HEARTBEATS, 0)) >= address[1]
            can = used and subject.may_be(address, _entry(subject, WATCHED + count - 1))
            need(can, f"the file has no consumer heartbeat time ({label(address)}) that can be written")

    return watching


WATCHING = (_watching(1), Subject.need_prompt_emcy)


def _entry(subject: Subject, milliseconds: int) -> int:
    # Bits 16 to 23 are the node-ID, the lower half the time in ms; the highest byte is reserved (CiA 301, 7.5.2.19).
    return subject.another << 16 | milliseconds


def _watch(subject: Subject, name: str, sub: int, milliseconds: int = WATCHED, **more: object) -> Data:
    value = hexadecimal(_entry(subject, milliseconds), 8)
    return step.write(name, (CONSUMED_HEARTBEATS, sub), value=value, **more)


def _watched(subject: Subject) -> Data:
    return _watch(subject, f"watch node {subject.another}, {WATCHED} ms", 1)


def _beats(subject: Subject) -> Data:
    # The tester plays that node, whose node-ID nobody on the bus has: whoever else watches nodes is not confused.
    return step.sent("heartbeat", *error_control(subject.another, NmtState.OPERATIONAL))


def _alive(subject: Subject) -> Data:
    """Send heartbeats faster than the device wants them."""
    return {**step.group("alive", _beats(subject), _missed("not missed", f"{WATCHED // 2} ms")), "repeat": 5}


def _lost(subject: Subject) -> Steps:
    # Missed can only be who was heard: the time begins with the first heartbeat (CiA 301, 7.2.8.3.2.2).
    return [_beats(subject), step.emcy("EMCY: its heartbeat is missed", ErrorCode.HEARTBEAT_LOST)]


@CHAPTER.clause(*CONSUMER, "7.104", group="a node is watched once", needs=[_watching(2)])
def _twice(subject: Subject) -> Steps:
    # CiA 301 names 0x06040043 (7.5.2.19); the other codes refuse it as well, and are in use.
    refused = codes(AbortCode.INCOMPATIBLE, AbortCode.VALUE, AbortCode.GENERAL, AbortCode.STATE)
    again = _watch(subject, "the same node in the second entry", 2, WATCHED + 1, abort=refused)
    return [_watched(subject), again]


@CHAPTER.clause(*CONSUMER, "7.105", group="heartbeats in time", needs=WATCHING)
def _faster(subject: Subject) -> Steps:
    return [_watched(subject), _missed("not before the first", ONCE), _alive(subject)]


@CHAPTER.clause(*CONSUMER, "7.106", group="heartbeats too late", needs=WATCHING)
def _slower(subject: Subject) -> Steps:
    return [_watched(subject), *_lost(subject), _missed("it is reported once", ONCE)]


@CHAPTER.clause(*CONSUMER, "7.107", group="a node that boots", needs=WATCHING)
def _restarted(subject: Subject) -> Steps:
    # A boot-up shows that the node was away: its consumer begins anew with the heartbeats that follow.
    boot = step.sent("boot-up of that node", *error_control(subject.another, NmtState.INITIALISING))
    return [_watched(subject), *_lost(subject), boot, _alive(subject), *_lost(subject)]
