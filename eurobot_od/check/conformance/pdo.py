"""PDOs: which there are, how a master changes them, and when TPDOs are sent (CiA 301, 7.2.2 and 7.5.2.35 to 7.5.2.38).

What an event is, is the maker's; no step waits for one.

Rule of this file: a PDO that was changed gets the file's mapping back, entry by entry, and its COB-ID last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import Chapter, Clause, Lacks, Subject, Tier, fresh, has, need, or_skipped
from eurobot_od.check.conformance.objects import NO_OBJECT, WRITE_ONLY
from eurobot_od.check.conformance.step import BUSY, OUTSIDE, RESTRICTED_ONES, Data, Steps, codes, hexadecimal, title
from eurobot_od.device.device import Device
from eurobot_od.od import values
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Mapped, Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import COB_ID, EVENT_TIMER, MAX_BITS, NOT_VALID, SYNC_START, TRANSMISSION_TYPE, PdoDirection
from eurobot_od.sdo.wire import Abort, AbortCode

CHAPTER: Chapter[Subject] = Chapter("pdo", "PDOs")

TOO_MANY = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX, AbortCode.NOT_MAPPABLE, AbortCode.MAPPING_TOO_LONG)
"""Aborts for a number of entries that a PDO does not have."""

MISSING = 0x1FFF
"""An index where mostly nothing is."""

NOT_SETTABLE = "cannot be read, written and put back"


OfPdo: TypeAlias = Callable[[Subject, Pdo], Steps]


def each_of(direction: PdoDirection, steps: OfPdo, name: str = "{}") -> Callable[[Subject], Steps]:
    """Make steps for all PDOs of a direction that hold; where one lacks something, a skip of this name."""

    def of_each(subject: Subject) -> Steps:
        for each in need(subject.of(direction), f"the file has no {direction.name} whose parameters hold"):
            yield from or_skipped(name.format(each.title), steps, subject, each)

    return of_each


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


# Communication parameters


def _communication(subject: Subject, pdo: Pdo) -> Steps:
    cob_id = need(subject.settable((pdo.index, COB_ID)), f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    need(pdo.valid, f"{pdo.title} is not valid by default")
    # Bits 0 to 29 must not change while bit 31 says that the PDO exists (CiA 301, 7.5.2.35). Any abort will do: the
    # clause names none.
    changed = hexadecimal(subject.number(address_of(cob_id)) ^ 1, 8)
    moved = step.write("another identifier while it is valid", address_of(cob_id), value=changed, abort="any")
    yield step.keeping(f"{pdo.title} keeps its identifier", cob_id, moved)
    time = subject.settable((pdo.index, values.INHIBIT_TIME)) if pdo.direction is PdoDirection.TPDO else None
    if time is not None:
        value = pdo.inhibit_time ^ 1
        other = step.write("another time while it is valid", address_of(time), value=value, abort="any")
        yield step.keeping(f"{pdo.title} keeps its inhibit time", time, other, step.unchanged(time))


RESTRICTED_NAME = "{} takes no restricted identifier"


def _restricted(subject: Subject, pdo: Pdo) -> Steps:
    """Give a PDO the identifiers that no PDO may have (CiA 301, 7.3.5)."""
    cob_id = need_off(subject, pdo)
    at, bits = address_of(cob_id), subject.number(address_of(cob_id)) & values.NO_RTR
    # Tried while it is not valid, with bit 31 cleared: a PDO on an identifier of NMT or SDO would be heard as one of
    # these.
    tried = (step.write(f"0x{each:03X}", at, value=each | bits, abort="any") for each in RESTRICTED_ONES)
    return [step.keeping(RESTRICTED_NAME.format(pdo.title), cob_id, off(cob_id), *tried)]


# Mapping


def _scan(subject: Subject, direction: PdoDirection) -> Steps:
    """Read the COB-ID of each PDO, and see that the next one is not there."""
    records = values.COMMUNICATION_RECORDS[direction]
    there = [index for index in subject.dictionary.members if index in records]
    for found in filter(None, (subject.find((index, COB_ID)) for index in there)):
        if found.readable:
            yield step.read(title(found), address_of(found), data="any")
    # A master finds out how many PDOs a device has by asking until one is not there.
    missing = next((index for index in records if index not in subject.dictionary.members), None)
    if missing is not None:
        yield step.read(f"0x{missing:04X} is not there", (missing, COB_ID), abort=codes(*NO_OBJECT))


def _default_mapping(subject: Subject, pdo: Pdo) -> Steps:
    """Read what a PDO maps, and each object that it has by default."""
    entries = ((pdo.mapping_index, sub) for sub in range(1, len(pdo.mapping) + 1))
    for address in (each for each in entries if subject.readable(each) is not None):
        yield step.read(f"{pdo.title}: {values.label(address)}", address, data="any")
    found = {each.address: subject.find(each.address) for each in pdo.mapping if not each.is_padding}
    for address, variable in need(found, f"{pdo.title} maps nothing by default").items():
        name = f"{pdo.title} maps {values.label(address)}"
        if variable is None or subject.dictionary.flags(address) & values.NOT_SCANNED:
            yield step.skip(name, "the file does not have it, or its ObjFlags say that a scan does not read it")
        elif variable.readable:
            yield step.read(name, address, data="any", optional=codes(AbortCode.NO_DATA))
        else:
            # It may be write-only, or reached by PDOs alone; that it is there shows in how it is refused.
            yield step.read(name, address, abort=codes(*WRITE_ONLY))


def _settable_mapping(subject: Subject, pdo: Pdo) -> ODVariable:
    """Return the COB-ID of a PDO whose mapping can be changed and put back; raises Lacks."""
    cob_id, used = need_off(subject, pdo), range(max(1, len(pdo.mapping)) + 1)
    settable = all(subject.settable((pdo.mapping_index, sub)) for sub in used)
    need(settable, f"the mapping of {pdo.title} {NOT_SETTABLE}")
    wrong = _unmapped(subject, pdo, used[1:])
    need(not wrong, f"the file itself maps in {pdo.title} what it does not let be mapped: {wrong}")
    return cob_id


def _mapping(subject: Subject, pdo: Pdo) -> Steps:
    title, cob_id = pdo.title, _settable_mapping(subject, pdo)
    yield step.group(f"{title} changed in order, and not otherwise", *_remapped(subject, pdo, cob_id))
    yield from or_skipped(f"{title} takes {MAX_BITS} bits at most", _at_most, subject, pdo, cob_id)


def _unmapped(subject: Subject, pdo: Pdo, subs: Iterable[int]) -> str:
    """Return an entry of the file that a device which is its file refuses to be given again; empty if there is none."""
    entries = (subject.number((pdo.mapping_index, sub)) for sub in subs)
    return next((hexadecimal(each, 8) for each in entries if each and not _may_be_mapped(subject, pdo, each)), "")


def _may_be_mapped(subject: Subject, pdo: Pdo, entry: int) -> bool:
    with suppress(Abort):
        subject.model.pdos.mapped(pdo.mapping_index, entry)
        return True
    return False


def _room(subject: Subject, pdo: Pdo) -> int:
    """Return the number of entries that the file has for a mapping."""
    return max(subject.dictionary.members.get(pdo.mapping_index, ()), default=0)


def _remapped(subject: Subject, pdo: Pdo, cob_id: ODVariable) -> Steps:
    """Change the mapping as CiA 301 says, try each step out of its order, and put all back."""
    record = pdo.mapping_index
    subs = range(1, len(pdo.mapping) + 1)
    yield from (step.save(cob_id), *(step.save(*each) for each in _mapping_of(subject, pdo, subs)))
    if pdo.valid:
        yield step.asking("3.24", step.write("sub-index 0 while it is valid", (record, 0), value=0, abort="any"))
    yield off(cob_id)
    if pdo.mapping:
        entry = hexadecimal(subject.number((record, 1)), 8)
        # Otherwise a PDO could go out half in the old mapping and half in the new one (CiA 301, 7.5.2.36).
        early = step.write("an entry while sub-index 0 is not 0", (record, 1), value=entry, abort="any")
        yield step.asking("3.23", early)
    yield step.write("2. sub-index 0 is 0", (record, 0), value=0)
    yield from _refused_entries(subject, pdo)
    yield from _other_entries(subject, pdo)
    count = _room(subject, pdo) + 1
    if 1 < count <= MAX_BITS:
        aborts = codes(*TOO_MANY, *OUTSIDE)
        too_many = step.write(f"{count} entries are too many", (record, 0), value=count, abort=aborts)
        yield step.asking("3.25", too_many)
    yield from _mapped_again(subject, pdo, cob_id, subs)


def _mapped_again(subject: Subject, pdo: Pdo, cob_id: ODVariable, subs: range) -> Steps:
    """Give a PDO that is not valid, and whose sub-index 0 is 0, the entries and the COB-ID that it had."""
    number, *entries = _mapping_of(subject, pdo, subs)
    # Those behind the last one are put back below, if the device lets them: not every one takes an entry of 0.
    used = entries[: len(pdo.mapping)]
    yield from (step.rewritten(f"3. entry {each.subindex}", each, kept) for each, kept in used)
    yield step.rewritten("4. sub-index 0 is as it was", *number)
    # Whatever came before: its COB-ID last, for with bit 31 cleared the PDO is there at once.
    yield from (step.put_back(*each) for each in (*entries, number))
    yield {**step.put_back(cob_id), "name": "5. as it was"}
    yield step.unchanged(number[0], "it has its entries", kept=number[1])


def _mapping_of(subject: Subject, pdo: Pdo, subs: range) -> list[tuple[ODVariable, str]]:
    """Return the number of a PDO's entries and some of them, each with the name of what keeps its value."""
    return subject.kept((pdo.mapping_index, sub) for sub in (0, *subs))


