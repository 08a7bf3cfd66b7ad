"""PDOs: which there are, how a master changes them, and when TPDOs are sent (CiA 301, 7.2.2 and 7.5.2.35 to 7.5.2.38).

The manufacturer defines what an event is, so no step waits for one.

A changed PDO gets the file's mapping back, entry by entry, and its COB-ID last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import (
    Chapter,
    Clause,
    DeviceUnderTest,
    Lacks,
    Tier,
    fresh,
    has,
    need,
    or_skipped,
)
from eurobot_od.check.conformance.objects import NO_OBJECT, WRITE_ONLY
from eurobot_od.check.conformance.step import BUSY, OUTSIDE, RESTRICTED_ONES, Data, Steps, codes, hexadecimal, title
from eurobot_od.device.device import Device
from eurobot_od.od import values
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Mapped, Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import COB_ID, EVENT_TIMER, MAX_BITS, NOT_VALID, SYNC_START, TRANSMISSION_TYPE, PdoDirection
from eurobot_od.sdo.wire import Abort, AbortCode

CHAPTER: Chapter[DeviceUnderTest] = Chapter("pdo", "PDOs")

TOO_MANY = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX, AbortCode.NOT_MAPPABLE, AbortCode.MAPPING_TOO_LONG)
"""Aborts for a number of entries that a PDO cannot have."""

MISSING = 0x1FFF
"""An index without an object in most devices."""

NOT_SETTABLE = "cannot be read, written and put back"


OfPdo: TypeAlias = Callable[[DeviceUnderTest, Pdo], Steps]


def each_of(direction: PdoDirection, steps: OfPdo, name: str = "{}") -> Callable[[DeviceUnderTest], Steps]:
    """Return a function that makes the steps for all correct PDOs of a direction.

    For a PDO that lacks something it makes a skip of this `name`, with the PDO's title.
    """

    def of_each(device: DeviceUnderTest) -> Steps:
        for each in need(device.of(direction), f"the file has no {direction.name} whose parameters hold"):
            yield from or_skipped(name.format(each.title), steps, device, each)

    return of_each


def off(cob_id: ODVariable, kept: str = "present") -> Data:
    """Return a step that makes a PDO not valid: its present COB-ID with bit 31 set."""
    return step.rewritten("1. not valid", cob_id, kept, NOT_VALID)


def need_off(device: DeviceUnderTest, pdo: Pdo) -> ODVariable:
    """Return the COB-ID of a PDO that can be made not valid and restored; raises Lacks."""
    cob_id = need(device.settable((pdo.index, COB_ID)), f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    model = Device(device.dictionary)
    address = address_of(cob_id)
    try:
        # Tried on a simulated device of the file: a default that breaks a rule could not be restored.
        for value in (device.number(address) | NOT_VALID, device.number(address)):
            model.objects.write(address, data_type(cob_id).write(value))
    except Abort as refusal:
        why = f"the file's own COB-ID of {pdo.title} is one that it does not take: {refusal}"
        raise Lacks(why) from None
    return cob_id


# Communication parameters


def _communication(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    cob_id = need(device.settable((pdo.index, COB_ID)), f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    need(pdo.valid, f"{pdo.title} is not valid by default")
    # Bits 0 to 29 must not change while the PDO is valid (CiA 301, 7.5.2.35). Any abort, as the clause names none.
    changed = hexadecimal(device.number(address_of(cob_id)) ^ 1, 8)
    moved = step.write("another identifier while it is valid", address_of(cob_id), value=changed, abort="any")
    yield step.keeping(f"{pdo.title} keeps its identifier", cob_id, moved)
    time = device.settable((pdo.index, values.INHIBIT_TIME)) if pdo.direction is PdoDirection.TPDO else None
    if time is not None:
        value = pdo.inhibit_time ^ 1
        other = step.write("another time while it is valid", address_of(time), value=value, abort="any")
        yield step.keeping(f"{pdo.title} keeps its inhibit time", time, other, step.unchanged(time))


RESTRICTED_NAME = "{} takes no restricted identifier"


def _restricted(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    """Write the COB-IDs that no PDO may have (CiA 301, 7.3.5)."""
    cob_id = need_off(device, pdo)
    at = address_of(cob_id)
    bits = device.number(address_of(cob_id)) & values.NO_RTR
    # Tried with bit 31 cleared, while the PDO is not valid.
    tried = (step.write(f"0x{each:03X}", at, value=each | bits, abort="any") for each in RESTRICTED_ONES)
    return [step.keeping(RESTRICTED_NAME.format(pdo.title), cob_id, off(cob_id), *tried)]


# Mapping


def _scan(device: DeviceUnderTest, direction: PdoDirection) -> Steps:
    """Read the COB-ID of each PDO, and check that the next PDO does not exist."""
    records = values.COMMUNICATION_RECORDS[direction]
    there = [index for index in device.dictionary.members if index in records]
    for found in filter(None, (device.find((index, COB_ID)) for index in there)):
        if found.readable:
            yield step.read(title(found), address_of(found), data="any")
    # A master counts a device's PDOs by reading until one does not exist.
    missing = next((index for index in records if index not in device.dictionary.members), None)
    if missing is not None:
        yield step.read(f"0x{missing:04X} is not there", (missing, COB_ID), abort=codes(*NO_OBJECT))


def _default_mapping(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    """Read the mapping of a PDO, and each object that it maps by default."""
    entries = ((pdo.mapping_index, sub) for sub in range(1, len(pdo.mapping) + 1))
    for address in (each for each in entries if device.readable(each) is not None):
        yield step.read(f"{pdo.title}: {values.label(address)}", address, data="any")
    found = {each.address: device.find(each.address) for each in pdo.mapping if not each.is_padding}
    for address, variable in need(found, f"{pdo.title} maps nothing by default").items():
        name = f"{pdo.title} maps {values.label(address)}"
        if variable is None or device.dictionary.flags(address) & values.NOT_SCANNED:
            yield step.skip(name, "the file does not have it, or its ObjFlags say that a scan does not read it")
        elif variable.readable:
            yield step.read(name, address, data="any", optional=codes(AbortCode.NO_DATA))
        else:
            # It may be write-only, or accessible by PDO only; the abort shows that it exists.
            yield step.read(name, address, abort=codes(*WRITE_ONLY))


def _settable_mapping(device: DeviceUnderTest, pdo: Pdo) -> ODVariable:
    """Return the COB-ID of a PDO whose mapping can be changed and restored; raises Lacks."""
    cob_id = need_off(device, pdo)
    used = range(max(1, len(pdo.mapping)) + 1)
    settable = all(device.settable((pdo.mapping_index, sub)) for sub in used)
    need(settable, f"the mapping of {pdo.title} {NOT_SETTABLE}")
    wrong = _unmapped(device, pdo, used[1:])
    need(not wrong, f"the file itself maps in {pdo.title} what it does not let be mapped: {wrong}")
    return cob_id


def _mapping(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    title = pdo.title
    cob_id = _settable_mapping(device, pdo)
    yield step.group(f"{title} changed in order, and not otherwise", *_remapped(device, pdo, cob_id))
    yield from or_skipped(f"{title} takes {MAX_BITS} bits at most", _at_most, device, pdo, cob_id)


def _unmapped(device: DeviceUnderTest, pdo: Pdo, subs: Iterable[int]) -> str:
    """Return an entry of the file that the simulated device refuses; empty if there is none."""
    entries = (device.number((pdo.mapping_index, sub)) for sub in subs)
    return next((hexadecimal(each, 8) for each in entries if each and not _may_be_mapped(device, pdo, each)), "")


def _may_be_mapped(device: DeviceUnderTest, pdo: Pdo, entry: int) -> bool:
    with suppress(Abort):
        device.model.pdos.mapped(pdo.mapping_index, entry)
        return True
    return False


def _room(device: DeviceUnderTest, pdo: Pdo) -> int:
    """Return the number of mapping entries in the file."""
    return max(device.dictionary.members.get(pdo.mapping_index, ()), default=0)


def _remapped(device: DeviceUnderTest, pdo: Pdo, cob_id: ODVariable) -> Steps:
    """Change the mapping as CiA 301 says, try each step out of order, and restore everything."""
    record = pdo.mapping_index
    subs = range(1, len(pdo.mapping) + 1)
    yield from (step.save(cob_id), *(step.save(*each) for each in _mapping_of(device, pdo, subs)))
    if pdo.valid:
        yield step.asking("3.24", step.write("sub-index 0 while it is valid", (record, 0), value=0, abort="any"))
    yield off(cob_id)
    if pdo.mapping:
        entry = hexadecimal(device.number((record, 1)), 8)
        # Otherwise a PDO could be sent with half the old mapping and half the new one (CiA 301, 7.5.2.36).
        early = step.write("an entry while sub-index 0 is not 0", (record, 1), value=entry, abort="any")
        yield step.asking("3.23", early)
    yield step.write("2. sub-index 0 is 0", (record, 0), value=0)
    yield from _refused_entries(device, pdo)
    yield from _other_entries(device, pdo)
    count = _room(device, pdo) + 1
    if 1 < count <= MAX_BITS:
        aborts = codes(*TOO_MANY, *OUTSIDE)
        too_many = step.write(f"{count} entries are too many", (record, 0), value=count, abort=aborts)
        yield step.asking("3.25", too_many)
    yield from _mapped_again(device, pdo, cob_id, subs)


def _mapped_again(device: DeviceUnderTest, pdo: Pdo, cob_id: ODVariable, subs: range) -> Steps:
    """Write the kept entries and COB-ID of a PDO that is not valid and has 0 in sub-index 0."""
    number, *entries = _mapping_of(device, pdo, subs)
    # The entries behind the last one are restored below, as not every device accepts an entry of 0.
    used = entries[: len(pdo.mapping)]
    yield from (step.rewritten(f"3. entry {each.subindex}", each, kept) for each, kept in used)
    yield step.rewritten("4. sub-index 0 is as it was", *number)
    # After the entries the COB-ID, as clearing bit 31 makes the PDO valid at once.
    yield from (step.put_back(*each) for each in (*entries, number))
    yield {**step.put_back(cob_id), "name": "5. as it was"}
    yield step.unchanged(number[0], "it has its entries", kept=number[1])


def _mapping_of(device: DeviceUnderTest, pdo: Pdo, subs: range) -> list[tuple[ODVariable, str]]:
    """Return sub-index 0 and these entries of a PDO's mapping, each with the variable for its value."""
    return device.kept((pdo.mapping_index, sub) for sub in (0, *subs))


