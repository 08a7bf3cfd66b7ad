"""NMT: states, commands, boot-up and heartbeat (CiA 301, 7.2.8 and 7.3.2); node guarding and the heartbeat consumer.

Clause 7.2.8.2.2 says how heartbeat and guarding exclude each other.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import (
    Chapter,
    Clause,
    DeviceUnderTest,
    Lacks,
    Tier,
    awake,
    fresh,
    need,
    settable,
)
from eurobot_od.check.conformance.step import Data, Steps, codes, hexadecimal, title
from eurobot_od.device.nmt import STATE_NAMES, TOGGLE, NmtState, boot_state, error_control
from eurobot_od.od import standard
from eurobot_od.od.objects import address_of, in_limits, limits
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, GUARD_TIME, HEARTBEAT_TIME, LIFE_TIME_FACTOR, ErrorCode
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, label
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

CHAPTER: Chapter[DeviceUnderTest] = Chapter("nmt", "NMT states, boot-up and heartbeat")

BEAT, SLOW = 100, 5000
"""Heartbeat times in ms: a short one to follow states, and one longer than any step."""

QUIET = "300 ms"
"""For how long a forbidden frame is waited for."""

LONGEST_PERIOD = 5000
"""Maximum heartbeat time of a file that is measured, in ms."""

SLOWEST = 2 * BEAT
"""Maximum heartbeat time by which states are followed, in ms."""

NO_HEARTBEAT = (
    f"the file has no producer heartbeat time (0x1017) that can be read, written, put back and be 1 to {SLOWEST} ms"
)

ANY: Data = {"heartbeat": "any"}

WALK = "start", "stop", "pre-operational", "stop", "start", "pre-operational"
"""A series of NMT commands from PRE-OPERATIONAL on, with every transition between two states."""

LEADS_TO = {"start": "operational", "stop": "stopped", "pre-operational": "pre-operational"}
"""The state after a command."""

ASKED_BY = {"pre-operational": "10.2", "start": "10.3", "stop": "10.4"}
"""Numbers of CiA's tool, by command."""

WAY_TO = {"pre-operational": (), "operational": ("start",), "stopped": ("stop",)}
"""NMT commands from PRE-OPERATIONAL to a state."""


def _beating(device: DeviceUnderTest, name: str, *steps: Data) -> Data:
    """Return steps during which the device's heartbeat is fast enough to follow its state."""
    try:
        time = _heartbeat_time(device)
    except Lacks as lack:
        return step.skip(name, str(lack))
    # The heartbeat shows the state (CiA 301, 7.2.8.3.2); many devices have none by default, or one per second.
    faster = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=_allowed(time, BEAT))
    return step.keeping(name, time, faster, *steps)


def _heartbeat_time(device: DeviceUnderTest) -> ODVariable:
    """Return 0x1017 if it can be changed, restored, and short enough to follow states; raises Lacks."""
    time = need(device.settable(HEARTBEAT_TIME), NO_HEARTBEAT)
    need(0 < _allowed(time, BEAT) <= SLOWEST, NO_HEARTBEAT)
    return time


def _allowed(variable: ODVariable, value: int) -> int:
    """Return the nearest value that an object's limits allow."""
    range_ = limits(variable)
    return value if range_ is None else int(min(max(value, range_.low), range_.high))


# Errors of its own


@Clause(CHAPTER, "7.5.2.2", "Error register", ctt="5.2")
def _errors(_: DeviceUnderTest) -> Steps:
    """Check that the device has no error at first: later red steps may come from it."""
    # Before all other steps, as a short circuit or an unplugged bus would make unrelated steps red.
    return [{"name": "the device reports no error itself", "errors": "none"}]


# Boot-up


@Clause(CHAPTER, "7.2.8.3.3", "Boot-up", Tier.REVERSIBLE, "10.1")
def _boot_ups(_: DeviceUnderTest) -> Steps:
    for command, (state, way) in product(("reset", "reset communication"), WAY_TO.items()):
        there = [step.nmt(each) for each in ("pre-operational", *way)]
        name = f"boot-up after {command} in {state.upper()}"
        # The boot-up marks the change from Initialisation to PRE-OPERATIONAL, whatever the state before (CiA 301,
        # 7.2.8.3.3); a STOPPED node follows the command, too.
        yield step.group(name, *there, step.nmt(command), step.booted(f"after {command}"))