def _at_most(subject: Subject, pdo: Pdo, cob_id: ODVariable) -> Steps:
    """Map more bits than a PDO has; entry by entry that may be, together it is refused."""
    record = pdo.mapping_index
    # The widest, so that few entries are needed: many devices have only four or eight of them.
    may = [each for each in subject.objects if each.pdo_mappable and each.access_type in values.MAPPABLE[pdo.direction]]
    numbers = [each for each in may if data_type(each).is_integer and 8 <= data_type(each).bits <= MAX_BITS]
    too_few = "the file has too few entries in it to map more"
    wide = need(max(numbers, key=lambda each: data_type(each).bits, default=None), too_few)
    count = MAX_BITS // data_type(wide).bits + 1
    need(count <= _room(subject, pdo), too_few)
    entries = range(1, count + 1)
    settable = all(subject.settable((record, sub)) for sub in entries)
    need(settable and not _unmapped(subject, pdo, entries), "its spare entries could not be put back")
    too_long, bits = codes(AbortCode.MAPPING_TOO_LONG), data_type(wide).bits
    yield step.group(
        f"{pdo.title} takes {MAX_BITS} bits at most",
        step.save(cob_id),
        *(step.save(*each) for each in _mapping_of(subject, pdo, entries)),
        off(cob_id),
        step.write("2. sub-index 0 is 0", (record, 0), value=0),
        *(step.write(f"entry {sub} of too many", (record, sub), value=_entry(wide)) for sub in entries),
        step.asking("3.26", step.write(f"{count * bits} bits", (record, 0), value=count, abort=too_long)),
        step.write("2. sub-index 0 is 0 again", (record, 0), value=0),
        *_mapped_again(subject, pdo, cob_id, entries),
    )


