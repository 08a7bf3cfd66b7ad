"""NMT: states, commands, boot-up and heartbeat (CiA 301, 7.2.8 and 7.3.2); node guarding and the heartbeat consumer.

How heartbeat and guarding exclude each other stands in 7.2.8.2.2.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, Lacks, Subject, Tier, awake, fresh, need, settable
from eurobot_od.check.conformance.step import Data, Steps, codes, hexadecimal, title
from eurobot_od.device.nmt import STATE_NAMES, TOGGLE, NmtState, boot_state, error_control
from eurobot_od.od import standard
from eurobot_od.od.objects import address_of, in_limits, limits
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, GUARD_TIME, HEARTBEAT_TIME, LIFE_TIME_FACTOR, ErrorCode
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, label
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

CHAPTER: Chapter[Subject] = Chapter("nmt", "NMT states, boot-up and heartbeat")

BEAT, SLOW = 100, 5000
"""Heartbeat times, ms: one with which states are watched, and one after which none comes while a step looks."""

QUIET = "300 ms"
"""How long nothing may come where nothing may."""

LONGEST_PERIOD = 5000
"""Longest heartbeat time of a file that is measured, ms."""

SLOWEST = 2 * BEAT
"""A state is watched by heartbeats of at most this time, ms."""

NO_HEARTBEAT = (
    f"the file has no producer heartbeat time (0x1017) that can be read, written, put back and be 1 to {SLOWEST} ms"
)

ANY: Data = {"heartbeat": "any"}

WALK = "start", "stop", "pre-operational", "stop", "start", "pre-operational"
"""Commands one after the other, from PRE-OPERATIONAL on: every way from state to state."""

LEADS_TO = {"start": "operational", "stop": "stopped", "pre-operational": "pre-operational"}
"""The state after a command."""

ASKED_BY = {"pre-operational": "10.2", "start": "10.3", "stop": "10.4"}
"""Numbers of CiA's tool by command."""

WAY_TO = {"pre-operational": (), "operational": ("start",), "stopped": ("stop",)}
"""Commands that lead to a state from PRE-OPERATIONAL."""


def _beating(subject: Subject, name: str, *steps: Data) -> Data:
    """Do some steps while the device says its state often enough to be watched."""
    try:
        time = _heartbeat_time(subject)
    except Lacks as lack:
        return step.skip(name, str(lack))
    # A node says its state only in its heartbeat (CiA 301, 7.2.8.3.2); many devices have none by default, or one a
    # second.
    faster = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=_allowed(time, BEAT))
    return step.keeping(name, time, faster, *steps)


def _heartbeat_time(subject: Subject) -> ODVariable:
    """Return 0x1017 if it can be set, put back, and be fast enough to watch a state; raises Lacks."""
    time = need(subject.settable(HEARTBEAT_TIME), NO_HEARTBEAT)
    need(0 < _allowed(time, BEAT) <= SLOWEST, NO_HEARTBEAT)
    return time


def _allowed(variable: ODVariable, value: int) -> int:
    """Return the value nearest to one that an object takes."""
    range_ = limits(variable)
    return value if range_ is None else int(min(max(value, range_.low), range_.high))


# Errors of its own


@Clause(CHAPTER, "7.5.2.2", "Error register", ctt="5.2")
def _errors(_: Subject) -> Steps:
    """See that the device has no error to begin with: what is red afterwards may come from it."""
    # First of all: a short circuit, or a bus that was unplugged, would make steps red that have nothing to do with it.
    return [{"name": "the device reports no error itself", "errors": "none"}]


# Boot-up


@Clause(CHAPTER, "7.2.8.3.3", "Boot-up", Tier.REVERSIBLE, "10.1")
def _boot_ups(_: Subject) -> Steps:
    for command, (state, way) in product(("reset", "reset communication"), WAY_TO.items()):
        there = [step.nmt(each) for each in ("pre-operational", *way)]
        name = f"boot-up after {command} in {state.upper()}"
        # The boot-up comes at the change from Initialisation to PRE-OPERATIONAL, whatever state the node was in before
        # (CiA 301, 7.2.8.3.3); a node that is STOPPED hears the command as well.
        yield step.group(name, *there, step.nmt(command), step.booted(f"after {command}"))