# Heartbeat


@Clause(CHAPTER, "7.5.2.20", "Heartbeat time", name="it can be changed")
def _heartbeat_times(device: DeviceUnderTest) -> Steps:
    time = _heartbeat_time(device)
    beat = _allowed(time, BEAT)
    slower = step.write(f"{SLOW} ms", HEARTBEAT_TIME, value=_allowed(time, SLOW))
    faster = step.write(f"{beat} ms", HEARTBEAT_TIME, value=beat)
    # From a long time to a short one: a device that finishes the old period first takes up to 5 s.
    first = step.expect("a heartbeat after the new time", ANY, f"{2 * beat} ms")
    change = step.keeping("a change counts at once", time, slower, step.wait("20 ms"), faster, first)
    yield step.asking("7.101", change)
    beats = step.keeping("heartbeats come at their time", time, faster, step.every(ANY, beat, 5))
    yield step.asking("7.102", beats)
    # 0 means no heartbeat (CiA 301, 7.5.2.20), but LowLimit may forbid it; then this is not tested.
    if in_limits(time, 0):
        none = step.write("0: no heartbeat", HEARTBEAT_TIME, value=0)
        silent = step.never("silent", ANY, QUIET)
        yield step.asking("7.103", step.keeping("0 ends it", time, faster, none, step.wait("20 ms"), silent))


@Clause(CHAPTER, "7.2.8.3.2", "Heartbeat", Tier.REVERSIBLE, group="as the file says")
def _heartbeat_of_the_file(device: DeviceUnderTest) -> Steps:
    period = device.number(HEARTBEAT_TIME)
    # Two periods are measured, which must not take minutes.
    need(0 < period <= LONGEST_PERIOD, f"the file has no heartbeat time from 1 to {LONGEST_PERIOD} ms")
    return [*fresh("reset"), step.every(ANY, period, 2)]


@Clause(CHAPTER, "7.3.2.2", "NMT state", Tier.REVERSIBLE)
def _first_state(device: DeviceUnderTest) -> Steps:
    # PRE-OPERATIONAL, unless the file's 0x1F80 lets the device start by itself (CiA 302-2).
    state = STATE_NAMES[boot_state(device.dictionary.default(standard.NMT_STARTUP))]
    beating = _beating(device, f"{state} by itself after a reset", step.heartbeat(state))
    yield step.group("after a reset", step.nmt("reset"), step.booted(), beating)
    yield step.nmt("pre-operational")


# Commands


@Clause(CHAPTER, "7.2.8.2.1", "NMT commands", Tier.REVERSIBLE)
def _walk(device: DeviceUnderTest) -> Steps:
    before = "pre-operational"
    for command in WALK:
        state = LEADS_TO[command]
        commands = [*map(step.nmt, WAY_TO[before]), step.nmt(command), step.heartbeat(state)]
        # There is no SDO in STOPPED (CiA 301, 7.3.2.2.4), so the heartbeat time could not be restored.
        back = [] if state == "pre-operational" else step.undoing(step.nmt("pre-operational"))
        walked = _beating(device, f"{command} in {before.upper()}", *commands, *back)
        yield step.asking(ASKED_BY[command], walked)
        before = state