def _refused_entries(subject: Subject, pdo: Pdo) -> Steps:
    """Map what cannot be mapped, and what is not there."""
    entry = pdo.mapping_index, 1
    unmapped = (each for each in subject.objects if not each.pdo_mappable)
    fixed = next((each for each in unmapped if data_type(each).size in (1, 2, 4)), None)
    if fixed is not None:
        value = _entry(fixed)
        refused = codes(AbortCode.NOT_MAPPABLE, *OUTSIDE)
        unmappable = step.write(f"{title(fixed)} cannot be mapped", entry, value=value, abort=refused)
        yield step.asking(UNMAPPABLE[pdo.direction], unmappable)
    if MISSING not in subject.dictionary.members:
        # Of 8 bits, so that it can only be refused because the object is not there.
        missing = hexadecimal(MISSING << 16 | 8, 8)
        aborts = codes(AbortCode.NO_OBJECT, AbortCode.NOT_MAPPABLE, *OUTSIDE)
        yield step.write("an object that is not there", entry, value=missing, abort=aborts)


UNMAPPABLE = {PdoDirection.RPDO: "3.29", PdoDirection.TPDO: "3.32"}
OWN_ACCESS = {PdoDirection.RPDO: "3.27", PdoDirection.TPDO: "3.30"}
OTHER_ACCESS = {PdoDirection.RPDO: "3.28", PdoDirection.TPDO: "3.31"}
"""Numbers of CiA's tool by direction: what cannot be mapped, and access types of this direction and of the other."""