def _at_most(device: DeviceUnderTest, pdo: Pdo, cob_id: ODVariable) -> Steps:
    """Map more bits than a PDO can have: each entry is allowed, together they are refused."""
    record = pdo.mapping_index
    # The widest object, as many devices have only four or eight entries.
    may = [each for each in device.objects if each.pdo_mappable and each.access_type in values.MAPPABLE[pdo.direction]]
    numbers = [each for each in may if data_type(each).is_integer and 8 <= data_type(each).bits <= MAX_BITS]
    too_few = "the file has too few entries in it to map more"
    wide = need(max(numbers, key=lambda each: data_type(each).bits, default=None), too_few)
    count = MAX_BITS // data_type(wide).bits + 1
    need(count <= _room(device, pdo), too_few)
    entries = range(1, count + 1)
    settable = all(device.settable((record, sub)) for sub in entries)
    need(settable and not _unmapped(device, pdo, entries), "its spare entries could not be put back")
    too_long = codes(AbortCode.MAPPING_TOO_LONG)
    bits = data_type(wide).bits
    yield step.group(
        f"{pdo.title} takes {MAX_BITS} bits at most",
        step.save(cob_id),
        *(step.save(*each) for each in _mapping_of(device, pdo, entries)),
        off(cob_id),
        step.write("2. sub-index 0 is 0", (record, 0), value=0),
        *(step.write(f"entry {sub} of too many", (record, sub), value=_entry(wide)) for sub in entries),
        step.asking("3.26", step.write(f"{count * bits} bits", (record, 0), value=count, abort=too_long)),
        step.write("2. sub-index 0 is 0 again", (record, 0), value=0),
        *_mapped_again(device, pdo, cob_id, entries),
    )


