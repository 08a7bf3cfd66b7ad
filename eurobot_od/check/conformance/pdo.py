"""PDOs: which there are, and how a master changes them (CiA 301, 7.5.2.35 to 7.5.2.38); when they go: `transmission`.

Rule of this file: a PDO that was changed gets the file's mapping back, entry by entry, and its COB-ID last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step, transmission
from eurobot_od.check.conformance.broadcasts import RESTRICTED_ONES
from eurobot_od.check.conformance.clauses import Chapter
from eurobot_od.check.conformance.step import OUTSIDE, Steps, codes, hexadecimal, title
from eurobot_od.check.conformance.subject import Subject, Tier, need, or_skipped
from eurobot_od.check.conformance.transmission import NOT_SETTABLE, each_of, need_off, off
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import (
    COB_ID,
    COMMUNICATION_RECORDS,
    DATA_TYPES,
    DUMMIES,
    INHIBIT_TIME,
    MAPPABLE,
    MAX_BITS,
    NO_RTR,
    NOT_SCANNED,
    PdoDirection,
    label,
)
from eurobot_od.sdo.wire import Abort, AbortCode

CHAPTER: Chapter[Subject] = Chapter("pdo", "PDOs")

TOO_MANY = (AbortCode.NO_OBJECT, AbortCode.NO_SUBINDEX, AbortCode.NOT_MAPPABLE, AbortCode.MAPPING_TOO_LONG)
"""Aborts for a number of entries that a PDO does not have."""

NO_OBJECT = (AbortCode.NO_OBJECT, AbortCode.GENERAL)
"""Aborts for a record that is not there, as CiA's test tool takes them."""

MISSING = 0x1FFF
"""An index where mostly nothing is."""


# Communication parameters