DIRECTED = {PdoDirection.RPDO: ("rww", "wo"), PdoDirection.TPDO: ("rwr", "ro")}
"""Access types of what may be mapped in this direction, and not in the other one (CiA 301, Table 42)."""


def _other_entries(subject: Subject, pdo: Pdo) -> Steps:
    """Map objects by their access type: those of this direction, one of the other, and a dummy."""
    entry = pdo.mapping_index, 1
    mapped = [each for each in subject.objects if each.pdo_mappable and data_type(each).size in (1, 2, 4)]
    for access in DIRECTED[pdo.direction]:
        each = next((each for each in mapped if each.access_type == access), None)
        if each is not None and _may_be_tried(subject, pdo, int(_entry(each), 16)):
            allowed = step.write(f"{title(each)} is {access}: it may be mapped", entry, value=_entry(each))
            yield step.asking(OWN_ACCESS[pdo.direction], allowed)
    # A TPDO takes `rwr` out of the device, an RPDO puts `rww` into it: in the other PDO neither means anything.
    (opposite,) = {*DIRECTED} - {pdo.direction}
    other = next((each for each in mapped if each.access_type in DIRECTED[opposite]), None)
    if other is not None:
        refused = codes(AbortCode.NOT_MAPPABLE, AbortCode.UNSUPPORTED_ACCESS, *OUTSIDE)
        what = f"{title(other)} is {other.access_type}: it may not"
        yield step.asking(OTHER_ACCESS[pdo.direction], step.write(what, entry, value=_entry(other), abort=refused))
    # Dummies fill an RPDO whose sender has more than this device wants; [DummyUsage] says which ones it takes (CiA
    # 306).
    usage = partial(subject.dictionary.device.document.text, "dummyusage")
    dummies = (each << 16 | values.DATA_TYPES[each].bits for each in values.DUMMIES if usage(f"dummy{each:04x}") == "1")
    dummy = next((each for each in dummies if _may_be_tried(subject, pdo, each)), None)
    if dummy is not None:
        yield step.asking("3.33", step.write("a dummy may be mapped", entry, value=hexadecimal(dummy, 8)))
    yield step.write("the file's entry", entry, value=hexadecimal(subject.number(entry), 8))


def _may_be_tried(subject: Subject, pdo: Pdo, entry: int, sub: int = 1) -> bool:
    """Return whether a PDO's entry may be this: it can be mapped there, and is within the entry's own limits."""
    return subject.may_be((pdo.mapping_index, sub), entry) and _may_be_mapped(subject, pdo, entry)


def _entry(each: ODVariable) -> str:
    return hexadecimal(each.index << 16 | each.subindex << 8 | data_type(each).bits, 8)


RPDO, TPDO = PdoDirection.RPDO, PdoDirection.TPDO

