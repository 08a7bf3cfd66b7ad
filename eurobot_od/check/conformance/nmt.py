"""NMT states and commands, boot-up and heartbeat (CiA 301, 7.2.8 and 7.3.2)."""

from __future__ import annotations

from itertools import product

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import BOOT_TIME, Chapter, Lacks, Subject, Tier, awake, fresh, need
from eurobot_od.check.conformance.step import Data, Steps
from eurobot_od.device.nmt import STATE_NAMES, boot_state
from eurobot_od.od.objects import in_limits, limits
from eurobot_od.od.standard import GUARD_TIME, HEARTBEAT_TIME, NMT_STARTUP
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.sdo.wire import ClientCommand, initiate

CHAPTER: Chapter[Subject] = Chapter("nmt", "NMT states, boot-up and heartbeat")

BEAT = 100
"""Heartbeat time with which states are watched, ms."""

SLOW = 5000
"""A heartbeat time after which none comes while a step looks, ms."""

SOON = f"{3 * BEAT} ms"
"""Within this time a heartbeat has the state that the device is in."""

QUIET = "300 ms"
"""How long nothing may come where nothing may."""

LONGEST_PERIOD = 5000
"""Longest heartbeat time of a file that is measured, ms."""

SLOWEST = 2 * BEAT
"""A state is watched by heartbeats of at most this time, ms: one of them has to come SOON."""

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


@CHAPTER.clause("7.5.2.2", "Error register", ctt="5.2")
def _errors(_: Subject) -> Steps:
    """See that the device has no error to begin with: what is red afterwards may come from it."""
    # First of all: a short circuit, or a bus that was unplugged, would make steps red that have nothing to do with it.
    return [{"name": "the device reports no error itself", "errors": "none"}]


# Boot-up


@CHAPTER.clause("7.2.8.3.3", "Boot-up", Tier.REVERSIBLE, "10.1")
def _boot_ups(_: Subject) -> Steps:
    for command, (state, way) in product(("reset", "reset communication"), WAY_TO.items()):
        there = [step.nmt(each) for each in ("pre-operational", *way)]
        name = f"boot-up after {command} in {state.upper()}"
        # The boot-up comes at the change from Initialisation to PRE-OPERATIONAL, whatever state the node was in before
        # (CiA 301, 7.2.8.3.3); a node that is STOPPED hears the command as well.
        yield step.group(name, *there, step.nmt(command), step.booted(BOOT_TIME, f"after {command}"))


# Heartbeat


@CHAPTER.clause("7.5.2.20", "Heartbeat time", name="it can be changed")
def _heartbeat_times(subject: Subject) -> Steps:
    time = _heartbeat_time(subject)
    beat = _allowed(time, BEAT)
    slower = step.write(f"{SLOW} ms", HEARTBEAT_TIME, value=_allowed(time, SLOW))
    faster = step.write(f"{beat} ms", HEARTBEAT_TIME, value=beat)
    # From a long time to a short one: a device that first lets the old time run out takes up to 5 s.
    first = {**step.heartbeat("any", f"{beat + 100} ms"), "name": "a heartbeat after the new time"}
    change = step.keeping("a change counts at once", time, slower, step.wait("20 ms"), faster, first)
    yield step.asking("7.101", change)
    beats = step.keeping("heartbeats come at their time", time, faster, step.every(ANY, beat, 5))
    unguarded = subject.find(GUARD_TIME) is not None and not subject.number(GUARD_TIME)
    yield step.asking("7.102, 7.204" if unguarded else "7.102", beats)
    # 0 means no heartbeat (CiA 301, 7.5.2.20), but a maker may forbid it by LowLimit: then there is nothing to look at.
    if in_limits(time, 0):
        none = step.write("0: no heartbeat", HEARTBEAT_TIME, value=0)
        silent = step.never("silent", ANY, QUIET)
        yield step.asking("7.103", step.keeping("0 ends it", time, faster, none, step.wait("20 ms"), silent))