@Clause(CHAPTER, "7.2.8.2.1", "NMT commands", Tier.DESTRUCTIVE)
def _other_commands(device: DeviceUnderTest) -> Steps:
    stays = step.never("stays", {"heartbeat": "operational"}, QUIET)
    for name, data in (
        ("another node's command does not matter", bytes([1, device.another])),
        ("an unknown command does not matter", bytes([0x77, device.dictionary.node_id])),
        # An NMT command has two bytes; the second one is the node-ID.
        ("half a command does not matter", bytes([1])),
    ):
        sent = step.sent(f"NMT {data.hex(' ').upper()}", NMT_COB_ID, data)
        yield _beating(device, name, sent, stays, step.heartbeat("any"))
    # Node-ID 0 is all nodes (CiA 301, 7.2.8.2.1). PRE-OPERATIONAL, as every node on the bus follows the command.
    started = [step.nmt("start"), step.heartbeat("operational")]
    to_all = step.sent("NMT pre-operational to all", NMT_COB_ID, bytes([0x80, 0]))
    yield _beating(device, "a command to all nodes", *started, to_all, step.heartbeat("pre-operational"))


# Services


@Clause(CHAPTER, "7.3.2.2.4", "NMT state", Tier.REVERSIBLE)
def _services(device: DeviceUnderTest) -> Steps:
    # An upload, so that even a device that serves it in STOPPED writes nothing.
    request = {"name": "a request", **device.request(initiate(ClientCommand.UPLOAD << 5, device.probe))}
    answered = awake(device, "an SDO is answered")
    yield step.asking("9.2", step.group("SDO in PRE-OPERATIONAL", answered))
    (pause,) = step.undoing(step.nmt("pre-operational"))
    yield step.asking("9.3", step.group("SDO in OPERATIONAL", step.nmt("start"), answered, pause))
    silent = step.never("no answer", device.answer("?" * 16), QUIET)
    stopped = *step.commanded("stop"), request, silent, pause, answered
    yield step.asking("9.4", step.group("no SDO in STOPPED", *stopped))


# Error control

CHANGED = (HEARTBEAT_TIME, GUARD_TIME, LIFE_TIME_FACTOR, *((CONSUMED_HEARTBEATS, sub) for sub in (1, 2)))

# Life guarding begins with the first remote frame, and ends only with a reset of the communication. So each group
# begins and ends with one.
GUARDED: Chapter[DeviceUnderTest] = Chapter(
    "error-control", "node guarding and heartbeat consumer", fresh=True, change=CHANGED
)

GUARD, FACTOR = 100, 3
"""A guard time in ms and a life time factor: the device reports a lost master after 0.3 s."""

WATCHED = 200
"""Consumer heartbeat time of the device for another node, in ms."""

ONCE = "500 ms"

NOT_GUARDED = "the file has no guard time (0x100C)"
NOT_WRITTEN = "the file has no 0x100C and 0x100D that can be written"


# Guarding


@Clause(GUARDED, "7.5.2.11", "Guard time", ctt="7.1")
def _times(device: DeviceUnderTest) -> Steps:
    for address, lack in ((GUARD_TIME, NOT_GUARDED), (LIFE_TIME_FACTOR, "the file has no life time factor (0x100D)")):
        found = device.find(address)
        name = f"0x{address[0]:04X}"
        if found is None or not found.readable:
            yield step.skip(name, lack if found is None else f"{name} cannot be read")
        else:
            yield step.read(title(found), address, data="any")


@Clause(GUARDED, "7.5.2.11", "Guard time", ctt="7.201", name="heartbeat and guarding")
def _both_kinds(device: DeviceUnderTest) -> Steps:
    found = [device.readable(each) for each in (HEARTBEAT_TIME, GUARD_TIME, LIFE_TIME_FACTOR)]
    need(all(found), "the file has not all of 0x1017, 0x100C and 0x100D")
    reads = (step.read(title(each), address_of(each), data="any") for each in found if each is not None)
    yield step.group("heartbeat and guarding", *reads)


@Clause(GUARDED, "7.5.2.20", "Heartbeat time", ctt="7.204", name="without guarding")
def _unguarded(device: DeviceUnderTest) -> Steps:
    need(device.find(GUARD_TIME), NOT_GUARDED)
    need(not device.number(GUARD_TIME), "the file has a guard time (0x100C) from the start")
    time = _heartbeat_time(device)
    faster = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=_allowed(time, BEAT))
    yield step.keeping("without guarding", time, faster, {**step.heartbeat("any"), "repeat": 2})