Clause(CHAPTER, "7.5.2.35", "RPDOs", ctt="3.1")(partial(_scan, direction=RPDO))
Clause(CHAPTER, "7.5.2.37", "TPDOs", ctt="3.2")(partial(_scan, direction=TPDO))
Clause(CHAPTER, "7.5.2.36", "RPDO mapping", ctt="3.21", name="RPDO")(each_of(RPDO, _default_mapping))
Clause(CHAPTER, "7.5.2.38", "TPDO mapping", ctt="3.21", name="TPDO")(each_of(TPDO, _default_mapping))
for _each in PdoDirection:
    _of_each = each_of(_each, _restricted, RESTRICTED_NAME)
    Clause(CHAPTER, "7.3.5", f"{_each.name} identifier", Tier.REVERSIBLE, "8.10", name=_each.name)(_of_each)
Clause(CHAPTER, "7.5.2.35", "RPDO communication", Tier.REVERSIBLE, name="RPDO")(each_of(RPDO, _communication))
Clause(CHAPTER, "7.5.2.36", "RPDO mapping", Tier.REVERSIBLE, name="RPDO")(each_of(RPDO, _mapping))
Clause(CHAPTER, "7.5.2.37", "TPDO communication", Tier.REVERSIBLE, name="TPDO")(each_of(TPDO, _communication))
Clause(CHAPTER, "7.5.2.38", "TPDO mapping", Tier.REVERSIBLE, name="TPDO")(each_of(TPDO, _mapping))


# When TPDOs are sent

EVENT_TIME = 100
"""Event timer with which TPDOs are looked at, ms."""

OVERFLOW, START = 10, 3
"""SYNC counter, and the number of the SYNC with which TPDOs begin."""

QUIET = "300 ms"

NO_SYNC = "the file has no SYNC (0x1005) with an identifier"

NO_SUCH_TYPE = (*BUSY, *OUTSIDE)
"""Aborts of a device that does not send a TPDO by SYNC."""

EVENT_TYPES, REMOTE_TYPES = (254, 255), (252, 253, 254, 255)


class Sending(NamedTuple):
    """A way to have a TPDO sent: what is changed `around` the steps, `ask`ed in any state, and `seen` in OPERATIONAL.

    `ask` is what has no effect in the other NMT states, `seen` has it too, and the frames that come.
    """

    way: str
    around: Callable[..., Steps]
    ask: Sequence[Data]
    seen: Sequence[Data]


SendingOf: TypeAlias = "Callable[[Subject, Pdo], Sending]"

STATES = {"OPERATIONAL": "start", "STOPPED": "stop", "PRE-OPERATIONAL": ""}
"""NMT states in the order of CiA's tool, and the command that leads there from PRE-OPERATIONAL."""


def _sent_when(
    number: str,
    topic: str,
    asked: tuple[str, str, str],
    needed: Callable[[Subject, Pdo], object],
    tier: Tier = Tier.REVERSIBLE,
) -> Callable[[SendingOf], SendingOf]:
    """Enter a way as a clause: in each NMT state a group for each TPDO, with its number of CiA's tool."""

    def enter(sending: SendingOf) -> SendingOf:
        def of_one(subject: Subject, pdo: Pdo) -> Steps:
            subject.need_seen(pdo)
            needed(subject, pdo)
            way = sending(subject, pdo)
            none = step.never("none comes", frame_of(pdo), QUIET)
            for test, (state, command) in zip(asked, STATES.items(), strict=True):
                there = step.commanded(command) if command else ()
                looks = way.seen if command == "start" else [*way.ask, none]
                name = f"{pdo.title} {way.way} in {state}"
                yield step.asking(test, step.group(name, *way.around(*there, *looks)))

        numbers = ", ".join(filter(None, asked))
        Clause(CHAPTER, number, topic, tier, numbers, name="TPDO")(each_of(PdoDirection.TPDO, of_one))
        return sending

    return enter


def frame_of(pdo: Pdo) -> Data:
    """Return the pattern of a PDO: whatever its data, but of its length."""
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


def _comes(name: str, pdo: Pdo, within: str = step.ANSWER_TIME) -> Data:
    return step.expect(name, frame_of(pdo), within)