# Heartbeat


@Clause(CHAPTER, "7.5.2.20", "Heartbeat time", name="it can be changed")
def _heartbeat_times(subject: Subject) -> Steps:
    time = _heartbeat_time(subject)
    beat = _allowed(time, BEAT)
    slower = step.write(f"{SLOW} ms", HEARTBEAT_TIME, value=_allowed(time, SLOW))
    faster = step.write(f"{beat} ms", HEARTBEAT_TIME, value=beat)
    # From a long time to a short one: a device that first lets the old time run out takes up to 5 s.
    first = step.expect("a heartbeat after the new time", ANY, f"{2 * beat} ms")
    change = step.keeping("a change counts at once", time, slower, step.wait("20 ms"), faster, first)
    yield step.asking("7.101", change)
    beats = step.keeping("heartbeats come at their time", time, faster, step.every(ANY, beat, 5))
    yield step.asking("7.102", beats)
    # 0 means no heartbeat (CiA 301, 7.5.2.20), but a maker may forbid it by LowLimit: then there is nothing to look at.
    if in_limits(time, 0):
        none = step.write("0: no heartbeat", HEARTBEAT_TIME, value=0)
        silent = step.never("silent", ANY, QUIET)
        yield step.asking("7.103", step.keeping("0 ends it", time, faster, none, step.wait("20 ms"), silent))


@Clause(CHAPTER, "7.2.8.3.2", "Heartbeat", Tier.REVERSIBLE, group="as the file says")
def _heartbeat_of_the_file(subject: Subject) -> Steps:
    period = subject.number(HEARTBEAT_TIME)
    # Two periods are measured, and a suite is to end: a device with one beat a minute is not worth two minutes here.
    need(0 < period <= LONGEST_PERIOD, f"the file has no heartbeat time from 1 to {LONGEST_PERIOD} ms")
    return [*fresh("reset"), step.every(ANY, period, 2)]


@Clause(CHAPTER, "7.3.2.2", "NMT state", Tier.REVERSIBLE)
def _first_state(subject: Subject) -> Steps:
    # By itself means PRE-OPERATIONAL, unless 0x1F80 of the file says that the device starts on its own (CiA 302-2).
    state = STATE_NAMES[boot_state(subject.dictionary.default(standard.NMT_STARTUP))]
    beating = _beating(subject, f"{state} by itself after a reset", step.heartbeat(state))
    yield step.group("after a reset", step.nmt("reset"), step.booted(), beating)
    yield step.nmt("pre-operational")


# Commands


@Clause(CHAPTER, "7.2.8.2.1", "NMT commands", Tier.REVERSIBLE)
def _walk(subject: Subject) -> Steps:
    before = "pre-operational"
    for command in WALK:
        state = LEADS_TO[command]
        commands = [*map(step.nmt, WAY_TO[before]), step.nmt(command), step.heartbeat(state)]
        # An SDO server is silent in STOPPED (CiA 301, 7.3.2.2.4): the heartbeat time could be neither set nor put back.
        back = [] if state == "pre-operational" else step.undoing(step.nmt("pre-operational"))
        walked = _beating(subject, f"{command} in {before.upper()}", *commands, *back)
        yield step.asking(ASKED_BY[command], walked)
        before = state