def _guarding(device: DeviceUnderTest) -> None:
    """Need a device that can be guarded."""
    need(device.find(GUARD_TIME), NOT_GUARDED)
    # If heartbeat and guarding are both configured, the heartbeat is used (CiA 301, 7.2.8.2.2).
    ends = not device.number(HEARTBEAT_TIME) or device.may_be(HEARTBEAT_TIME, 0)
    need(ends, "the file's heartbeat (0x1017) cannot be ended, and a device that has one is not guarded")


def _without_life_guarding(device: DeviceUnderTest) -> None:
    """Need a device without life guarding, as the steps do not guard it in time."""
    waits = device.number(GUARD_TIME) and device.number(LIFE_TIME_FACTOR)
    need(not waits, "the file's life guarding is on: once it is asked, the device may leave OPERATIONAL by itself")


def _own(device: DeviceUnderTest) -> int:
    return ERROR_CONTROL_BASE + device.dictionary.node_id


def _answer(device: DeviceUnderTest, digits: str = "??") -> Data:
    return {"raw": f"{_own(device):03X}#{digits}"}


def _no_heartbeat(device: DeviceUnderTest) -> Steps:
    return _heartbeat("no heartbeat", 0) if device.number(HEARTBEAT_TIME) else []


def _heartbeat(name: str, milliseconds: int) -> Steps:
    # A device may send a heartbeat as soon as it has the new time; the wait keeps it from being taken for an answer.
    return [step.write(name, HEARTBEAT_TIME, value=milliseconds), step.wait("200 ms")]


ASKED = (
    ("", NmtState.PRE_OPERATIONAL),
    ("", NmtState.PRE_OPERATIONAL),
    ("start", NmtState.OPERATIONAL),
    ("stop", NmtState.STOPPED),
    ("pre-operational", NmtState.PRE_OPERATIONAL),
)
"""NMT commands, each before a remote frame, and the state in which it finds the device."""

GUARDING = GUARDED, "7.2.8.3.2.1", "Node guarding"
NOT_ITS_OWN = "another node's identifier is not answered"


@Clause(
    *GUARDING, Tier.REVERSIBLE, "7.2, 7.3", name="a remote frame is answered", needs=[_guarding, _without_life_guarding]
)
def _guarded(device: DeviceUnderTest) -> Steps:
    """Send a remote frame in every state; after a reset of the communication the toggle bit starts at 0."""
    steps = [*_no_heartbeat(device)]
    for number, (command, state) in enumerate(ASKED):
        steps += step.commanded(command) if command else []
        # Bit 7 alternates with each answer, so that the master recognises a repeated one (CiA 301, 7.2.8.3.2.1).
        answer = _answer(device, f"{state | TOGGLE * (number % 2):02X}")
        said = f"{number + 1}. {state.name.replace('_', '-')}, toggle bit {number % 2}"
        asked = step.remote(_own(device)), step.expect(said, answer)
        steps += [step.asking("7.3" if number else "7.2", each) for each in asked]
    yield GUARDED.group(device, "each remote frame is answered with the state and the next toggle bit", steps)


@Clause(*GUARDING, Tier.DESTRUCTIVE, "7.4", name=NOT_ITS_OWN, needs=[_guarding])
def _other_identifier(device: DeviceUnderTest) -> Steps:
    # A device that compares only a part of the COB-ID would answer for others, and hide that they are lost.
    asked = step.remote(ERROR_CONTROL_BASE + device.another)
    silent = step.never("no answer", _answer(device), QUIET)
    return [GUARDED.group(device, NOT_ITS_OWN, [*_no_heartbeat(device), asked, silent])]


LIFE_GUARDING = GUARDED, "7.5.2.12", "Life guarding", Tier.DESTRUCTIVE
GUARDING_FOR_LIFE = (
    _guarding,
    settable(GUARD_TIME, GUARD, lack=NOT_WRITTEN),
    settable(LIFE_TIME_FACTOR, FACTOR, lack=NOT_WRITTEN),
    DeviceUnderTest.need_prompt_emcy,
)