def _none(name: str, pdo: Pdo) -> Data:
    return step.never(name, frame_of(pdo), QUIET)


PARAMETERS: Mapping[int, tuple[str, Mapping[str, object]]] = {
    EVENT_TIMER: ("event timer", {}),
    TRANSMISSION_TYPE: ("transmission type", {"optional": codes(*NO_SUCH_TYPE)}),
}
"""What a parameter is called, and how it is written, by its sub-index."""


def having(subject: Subject, pdo: Pdo, parameters: Mapping[int, int], *steps: Data) -> Steps:
    """Do some steps with other values of parameters of a TPDO, then put back those that it had."""
    back: list[Data] = []
    for sub, value in parameters.items():
        what, more = PARAMETERS[sub]
        found, kept = need(subject.settable((pdo.index, sub)), NOT_SETTABLE), f"present_{sub}"
        yield step.save(found, kept)
        yield step.write(f"{pdo.title}: {what} {value}", address_of(found), value=value, **more)
        back.append(step.put_back(found, kept))
    yield from (*steps, *step.undoing(step.nmt("pre-operational")), *back)


# By events and their timer

EVENT_DRIVEN = 254
"""The transmission type that CiA's tool gives an event-driven TPDO."""


def _timed(subject: Subject, pdo: Pdo) -> None:
    # Types 254 and 255 alone have an event timer (CiA 301, 7.5.2.37).
    may = pdo.transmission_type in EVENT_TYPES or subject.may_be((pdo.index, TRANSMISSION_TYPE), EVENT_DRIVEN)
    need(may, f"{pdo.title} is not event-driven by default, and cannot be")
    settable = subject.may_be((pdo.index, EVENT_TIMER), EVENT_TIME)
    need(settable, f"the event timer of {pdo.title} {NOT_SETTABLE}")
    short = pdo.inhibit_time < 10 * EVENT_TIME
    need(short, f"the inhibit time of {pdo.title} is longer than {EVENT_TIME} ms")


def _event_driven(subject: Subject, pdo: Pdo) -> None:
    _timed(subject, pdo)
    may = subject.may_be((pdo.index, TRANSMISSION_TYPE), EVENT_DRIVEN)
    need(may, f"the transmission type of {pdo.title} cannot be {EVENT_DRIVEN}")


# What an event is, is the maker's. As in CiA's tool the timer causes it, so that both tests send the same frames.
@_sent_when("7.5.2.37", "TPDO transmission", ("3.4", "3.10", "3.16"), _event_driven)
def _by_event(subject: Subject, pdo: Pdo) -> Sending:
    return _at_times(subject, pdo, "by event", {TRANSMISSION_TYPE: EVENT_DRIVEN, EVENT_TIMER: EVENT_TIME})


@_sent_when("7.5.2.37", "TPDO transmission", ("3.5", "3.11", "3.17"), _timed)
def _by_event_timer(subject: Subject, pdo: Pdo) -> Sending:
    changed = {} if pdo.transmission_type in EVENT_TYPES else {TRANSMISSION_TYPE: EVENT_DRIVEN}
    return _at_times(subject, pdo, "by event timer", {**changed, EVENT_TIMER: EVENT_TIME})


def _at_times(subject: Subject, pdo: Pdo, way: str, parameters: Mapping[int, int]) -> Sending:
    # At most: an event of the device's own may send it sooner, and begins the time anew.
    comes = {**_comes(f"again and again, {EVENT_TIME} ms apart at most", pdo, f"{3 * EVENT_TIME} ms"), "repeat": 3}
    return Sending(way, partial(having, subject, pdo, parameters), (), [comes])


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


@_sent_when("7.2.2.2", "TPDO transmission", ("3.6", "3.12", "3.18"), _synchronous)
def _by_sync(subject: Subject, pdo: Pdo) -> Sending:
    # Twice: a device that sends once on a change of its parameters would pass with one.
    with_each = {**step.group("with each SYNC", sync(subject), _comes("it comes", pdo)), "repeat": 2}
    seen = _none("none without SYNC", pdo), with_each
    return Sending("by SYNC", partial(having, subject, pdo, {TRANSMISSION_TYPE: 1}), [sync(subject)], seen)