@Clause(CHAPTER, "7.2.8.2.1", "NMT commands", Tier.DESTRUCTIVE)
def _other_commands(subject: Subject) -> Steps:
    stays = step.never("stays", {"heartbeat": "operational"}, QUIET)
    for name, data in (
        ("another node's command does not matter", bytes([1, subject.another])),
        ("an unknown command does not matter", bytes([0x77, subject.dictionary.node_id])),
        # An NMT frame has two bytes; with one of them a device would have to guess whom it is for.
        ("half a command does not matter", bytes([1])),
    ):
        sent = step.sent(f"NMT {data.hex(' ').upper()}", NMT_COB_ID, data)
        yield _beating(subject, name, sent, stays, step.heartbeat("any"))
    # Node-ID 0 is for all nodes (CiA 301, 7.2.8.2.1). PRE-OPERATIONAL, because every other node on the bus hears it
    # too.
    started = [step.nmt("start"), step.heartbeat("operational")]
    to_all = step.sent("NMT pre-operational to all", NMT_COB_ID, bytes([0x80, 0]))
    yield _beating(subject, "a command to all nodes", *started, to_all, step.heartbeat("pre-operational"))


# Services


@Clause(CHAPTER, "7.3.2.2.4", "NMT state", Tier.REVERSIBLE)
def _services(subject: Subject) -> Steps:
    # An upload: whatever a device in STOPPED makes of it, nothing is written.
    request = {"name": "a request", **subject.request(initiate(ClientCommand.UPLOAD << 5, subject.probe))}
    answered = awake(subject, "an SDO is answered")
    yield step.asking("9.2", step.group("SDO in PRE-OPERATIONAL", answered))
    (pause,) = step.undoing(step.nmt("pre-operational"))
    yield step.asking("9.3", step.group("SDO in OPERATIONAL", step.nmt("start"), answered, pause))
    silent = step.never("no answer", subject.answer("?" * 16), QUIET)
    stopped = *step.commanded("stop"), request, silent, pause, answered
    yield step.asking("9.4", step.group("no SDO in STOPPED", *stopped))


# Error control

CHANGED = (HEARTBEAT_TIME, GUARD_TIME, LIFE_TIME_FACTOR, *((CONSUMED_HEARTBEATS, sub) for sub in (1, 2)))

# Whatever may have begun life guarding, which begins with the first remote frame, ends with a reset of the
# communication: hence one around each group.
GUARDED: Chapter[Subject] = Chapter("error-control", "node guarding and heartbeat consumer", fresh=True, change=CHANGED)

GUARD, FACTOR = 100, 3
"""A guard time in ms and a life time factor: the master is missed after 0.3 s."""

WATCHED = 200
"""How long the device waits for another node's heartbeat, ms."""

ONCE = "500 ms"

NOT_GUARDED = "the file has no guard time (0x100C)"
NOT_WRITTEN = "the file has no 0x100C and 0x100D that can be written"


# Guarding


@Clause(GUARDED, "7.5.2.11", "Guard time", ctt="7.1")
def _times(subject: Subject) -> Steps:
    for address, lack in ((GUARD_TIME, NOT_GUARDED), (LIFE_TIME_FACTOR, "the file has no life time factor (0x100D)")):
        found, name = subject.find(address), f"0x{address[0]:04X}"
        if found is None or not found.readable:
            yield step.skip(name, lack if found is None else f"{name} cannot be read")
        else:
            yield step.read(title(found), address, data="any")


@Clause(GUARDED, "7.5.2.11", "Guard time", ctt="7.201", name="heartbeat and guarding")
def _both_kinds(subject: Subject) -> Steps:
    found = [subject.readable(each) for each in (HEARTBEAT_TIME, GUARD_TIME, LIFE_TIME_FACTOR)]
    need(all(found), "the file has not all of 0x1017, 0x100C and 0x100D")
    reads = (step.read(title(each), address_of(each), data="any") for each in found if each is not None)
    yield step.group("heartbeat and guarding", *reads)


@Clause(GUARDED, "7.5.2.20", "Heartbeat time", ctt="7.204", name="without guarding")
def _unguarded(subject: Subject) -> Steps:
    need(subject.find(GUARD_TIME), NOT_GUARDED)
    need(not subject.number(GUARD_TIME), "the file has a guard time (0x100C) from the start")
    time = _heartbeat_time(subject)
    faster = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=_allowed(time, BEAT))
    yield step.keeping("without guarding", time, faster, {**step.heartbeat("any"), "repeat": 2})


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
    # A device may send the first heartbeat as soon as it has the new time; this one must not be taken for an answer.
    return [step.write(name, HEARTBEAT_TIME, value=milliseconds), step.wait("200 ms")]


