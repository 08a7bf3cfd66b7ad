"""Every object: access, type, limits, default, and what is refused (CiA 301, 7.2.4.3.17, 7.4 and 7.5)."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.check.conformance.subject import (
    BUSY,
    Chapter,
    Clause,
    Object,
    Subject,
    codes,
    group,
    put_back,
    read,
    save,
    skip,
    unchanged,
    write,
)
from eurobot_od.check.conformance.writing import Data
from eurobot_od.od import values
from eurobot_od.od.values import MAPPING_RECORDS, MOST_SUBS, Address, label
from eurobot_od.sdo.wire import AbortCode

IDENTITY = {1: "vendornumber", 2: "productnumber", 3: "revisionnumber"}
"""Sub-indices of 0x1018 that are the same in all devices of a kind, and the keys of [DeviceInfo] that have them."""

FREE = (0x1FFF, 0x5FFF, 0x9FFF, 0xBFFF)
"""Indices where mostly nothing is, one in each area."""

FIXED = (0x1000, 0x1008)
"""Read-only objects whose value does not depend on what the device does."""

ACTING = {0x1003, 0x1010, 0x1011, 0x1013, *range(0x1023, 0x1028), *range(0x1F50, 0x1F58)}
"""Objects whose writing does something: their own clauses look at them, or nobody should."""

MAPPINGS = {index for records in MAPPING_RECORDS.values() for index in records}

COMMUNICATIONS = {index for records in values.COMMUNICATION_RECORDS.values() for index in records}
SYNC: Address = (0x1005, 0)

CONFIGURED = ("const", "rw", "rww")
"""Access types of what has its default after power-on; `ro` and `rwr` are mostly measured."""

OUTSIDE = (AbortCode.VALUE, AbortCode.TOO_LOW, AbortCode.TOO_HIGH)
"""Aborts for the present value of an object to which the file gives none, or none within its limits."""

WRONG_LENGTH = (AbortCode.LENGTH, AbortCode.TOO_LONG, AbortCode.TOO_SHORT)


def _plain(each: Object) -> bool:
    """Whether writing an object means nothing but its value."""
    return each.address[0] not in ACTING and each.address[0] not in MAPPINGS


def _writable(subject: Subject) -> Iterator[Object]:
    return (each for each in subject.objects.values() if each.writable and _plain(each))


# Identity


def _identity(subject: Subject) -> Iterator[Data]:
    for subindex, key in IDENTITY.items():
        each = subject.find((0x1018, subindex))
        if each is None:
            continue
        said = subject.number(each.address) or _device_info(subject, key)
        if said:
            yield read(str(each), each.address, expect=said)
        else:
            yield skip(str(each), "the file does not say it")


def _device_info(subject: Subject, key: str) -> int:
    number = values.parse_number(subject.dictionary.device.document.text("deviceinfo", key))
    return number.value if number else 0


# Values


def _readable(subject: Subject) -> Iterator[Data]:
    """Read everything; the value must have the length of its type. What has no value now may say so."""
    for each in subject.objects.values():
        if each.readable:
            none_now = [AbortCode.NO_DATA, *([AbortCode.NO_SUBINDEX] if each.address[0] == 0x1003 else [])]
            yield read(str(each), each.address, optional=codes(*none_now), **_length(each))


def _length(each: Object) -> dict[str, object]:
    """Have the length looked at: reading a number as a number does."""
    return {"save": "read"} if each.typed else {}


def _defaults(subject: Subject) -> Iterator[Data]:
    for each in subject.objects.values():
        configured = each.access in CONFIGURED or each.address[0] in FIXED
        own = each.address == subject.dictionary.node_id_address  # what the suite was given, not what the file says
        if each.readable and configured and not own and each.address[0] not in ACTING:
            yield from _default(each)


def _default(each: Object) -> Iterator[Data]:
    content = each.default_bytes
    if content is None or (not content and not each.type.size):
        return
    if isinstance(each.default, int) and each.typed and each.in_limits:
        yield read(str(each), each.address, expect=int(each.default))
    elif len(content) <= 200:  # a file within the file is compared nowhere
        yield read(str(each), each.address, data=content.hex(" ").upper())


# Access


def _write_only(subject: Subject) -> Iterator[Data]:
    for each in subject.objects.values():
        if not each.readable:
            yield read(str(each), each.address, abort=codes(AbortCode.WRITE_ONLY))


def _read_only(subject: Subject) -> Iterator[Data]:
    for each in subject.objects.values():
        if not each.writable:
            zeros = bytes(each.type.size or 1).hex(" ")
            yield write(str(each), each.address, data=zeros, abort=codes(AbortCode.READ_ONLY))


def _own_values(subject: Subject) -> Iterator[Data]:
    """Write what is there already, and read it again."""
    for each in _writable(subject):
        if not each.readable:
            yield skip(str(each), "write-only: what is there is not known, so nothing is written")
        elif each.type is values.DOMAIN:
            yield skip(str(each), "a DOMAIN may be a program: nothing is written")
        else:
            refused = BUSY if _has_value(subject, each) else (*BUSY, *OUTSIDE)
            written = {**put_back(each, optional=codes(*refused)), "name": "it is written"}
            yield group(f"{each}: the value it has", save(each), written, unchanged(each))


def _has_value(subject: Subject, each: Object) -> bool:
    """Whether the file gives an object a value that it may have: a PDO cannot be synchronous without SYNC."""
    if not isinstance(each.default, int):
        return each.default is not None
    is_type = each.address[0] in COMMUNICATIONS and each.address[1] == values.TRANSMISSION_TYPE
    cannot_be = is_type and each.default in values.SYNCHRONOUS and SYNC not in subject.objects
    return each.in_limits and not cannot_be


# Refusals


def _unknown_objects(subject: Subject) -> Iterator[Data]:
    for index in FREE:
        if index not in subject.dictionary.members:
            yield read(f"read {label((index, 0))}", (index, 0), abort=codes(AbortCode.NO_OBJECT))
            yield write(
                f"write {label((index, 0))}",
                (index, 0),
                data="00",
                abort=codes(AbortCode.NO_OBJECT),
            )


def _unknown_subindices(subject: Subject) -> Iterator[Data]:
    for index, members in subject.dictionary.members.items():
        free = max(members, default=MOST_SUBS) + 1
        if free <= MOST_SUBS:
            address: Address = index, free
            yield read(f"read {label(address)}", address, abort=codes(AbortCode.NO_SUBINDEX))


def _wrong_lengths(subject: Subject) -> Iterator[Data]:
    for each in _writable(subject):
        size = each.type.size
        if size:
            yield _of_length(each, size + 1, "too long")
        if size > 1:
            yield _of_length(each, size - 1, "too short")


def _of_length(each: Object, size: int, what: str) -> Data:
    content = bytes(size).hex(" ")
    return write(f"{each}: {size} bytes are {what}", each.address, data=content, abort=codes(*WRONG_LENGTH))


def _limits(subject: Subject) -> Iterator[Data]:
    for each in _writable(subject):
        refused = list(_outside(each))
        if refused and each.readable:
            yield group(str(each), save(each), *refused, unchanged(each))
        elif refused:
            yield group(str(each), *refused)


def _outside(each: Object) -> Iterator[Data]:
    """Write the values next to the limits, and have them refused."""
    for value, what, code in (
        (None if each.low is None else each.low - 1, "too low", AbortCode.TOO_LOW),
        (None if each.high is None else each.high + 1, "too high", AbortCode.TOO_HIGH),
    ):
        if value is not None and each.typed:
            yield write(f"{value} is {what}", each.address, value=value, abort=codes(code, AbortCode.VALUE))


# Other values: destructive


def _other_values(subject: Subject) -> Iterator[Data]:
    """Write another value to each configuration object, and put back the one it had."""
    if not subject.destructive:
        yield skip("configuration objects take other values", "only with --destructive")
        return
    for each in _writable(subject):
        other = _other(each) if _is_setting(subject, each) else None
        if other is not None:
            written = write(f"{other} is written", each.address, value=other, optional=codes(*BUSY))
            seen = read("and read again", each.address, expect=other)
            yield group(f"{each}: another value", save(each), written, seen, put_back(each))


def _is_setting(subject: Subject, each: Object) -> bool:
    """Whether an object is one of the device's own settings, and not its node-ID."""
    own = each.address[0] >= values.MANUFACTURER[0] and each.address != subject.dictionary.node_id_address
    return own and each.access == "rw" and not each.mappable and _has_value(subject, each)


def _other(each: Object) -> int | None:
    """Return a value that an object may have besides its default, None if there is none, or if it is a text."""
    if not each.type.is_integer:
        return None
    low = each.type.low if each.low is None else each.low
    high = each.type.high if each.high is None else each.high
    present = each.default if isinstance(each.default, int) else 0
    return next((value for value in (present + 1, present - 1) if low <= value <= high), None)


CHAPTER = Chapter(
    "objects",
    "objects",
    (
        Clause("7.2.4.3.17", "Unknown object", _unknown_objects),
        Clause("7.2.4.3.17", "Unknown sub-index", _unknown_subindices),
        Clause("7.5.2.21", "Identity", _identity),
        Clause("7.4.4", "Length of the type", _readable),
        Clause("7.3.2.2.3", "Default after a reset", _defaults),
        Clause("7.4.5", "Write-only", _write_only),
        Clause("7.4.5", "Read-only", _read_only),
        Clause("7.4.5", "Writable", _own_values),
        Clause("7.2.4.3.17", "Wrong length", _wrong_lengths),
        Clause("7.2.4.3.17", "Limits", _limits),
        Clause("7.4.5", "Writable", _other_values),
    ),
)