def _acyclic(subject: Subject, pdo: Pdo) -> None:
    _synchronous(subject, pdo)
    need(subject.may_be((pdo.index, TRANSMISSION_TYPE), 0), f"the transmission type of {pdo.title} cannot be 0")


# That it comes after an event (3.7), nobody can have over the bus.
@_sent_when("7.2.2.2", "TPDO transmission", ("", "3.13", "3.19"), _acyclic)
def _by_acyclic_sync(subject: Subject, pdo: Pdo) -> Sending:
    """With type 0 a TPDO goes with the SYNC after an event: with none else, and without SYNC never."""
    until = sync(subject), step.wait("100 ms"), _none("none until the next SYNC", pdo)
    around = partial(having, subject, pdo, {TRANSMISSION_TYPE: 0})
    return Sending("by SYNC after an event", around, [sync(subject)] * 2, [_none("none without SYNC", pdo), *until])


# By remote frame


def _asked(subject: Subject, pdo: Pdo) -> None:
    # Bit 30 of a TPDO's COB-ID (CiA 301, 7.5.2.37).
    forbidden = subject.number((pdo.index, COB_ID)) & values.NO_RTR
    need(not forbidden, f"bit 30 of the COB-ID of {pdo.title} forbids remote frames")
    need(pdo.transmission_type in REMOTE_TYPES, f"{pdo.title} follows SYNC")


@_sent_when("7.2.2.5.2", "TPDO by remote frame", ("3.3", "3.9", "3.15"), _asked)
def _by_remote_frame(subject: Subject, pdo: Pdo) -> Sending:
    # With the length of its data: some controllers answer a remote frame only if the length code agrees.
    asked = step.remote(pdo.cob_id, pdo.length)
    return Sending("by remote frame", partial(having, subject, pdo, {}), [asked], [asked, _comes("it comes", pdo)])


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


@_sent_when("7.5.2.37", "SYNC start value", ("3.8", "3.14", "3.20"), _numbered, Tier.DESTRUCTIVE)
def _from_start_value(subject: Subject, pdo: Pdo) -> Sending:
    """Have a TPDO begin with the SYNC of a number, and then go with each one."""
    # The counter is in SYNC's data byte: the tester plays the producer, and counts from 1 (CiA 301, 7.2.5).
    syncs = [sync(subject, bytes([number])) for number in range(1, START + 3)]
    seen: list[Data] = []
    for number, each in enumerate(syncs, start=1):
        looks = _comes("it comes", pdo) if number >= START else _none(f"not before SYNC {START}", pdo)
        seen += [each, looks]
    return Sending(f"from SYNC {START} on", partial(_starting, subject, pdo), syncs, seen)


def _starting(subject: Subject, pdo: Pdo, *steps: Data) -> Steps:
    """Do some steps with a SYNC counter and a start value, then put back what there was."""
    kept = subject.kept((SYNC_COUNTER, SYNC_PERIOD))
    parameters = subject.kept((pdo.index, sub) for sub in (COB_ID, TRANSMISSION_TYPE, SYNC_START))
    (cob_id, present), (type_, _), (start, _) = parameters
    yield from (*fresh(), *(step.save(*each) for each in kept))
    if subject.number(SYNC_PERIOD):
        yield step.write("period 0", SYNC_PERIOD, value=0)
    yield step.write(f"counter {OVERFLOW}", SYNC_COUNTER, value=OVERFLOW)
    yield from (step.save(*parameter) for parameter in parameters)
    # The start value must not be changed while the PDO exists (CiA 301, 7.5.2.37).
    yield off(cob_id, present)
    yield step.write("transmission type 1", address_of(type_), value=1, optional=codes(*NO_SUCH_TYPE))
    yield step.write(f"SYNC start value {START}", address_of(start), value=START)
    yield step.rewritten(f"{pdo.title} valid", cob_id, present)
    yield from (*steps, *step.undoing(*fresh()))
    yield from (step.put_back(*parameter) for parameter in (*reversed(parameters), *kept))