ASKED = (
    ("", NmtState.PRE_OPERATIONAL),
    ("", NmtState.PRE_OPERATIONAL),
    ("start", NmtState.OPERATIONAL),
    ("stop", NmtState.STOPPED),
    ("pre-operational", NmtState.PRE_OPERATIONAL),
)
"""NMT commands, each before a remote frame, and the state in which that finds the device."""

GUARDING = GUARDED, "7.2.8.3.2.1", "Node guarding"
NOT_ITS_OWN = "another node's identifier is not answered"


@Clause(*GUARDING, Tier.REVERSIBLE, "7.2, 7.3", name="a remote frame is answered", needs=[_guarding, _patient])
def _guarded(subject: Subject) -> Steps:
    """Ask in every state; after a reset of the communication the toggle bit begins with 0."""
    steps = [*_no_heartbeat(subject)]
    for number, (command, state) in enumerate(ASKED):
        steps += step.commanded(command) if command else []
        # Bit 7 alternates from answer to answer, so that a master notices one that it has seen before (CiA 301,
        # 7.2.8.3.2.1).
        answer = _answer(subject, f"{state | TOGGLE * (number % 2):02X}")
        said = f"{number + 1}. {state.name.replace('_', '-')}, toggle bit {number % 2}"
        asked = step.remote(_own(subject)), step.expect(said, answer)
        steps += [step.asking("7.3" if number else "7.2", each) for each in asked]
    yield GUARDED.group(subject, "each remote frame is answered with the state and the next toggle bit", steps)


@Clause(*GUARDING, Tier.DESTRUCTIVE, "7.4", name=NOT_ITS_OWN, needs=[_guarding])
def _other_identifier(subject: Subject) -> Steps:
    # A device that compares only a part of the identifier would answer for its neighbours, and hide that one is
    # missing.
    asked = step.remote(ERROR_CONTROL_BASE + subject.another)
    silent = step.never("no answer", _answer(subject), QUIET)
    return [GUARDED.group(subject, NOT_ITS_OWN, [*_no_heartbeat(subject), asked, silent])]


LIFE_GUARDING = GUARDED, "7.5.2.12", "Life guarding", Tier.DESTRUCTIVE
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


@Clause(*LIFE_GUARDING, "7.5", group="both are written", needs=GUARDING_FOR_LIFE)
def _both_times(subject: Subject) -> Steps:
    yield from _life_times(subject)
    yield step.read("guard time", GUARD_TIME, expect=GUARD)
    yield step.read("life time factor", LIFE_TIME_FACTOR, expect=FACTOR)


@Clause(*LIFE_GUARDING, "7.6", group="the master is missed", needs=GUARDING_FOR_LIFE)
def _life_guarding(subject: Subject) -> Steps:
    yield from _life_times(subject)
    yield _missed("not before its first remote frame", ONCE)
    # Longer in all than the life time, so that it is the questions which keep the device from missing its master.
    yield {**_asked(subject, _missed("the master is not missed", f"{GUARD} ms")), "repeat": 4}
    yield step.emcy("EMCY: the life time is over", ErrorCode.HEARTBEAT_LOST)
    yield _missed("it is reported once", ONCE)
    yield step.remote(_own(subject))
    yield step.expect("a remote frame is answered again", _answer(subject))


def _asked(subject: Subject, *more: Data) -> Data:
    answer = step.expect("answer", _answer(subject))
    return step.group("guarded", step.remote(_own(subject)), answer, *more)


# Guarding and heartbeat