def _life_times(device: DeviceUnderTest) -> Steps:
    guard = step.write(f"guard time {GUARD} ms", GUARD_TIME, value=GUARD)
    return [*_no_heartbeat(device), guard, step.write(f"life time factor {FACTOR}", LIFE_TIME_FACTOR, value=FACTOR)]


def _missed(name: str, span: str) -> Data:
    return step.never(name, {"emcy": hexadecimal(ErrorCode.HEARTBEAT_LOST)}, span)


@Clause(*LIFE_GUARDING, "7.5", group="both are written", needs=GUARDING_FOR_LIFE)
def _both_times(device: DeviceUnderTest) -> Steps:
    yield from _life_times(device)
    yield step.read("guard time", GUARD_TIME, expect=GUARD)
    yield step.read("life time factor", LIFE_TIME_FACTOR, expect=FACTOR)


@Clause(*LIFE_GUARDING, "7.6", group="the master is missed", needs=GUARDING_FOR_LIFE)
def _life_guarding(device: DeviceUnderTest) -> Steps:
    yield from _life_times(device)
    yield _missed("not before its first remote frame", ONCE)
    # Together longer than the life time, so only the remote frames keep the device from reporting a lost master.
    yield {**_asked(device, _missed("the master is not missed", f"{GUARD} ms")), "repeat": 4}
    yield step.emcy("EMCY: the life time is over", ErrorCode.HEARTBEAT_LOST)
    yield _missed("it is reported once", ONCE)
    yield step.remote(_own(device))
    yield step.expect("a remote frame is answered again", _answer(device))


def _asked(device: DeviceUnderTest, *more: Data) -> Data:
    answer = step.expect("answer", _answer(device))
    return step.group("guarded", step.remote(_own(device)), answer, *more)


# Guarding and heartbeat

ONE = GUARDED, "7.2.8.2.2", "Heartbeat or guarding", Tier.REVERSIBLE
OTHER = GUARDED, "7.2.8.2.2", "Heartbeat or guarding", Tier.DESTRUCTIVE
SLOW_OR_NONE = settable(HEARTBEAT_TIME, SLOW, 0, lack="the file has no heartbeat time (0x1017) that can be 0 and 5 s")
BEATS = f"the file has no heartbeat time (0x1017) that can be {BEAT} and {SLOW} ms"


EITHER_MAY_BE = [_guarding, SLOW_OR_NONE]
INSTEAD = [*GUARDING_FOR_LIFE, settable(HEARTBEAT_TIME, BEAT, SLOW, lack=BEATS)]


@Clause(*ONE, "7.202, 7.203, 7.205", group="with a heartbeat it is not guarded", needs=EITHER_MAY_BE)
def _one_of_both(device: DeviceUnderTest) -> Steps:
    yield from _not_guarded(device, "7.205")
    yield from (step.asking("7.202", each) for each in _heartbeat("no heartbeat", 0))
    guarded = step.remote(_own(device)), step.expect("without one it is guarded again", _answer(device))
    yield from (step.asking("7.203", each) for each in guarded)


def _not_guarded(device: DeviceUnderTest, number: str) -> Steps:
    """Return steps that fail if the device answers remote frames; its heartbeat is too slow to be taken for one."""
    yield from _heartbeat(f"a heartbeat every {SLOW} ms", SLOW)
    silent = step.remote(_own(device)), step.never("no answer to a remote frame", _answer(device), QUIET)
    yield from (step.asking(number, each) for each in silent)


@Clause(*OTHER, "7.206, 7.207", group="the heartbeat takes guarding's place", needs=INSTEAD)
def _heartbeat_instead(device: DeviceUnderTest) -> Steps:
    """Change from guarding to the heartbeat: its bit 7 is 0, and no lost master is reported."""
    yield from _life_times(device)
    yield _asked(device)
    beating = step.write(f"a heartbeat every {BEAT} ms", HEARTBEAT_TIME, value=BEAT)
    # Bit 7 of a heartbeat is reserved and 0 (CiA 301, 7.2.8.3.2.2).
    beat = _answer(device, f"{NmtState.PRE_OPERATIONAL:02X}")
    comes = {**step.expect("a heartbeat, its toggle bit always 0", beat, QUIET), "repeat": 4}
    yield from (step.asking("7.206", each) for each in (beating, comes, _missed("the master is not missed", "1 s")))
    yield from _not_guarded(device, "7.207")


