"""Every object: access, type, limits, default, and what is refused (CiA 301, 7.2.4.3.17, 7.4 and 7.5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, repeat

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import NO_DEVICE_TYPE, Chapter, Clause, Subject, Tier, need
from eurobot_od.check.conformance.step import BUSY, NO_BLOCKS, OUTSIDE, Data, Steps, codes, title
from eurobot_od.device.objects import COMMUNICATION_PROFILE
from eurobot_od.od import standard, values
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import address_of, data_type, default_bytes, default_of, in_limits, limits
from eurobot_od.od.standard import COMMANDS, DEVICE_TYPE, ERROR_FIELD, IDENTITY
from eurobot_od.od.values import COMMUNICATIONS, MAPPINGS, MOST_SUBS, NOT_SCANNED, Address, label
from eurobot_od.sdo.wire import AbortCode
from eurobot_od.support.texts import amount

CHAPTER: Chapter[Subject] = Chapter("objects", "objects")

GIVEN_UP = 0x1004

FREE = (GIVEN_UP, 0x1FFF, 0x5FFF, 0x9FFF, 0xBFFF)
"""Indices where mostly nothing is: one that CiA 301 has given up, and one in each area."""

FIXED = (DEVICE_TYPE[0], standard.DEVICE_NAME[0])
"""Read-only objects whose value does not depend on what the device does."""

ACTING = {*COMMANDS, 0x1013, *range(0x1023, 0x1028), *range(0x1F50, 0x1F58)}
"""Objects whose writing does something: their own clauses look at them, or nobody should."""

SET_BY_DEVICE = {*COMMUNICATIONS, *(index for index, _ in standard.VERIFY_CONFIGURATION)}
"""Objects that may have a value outside their limits: 0x1020 is 0 after each change of the configuration."""

CONFIGURED = ("const", "rw", "rww")
"""Access types of what has its default after power-on; `ro` and `rwr` are mostly measured."""

MAKERS = range(COMMUNICATION_PROFILE.stop, 0x10000)
"""The maker's and the profile's objects: a device that takes what it should refuse there may move."""

WRONG_LENGTH = (AbortCode.LENGTH, AbortCode.TOO_LONG, AbortCode.TOO_SHORT, AbortCode.GENERAL)
"""As those below with the general error, with which CiA's test tool lets a device refuse as well."""

NO_OBJECT = (AbortCode.NO_OBJECT, AbortCode.GENERAL)
NO_SUBINDEX = (AbortCode.NO_SUBINDEX, AbortCode.GENERAL)
READ_ONLY = (AbortCode.READ_ONLY, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)
WRITE_ONLY = (AbortCode.WRITE_ONLY, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)


def _writable(subject: Subject) -> Iterator[ODVariable]:
    """Yield the objects whose writing means nothing but their value."""
    return (each for each in subject.objects if each.writable and each.index not in (*ACTING, *MAPPINGS))


def _tried(subject: Subject) -> Iterator[ODVariable]:
    """Yield the objects to which something else may be written than they have, if only to be refused."""
    return (each for each in _writable(subject) if not subject.dictionary.flags(address_of(each)))


@Clause(CHAPTER, "7.2.4.3.17", "Unknown object")
def _unknown_objects(subject: Subject) -> Steps:
    for address in _free(subject):
        asked = "2.6" if address[0] == GIVEN_UP else ""
        yield step.asking(asked, step.read(f"read {label(address)}", address, abort=codes(*NO_OBJECT)))


@Clause(CHAPTER, "7.2.4.3.17", "Unknown object", Tier.REVERSIBLE)
def _unknown_written(subject: Subject) -> Steps:
    for address in _free(subject):
        yield step.write(f"write {label(address)}", address, data="00", abort=codes(*NO_OBJECT))


def _free(subject: Subject) -> Iterator[Address]:
    return ((index, 0) for index in FREE if index not in subject.dictionary.members)


@Clause(CHAPTER, "7.2.4.3.17", "Unknown sub-index")
def _unknown_subindices(subject: Subject) -> Steps:
    for index, members in subject.dictionary.members.items():
        # The one after the last: a device that does not check its sub-indices reads what lies behind the record.
        free = max(members, default=MOST_SUBS) + 1
        if free <= MOST_SUBS:
            address: Address = index, free
            asked = "2.5" if index == DEVICE_TYPE[0] else ""
            yield step.asking(asked, step.read(f"read {label(address)}", address, abort=codes(*NO_SUBINDEX)))


# Identity


@Clause(CHAPTER, "7.5.2.21", "Identity")
def _identity(subject: Subject) -> Steps:
    for subindex, number in enumerate(Identity.of(subject.dictionary)[:3], start=1):
        each = subject.find((IDENTITY, subindex))
        if each is not None:
            yield _told(each, number)


