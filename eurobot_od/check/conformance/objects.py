"""Every object: access, type, limits, default, and refused values (CiA 301, 7.2.4.3.17, 7.4 and 7.5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, repeat

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import NO_DEVICE_TYPE, Chapter, Clause, DeviceUnderTest, Tier, need
from eurobot_od.check.conformance.step import BUSY, NO_BLOCKS, OUTSIDE, Data, Steps, codes, title
from eurobot_od.device.objects import COMMUNICATION_PROFILE
from eurobot_od.od import standard, values
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import address_of, data_type, default_bytes, default_of, in_limits, limits
from eurobot_od.od.standard import COMMANDS, DEVICE_TYPE, ERROR_FIELD, IDENTITY
from eurobot_od.od.values import COMMUNICATIONS, MAPPINGS, MOST_SUBS, NOT_SCANNED, Address, label
from eurobot_od.sdo.wire import AbortCode
from eurobot_od.support.texts import amount

CHAPTER: Chapter[DeviceUnderTest] = Chapter("objects", "objects")

REMOVED = 0x1004

FREE = (REMOVED, 0x1FFF, 0x5FFF, 0x9FFF, 0xBFFF)
"""Indices without an object in most devices: one that CiA 301 has removed, and one in each area."""

FIXED = (DEVICE_TYPE[0], standard.DEVICE_NAME[0])
"""Read-only objects whose value does not depend on what the device does."""

ACTING = {*COMMANDS, 0x1013, *range(0x1023, 0x1028), *range(0x1F50, 0x1F58)}
"""Objects whose writing is a command: they have their own clauses, or are not written."""

SET_BY_DEVICE = {*COMMUNICATIONS, *(index for index, _ in standard.VERIFY_CONFIGURATION)}
"""Objects that may have a value outside their limits: 0x1020 is 0 after each change of the configuration."""

CONFIGURED = ("const", "rw", "rww")
"""Access types of objects with their default after power-on; `ro` and `rwr` are usually measured."""

MAKERS = range(COMMUNICATION_PROFILE.stop, 0x10000)
"""Objects of the manufacturer and the profile: with a wrong value that it accepts, a device may move."""

WRONG_LENGTH = (AbortCode.LENGTH, AbortCode.TOO_LONG, AbortCode.TOO_SHORT, AbortCode.GENERAL)
"""Aborts for a wrong length; the general error, here and below, is one that CiA's tool accepts, too."""

NO_OBJECT = (AbortCode.NO_OBJECT, AbortCode.GENERAL)
NO_SUBINDEX = (AbortCode.NO_SUBINDEX, AbortCode.GENERAL)
READ_ONLY = (AbortCode.READ_ONLY, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)
WRITE_ONLY = (AbortCode.WRITE_ONLY, AbortCode.UNSUPPORTED_ACCESS, AbortCode.GENERAL)


def _writable(device: DeviceUnderTest) -> Iterator[ODVariable]:
    """Yield the objects whose writing only changes their value."""
    return (each for each in device.objects if each.writable and each.index not in (*ACTING, *MAPPINGS))


def _tried(device: DeviceUnderTest) -> Iterator[ODVariable]:
    """Yield the objects to which other values may be written, to be accepted or refused."""
    return (each for each in _writable(device) if not device.dictionary.flags(address_of(each)))


@Clause(CHAPTER, "7.2.4.3.17", "Unknown object")
def _unknown_objects(device: DeviceUnderTest) -> Steps:
    for address in _free(device):
        asked = "2.6" if address[0] == REMOVED else ""
        yield step.asking(asked, step.read(f"read {label(address)}", address, abort=codes(*NO_OBJECT)))


@Clause(CHAPTER, "7.2.4.3.17", "Unknown object", Tier.REVERSIBLE)
def _unknown_written(device: DeviceUnderTest) -> Steps:
    for address in _free(device):
        yield step.write(f"write {label(address)}", address, data="00", abort=codes(*NO_OBJECT))


def _free(device: DeviceUnderTest) -> Iterator[Address]:
    return ((index, 0) for index in FREE if index not in device.dictionary.members)


@Clause(CHAPTER, "7.2.4.3.17", "Unknown sub-index")
def _unknown_subindices(device: DeviceUnderTest) -> Steps:
    for index, members in device.dictionary.members.items():
        # The one after the last: a device that does not check sub-indices reads memory behind the record.
        free = max(members, default=MOST_SUBS) + 1
        if free <= MOST_SUBS:
            address: Address = index, free
            asked = "2.5" if index == DEVICE_TYPE[0] else ""
            yield step.asking(asked, step.read(f"read {label(address)}", address, abort=codes(*NO_SUBINDEX)))


# Identity