ONE = GUARDED, "7.2.8.2.2", "Heartbeat or guarding", Tier.REVERSIBLE
OTHER = GUARDED, "7.2.8.2.2", "Heartbeat or guarding", Tier.DESTRUCTIVE
SLOW_OR_NONE = settable(HEARTBEAT_TIME, SLOW, 0, lack="the file has no heartbeat time (0x1017) that can be 0 and 5 s")
BEATS = f"the file has no heartbeat time (0x1017) that can be {BEAT} and {SLOW} ms"


EITHER_MAY_BE = [_guarding, SLOW_OR_NONE]
INSTEAD = [*GUARDING_FOR_LIFE, settable(HEARTBEAT_TIME, BEAT, SLOW, lack=BEATS)]


@Clause(*ONE, "7.202, 7.203, 7.205", group="with a heartbeat it is not guarded", needs=EITHER_MAY_BE)
def _one_of_both(subject: Subject) -> Steps:
    yield from _not_guarded(subject, "7.205")
    yield from (step.asking("7.202", each) for each in _heartbeat("no heartbeat", 0))
    guarded = step.remote(_own(subject)), step.expect("without one it is guarded again", _answer(subject))
    yield from (step.asking("7.203", each) for each in guarded)


def _not_guarded(subject: Subject, number: str) -> Steps:
    """See that the device is not guarded, with a heartbeat so slow that none is taken for an answer."""
    yield from _heartbeat(f"a heartbeat every {SLOW} ms", SLOW)
    silent = step.remote(_own(subject)), step.never("no answer to a remote frame", _answer(subject), QUIET)
    yield from (step.asking(number, each) for each in silent)


@Clause(*OTHER, "7.206, 7.207", group="the heartbeat takes guarding's place", needs=INSTEAD)
def _heartbeat_instead(subject: Subject) -> Steps:
    """Change from guarding to the heartbeat: the heartbeat's bit 7 is 0, and the master is not missed."""
    yield from _life_times(subject)
    yield _asked(subject)
    beating = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=BEAT)
    # A heartbeat has no toggle bit: bit 7 is reserved and 0 (CiA 301, 7.2.8.3.2.2).
    beat = _answer(subject, f"{NmtState.PRE_OPERATIONAL:02X}")
    comes = {**step.expect("a heartbeat, its toggle bit always 0", beat, QUIET), "repeat": 4}
    yield from (step.asking("7.206", each) for each in (beating, comes, _missed("the master is not missed", "1 s")))
    yield from _not_guarded(subject, "7.207")


# Heartbeat consumer

CONSUMER = GUARDED, "7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE


def _watching(count: int) -> Callable[[Subject], None]:
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


@Clause(*CONSUMER, "7.104", group="a node is watched once", needs=[_watching(2)])
def _twice(subject: Subject) -> Steps:
    # CiA 301 names 0x06040043 (7.5.2.19); the other codes refuse it as well, and are in use.
    refused = codes(AbortCode.INCOMPATIBLE, AbortCode.VALUE, AbortCode.GENERAL, AbortCode.STATE)
    again = _watch(subject, "the same node in the second entry", 2, WATCHED + 1, abort=refused)
    return [_watched(subject), again]


@Clause(*CONSUMER, "7.105", group="heartbeats in time", needs=WATCHING)
def _faster(subject: Subject) -> Steps:
    return [_watched(subject), _missed("not before the first", ONCE), _alive(subject)]


@Clause(*CONSUMER, "7.106", group="heartbeats too late", needs=WATCHING)
def _slower(subject: Subject) -> Steps:
    return [_watched(subject), *_lost(subject), _missed("it is reported once", ONCE)]


@Clause(*CONSUMER, "7.107", group="a node that boots", needs=WATCHING)
def _restarted(subject: Subject) -> Steps:
    # A boot-up shows that the node was away: its consumer begins anew with the heartbeats that follow.
    boot = step.sent("boot-up of that node", *error_control(subject.another, NmtState.INITIALISING))
    return [_watched(subject), *_lost(subject), boot, _alive(subject), *_lost(subject)]
