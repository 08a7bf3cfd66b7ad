"""PDOs: how a master changes them, and when TPDOs are sent (CiA 301, 7.2.2 and 7.5.2.35 to 7.5.2.38).

Rule of this file: of a PDO that is changed, the file's mapping is put back entry by entry, and its COB-ID last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from eurobot_od.check.conformance.subject import (
    BUSY,
    OUTSIDE,
    Chapter,
    Clause,
    Subject,
    Tier,
    codes,
    expect,
    group,
    never,
    nmt,
    put_back,
    read,
    save,
    skip,
    title,
    unchanged,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data, hexadecimal
from eurobot_od.od.objects import address_of, data_type, in_limits
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import SYNC, SYNC_COUNTER, SYNC_PRODUCER
from eurobot_od.od.values import (
    COB_ID,
    EVENT_TIMER,
    INHIBIT_TIME,
    MAPPABLE,
    MAX_BITS,
    NOT_VALID,
    TRANSMISSION_TYPE,
    PdoDirection,
)
from eurobot_od.sdo.wire import Abort, AbortCode

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


EVENT_TIME = 100
"""Event timer with which TPDOs are looked at, ms."""

SOON, QUIET = f"{3 * EVENT_TIME} ms", "300 ms"

NOT_SETTABLE = "cannot be read, written and put back"

MISSING = 0x1FFF
"""An index where mostly nothing is."""

NO_SUCH_TYPE = (AbortCode.VALUE, AbortCode.TOO_HIGH, AbortCode.TOO_LOW, *BUSY)
"""Aborts of a device that does not send a TPDO by SYNC."""

ClauseOf = Callable[[Subject, Pdo], "Iterator[Data]"]


def _of(direction: PdoDirection, steps: ClauseOf) -> Callable[[Subject], Iterator[Data]]:
    """Make steps for all PDOs of a direction that hold."""

    def all_of_them(subject: Subject) -> Iterator[Data]:
        chosen = [each for each in subject.pdos if each.direction is direction]
        for each in chosen:
            yield from steps(subject, each)
        if not chosen:
            yield skip(direction.name, f"the file has no {direction.name} whose parameters hold")

    return all_of_them


# Communication parameters


def _communication(subject: Subject, pdo: Pdo) -> Iterator[Data]:
    cob_id = subject.settable((pdo.index, COB_ID))
    if cob_id is None:
        yield skip(pdo.title, f"the COB-ID of {pdo.title} {NOT_SETTABLE}")
    elif not pdo.valid:
        yield skip(pdo.title, f"{pdo.title} is not valid by default")
    else:
        changed = hexadecimal(subject.number(address_of(cob_id)) ^ 1, 8)
        moved = write("another identifier while it is valid", address_of(cob_id), value=changed, abort="any")
        yield group(f"{pdo.title} keeps its identifier", save(cob_id), moved, put_back(cob_id))
        time = subject.settable((pdo.index, INHIBIT_TIME)) if pdo.direction is PdoDirection.TPDO else None
        if time is not None:
            value = pdo.inhibit_time ^ 1
            other = write("another time while it is valid", address_of(time), value=value, abort="any")
            yield group(f"{pdo.title} keeps its inhibit time", save(time), other, unchanged(time))


# Mapping


def _mapping(subject: Subject, pdo: Pdo) -> Iterator[Data]:
    title, cob_id = pdo.title, subject.settable((pdo.index, COB_ID))
    used = range(max(1, len(pdo.mapping)) + 1)
    if cob_id is None:
        yield skip(title, f"the COB-ID of {title} {NOT_SETTABLE}")
    elif not all(subject.settable((pdo.mapping_index, sub)) for sub in used):
        yield skip(title, f"the mapping of {title} {NOT_SETTABLE}")
    elif wrong := _unmapped(subject, pdo, used[1:]):
        yield skip(title, f"the file itself maps in {title} what it does not let be mapped: {wrong}")
    else:
        yield group(f"{title} changed in order, and not otherwise", *_remapped(subject, pdo, cob_id))
        yield _at_most(subject, pdo, cob_id)


def _unmapped(subject: Subject, pdo: Pdo, subs: Iterable[int]) -> str:
    """Return an entry of the file that a device which is its file refuses to be given again; empty if there is none."""
    for sub in subs:
        entry = subject.number((pdo.mapping_index, sub))
        try:
            if entry:
                subject.model.check_mapped(pdo.mapping_index, entry)
        except Abort:
            return hexadecimal(entry, 8)
    return ""


def _room(subject: Subject, pdo: Pdo) -> int:
    """Return the number of entries that the file has for a mapping."""
    return max(subject.dictionary.members.get(pdo.mapping_index, ()), default=0)


def _remapped(subject: Subject, pdo: Pdo, cob_id: ODVariable) -> Iterator[Data]:
    """Change the mapping as CiA 301 says, try each step out of its order, and put all back."""
    record = pdo.mapping_index
    yield save(cob_id)
    if pdo.valid:
        yield write("sub-index 0 while it is valid", (record, 0), value=0, abort="any")
    yield _off(subject, cob_id)
    if pdo.mapping:
        entry = hexadecimal(subject.number((record, 1)), 8)
        yield write("an entry while sub-index 0 is not 0", (record, 1), value=entry, abort="any")
    yield write("2. sub-index 0 is 0", (record, 0), value=0)
    yield from _refused_entries(subject, pdo)
    yield from _mapped_again(subject, pdo, cob_id)


def _off(subject: Subject, cob_id: ODVariable) -> Data:
    off = subject.number(address_of(cob_id)) | NOT_VALID
    return write("1. not valid", address_of(cob_id), value=hexadecimal(off, 8))


def _mapped_again(subject: Subject, pdo: Pdo, cob_id: ODVariable) -> Iterator[Data]:
    """Give a PDO that is not valid, and whose sub-index 0 is 0, its entries and its COB-ID."""
    record, count = pdo.mapping_index, len(pdo.mapping)
    for sub in range(1, count + 1):
        yield write(f"3. entry {sub}", (record, sub), value=hexadecimal(subject.number((record, sub)), 8))
    yield write(f"4. sub-index 0 is {count}", (record, 0), value=count)
    yield {**put_back(cob_id), "name": "5. as it was"}
    yield read("it has its entries", (record, 0), expect=count)


def _at_most(subject: Subject, pdo: Pdo, cob_id: ODVariable) -> Data:
    """Map more bits than a PDO has; entry by entry that may be, together it is refused."""
    record, name = pdo.mapping_index, f"{pdo.title} takes {MAX_BITS} bits at most"
    wide = _widest(subject, pdo)
    if wide is None or MAX_BITS // data_type(wide).bits >= _room(subject, pdo):
        return skip(name, "the file has too few entries in it to map more")
    count = MAX_BITS // data_type(wide).bits + 1
    entries = range(1, count + 1)
    if _unmapped(subject, pdo, entries) or not all(subject.settable((record, sub)) for sub in entries):
        return skip(name, "its spare entries could not be put back")
    spare = {sub: subject.number((record, sub)) for sub in range(len(pdo.mapping) + 1, count + 1)}
    too_long = codes(AbortCode.MAPPING_TOO_LONG)
    return group(
        name,
        save(cob_id),
        _off(subject, cob_id),
        write("2. sub-index 0 is 0", (record, 0), value=0),
        *(write(f"entry {sub} of too many", (record, sub), value=_entry(wide)) for sub in range(1, count + 1)),
        write(f"{count * data_type(wide).bits} bits", (record, 0), value=count, abort=too_long),
        *(write(f"spare entry {sub}", (record, sub), value=hexadecimal(spare[sub], 8)) for sub in spare),
        *_mapped_again(subject, pdo, cob_id),
    )


def _refused_entries(subject: Subject, pdo: Pdo) -> Iterator[Data]:
    """Map what cannot be mapped, and what is not there."""
    entry = pdo.mapping_index, 1
    unmapped = (each for each in subject.objects if not each.pdo_mappable)
    fixed = next((each for each in unmapped if data_type(each).size in (1, 2, 4)), None)
    if fixed is not None:
        value = _entry(fixed)
        yield write(
            f"{title(fixed)} cannot be mapped", entry, value=value, abort=codes(AbortCode.NOT_MAPPABLE, *OUTSIDE)
        )
    if MISSING not in subject.dictionary.members:
        missing = hexadecimal(MISSING << 16 | 8, 8)
        aborts = codes(AbortCode.NO_OBJECT, AbortCode.NOT_MAPPABLE, *OUTSIDE)
        yield write("an object that is not there", entry, value=missing, abort=aborts)


def _entry(each: ODVariable) -> str:
    return hexadecimal(each.index << 16 | each.subindex << 8 | data_type(each).bits, 8)


def _widest(subject: Subject, pdo: Pdo) -> ODVariable | None:
    """Return the widest number that may be mapped there."""
    may = [each for each in subject.objects if each.pdo_mappable and each.access_type in MAPPABLE[pdo.direction]]
    numbers = [each for each in may if data_type(each).is_integer and 8 <= data_type(each).bits <= MAX_BITS]
    return max(numbers, key=lambda each: data_type(each).bits, default=None)


# When TPDOs are sent


def _sent(pdo: Pdo) -> Data:
    """Return the pattern of a TPDO: whatever its data, but of its length."""
    return {"raw": f"{pdo.cob_id:03X}#{'?' * (2 * pdo.length)}"}


def _event_timer(subject: Subject, pdo: Pdo) -> Iterator[Data]:
    timer, sent = subject.settable((pdo.index, EVENT_TIMER)), _sent(pdo)
    reasons = {
        f"{pdo.title} is not event-driven by default": pdo.transmission_type not in (254, 255),
        f"the event timer of {pdo.title} {NOT_SETTABLE}": timer is None or not in_limits(timer, EVENT_TIME),
        f"the inhibit time of {pdo.title} is longer than {EVENT_TIME} ms": pdo.inhibit_time >= 10 * EVENT_TIME,
    }
    why = subject.why_not_seen(pdo) or next((reason for reason, holds in reasons.items() if holds), "")
    if why or timer is None:
        yield skip(pdo.title, why)
        return
    yield group(
        f"{pdo.title} by its event timer",
        save(timer),
        write(f"event timer {EVENT_TIME} ms", address_of(timer), value=EVENT_TIME),
        wait("50 ms"),
        never("none in PRE-OPERATIONAL", sent, QUIET),
        nmt("start"),
        {**expect(f"again and again, {EVENT_TIME} ms apart at most", sent, SOON), "repeat": 3},
        nmt("stop"),
        wait("50 ms"),
        never("none in STOPPED", sent, QUIET),
        nmt("pre-operational"),
        put_back(timer),
    )


def _by_sync(subject: Subject, pdo: Pdo) -> Iterator[Data]:
    type_, sent = subject.settable((pdo.index, TRANSMISSION_TYPE)), _sent(pdo)
    reasons = {
        "the file has no SYNC (0x1005) with an identifier": subject.model.sync_cob_id is None,
        "the device sends SYNC itself": bool(subject.number(SYNC) & SYNC_PRODUCER),
        "the file's SYNC has a counter": bool(subject.number(SYNC_COUNTER)),
        f"the transmission type of {pdo.title} {NOT_SETTABLE}": type_ is None or not in_limits(type_, 1),
    }
    why = subject.why_not_seen(pdo) or next((reason for reason, holds in reasons.items() if holds), "")
    if why or type_ is None:
        yield skip(pdo.title, why)
        return
    sync = {"name": "SYNC", "send": {"raw": f"{subject.model.sync_cob_id:03X}#"}}
    yield group(
        f"{pdo.title} by SYNC",
        save(type_),
        write("transmission type 1", address_of(type_), value=1, optional=codes(*NO_SUCH_TYPE)),
        sync,
        never("none in PRE-OPERATIONAL", sent, QUIET),
        nmt("start"),
        wait("50 ms"),
        never("none without SYNC", sent, QUIET),
        {**group("with each SYNC", sync, expect("it comes", sent, SOON)), "repeat": 2},
        nmt("pre-operational"),
        put_back(type_),
    )


CHAPTER = Chapter(
    "pdo",
    "PDOs",
    (
        Clause("7.5.2.35", "RPDO communication", _of(PdoDirection.RPDO, _communication), Tier.REVERSIBLE),
        Clause(
            "7.5.2.36", "RPDO mapping", _of(PdoDirection.RPDO, _mapping), Tier.REVERSIBLE, "3.22 to 3.24, 3.26, 3.29"
        ),
        Clause("7.5.2.37", "TPDO communication", _of(PdoDirection.TPDO, _communication), Tier.REVERSIBLE),
        Clause(
            "7.5.2.38", "TPDO mapping", _of(PdoDirection.TPDO, _mapping), Tier.REVERSIBLE, "3.22 to 3.24, 3.26, 3.32"
        ),
        Clause("7.5.2.37", "TPDO transmission", _of(PdoDirection.TPDO, _event_timer), Tier.REVERSIBLE, "3.5"),
        Clause("7.2.2.2", "TPDO transmission", _of(PdoDirection.TPDO, _by_sync), Tier.REVERSIBLE, "3.6"),
    ),
)