# Heartbeat consumer

CONSUMER = GUARDED, "7.5.2.19", "Consumer heartbeat time", Tier.DESTRUCTIVE


def _watching(count: int) -> Callable[[DeviceUnderTest], None]:
    """Return a need: the device can monitor another node with each of its first `count` entries."""

    def watching(device: DeviceUnderTest) -> None:
        for address in ((CONSUMED_HEARTBEATS, sub) for sub in range(1, count + 1)):
            used = device.number((CONSUMED_HEARTBEATS, 0)) >= address[1]
            can = used and device.may_be(address, _entry(device, WATCHED + count - 1))
            need(can, f"the file has no consumer heartbeat time ({label(address)}) that can be written")

    return watching


WATCHING = (_watching(1), DeviceUnderTest.need_prompt_emcy)


def _entry(device: DeviceUnderTest, milliseconds: int) -> int:
    # Bits 16 to 23 are the node-ID, the lower half the time in ms; the highest byte is reserved (CiA 301, 7.5.2.19).
    return device.another << 16 | milliseconds


def _watch(device: DeviceUnderTest, name: str, sub: int, milliseconds: int = WATCHED, **more: object) -> Data:
    value = hexadecimal(_entry(device, milliseconds), 8)
    return step.write(name, (CONSUMED_HEARTBEATS, sub), value=value, **more)


def _watched(device: DeviceUnderTest) -> Data:
    return _watch(device, f"watch node {device.another}, {WATCHED} ms", 1)


def _beats(device: DeviceUnderTest) -> Data:
    # The tester plays a node whose node-ID is not in use, so no other consumer is confused.
    return step.sent("heartbeat", *error_control(device.another, NmtState.OPERATIONAL))


def _alive(device: DeviceUnderTest) -> Data:
    """Return steps that send heartbeats faster than the consumer heartbeat time."""
    return {**step.group("alive", _beats(device), _missed("not missed", f"{WATCHED // 2} ms")), "repeat": 5}


def _lost(device: DeviceUnderTest) -> Steps:
    # Monitoring begins with the first heartbeat (CiA 301, 7.2.8.3.2.2).
    return [_beats(device), step.emcy("EMCY: its heartbeat is missed", ErrorCode.HEARTBEAT_LOST)]


@Clause(*CONSUMER, "7.104", group="a node is watched once", needs=[_watching(2)])
def _twice(device: DeviceUnderTest) -> Steps:
    # CiA 301 demands 0x06040043 (7.5.2.19); the other codes refuse it as well, and devices use them.
    refused = codes(AbortCode.INCOMPATIBLE, AbortCode.VALUE, AbortCode.GENERAL, AbortCode.STATE)
    again = _watch(device, "the same node in the second entry", 2, WATCHED + 1, abort=refused)
    return [_watched(device), again]


@Clause(*CONSUMER, "7.105", group="heartbeats in time", needs=WATCHING)
def _faster(device: DeviceUnderTest) -> Steps:
    return [_watched(device), _missed("not before the first", ONCE), _alive(device)]


@Clause(*CONSUMER, "7.106", group="heartbeats too late", needs=WATCHING)
def _slower(device: DeviceUnderTest) -> Steps:
    return [_watched(device), *_lost(device), _missed("it is reported once", ONCE)]


@Clause(*CONSUMER, "7.107", group="a node that boots", needs=WATCHING)
def _restarted(device: DeviceUnderTest) -> Steps:
    # A boot-up ends the monitoring; it begins again with the next heartbeat.
    boot = step.sent("boot-up of that node", *error_control(device.another, NmtState.INITIALISING))
    return [_watched(device), *_lost(device), boot, _alive(device), *_lost(device)]