@Clause(CHAPTER, "7.5.2.21", "Identity")
def _identity(device: DeviceUnderTest) -> Steps:
    for subindex, number in enumerate(Identity.of(device.dictionary)[:3], start=1):
        each = device.find((IDENTITY, subindex))
        if each is not None:
            yield _identity_number(each, number)


def _identity_number(each: ODVariable, number: int) -> Data:
    # Masters identify devices by these; 0 in a file usually means that it was not filled in.
    if not number:
        return step.skip(title(each), "the file does not say it")
    try:
        return step.read(title(each), address_of(each), data=data_type(each).write(number).hex(" ").upper())
    except ValueError as error:  # the object is too small for the number in [DeviceInfo]
        return step.skip(title(each), f"[DeviceInfo] of the file: {error}")


@Clause(CHAPTER, "7.4.9", "Structure", ctt="4.5", name="0x1000:255")
def _structure(device: DeviceUnderTest) -> Steps:
    """Read sub-index 255 of 0x1000: ObjectType VAR and DataType UNSIGNED32 (CiA 301, 7.4.9)."""
    need(device.find(DEVICE_TYPE), NO_DEVICE_TYPE)
    # Sub-index 255 is optional; few devices have it.
    absent = codes(*NO_SUBINDEX)
    return [step.read("0x1000:255", (DEVICE_TYPE[0], values.STRUCTURE), data="07 07 00 00", optional=absent)]


# Values


@Clause(CHAPTER, "7.4.4", "Length of the type", ctt="4.1")
def _readable(device: DeviceUnderTest) -> Steps:
    """Read everything; each value must have the length of its type. An object may abort if it has no value now."""
    for each in device.objects:
        if each.readable and device.dictionary.flags(address_of(each)) & NOT_SCANNED:
            yield step.skip(title(each), "its ObjFlags say that a scan does not read it")
        elif each.readable:
            # Another clause tests the aborts of empty entries of the error history, by the newest one (7.5.2.4).
            empty = (AbortCode.NO_SUBINDEX, AbortCode.GENERAL, *BUSY) if each.index == ERROR_FIELD else ()
            none_now = AbortCode.NO_DATA, *empty
            # A DOMAIN may have megabytes, so it is read in blocks or not at all.
            is_file = data_type(each) is values.DOMAIN
            blocks, without = ({"transfer": "block"}, NO_BLOCKS) if is_file else ({}, ())
            yield step.read(title(each), address_of(each), **blocks, optional=codes(*none_now, *without))


@Clause(CHAPTER, "7.3.2.2.3", "Default after a reset", Tier.REVERSIBLE, "4.2")
def _defaults(device: DeviceUnderTest) -> Steps:
    for each in device.objects:
        configured = each.access_type in CONFIGURED or each.index in FIXED
        # The node-ID was given to the suite, and the SDO COB-IDs follow from it; the file may have others.
        own = address_of(each) in (
            device.dictionary.device.node_id_address,
            standard.SDO_REQUESTS,
            standard.SDO_ANSWERS,
        )
        scanned = not device.dictionary.flags(address_of(each)) & NOT_SCANNED
        if each.readable and scanned and configured and not own and each.index not in ACTING:
            yield from _default(each)


def _default(each: ODVariable) -> Steps:
    content = default_bytes(each)
    if content is None or (not content and not data_type(each).size) or each.index == IDENTITY:
        return  # the identity has its own clause
    default = default_of(each)
    if isinstance(default, int) and data_type(each).is_integer and in_limits(each, default):
        yield step.read(title(each), address_of(each), expect=step.raw(each, int(default)))
    elif len(content) <= 200:  # longer defaults, such as a DOMAIN's, are not compared
        yield step.read(title(each), address_of(each), data=content.hex(" ").upper())


# Access


@Clause(CHAPTER, "7.4.5", "Write-only", ctt="2.4, 4.4", name="every object")
def _write_only(device: DeviceUnderTest) -> Steps:
    write_only = [each for each in device.objects if not each.readable]
    for each, asked in zip(need(write_only, "the file has no write-only object"), chain(["2.4"], repeat("4.4"))):
        yield step.asking(asked, step.read(title(each), address_of(each), abort=codes(*WRITE_ONLY)))


@Clause(CHAPTER, "7.4.5", "Read-only", Tier.DESTRUCTIVE, "4.3", only=MAKERS)
@Clause(CHAPTER, "7.4.5", "Read-only", Tier.REVERSIBLE, "4.3", only=COMMUNICATION_PROFILE)
def _read_only(device: DeviceUnderTest) -> Steps:
    for each in device.objects:
        if not each.writable:
            # The right length, so that only the access can be refused; zeros do the least harm if they are accepted.
            zeros = bytes(data_type(each).size or 1).hex(" ")
            asked = "2.3" if address_of(each) == DEVICE_TYPE else "4.3"
            yield step.asking(asked, step.write(title(each), address_of(each), data=zeros, abort=codes(*READ_ONLY)))