def _told(each: ODVariable, number: int) -> Data:
    # A master tells devices apart by these; 0 in a file mostly means that nobody has filled it in.
    if not number:
        return step.skip(title(each), "the file does not say it")
    try:
        return step.read(title(each), address_of(each), data=data_type(each).write(number).hex(" ").upper())
    except ValueError as error:  # an object too small for what [DeviceInfo] says
        return step.skip(title(each), f"[DeviceInfo] of the file: {error}")


@Clause(CHAPTER, "7.4.9", "Structure", ctt="4.5", name="0x1000:255")
def _structure(subject: Subject) -> Steps:
    """Read what 0x1000 says about itself: ObjectType VAR and DataType UNSIGNED32 (CiA 301, 7.4.9)."""
    need(subject.find(DEVICE_TYPE), NO_DEVICE_TYPE)
    # Sub-index 255 is optional: few devices have it.
    absent = codes(*NO_SUBINDEX)
    return [step.read("0x1000:255", (DEVICE_TYPE[0], values.STRUCTURE), data="07 07 00 00", optional=absent)]


# Values


@Clause(CHAPTER, "7.4.4", "Length of the type", ctt="4.1")
def _readable(subject: Subject) -> Steps:
    """Read everything; the value must have the length of its type. What has no value now may say so."""
    for each in subject.objects:
        if each.readable and subject.dictionary.flags(address_of(each)) & NOT_SCANNED:
            yield step.skip(title(each), "its ObjFlags say that a scan does not read it")
        elif each.readable:
            # What an entry of a history says that is empty is asked once, of the newest one (7.5.2.4).
            empty = (AbortCode.NO_SUBINDEX, AbortCode.GENERAL, *BUSY) if each.index == ERROR_FIELD else ()
            none_now = AbortCode.NO_DATA, *empty
            # A file within the device may have megabytes; a server without blocks is not asked for it.
            is_file = data_type(each) is values.DOMAIN
            blocks, without = ({"transfer": "block"}, NO_BLOCKS) if is_file else ({}, ())
            yield step.read(title(each), address_of(each), **blocks, optional=codes(*none_now, *without))


@Clause(CHAPTER, "7.3.2.2.3", "Default after a reset", Tier.REVERSIBLE, "4.2")
def _defaults(subject: Subject) -> Steps:
    for each in subject.objects:
        configured = each.access_type in CONFIGURED or each.index in FIXED
        # What the suite was given, and where it talks to the device: neither is always what the file says.
        own = address_of(each) in (
            subject.dictionary.device.node_id_address,
            standard.SDO_REQUESTS,
            standard.SDO_ANSWERS,
        )
        scanned = not subject.dictionary.flags(address_of(each)) & NOT_SCANNED
        if each.readable and scanned and configured and not own and each.index not in ACTING:
            yield from _default(each)


def _default(each: ODVariable) -> Steps:
    content = default_bytes(each)
    if content is None or (not content and not data_type(each).size) or each.index == IDENTITY:
        return  # of the identity [DeviceInfo] may say it better
    default = default_of(each)
    if isinstance(default, int) and data_type(each).is_integer and in_limits(each, default):
        yield step.read(title(each), address_of(each), expect=step.raw(each, int(default)))
    elif len(content) <= 200:  # a file within the file is compared nowhere
        yield step.read(title(each), address_of(each), data=content.hex(" ").upper())


# Access


def _numbers(first: str, others: str) -> Iterator[str]:
    """Yield the number of CiA's tool that asks one object, then for ever the one that asks them all."""
    return chain([first], repeat(others))


@Clause(CHAPTER, "7.4.5", "Write-only", ctt="2.4, 4.4", name="every object")
def _write_only(subject: Subject) -> Steps:
    write_only = [each for each in subject.objects if not each.readable]
    for each, asked in zip(need(write_only, "the file has no write-only object"), _numbers("2.4", "4.4")):
        yield step.asking(asked, step.read(title(each), address_of(each), abort=codes(*WRITE_ONLY)))


@Clause(CHAPTER, "7.4.5", "Read-only", Tier.DESTRUCTIVE, "4.3", only=MAKERS)
@Clause(CHAPTER, "7.4.5", "Read-only", Tier.REVERSIBLE, "4.3", only=COMMUNICATION_PROFILE)
def _read_only(subject: Subject) -> Steps:
    for each in subject.objects:
        if not each.writable:
            # Of the right length, so that only the access can be refused; and zeros, should it be taken after all: they
            # do the least.
            zeros = bytes(data_type(each).size or 1).hex(" ")
            asked = "2.3" if address_of(each) == DEVICE_TYPE else "4.3"
            yield step.asking(asked, step.write(title(each), address_of(each), data=zeros, abort=codes(*READ_ONLY)))