# Another mapping, last: it shows in TPDOs that are sent

OTHER_NAME = "{} with another mapping"


def _with_another(subject: Subject, pdo: Pdo) -> Steps:
    """Put another mapping in force by the procedure, look at a TPDO that has it, and put the file's back."""
    cob_id, other, record = _settable_mapping(subject, pdo), _another(subject, pdo), pdo.mapping_index
    subs = range(1, max(len(pdo.mapping), len(other.mapping)) + 1)
    entries = [(sub, _entry_of(each)) for sub, each in enumerate(other.mapping, start=1)]
    seen = _seen_with(subject, other) if pdo.valid and pdo.direction is PdoDirection.TPDO else ()
    in_force = (
        step.write("4. sub-index 0", (record, 0), value=len(entries)),
        *(step.read(f"entry {sub} is there", (record, sub), expect=value) for sub, value in entries),
        step.rewritten("5. as valid as it was", cob_id),
        *seen,
    )
    yield step.group(
        OTHER_NAME.format(pdo.title),
        step.save(cob_id),
        *(step.save(*each) for each in _mapping_of(subject, pdo, subs)),
        off(cob_id),
        step.write("2. sub-index 0 is 0", (record, 0), value=0),
        *(step.write(f"3. entry {sub}", (record, sub), value=value) for sub, value in entries),
        step.asking("3.22", step.group("in force", *in_force)),
        off(cob_id),
        step.write("2. sub-index 0 is 0 again", (record, 0), value=0),
        *_mapped_again(subject, pdo, cob_id, subs),
    )


def _another(subject: Subject, pdo: Pdo) -> Pdo:
    """Return a PDO with a mapping that it may have and that shows in the length of its frames; raises Lacks."""
    may = (each for each in subject.objects if each.pdo_mappable and data_type(each).size in (1, 2, 4))
    alone = ((Mapped.of(each, data_type(each).bits, each),) for each in may)
    # Without its first object, of one object alone a second time too, else another object of the device.
    mappings = (pdo.mapping[1:], pdo.mapping * 2 if len(pdo.mapping) == 1 else (), *alone)
    others = (replace(pdo, mapping=each) for each in mappings)
    found = next((each for each in others if each.length and _may_be_given(subject, pdo, each)), None)
    return need(found, f"the file has no other mapping that {pdo.title} could have")


def _may_be_given(subject: Subject, pdo: Pdo, other: Pdo) -> bool:
    number, bits = len(other.mapping), sum(each.bits for each in other.mapping)
    return (
        other.length != pdo.length
        and bits <= MAX_BITS
        and subject.may_be((pdo.mapping_index, 0), number)
        and all(_may_be_tried(subject, pdo, _entry_of(each), sub) for sub, each in enumerate(other.mapping, start=1))
    )


def _seen_with(subject: Subject, other: Pdo) -> Steps:
    """Have a TPDO sent in one of the ways that it can be, or say why it cannot be seen."""
    for needed, sending in ((_synchronous, _by_sync), (_timed, _by_event_timer), (_asked, _by_remote_frame)):
        if has(subject.need_seen, other) and has(needed, subject, other):
            way = sending(subject, other)
            return way.around(*step.commanded("start"), *way.seen)
    return [step.skip("it is sent with it", f"{other.title} cannot be sent by SYNC, event timer or remote frame")]


def _entry_of(each: Mapped) -> int:
    index, sub = each.address
    return index << 16 | sub << 8 | each.bits


for _each in PdoDirection:
    _number = "7.5.2.36" if _each is RPDO else "7.5.2.38"
    _of_each = each_of(_each, _with_another, OTHER_NAME)
    Clause(CHAPTER, _number, f"{_each.name} mapping", Tier.REVERSIBLE, "3.22", name=_each.name)(_of_each)