def _refused_entries(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    """Map an object that is not mappable, and one that does not exist."""
    entry = pdo.mapping_index, 1
    unmapped = (each for each in device.objects if not each.pdo_mappable)
    fixed = next((each for each in unmapped if data_type(each).size in (1, 2, 4)), None)
    if fixed is not None:
        value = _entry(fixed)
        refused = codes(AbortCode.NOT_MAPPABLE, *OUTSIDE)
        unmappable = step.write(f"{title(fixed)} cannot be mapped", entry, value=value, abort=refused)
        yield step.asking(UNMAPPABLE[pdo.direction], unmappable)
    if MISSING not in device.dictionary.members:
        # Of 8 bits, so that only the missing object can be the reason.
        missing = hexadecimal(MISSING << 16 | 8, 8)
        aborts = codes(AbortCode.NO_OBJECT, AbortCode.NOT_MAPPABLE, *OUTSIDE)
        yield step.write("an object that is not there", entry, value=missing, abort=aborts)


UNMAPPABLE = {PdoDirection.RPDO: "3.29", PdoDirection.TPDO: "3.32"}
OWN_ACCESS = {PdoDirection.RPDO: "3.27", PdoDirection.TPDO: "3.30"}
OTHER_ACCESS = {PdoDirection.RPDO: "3.28", PdoDirection.TPDO: "3.31"}
"""Numbers of CiA's tool by direction: unmappable objects, access types of this direction, those of the other."""

DIRECTED = {PdoDirection.RPDO: ("rww", "wo"), PdoDirection.TPDO: ("rwr", "ro")}
"""Access types of objects that may be mapped in this direction only (CiA 301, Table 42)."""


def _other_entries(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    """Map objects by access type: those of this direction, one of the other direction, and a dummy."""
    entry = pdo.mapping_index, 1
    mapped = [each for each in device.objects if each.pdo_mappable and data_type(each).size in (1, 2, 4)]
    for access in DIRECTED[pdo.direction]:
        each = next((each for each in mapped if each.access_type == access), None)
        if each is not None and _may_be_tried(device, pdo, int(_entry(each), 16)):
            allowed = step.write(f"{title(each)} is {access}: it may be mapped", entry, value=_entry(each))
            yield step.asking(OWN_ACCESS[pdo.direction], allowed)
    # `rwr` objects can be mapped in TPDOs only, `rww` objects in RPDOs only.
    (opposite,) = {*DIRECTED} - {pdo.direction}
    other = next((each for each in mapped if each.access_type in DIRECTED[opposite]), None)
    if other is not None:
        refused = codes(AbortCode.NOT_MAPPABLE, AbortCode.UNSUPPORTED_ACCESS, *OUTSIDE)
        what = f"{title(other)} is {other.access_type}: it may not"
        yield step.asking(OTHER_ACCESS[pdo.direction], step.write(what, entry, value=_entry(other), abort=refused))
    # Dummy entries skip data that the device does not use; [DummyUsage] lists the possible ones (CiA 306).
    usage = partial(device.dictionary.device.document.text, "dummyusage")
    dummies = (each << 16 | values.DATA_TYPES[each].bits for each in values.DUMMIES if usage(f"dummy{each:04x}") == "1")
    dummy = next((each for each in dummies if _may_be_tried(device, pdo, each)), None)
    if dummy is not None:
        yield step.asking("3.33", step.write("a dummy may be mapped", entry, value=hexadecimal(dummy, 8)))
    yield step.write("the file's entry", entry, value=hexadecimal(device.number(entry), 8))


def _may_be_tried(device: DeviceUnderTest, pdo: Pdo, entry: int, sub: int = 1) -> bool:
    """Return whether a PDO's entry may have this value: by the object and by the entry's own limits."""
    return device.may_be((pdo.mapping_index, sub), entry) and _may_be_mapped(device, pdo, entry)


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


# Transmission of TPDOs

EVENT_TIME = 100
"""Event timer during the steps, in ms."""

OVERFLOW, START = 10, 3
"""Value of the SYNC counter, and SYNC start value of the TPDO."""

QUIET = "300 ms"

NO_SYNC = "the file has no SYNC (0x1005) with an identifier"

NO_SUCH_TYPE = (*BUSY, *OUTSIDE)
"""Aborts of a device that does not support a transmission type."""

EVENT_TYPES, REMOTE_TYPES = (254, 255), (252, 253, 254, 255)


class Sending(NamedTuple):
    """A way to make a device send a TPDO.

    `around` makes the steps that change the device and restore it. `ask` are steps that cause no frame outside
    OPERATIONAL; `seen` are those in OPERATIONAL, with the expected frames.
    """

    way: str
    around: Callable[..., Steps]
    ask: Sequence[Data]
    seen: Sequence[Data]


SendingOf: TypeAlias = "Callable[[DeviceUnderTest, Pdo], Sending]"

STATES = {"OPERATIONAL": "start", "STOPPED": "stop", "PRE-OPERATIONAL": ""}
"""NMT states in the order of CiA's tool, with the command from PRE-OPERATIONAL."""


def _sent_when(
    number: str,
    topic: str,
    asked: tuple[str, str, str],
    needed: Callable[[DeviceUnderTest, Pdo], object],
    tier: Tier = Tier.REVERSIBLE,
) -> Callable[[SendingOf], SendingOf]:
    """Return a decorator that adds a way as a clause: a group per TPDO and NMT state, with its number of CiA's tool."""

    def enter(sending: SendingOf) -> SendingOf:
        def of_one(device: DeviceUnderTest, pdo: Pdo) -> Steps:
            device.need_seen(pdo)
            needed(device, pdo)
            way = sending(device, pdo)
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
    """Return the pattern of a PDO: its COB-ID and length, with any data."""
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


def _comes(name: str, pdo: Pdo, within: str = step.ANSWER_TIME) -> Data:
    return step.expect(name, frame_of(pdo), within)


def _none(name: str, pdo: Pdo) -> Data:
    return step.never(name, frame_of(pdo), QUIET)


PARAMETERS: Mapping[int, tuple[str, Mapping[str, object]]] = {
    EVENT_TIMER: ("event timer", {}),
    TRANSMISSION_TYPE: ("transmission type", {"optional": codes(*NO_SUCH_TYPE)}),
}
"""Names of parameters, and further keys of their writing, by sub-index."""


def having(device: DeviceUnderTest, pdo: Pdo, parameters: Mapping[int, int], *steps: Data) -> Steps:
    """Do steps with changed parameters of a TPDO, then restore these."""
    back: list[Data] = []
    for sub, value in parameters.items():
        what, more = PARAMETERS[sub]
        found = need(device.settable((pdo.index, sub)), NOT_SETTABLE)
        kept = f"present_{sub}"
        yield step.save(found, kept)
        yield step.write(f"{pdo.title}: {what} {value}", address_of(found), value=value, **more)
        back.append(step.put_back(found, kept))
    yield from (*steps, *step.undoing(step.nmt("pre-operational")), *back)


# By events and their timer

EVENT_DRIVEN = 254
"""Transmission type of an event-driven TPDO, as in CiA's tool."""


def _timed(device: DeviceUnderTest, pdo: Pdo) -> None:
    # Only types 254 and 255 have an event timer (CiA 301, 7.5.2.37).
    may = pdo.transmission_type in EVENT_TYPES or device.may_be((pdo.index, TRANSMISSION_TYPE), EVENT_DRIVEN)
    need(may, f"{pdo.title} is not event-driven by default, and cannot be")
    settable = device.may_be((pdo.index, EVENT_TIMER), EVENT_TIME)
    need(settable, f"the event timer of {pdo.title} {NOT_SETTABLE}")
    short = pdo.inhibit_time < 10 * EVENT_TIME
    need(short, f"the inhibit time of {pdo.title} is longer than {EVENT_TIME} ms")


def _event_driven(device: DeviceUnderTest, pdo: Pdo) -> None:
    _timed(device, pdo)
    may = device.may_be((pdo.index, TRANSMISSION_TYPE), EVENT_DRIVEN)
    need(may, f"the transmission type of {pdo.title} cannot be {EVENT_DRIVEN}")


# The manufacturer defines events. As in CiA's tool the timer causes one, so both tests cause the same frames.
@_sent_when("7.5.2.37", "TPDO transmission", ("3.4", "3.10", "3.16"), _event_driven)
def _by_event(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    return _at_times(device, pdo, "by event", {TRANSMISSION_TYPE: EVENT_DRIVEN, EVENT_TIMER: EVENT_TIME})


@_sent_when("7.5.2.37", "TPDO transmission", ("3.5", "3.11", "3.17"), _timed)
def _by_event_timer(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    changed = {} if pdo.transmission_type in EVENT_TYPES else {TRANSMISSION_TYPE: EVENT_DRIVEN}
    return _at_times(device, pdo, "by event timer", {**changed, EVENT_TIMER: EVENT_TIME})


def _at_times(device: DeviceUnderTest, pdo: Pdo, way: str, parameters: Mapping[int, int]) -> Sending:
    # "At most", as an event of the device may send it sooner, and restarts the timer.
    comes = {**_comes(f"again and again, {EVENT_TIME} ms apart at most", pdo, f"{3 * EVENT_TIME} ms"), "repeat": 3}
    return Sending(way, partial(having, device, pdo, parameters), (), [comes])


# By SYNC


def need_sync(device: DeviceUnderTest) -> None:
    """Need a SYNC that the tester can send; raises Lacks."""
    need(device.model.pdos.sync_cob_id is not None, NO_SYNC)
    need(not device.number(SYNC) & SYNC_PRODUCER, "the device sends SYNC itself")


def need_uncounted_sync(device: DeviceUnderTest) -> None:
    """Need a SYNC without a counter; raises Lacks."""
    need_sync(device)
    need(not device.number(SYNC_COUNTER), "the file's SYNC has a counter")


def sync(device: DeviceUnderTest, data: bytes = b"") -> Data:
    """Return a step that sends SYNC."""
    return step.sent(f"SYNC {data[0]}" if data else "SYNC", device.model.pdos.sync_cob_id or 0, data)


def _synchronous(device: DeviceUnderTest, pdo: Pdo) -> None:
    need_uncounted_sync(device)
    settable = device.may_be((pdo.index, TRANSMISSION_TYPE), 1)
    need(settable, f"the transmission type of {pdo.title} {NOT_SETTABLE}")


@_sent_when("7.2.2.2", "TPDO transmission", ("3.6", "3.12", "3.18"), _synchronous)
def _by_sync(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    # Twice, as a device may send the TPDO once when its parameters change.
    with_each = {**step.group("with each SYNC", sync(device), _comes("it comes", pdo)), "repeat": 2}
    seen = _none("none without SYNC", pdo), with_each
    return Sending("by SYNC", partial(having, device, pdo, {TRANSMISSION_TYPE: 1}), [sync(device)], seen)


def _acyclic(device: DeviceUnderTest, pdo: Pdo) -> None:
    _synchronous(device, pdo)
    need(device.may_be((pdo.index, TRANSMISSION_TYPE), 0), f"the transmission type of {pdo.title} cannot be 0")


# 3.7 needs an event, which cannot be caused over the bus.
@_sent_when("7.2.2.2", "TPDO transmission", ("", "3.13", "3.19"), _acyclic)
def _by_acyclic_sync(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    """With type 0 a TPDO is sent with the SYNC after an event, not with others, and never without SYNC."""
    until = sync(device), step.wait("100 ms"), _none("none until the next SYNC", pdo)
    around = partial(having, device, pdo, {TRANSMISSION_TYPE: 0})
    return Sending("by SYNC after an event", around, [sync(device)] * 2, [_none("none without SYNC", pdo), *until])


# By remote frame


def _asked(device: DeviceUnderTest, pdo: Pdo) -> None:
    # Bit 30 of a TPDO's COB-ID (CiA 301, 7.5.2.37).
    forbidden = device.number((pdo.index, COB_ID)) & values.NO_RTR
    need(not forbidden, f"bit 30 of the COB-ID of {pdo.title} forbids remote frames")
    need(pdo.transmission_type in REMOTE_TYPES, f"{pdo.title} follows SYNC")


@_sent_when("7.2.2.5.2", "TPDO by remote frame", ("3.3", "3.9", "3.15"), _asked)
def _by_remote_frame(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    # With the PDO's length, as some controllers answer a remote frame only if the DLC matches.
    asked = step.remote(pdo.cob_id, pdo.length)
    return Sending("by remote frame", partial(having, device, pdo, {}), [asked], [asked, _comes("it comes", pdo)])


# By numbered SYNC


def _numbered(device: DeviceUnderTest, pdo: Pdo) -> None:
    need_sync(device)
    counts = device.may_be(SYNC_COUNTER, OVERFLOW)
    need(counts, f"the file has no SYNC counter (0x1019) that can be {OVERFLOW}")
    no_period = not device.number(SYNC_PERIOD) or device.may_be(SYNC_PERIOD, 0)
    need(no_period, "the file's period of SYNC (0x1006) cannot be 0")
    may = all(device.may_be((pdo.index, sub), value) for sub, value in ((TRANSMISSION_TYPE, 1), (SYNC_START, START)))
    need(may, f"the file has no SYNC start value of {pdo.title} that can be {START}")
    need_off(device, pdo)


@_sent_when("7.5.2.37", "SYNC start value", ("3.8", "3.14", "3.20"), _numbered, Tier.DESTRUCTIVE)
def _from_start_value(device: DeviceUnderTest, pdo: Pdo) -> Sending:
    """Expect a TPDO from the SYNC with its start value on, and then with every SYNC."""
    # The tester is the producer; its counter, the data byte, starts at 1 (CiA 301, 7.2.5).
    syncs = [sync(device, bytes([number])) for number in range(1, START + 3)]
    seen: list[Data] = []
    for number, each in enumerate(syncs, start=1):
        looks = _comes("it comes", pdo) if number >= START else _none(f"not before SYNC {START}", pdo)
        seen += [each, looks]
    return Sending(f"from SYNC {START} on", partial(_starting, device, pdo), syncs, seen)


def _starting(device: DeviceUnderTest, pdo: Pdo, *steps: Data) -> Steps:
    """Do steps with a SYNC counter and a start value, then restore everything."""
    kept = device.kept((SYNC_COUNTER, SYNC_PERIOD))
    parameters = device.kept((pdo.index, sub) for sub in (COB_ID, TRANSMISSION_TYPE, SYNC_START))
    (cob_id, present), (type_, _), (start, _) = parameters
    yield from (*fresh(), *(step.save(*each) for each in kept))
    if device.number(SYNC_PERIOD):
        yield step.write("period 0", SYNC_PERIOD, value=0)
    yield step.write(f"counter {OVERFLOW}", SYNC_COUNTER, value=OVERFLOW)
    yield from (step.save(*parameter) for parameter in parameters)
    # The start value must not be changed while the PDO is valid (CiA 301, 7.5.2.37).
    yield off(cob_id, present)
    yield step.write("transmission type 1", address_of(type_), value=1, optional=codes(*NO_SUCH_TYPE))
    yield step.write(f"SYNC start value {START}", address_of(start), value=START)
    yield step.rewritten(f"{pdo.title} valid", cob_id, present)
    yield from (*steps, *step.undoing(*fresh()))
    yield from (step.put_back(*parameter) for parameter in (*reversed(parameters), *kept))


# Another mapping, after the ways to send TPDOs, which show it

OTHER_NAME = "{} with another mapping"


def _with_another(device: DeviceUnderTest, pdo: Pdo) -> Steps:
    """Activate another mapping by CiA's procedure, check the TPDO with it, and restore the file's."""
    cob_id = _settable_mapping(device, pdo)
    other = _another(device, pdo)
    record = pdo.mapping_index
    subs = range(1, max(len(pdo.mapping), len(other.mapping)) + 1)
    entries = [(sub, _entry_of(each)) for sub, each in enumerate(other.mapping, start=1)]
    seen = _seen_with(device, other) if pdo.valid and pdo.direction is PdoDirection.TPDO else ()
    in_force = (
        step.write("4. sub-index 0", (record, 0), value=len(entries)),
        *(step.read(f"entry {sub} is there", (record, sub), expect=value) for sub, value in entries),
        step.rewritten("5. as valid as it was", cob_id),
        *seen,
    )
    yield step.group(
        OTHER_NAME.format(pdo.title),
        step.save(cob_id),
        *(step.save(*each) for each in _mapping_of(device, pdo, subs)),
        off(cob_id),
        step.write("2. sub-index 0 is 0", (record, 0), value=0),
        *(step.write(f"3. entry {sub}", (record, sub), value=value) for sub, value in entries),
        step.asking("3.22", step.group("in force", *in_force)),
        off(cob_id),
        step.write("2. sub-index 0 is 0 again", (record, 0), value=0),
        *_mapped_again(device, pdo, cob_id, subs),
    )


def _another(device: DeviceUnderTest, pdo: Pdo) -> Pdo:
    """Return a PDO with a possible mapping of another length; raises Lacks if there is none."""
    may = (each for each in device.objects if each.pdo_mappable and data_type(each).size in (1, 2, 4))
    alone = ((Mapped.of(each, data_type(each).bits, each),) for each in may)
    # Without the first object; a single object twice; otherwise another object alone.
    mappings = (pdo.mapping[1:], pdo.mapping * 2 if len(pdo.mapping) == 1 else (), *alone)
    others = (replace(pdo, mapping=each) for each in mappings)
    found = next((each for each in others if each.length and _may_be_given(device, pdo, each)), None)
    return need(found, f"the file has no other mapping that {pdo.title} could have")


def _may_be_given(device: DeviceUnderTest, pdo: Pdo, other: Pdo) -> bool:
    number = len(other.mapping)
    bits = sum(each.bits for each in other.mapping)
    return (
        other.length != pdo.length
        and bits <= MAX_BITS
        and device.may_be((pdo.mapping_index, 0), number)
        and all(_may_be_tried(device, pdo, _entry_of(each), sub) for sub, each in enumerate(other.mapping, start=1))
    )


def _seen_with(device: DeviceUnderTest, other: Pdo) -> Steps:
    """Return the steps of a way to send the TPDO, or a skip if there is none."""
    for needed, sending in ((_synchronous, _by_sync), (_timed, _by_event_timer), (_asked, _by_remote_frame)):
        if has(device.need_seen, other) and has(needed, device, other):
            way = sending(device, other)
            return way.around(*step.commanded("start"), *way.seen)
    return [step.skip("it is sent with it", f"{other.title} cannot be sent by SYNC, event timer or remote frame")]


def _entry_of(each: Mapped) -> int:
    index, sub = each.address
    return index << 16 | sub << 8 | each.bits


for _each in PdoDirection:
    _number = "7.5.2.36" if _each is RPDO else "7.5.2.38"
    _of_each = each_of(_each, _with_another, OTHER_NAME)
    Clause(CHAPTER, _number, f"{_each.name} mapping", Tier.REVERSIBLE, "3.22", name=_each.name)(_of_each)