@Clause(CHAPTER, "7.4.5", "Writable", Tier.REVERSIBLE, "4.9")
def _own_values(subject: Subject) -> Steps:
    """Write what is there already, and read it again."""
    for each in _writable(subject):
        if not each.readable:
            yield step.skip(title(each), "write-only: what is there is not known, so nothing is written")
        elif subject.dictionary.flags(address_of(each)):
            flags = "its ObjFlags say that a configuration does not write it, or a scan not read it"
            yield step.skip(title(each), flags)
        elif data_type(each) is values.DOMAIN:
            yield step.skip(title(each), "a DOMAIN may be a program: nothing is written")
        else:
            # Some stacks refuse with 0x06090030 whatever is written to a PDO's record while it is valid.
            refused = BUSY if _has_value(each) and each.index not in SET_BY_DEVICE else (*BUSY, *OUTSIDE)
            written = step.rewritten("it is written", each, optional=codes(*refused))
            asked = "2.2" if each.index in COMMUNICATION_PROFILE else "4.9"
            own = step.group(f"{title(each)}: the value it has", step.save(each), written, step.unchanged(each))
            yield step.asking(asked, own)


def _has_value(each: ODVariable) -> bool:
    """Return whether the file gives an object a value that it may have."""
    default = default_of(each)
    return default is not None and in_limits(each, default)


# Refusals


@Clause(CHAPTER, "7.2.4.3.17", "Wrong length", Tier.DESTRUCTIVE, only=MAKERS)
@Clause(CHAPTER, "7.2.4.3.17", "Wrong length", Tier.REVERSIBLE, only=COMMUNICATION_PROFILE)
def _wrong_lengths(subject: Subject) -> Steps:
    for each in _tried(subject):
        size = data_type(each).size
        # Downloaded in one frame or by segments, as the length asks for: what is to be refused is the length, not the
        # transfer.
        longer = 4 if size in (1, 2) else size + 1
        sizes = [(longer, "many", "2.8" if longer == 4 else "")] if size else []
        if size > 1:
            sizes.append((1, "few", "2.9" if size in (2, 4) else ""))
        if sizes:
            yield _refused(each, [_of_length(each, *wrong) for wrong in sizes])


def _of_length(each: ODVariable, size: int, what: str, asked: str) -> Data:
    content, name = bytes(size).hex(" "), f"{amount(size, 'byte')}, too {what}"
    return step.asking(asked, step.write(name, address_of(each), data=content, abort=codes(*WRONG_LENGTH)))


def _refused(each: ODVariable, refused: Sequence[Data]) -> Data:
    """Have some values of an object refused; a device may say no and write all the same."""
    # Put back at once: what a device takes that it should refuse may make all that follows red.
    if not each.readable:
        return step.group(title(each), *refused)
    return step.keeping(title(each), each, *refused, step.unchanged(each))


@Clause(CHAPTER, "7.2.4.3.17", "Limits", Tier.DESTRUCTIVE, only=MAKERS)
@Clause(CHAPTER, "7.2.4.3.17", "Limits", Tier.REVERSIBLE, only=COMMUNICATION_PROFILE)
def _limits(subject: Subject) -> Steps:
    too_low, too_high = _numbers("2.11", "4.6"), _numbers("2.10", "4.6")
    for each in _tried(subject):
        refused = list(_outside(each, too_low, too_high))
        if refused:
            yield _refused(each, refused)


def _outside(each: ODVariable, too_low: Iterator[str], too_high: Iterator[str]) -> Steps:
    """Write the values next to the limits, and have them refused."""
    type_, range_ = data_type(each), limits(each)
    if range_ is None or not type_.is_integer:
        return
    for value, what, code, numbers in (
        (range_.low - 1, "too low", AbortCode.TOO_LOW, too_low),
        (range_.high + 1, "too high", AbortCode.TOO_HIGH, too_high),
    ):
        # A value that its type cannot carry would be refused by our own encoding, and never get to the device.
        if type_.low <= value <= type_.high:
            refused = codes(code, AbortCode.VALUE, AbortCode.GENERAL)
            raw = step.raw(each, int(value))
            written = step.write(f"{value} is {what}", address_of(each), value=raw, abort=refused)
            yield step.asking(next(numbers), written)


# Other values: destructive


@Clause(CHAPTER, "7.4.5", "Writable", Tier.DESTRUCTIVE)
def _other_values(subject: Subject) -> Steps:
    """Write another value to each of the device's own settings, and put back the one it had."""
    for each in _tried(subject):
        own = each.index >= values.MANUFACTURER[0] and address_of(each) != subject.dictionary.device.node_id_address
        # What a PDO can carry is a process value: writing it may move something.
        if not (own and each.access_type == "rw" and not each.pdo_mappable and _has_value(each)):
            continue
        default = default_of(each)
        present = default if isinstance(default, int) else 0
        other = next((value for value in (present + 1, present - 1) if in_limits(each, value)), None)
        if data_type(each).is_integer and other is not None:
            raw = step.raw(each, other)
            written = step.write(f"{other} is written", address_of(each), value=raw, optional=codes(*BUSY))
            seen = step.read("and read again", address_of(each), expect=raw)
            yield step.keeping(f"{title(each)}: another value", each, written, seen)