@CHAPTER.clause("7.2.8.3.2", "Heartbeat", Tier.REVERSIBLE, group="as the file says")
def _heartbeat_of_the_file(subject: Subject) -> Steps:
    period = subject.number(HEARTBEAT_TIME)
    # Two periods are measured, and a suite is to end: a device with one beat a minute is not worth two minutes here.
    need(0 < period <= LONGEST_PERIOD, f"the file has no heartbeat time from 1 to {LONGEST_PERIOD} ms")
    return [*fresh("reset"), step.every(ANY, period, 2)]


@CHAPTER.clause("7.3.2.2", "NMT state", Tier.REVERSIBLE)
def _first_state(subject: Subject) -> Steps:
    # By itself means PRE-OPERATIONAL, unless 0x1F80 of the file says that the device starts on its own (CiA 302-2).
    state = STATE_NAMES[boot_state(subject.dictionary.default(NMT_STARTUP))]
    beating = _beating(subject, f"{state} by itself after a reset", step.heartbeat(state, SOON))
    yield step.group("after a reset", step.nmt("reset"), step.booted(BOOT_TIME), beating)
    yield step.nmt("pre-operational")


# Commands


@CHAPTER.clause("7.2.8.2.1", "NMT commands", Tier.REVERSIBLE)
def _walk(subject: Subject) -> Steps:
    before = "pre-operational"
    for command in WALK:
        state = LEADS_TO[command]
        commands = [*map(step.nmt, WAY_TO[before]), step.nmt(command), step.heartbeat(state, SOON)]
        # An SDO server is silent in STOPPED (CiA 301, 7.3.2.2.4): the heartbeat time could be neither set nor put back.
        back = [] if state == "pre-operational" else step.undoing(step.nmt("pre-operational"))
        walked = _beating(subject, f"{command} in {before.upper()}", *commands, *back)
        yield step.asking(ASKED_BY[command], walked)
        before = state


@CHAPTER.clause("7.2.8.2.1", "NMT commands", Tier.DESTRUCTIVE)
def _other_commands(subject: Subject) -> Steps:
    stays = step.never("stays", {"heartbeat": "operational"}, QUIET)
    for name, data in (
        ("another node's command does not matter", bytes([1, subject.another])),
        ("an unknown command does not matter", bytes([0x77, subject.dictionary.node_id])),
        # An NMT frame has two bytes; with one of them a device would have to guess whom it is for.
        ("half a command does not matter", bytes([1])),
    ):
        sent = step.sent(f"NMT {data.hex(' ').upper()}", NMT_COB_ID, data)
        yield _beating(subject, name, sent, stays, step.heartbeat("any", SOON))
    # Node-ID 0 is for all nodes (CiA 301, 7.2.8.2.1). PRE-OPERATIONAL, because every other node on the bus hears it
    # too.
    started = [step.nmt("start"), step.heartbeat("operational", SOON)]
    to_all = step.sent("NMT pre-operational to all", NMT_COB_ID, bytes([0x80, 0]))
    yield _beating(subject, "a command to all nodes", *started, to_all, step.heartbeat("pre-operational", SOON))


# Services


@CHAPTER.clause("7.3.2.2.4", "NMT state", Tier.REVERSIBLE)
def _services(subject: Subject) -> Steps:
    # An upload: whatever a device in STOPPED makes of it, nothing is written.
    request = {"name": "a request", **subject.request(initiate(ClientCommand.UPLOAD << 5, subject.probe))}
    answered = awake(subject, "an SDO is answered")
    yield step.asking("9.2", step.group("SDO in PRE-OPERATIONAL", answered))
    (pause,) = step.undoing(step.nmt("pre-operational"))
    yield step.asking("9.3", step.group("SDO in OPERATIONAL", step.nmt("start"), answered, pause))
    silent = step.never("no answer", subject.answer("?" * 16), QUIET)
    stopped = step.nmt("stop"), step.wait("50 ms"), request, silent, pause, answered
    yield step.asking("9.4", step.group("no SDO in STOPPED", *stopped))