def _communication(subject: Subject, pdo: Pdo) -> Steps:
    cob_id = need(subject.settable((pdo.index, COB_ID)), f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    need(pdo.valid, f"{pdo.title} is not valid by default")
    # Bits 0 to 29 must not change while bit 31 says that the PDO exists (CiA 301, 7.5.2.35). Any abort will do: the
    # clause names none.
    changed = hexadecimal(subject.number(address_of(cob_id)) ^ 1, 8)
    moved = step.write("another identifier while it is valid", address_of(cob_id), value=changed, abort="any")
    yield step.group(f"{pdo.title} keeps its identifier", step.save(cob_id), moved, step.put_back(cob_id))
    time = subject.settable((pdo.index, INHIBIT_TIME)) if pdo.direction is PdoDirection.TPDO else None
    if time is not None:
        value = pdo.inhibit_time ^ 1
        other = step.write("another time while it is valid", address_of(time), value=value, abort="any")
        same, back = step.unchanged(time), step.put_back(time)
        yield step.group(f"{pdo.title} keeps its inhibit time", step.save(time), other, same, back)


RESTRICTED_NAME = "{} takes no restricted identifier"


def _restricted(subject: Subject, pdo: Pdo) -> Steps:
    """Give a PDO the identifiers that no PDO may have (CiA 301, 7.3.5)."""
    cob_id = need_off(subject, pdo)
    at, bits = address_of(cob_id), subject.number(address_of(cob_id)) & NO_RTR
    # Tried while it is not valid, with bit 31 cleared: a PDO on an identifier of NMT or SDO would be heard as one of
    # these.
    tried = (step.write(f"0x{each:03X}", at, value=each | bits, abort="any") for each in RESTRICTED_ONES)
    name = RESTRICTED_NAME.format(pdo.title)
    return [step.group(name, step.save(cob_id), off(cob_id), *tried, step.put_back(cob_id))]


# Mapping


def _scan(subject: Subject, direction: PdoDirection) -> Steps:
    """Read the COB-ID of each PDO, and see that the next one is not there."""
    records = COMMUNICATION_RECORDS[direction]
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
        yield step.read(f"{pdo.title}: {label(address)}", address, data="any")
    found = {each.address: subject.find(each.address) for each in pdo.mapping if not each.is_padding}
    for address, variable in need(found, f"{pdo.title} maps nothing by default").items():
        name = f"{pdo.title} maps {label(address)}"
        if variable is None or subject.dictionary.flags(address) & NOT_SCANNED:
            yield step.skip(name, "the file does not have it, or its ObjFlags say that a scan does not read it")
        elif variable.readable:
            yield step.read(name, address, data="any", optional=codes(AbortCode.NO_DATA))
        else:
            # What an RPDO maps may be write-only; that it is there shows in how it is refused.
            yield step.read(name, address, abort=codes(AbortCode.WRITE_ONLY))


def _mapping(subject: Subject, pdo: Pdo) -> Steps:
    title, cob_id = pdo.title, need_off(subject, pdo)
    used = range(max(1, len(pdo.mapping)) + 1)
    settable = all(subject.settable((pdo.mapping_index, sub)) for sub in used)
    need(settable, f"the mapping of {title} {NOT_SETTABLE}")
    wrong = _unmapped(subject, pdo, used[1:])
    need(not wrong, f"the file itself maps in {title} what it does not let be mapped: {wrong}")
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
    yield step.asking("3.22", step.rewritten("4. sub-index 0 is as it was", *number))
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
    may = [each for each in subject.objects if each.pdo_mappable and each.access_type in MAPPABLE[pdo.direction]]
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
    dummies = (each << 16 | DATA_TYPES[each].bits for each in DUMMIES if usage(f"dummy{each:04x}") == "1")
    dummy = next((each for each in dummies if _may_be_tried(subject, pdo, each)), None)
    if dummy is not None:
        yield step.asking("3.33", step.write("a dummy may be mapped", entry, value=hexadecimal(dummy, 8)))
    yield step.write("the file's entry", entry, value=hexadecimal(subject.number(entry), 8))


def _may_be_tried(subject: Subject, pdo: Pdo, entry: int) -> bool:
    """Whether a PDO's first entry may be this: it can be mapped there, and is within the entry's own limits."""
    return subject.may_be((pdo.mapping_index, 1), entry) and _may_be_mapped(subject, pdo, entry)


def _entry(each: ODVariable) -> str:
    return hexadecimal(each.index << 16 | each.subindex << 8 | data_type(each).bits, 8)


# The chapter

RPDO, TPDO = PdoDirection.RPDO, PdoDirection.TPDO


def _enter(
    direction: PdoDirection,
    steps: Callable[[Subject, Pdo], Steps],
    number: str,
    topic: str,
    tier: Tier = Tier.READING,
    ctt: str = "",
    name: str = "{}",
) -> None:
    """Enter what is done with each PDO of a direction as a clause."""
    CHAPTER.clause(number, topic, tier, ctt, name=direction.name)(each_of(direction, steps, name))


CHAPTER.clause("7.5.2.35", "RPDOs", ctt="3.1")(partial(_scan, direction=RPDO))
CHAPTER.clause("7.5.2.37", "TPDOs", ctt="3.2")(partial(_scan, direction=TPDO))
_enter(RPDO, _default_mapping, "7.5.2.36", "RPDO mapping", ctt="3.21")
_enter(TPDO, _default_mapping, "7.5.2.38", "TPDO mapping", ctt="3.21")
_enter(RPDO, _restricted, "7.3.5", "RPDO identifier", Tier.REVERSIBLE, "8.10", RESTRICTED_NAME)
_enter(TPDO, _restricted, "7.3.5", "TPDO identifier", Tier.REVERSIBLE, "8.10", RESTRICTED_NAME)
_enter(RPDO, _communication, "7.5.2.35", "RPDO communication", Tier.REVERSIBLE)
_enter(RPDO, _mapping, "7.5.2.36", "RPDO mapping", Tier.REVERSIBLE)
_enter(TPDO, _communication, "7.5.2.37", "TPDO communication", Tier.REVERSIBLE)
_enter(TPDO, _mapping, "7.5.2.38", "TPDO mapping", Tier.REVERSIBLE)
CHAPTER.extend(transmission.CHAPTER)
