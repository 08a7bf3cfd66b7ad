"""NMT states and commands, boot-up and heartbeat (CiA 301, 7.2.8 and 7.3.2)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

from eurobot_od.check.conformance.subject import (
    BOOT_TIME,
    Chapter,
    Subject,
    Tier,
    awake,
    group,
    heartbeat,
    never,
    nmt,
    put_back,
    save,
    sent,
    skip,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data
from eurobot_od.device.nmt import STATE_NAMES, boot_state
from eurobot_od.od.objects import address_of, in_limits, limits
from eurobot_od.od.standard import HEARTBEAT_TIME, NMT_STARTUP
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.sdo.wire import ClientCommand, initiate

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

CHAPTER = Chapter("nmt", "NMT states, boot-up and heartbeat")

BEAT = 100
"""Heartbeat time with which states are watched, ms."""

SLOW = 5000
"""A heartbeat time after which none comes while a step looks, ms."""

SOON = f"{3 * BEAT} ms"
"""Within this time a heartbeat has the state that the device is in."""

QUIET = "300 ms"
"""How long nothing may come where nothing may."""

PRECISION = "20 ms"
"""By how much a heartbeat may be off its time; the standard names no precision."""

LONGEST_PERIOD = 5000
"""Longest heartbeat time of a file that is measured, ms."""

SLOWEST = 2 * BEAT
"""A state is watched by heartbeats of at most this time, ms: one of them has to come SOON."""

NO_HEARTBEAT = (
    f"the file has no producer heartbeat time (0x1017) that can be read, written, put back and be 1 to {SLOWEST} ms"
)

WALK = (
    ("start", "operational"),
    ("stop", "stopped"),
    ("pre-operational", "pre-operational"),
    ("stop", "stopped"),
    ("start", "operational"),
    ("pre-operational", "pre-operational"),
)
"""Commands one after the other, from PRE-OPERATIONAL on, and the state after each: every way from state to state."""

WAY_TO = {"pre-operational": (), "operational": ("start",), "stopped": ("stop",)}
"""Commands that lead to a state from PRE-OPERATIONAL."""


def _beating(subject: Subject, name: str, *steps: Data) -> Data:
    """Do some steps while the device says its state often enough to be watched."""
    time = _heartbeat_time(subject)
    if time is None:
        return skip(name, NO_HEARTBEAT)
    # A node says its state only in its heartbeat (CiA 301, 7.2.8.3.2); many devices have none by default, or one a
    # second.
    faster = write(f"a heartbeat every {BEAT} ms", address_of(time), value=_allowed(time, BEAT))
    return group(name, save(time), faster, *steps, put_back(time))


def _heartbeat_time(subject: Subject) -> ODVariable | None:
    """Return 0x1017 if it can be set, put back, and be fast enough to watch a state."""
    time = subject.settable(HEARTBEAT_TIME)
    return time if time is not None and 0 < _allowed(time, BEAT) <= SLOWEST else None


def _allowed(variable: ODVariable, value: int) -> int:
    """Return the value nearest to one that an object takes."""
    range_ = limits(variable)
    return value if range_ is None else int(min(max(value, range_.low), range_.high))


# Errors of its own


@CHAPTER.clause("7.5.2.2", "Error register")
def _errors(_: Subject) -> Iterator[Data]:
    """See that the device has no error to begin with: what is red afterwards may come from it."""
    # First of all: a short circuit, or a bus that was unplugged, would make steps red that have nothing to do with it.
    yield {"name": "the device reports no error itself", "errors": "none"}


# Boot-up


@CHAPTER.clause("7.2.8.3.3", "Boot-up", Tier.REVERSIBLE, "10.1")
def _boot_ups(subject: Subject) -> Iterator[Data]:
    for command, (state, way) in product(("reset", "reset communication"), WAY_TO.items()):
        there = [nmt(each) for each in ("pre-operational", *way)]
        name = f"boot-up after {command} in {state.upper()}"
        # The boot-up comes at the change from Initialisation to PRE-OPERATIONAL, whatever state the node was in before
        # (CiA 301, 7.2.8.3.3); a node that is STOPPED hears the command as well.
        booted = {**heartbeat("boot-up", BOOT_TIME), "name": f"after {command}"}
        yield group(name, *there, nmt(command), booted, awake(subject))


# Heartbeat


@CHAPTER.clause("7.5.2.20", "Heartbeat time", ctt="7.101 to 7.103, 7.204")
def _heartbeat_times(subject: Subject) -> Iterator[Data]:
    time = _heartbeat_time(subject)
    if time is None:
        yield skip("it can be changed", NO_HEARTBEAT)
        return
    beat = _allowed(time, BEAT)
    slower = write(f"{SLOW} ms", address_of(time), value=_allowed(time, SLOW))
    faster = write(f"{beat} ms", address_of(time), value=beat)
    # From a long time to a short one: a device that first lets the old time run out takes up to 5 s.
    first = {**heartbeat("any", f"{beat + 100} ms"), "name": "a heartbeat after the new time"}
    yield group("a change counts at once", save(time), slower, wait("20 ms"), faster, first, put_back(time))
    every = {"message": {"heartbeat": "any"}, "every": f"{beat} ms", "tolerance": PRECISION, "count": 5}
    yield group(
        "heartbeats come at their time",
        save(time),
        faster,
        {"name": f"every {beat} ms", "period": every},
        put_back(time),
    )
    # 0 means no heartbeat (CiA 301, 7.5.2.20), but a maker may forbid it by LowLimit: then there is nothing to look at.
    if in_limits(time, 0):
        none = write("0: no heartbeat", address_of(time), value=0)
        silent = never("silent", {"heartbeat": "any"}, QUIET)
        yield group("0 ends it", save(time), faster, none, wait("20 ms"), silent, put_back(time))


@CHAPTER.clause("7.2.8.3.2", "Heartbeat", Tier.REVERSIBLE, "7.102")
def _heartbeat_of_the_file(subject: Subject) -> Iterator[Data]:
    period = subject.number(HEARTBEAT_TIME)
    # Two periods are measured, and a suite is to end: a device with one beat a minute is not worth two minutes here.
    if not 0 < period <= LONGEST_PERIOD:
        yield skip("as the file says", f"the file has no heartbeat time from 1 to {LONGEST_PERIOD} ms")
        return
    every = {"message": {"heartbeat": "any"}, "every": f"{period} ms", "tolerance": PRECISION, "count": 2}
    yield group(
        "as the file says",
        nmt("reset"),
        awake(subject),
        nmt("pre-operational"),
        {"name": f"every {period} ms", "period": every},
    )


@CHAPTER.clause("7.3.2.2", "NMT state", Tier.REVERSIBLE, "9.1")
def _first_state(subject: Subject) -> Iterator[Data]:
    # By itself means PRE-OPERATIONAL, unless 0x1F80 of the file says that the device starts on its own (CiA 302-2).
    state = STATE_NAMES[boot_state(subject.dictionary.default(NMT_STARTUP))]
    says = heartbeat(state, SOON)
    beating = _beating(subject, f"{state} by itself after a reset", says)
    yield group("after a reset", nmt("reset"), awake(subject), beating)
    yield nmt("pre-operational")


# Commands


@CHAPTER.clause("7.2.8.2.1", "NMT commands", Tier.REVERSIBLE, "10.2 to 10.4")
def _walk(subject: Subject) -> Iterator[Data]:
    before = "pre-operational"
    for command, state in WALK:
        commands = [*(nmt(each) for each in WAY_TO[before]), nmt(command), heartbeat(state, SOON)]
        # An SDO server is silent in STOPPED (CiA 301, 7.3.2.2.4): the heartbeat time could be neither set nor put back.
        back = [] if state == "pre-operational" else [nmt("pre-operational")]
        yield _beating(subject, f"{command} in {before.upper()}", *commands, *back)
        before = state


@CHAPTER.clause("7.2.8.2.1", "NMT commands", Tier.DESTRUCTIVE)
def _other_commands(subject: Subject) -> Iterator[Data]:
    for name, data in (
        ("another node's command does not matter", bytes([1, subject.another])),
        ("an unknown command does not matter", bytes([0x77, subject.node_id])),
        # An NMT frame has two bytes; with one of them a device would have to guess whom it is for.
        ("half a command does not matter", bytes([1])),
    ):
        yield _beating(
            subject, name, _raw(data), never("stays", {"heartbeat": "operational"}, QUIET), heartbeat("any", SOON)
        )
    # Node-ID 0 is for all nodes (CiA 301, 7.2.8.2.1). PRE-OPERATIONAL, because every other node on the bus hears it
    # too.
    started = [nmt("start"), heartbeat("operational", SOON)]
    to_all = {**_raw(bytes([0x80, 0])), "name": "NMT pre-operational to all"}
    yield _beating(subject, "a command to all nodes", *started, to_all, heartbeat("pre-operational", SOON))


def _raw(data: bytes) -> Data:
    return sent(f"NMT {data.hex(' ').upper()}", NMT_COB_ID, data)


# Services


@CHAPTER.clause("7.3.2.2.4", "NMT state", Tier.REVERSIBLE, "9.2 to 9.4")
def _services(subject: Subject) -> Iterator[Data]:
    # An upload: whatever a device in STOPPED makes of it, nothing is written.
    request = subject.request(initiate(ClientCommand.UPLOAD << 5, subject.probe))
    answered = awake(subject, "an SDO is answered")
    yield group("SDO in PRE-OPERATIONAL", answered)
    yield group("SDO in OPERATIONAL", nmt("start"), answered, nmt("pre-operational"))
    yield group(
        "no SDO in STOPPED",
        nmt("stop"),
        wait("50 ms"),
        {"name": "a request", **request},
        never("no answer", subject.answer("?" * 16), QUIET),
        nmt("pre-operational"),
        answered,
    )