@Clause(CHAPTER, "7.4.5", "Writable", Tier.REVERSIBLE, "4.9")
def _own_values(device: DeviceUnderTest) -> Steps:
    """Write each object's own value, and read it again."""
    for each in _writable(device):
        if not each.readable:
            yield step.skip(title(each), "write-only: what is there is not known, so nothing is written")
        elif device.dictionary.flags(address_of(each)):
            flags = "its ObjFlags say that a configuration does not write it, or a scan not read it"
            yield step.skip(title(each), flags)
        elif data_type(each) is values.DOMAIN:
            yield step.skip(title(each), "a DOMAIN may be a program: nothing is written")
        else:
            # Some stacks refuse every write to the record of a valid PDO with 0x06090030.
            refused = BUSY if _has_value(each) and each.index not in SET_BY_DEVICE else (*BUSY, *OUTSIDE)
            written = step.rewritten("it is written", each, optional=codes(*refused))
            asked = "2.2" if each.index in COMMUNICATION_PROFILE else "4.9"
            own = step.group(f"{title(each)}: the value it has", step.save(each), written, step.unchanged(each))
            yield step.asking(asked, own)


def _has_value(each: ODVariable) -> bool:
    """Return whether the file has a default for an object, within its limits."""
    default = default_of(each)
    return default is not None and in_limits(each, default)


# Refusals


@Clause(CHAPTER, "7.2.4.3.17", "Wrong length", Tier.DESTRUCTIVE, only=MAKERS)
@Clause(CHAPTER, "7.2.4.3.17", "Wrong length", Tier.REVERSIBLE, only=COMMUNICATION_PROFILE)
def _wrong_lengths(device: DeviceUnderTest) -> Steps:
    for each in _tried(device):
        size = data_type(each).size
        # The transfer, expedited or segmented, fits the length, so that only the length can be refused.
        longer = 4 if size in (1, 2) else size + 1
        if not size:
            continue
        sizes = [(longer, "many", "2.8" if longer == 4 else "")]
        if size > 1:
            sizes.append((1, "few", "2.9" if size in (2, 4) else ""))
        yield _refused(each, [_of_length(each, *wrong) for wrong in sizes])


def _of_length(each: ODVariable, size: int, what: str, asked: str) -> Data:
    content = bytes(size).hex(" ")
    name = f"{amount(size, 'byte')}, too {what}"
    return step.asking(asked, step.write(name, address_of(each), data=content, abort=codes(*WRONG_LENGTH)))


def _refused(each: ODVariable, refused: Sequence[Data]) -> Data:
    """Return steps that write values of an object to be refused; a faulty device may refuse and write all the same."""
    # Restored at once, as an accepted value may make all later steps red.
    if not each.readable:
        return step.group(title(each), *refused)
    return step.keeping(title(each), each, *refused, step.unchanged(each))


@Clause(CHAPTER, "7.2.4.3.17", "Limits", Tier.DESTRUCTIVE, only=MAKERS)
@Clause(CHAPTER, "7.2.4.3.17", "Limits", Tier.REVERSIBLE, only=COMMUNICATION_PROFILE)
def _limits(device: DeviceUnderTest) -> Steps:
    too_low = chain(["2.11"], repeat("4.6"))
    too_high = chain(["2.10"], repeat("4.6"))
    for each in _tried(device):
        refused = list(_outside(each, too_low, too_high))
        if refused:
            yield _refused(each, refused)


def _outside(each: ODVariable, too_low: Iterator[str], too_high: Iterator[str]) -> Steps:
    """Write the values just outside the limits, which must be refused."""
    type_ = data_type(each)
    range_ = limits(each)
    if range_ is None or not type_.is_integer:
        return
    for value, what, code, numbers in (
        (range_.low - 1, "too low", AbortCode.TOO_LOW, too_low),
        (range_.high + 1, "too high", AbortCode.TOO_HIGH, too_high),
    ):
        # Our own encoding would refuse a value that the type cannot hold.
        if type_.low <= value <= type_.high:
            refused = codes(code, AbortCode.VALUE, AbortCode.GENERAL)
            raw = step.raw(each, int(value))
            written = step.write(f"{value} is {what}", address_of(each), value=raw, abort=refused)
            yield step.asking(next(numbers), written)


# Other values: destructive


@Clause(CHAPTER, "7.4.5", "Writable", Tier.DESTRUCTIVE)
def _other_values(device: DeviceUnderTest) -> Steps:
    """Write another value to each setting of the manufacturer, and restore it."""
    for each in _tried(device):
        own = each.index >= values.MANUFACTURER[0] and address_of(each) != device.dictionary.device.node_id_address
        # An object that can be mapped is a process value, whose writing may move something.
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
