"""Rules about PDOs: their communication parameters, their identifiers and their mappings (CiA 301)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import TypeAlias

from eurobot_od.lint.file_rules import Check, dummies
from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import LintedDevice
from eurobot_od.od import values
from eurobot_od.od.description import SIMPLE, DescribedRecords, DescribedVariable
from eurobot_od.od.document import Entry, Section
from eurobot_od.od.values import IdentifierRange, MappingEntry, Multiplex, PdoDirection, owner

RULES = Rules()

MappedObject: TypeAlias = tuple[DescribedRecords, MappingEntry, DescribedVariable, DescribedVariable]
"""A mapped variable: PDO, mapping entry, variable that holds the entry, and mapped variable."""

COMMUNICATION = "CiA 301, objects 0x1400 and 0x1800"

RESERVED_BITS = 0x1FFFF800
"""Bits 11 to 28 of a COB-ID, which must be 0 for a base frame."""


def _setting(device: LintedDevice, sub: int) -> Iterator[tuple[DescribedRecords, Entry, int]]:
    """Yield a communication parameter of every PDO that has it: PDO, place, value without node-ID."""
    for pdo in device.pdos:
        variable = pdo.setting(sub)
        at, value = (variable.value_entry, variable.value) if variable else (None, None)
        if at and value:
            yield pdo, at, value.value


def setting_of(sub: int, is_wrong: Callable[[PdoDirection, int], bool], sentence: str) -> Check:
    """Return the check that no PDO has a wrong communication parameter."""

    def check(device: LintedDevice) -> Violations:
        for pdo, at, value in _setting(device, sub):
            if is_wrong(pdo.direction, value):
                yield at, sentence.format(pdo=pdo.title, text=at.value[:20], value=value)

    return check


# Records


@RULES.rule("E601", "CiA 301, objects 0x1600 and 0x1A00")
def mapping_only(device: LintedDevice) -> Violations:
    """A PDO mapping has its communication record."""
    for pdo in device.pdos:
        if pdo.mapping and pdo.communication is None:
            yield pdo.mapping.place, f"{pdo.title} has a mapping, but no 0x{pdo.index:04X}"


@RULES.rule("E602", "CiA 301, objects 0x1400 and 0x1800")
def communication_only(device: LintedDevice) -> Violations:
    """A PDO communication record has its mapping."""
    for pdo in device.pdos:
        if pdo.communication and pdo.mapping is None:
            yield pdo.communication.place, f"{pdo.title} has no mapping 0x{pdo.mapping_index:04X}"


@RULES.rule("E603", "CiA 301, objects 0x1400 and 0x1800")
def without_parameters(device: LintedDevice) -> Violations:
    """A PDO has a COB-ID and a transmission type."""
    for pdo in device.pdos:
        missing = [sub for sub in (1, 2) if pdo.setting(sub) is None]
        if pdo.communication and missing:
            what = "COB-ID" if missing[0] == 1 else "transmission type"
            yield pdo.communication.place, f"{pdo.title} has no {what} (sub {missing[0]})"


# Identifiers


def _identifiers(device: LintedDevice) -> Iterator[tuple[DescribedRecords, Entry | Section, int]]:
    """Yield every valid PDO, the place of its identifier, and the identifier for the lowest node-ID."""
    for pdo in device.pdos:
        identifier = pdo.identifier(device.node_ids[0])
        variable = pdo.setting(1)
        if identifier is not None and variable:
            yield pdo, variable.place, identifier


def in_range_of(ranges: tuple[IdentifierRange, ...], sentence: str) -> Check:
    """Return the check that no PDO has an identifier in some ranges."""

    def check(device: LintedDevice) -> Violations:
        for pdo, at, identifier in _identifiers(device):
            found = owner(identifier, ranges)
            if found:
                yield at, f"{pdo.title} has identifier 0x{identifier:03X}, {sentence} {found.whose(identifier)}"

    return check


@RULES.rule("I608", "CiA 301, pre-defined connection set; an error only if that node-ID is in the network (E808)")
def in_predefined(device: LintedDevice) -> Violations:
    """A custom identifier is not where a node has its default one."""
    for pdo, at, identifier in _identifiers(device):
        found = owner(identifier, values.PREDEFINED)
        cob_id = pdo.value(1)
        # Made from the node-ID; in a DCF it may be written out, so that this is unknown.
        is_own = device.node_id is not None or (cob_id and cob_id.relative)
        if found and not is_own:
            yield at, f"{pdo.title} has the custom identifier 0x{identifier:03X}, by default {found.whose(identifier)}"


@RULES.rule("W609", "public: CANopenNode, CO_PDO.c, adds the node-ID to such an identifier")
def on_default_base(device: LintedDevice) -> Violations:
    """No identifier is the base of the PDO's own default."""
    for pdo, at, identifier in _identifiers(device):
        if identifier == pdo.default_base:
            yield at, f"{pdo.title} has 0x{identifier:03X}, the base of its default: CANopenNode adds the node-ID to it"


@RULES.rule("E610", "CiA 301, PDO")
def one_identifier(device: LintedDevice) -> Violations:
    """The valid PDOs of a device have different identifiers for at least one node-ID."""
    first: dict[tuple[int | None, ...], DescribedRecords] = {}
    for pdo, at, identifier in _identifiers(device):
        # The file is only wrong if they clash for every node-ID.
        everywhere = tuple(map(pdo.identifier, device.node_ids))
        if first.setdefault(everywhere, pdo) is not pdo:
            yield at, f"{pdo.title} has identifier 0x{identifier:03X}, as {first[everywhere].title} has"


@RULES.rule("E611", "CiA 301, objects 0x1400 and 0x1800")
def outside_cob_id(device: LintedDevice) -> Violations:
    """$NODEID+... stays inside 11 bits."""
    for pdo, at, cob_id in _setting(device, 1):
        value = pdo.value(1)
        highest = (cob_id & values.BASE_IDENTIFIER) + device.node_ids[-1]
        # The sum would overflow into bits 11 and above.
        if value and value.relative and highest > values.BASE_IDENTIFIER:
            yield at, f"COB-ID {at.value[:20]} of {pdo.title} leaves 11 bits for the highest node-ID"


RULES += (
    Rule("E604", "Bits 11 to 28 of the COB-ID of a base frame are 0.", COMMUNICATION,
         setting_of(values.COB_ID, lambda _, value: not value & values.EXTENDED and bool(value & RESERVED_BITS),
                    "COB-ID {text} of {pdo} has bits 11 to 28 set without bit 29")),
    Rule("W605", "PDOs have 11-bit identifiers.", COMMUNICATION,
         setting_of(values.COB_ID, lambda _, value: bool(value & values.EXTENDED),
                    "{pdo} has a 29-bit identifier, which few devices know")),
    Rule("E606", "No PDO has an identifier of NMT, SDO, heartbeat or LSS.",
         "CiA 301, restricted CAN-IDs; public: CANopenNode, CO_IS_RESTRICTED_CAN_ID",
         in_range_of(values.RESTRICTED, "restricted to")),
    Rule("I607", "A custom identifier is not one of those restricted to services that the network may not have.",
         "CiA 301, restricted CAN-IDs; public: CANopenNode, CO_IS_RESTRICTED_CAN_ID, refuses them by SDO; they work as "
         "long as no such service is in the network, hence no error",
         in_range_of(values.RESERVED, "restricted to services not every network has:")),
)  # fmt: skip

# Transmission

RTR_TYPES = (252, 253)


def is_reserved(type_: int) -> bool:
    """Return whether a transmission type is reserved for PDOs of both directions."""
    return not (type_ in values.SYNCHRONOUS or 252 <= type_ <= 255)


@RULES.rule("E623", "CiA 301, object 0x1800")
def rtr_forbidden(device: LintedDevice) -> Violations:
    """A TPDO sent on remote frames allows them."""
    for pdo, at, value in _setting(device, 2):
        cob_id = pdo.value(1)
        if pdo.direction is PdoDirection.TPDO and value in RTR_TYPES and cob_id and cob_id.value & values.NO_RTR:
            yield at, f"{pdo.title} is sent on a remote frame (type {value}), but bit 30 of its COB-ID forbids them"


@RULES.rule("W624", "CiA 301, object 0x1005")
def synchronous_without_sync(device: LintedDevice) -> Violations:
    """A device with synchronous PDOs has a SYNC."""
    for pdo, at, value in _setting(device, 2):
        # 252 samples at the SYNC and sends at the remote frame; 253 does both at the remote frame.
        if (value in values.SYNCHRONOUS or value == RTR_TYPES[0]) and 0x1005 not in device.objects and pdo.is_valid:
            yield at, f"{pdo.title} is synchronous (type {value}), but the device has no SYNC (0x1005)"


@RULES.rule("W626", "CiA 301, object 0x1400")
def inhibited_rpdo(device: LintedDevice) -> Violations:
    """Inhibit time and SYNC start value are for TPDOs."""
    for sub, what in ((3, "an inhibit time"), (6, "a SYNC start value")):
        for pdo, at, value in _setting(device, sub):
            if pdo.direction is PdoDirection.RPDO and value:
                yield at, f"{pdo.title} has {what}, which RPDOs do not use"


@RULES.rule("W628", "CiA 301, object 0x1800")
def slower_than_event(device: LintedDevice) -> Violations:
    """An event timer is not shorter than the inhibit time."""
    for pdo, at, milliseconds in _setting(device, 5):
        inhibit = pdo.value(3)  # in 100 us, the event timer in ms
        if pdo.direction is PdoDirection.TPDO and inhibit and 0 < milliseconds * 10 < inhibit.value:
            yield at, f"event timer {milliseconds} ms of {pdo.title} is shorter than its inhibit time {inhibit.value}"


TYPE = "transmission type {value} of {pdo}: "

RULES += (
    Rule("E620", "A TPDO's transmission type is 0 to 240 or 252 to 255.",
         "CiA 301, object 0x1800 sub 2; public: manuals of Lika RD4, Applied Motion ST10, Gefran RK5C",
         setting_of(values.TRANSMISSION_TYPE, lambda direction, v: direction is PdoDirection.TPDO and is_reserved(v),
                    TYPE + "241 to 251 are reserved")),
    Rule("E621", "An RPDO's transmission type is 0 to 240, 254 or 255.",
         "CiA 301, object 0x1400 sub 2; public: manual of Lika RD4, object 1400",
         setting_of(values.TRANSMISSION_TYPE, lambda direction, v: direction is PdoDirection.RPDO and is_reserved(v),
                    TYPE + "241 to 253 are reserved")),
    Rule("W622", "No RPDO is for remote frames only.",
         "CiA 301, object 0x1400 sub 2; public: Lika RD4 lists 252 and 253 for RPDOs too, hence a warning",
         setting_of(values.TRANSMISSION_TYPE, lambda direction, v: direction is PdoDirection.RPDO and v in RTR_TYPES,
                    TYPE + "remote frames ask for TPDOs; reserved for RPDOs")),
    Rule("W625", "Sub-index 4 is reserved.", COMMUNICATION,
         setting_of(4, lambda _, value: value != 0, "sub 4 of {pdo} is {text}, but is reserved")),
    Rule("E627", "A SYNC start value is 0 to 240.", "CiA 301, object 0x1800 sub 6",
         setting_of(values.SYNC_START, lambda _, value: not 0 <= value <= 240,
                    "SYNC start value {value} of {pdo} is not 0 to 240")),
)  # fmt: skip

# Mappings


def _counts(device: LintedDevice) -> Iterator[tuple[DescribedRecords, DescribedVariable, int]]:
    """Yield the number of mapped objects of every PDO that has one: PDO, sub-index 0, number."""
    for pdo in device.pdos:
        zero = pdo.entry(0)
        count = pdo.amount
        if zero and count:
            yield pdo, zero, count.value


@RULES.rule("E630", "CiA 301, objects 0x1600 and 0x1A00")
def count_range(device: LintedDevice) -> Violations:
    """A PDO maps 0 to 64 objects, or is multiplexed."""
    for pdo, variable, count in _counts(device):
        if not 0 <= count <= values.MAX_BITS and count not in set(Multiplex):
            yield variable.place, f"{pdo.title} maps {count} objects, not 0 to 64 (254 and 255: multiplexed)"


@RULES.rule("E631", "CiA 301, objects 0x1600 and 0x1A00")
def too_few_entries(device: LintedDevice) -> Violations:
    """A mapping has as many entries as sub-index 0 says."""
    for pdo, variable, count in _counts(device):
        missing = next((n for n in range(1, min(count, values.MAX_BITS) + 1) if not pdo.entry(n)), 0)
        if missing and not pdo.is_multiplexed:
            yield variable.place, f"{pdo.title} maps {count} objects, but has no sub {missing}"


@RULES.rule("E632", "CiA 301, objects 0x1600 and 0x1A00")
def no_entry(device: LintedDevice) -> Violations:
    """Mapped entries have no gap."""
    for pdo, _, count in _counts(device):
        if pdo.is_multiplexed:
            continue
        for n in range(1, min(count, values.MAX_BITS) + 1):
            variable = pdo.entry(n)
            if variable and (variable.value is None or variable.value.value == 0):
                yield variable.place, f"{pdo.title} maps {count} objects, but entry {n} is empty"


@RULES.rule("I633", "CiA 301, objects 0x1600 and 0x1A00; public: Kollmorgen AKD manual, `0: PDO is not active`")
def no_data(device: LintedDevice) -> Violations:
    """A PDO has data."""
    for pdo, variable, count in _counts(device):
        # Only an info: CANopenNode refuses PDOs without data (EMCY 0x8200), Lely accepts them.
        if count == 0 and pdo.is_valid:
            yield variable.place, f"{pdo.title} has no data; some devices take 0 objects as a disabled mapping"


@RULES.rule("W634", "CiA 301, objects 0x1600 and 0x1A00")
def left_over(device: LintedDevice) -> Violations:
    """Entries after the mapped ones are empty."""
    for pdo, _, count in _counts(device):
        # Unused entries of 0 are allowed.
        unused = (variable for sub, variable in device.subs(pdo.mapping_index).items() if count < sub < 255)
        first = next((each for each in unused if each.value and each.value.value), None)
        if first and not pdo.is_multiplexed:
            yield first.place, f"{pdo.title} maps {count} objects, so that entry {first.sub} is not used"


@RULES.rule("E635", "CiA 301, PDO mapping")
def too_long(device: LintedDevice) -> Violations:
    """A PDO has at most 64 bits."""
    for pdo, variable, _ in _counts(device):
        if pdo.bits > values.MAX_BITS:
            yield variable.place, f"{pdo.title} maps {pdo.bits} bits, a PDO has at most 64"


def _objects(device: LintedDevice) -> Iterator[MappedObject]:
    """Yield every mapped variable."""
    for pdo, each, by in device.mapped:
        variable = device.variable(*each.address)
        if variable:
            yield pdo, each, by, variable


@RULES.rule("E636", "CiA 301, PDO mapping")
def missing_object(device: LintedDevice) -> Violations:
    """A mapped object exists."""
    # Objects of a module exist once it is connected, which an EDS does not say.
    later = device.modules.brought if not device.modules.connected else ()
    for pdo, each, by in device.mapped:
        if _is_dummy(each) or each.index in later:
            continue
        if device.connected.variable(*each.address) is None:
            yield by.place, f"{pdo.title} maps {each.where}, {_missing(device, each)}"


def _missing(device: LintedDevice, each: MappingEntry) -> str:
    """Return what is missing of a mapped object: the object, or its sub-index."""
    whole = device.connected.objects.get(each.index)
    if whole is None:
        return f"but there is no object 0x{each.index:04X}"
    subs = [variable.sub for variable in whole.variables()]
    if whole.code in SIMPLE:
        return "but that has no sub-indices: it is mapped as sub 0"
    return f"but it has no such sub-index; the highest is {max(subs, default=0)}"


def _is_dummy(each: MappingEntry) -> bool:
    return each.index < 0x20  # a data type in place of an object: its bits are skipped


@RULES.rule("E637", "CiA 301, PDO mapping (abort 0604 0041)")
def not_mappable(device: LintedDevice) -> Violations:
    """A mapped object is mappable."""
    for pdo, each, by, variable in _objects(device):
        if not variable.is_mappable and not _is_dummy(each):
            yield by.place, f"{pdo.title} maps {each.where}, whose PDOMapping is not 1"


@RULES.rule("E638", "CiA 301, PDO mapping (abort 0604 0042)")
def longer_than_type(device: LintedDevice) -> Violations:
    """A mapped length is not above the type's."""
    for pdo, each, by, variable in _objects(device):
        # A text or a DOMAIN has no fixed length.
        if variable.type and 0 < variable.type.bits < each.bits:
            yield by.place, f"{pdo.title} maps {each.bits} bits of {each.where}, a {variable.type.name}"


def _shorter(device: LintedDevice) -> Iterator[MappedObject]:
    return (row for row in _objects(device) if row[3].type and 0 < row[1].bits < row[3].type.bits)


def _fits(each: MappingEntry, variable: DescribedVariable) -> bool:
    """Return whether the limits of an object exclude all values that do not fit the mapped bits."""
    low, high = variable.number("lowlimit"), variable.number("highlimit")
    if high is None or variable.type is None:  # without a limit, every value of the type is possible
        return False
    signed = variable.type.low < 0
    lowest = low.value if low else variable.type.low
    return lowest >= -(1 << each.bits - 1) * signed and high.value < 1 << each.bits - signed


@RULES.rule("W639", "CiA 301, PDO mapping")
def cut(device: LintedDevice) -> Violations:
    """A mapped length leaves room for every value of the object."""
    for pdo, each, by, variable in _shorter(device):
        if not _fits(each, variable):
            text = f"{pdo.title} maps {each.bits} bits of {each.where}, whose values need more: the upper bits are lost"
            yield by.place, text


@RULES.rule("I640", "CiA 301, PDO mapping; public: CANopenNode, CO_PDO.c, refuses lengths that are not whole bytes")
def shortened(device: LintedDevice) -> Violations:
    """A mapped length equals the type's."""
    for pdo, each, by, variable in _shorter(device):
        if _fits(each, variable) and variable.type:
            text = f"{pdo.title} maps {each.bits} of {variable.type.bits} bits of {each.where}; CANopenNode maps bytes"
            yield by.place, text


def direction_of(direction: PdoDirection) -> Check:
    """Return the check that PDOs of a direction map objects whose access type allows it."""
    refused = set(values.ACCESS_TYPES) - set(values.MAPPABLE[direction])

    def check(device: LintedDevice) -> Violations:
        for pdo, each, by, variable in _objects(device):
            if pdo.direction is direction and variable.access in refused:
                yield by.place, f"{pdo.title} maps {each.where}, which is {variable.access}"

    return check


@RULES.rule("E643", "CiA 301, dummy entries")
def dummy_in_tpdo(device: LintedDevice) -> Violations:
    """Only RPDOs map dummies."""
    for pdo, each, by in device.mapped:
        if _is_dummy(each) and pdo.direction is PdoDirection.TPDO:
            yield by.place, f"{pdo.title} maps dummy 0x{each.index:04X}; only RPDOs skip bits"


@RULES.rule("E644", "CiA 306, [DummyUsage]")
def disabled_dummy(device: LintedDevice) -> Violations:
    """A mapped dummy is enabled in [DummyUsage]."""
    enabled = {code for code, entry in dummies(device).items() if entry.value == "1"}
    for pdo, each, by in device.mapped:
        if _is_dummy(each) and each.index not in enabled and pdo.direction is PdoDirection.RPDO:
            yield by.place, f"{pdo.title} maps dummy 0x{each.index:04X}, which [DummyUsage] does not enable"


@RULES.rule("E645", "CiA 301, dummy entries")
def dummy_length(device: LintedDevice) -> Violations:
    """A mapped dummy has the length of its type."""
    for pdo, each, by in device.mapped:
        type_ = values.DATA_TYPES.get(each.index)
        if type_ and type_.bits != each.bits:
            yield by.place, f"{pdo.title} maps {each.bits} bits of dummy {type_.name}, which has {type_.bits}"


@RULES.rule("E646", "CiA 301, PDO mapping")
def no_bits(device: LintedDevice) -> Violations:
    """A mapped object has at least one bit."""
    for pdo, each, by in device.mapped:
        if each.bits == 0:
            yield by.place, f"{pdo.title} maps {each.where} with 0 bits"


@RULES.rule("W647", "CiA 301, PDO mapping")
def mapped_twice(device: LintedDevice) -> Violations:
    """A PDO maps an object once."""
    for pdo in device.pdos:
        counts = Counter(each.address for each, _ in pdo.mapped() if not _is_dummy(each))
        again = {key for key, number in counts.items() if number > 1}
        # One finding for each PDO, at its last repeated entry.
        last = [(each, by) for each, by in pdo.mapped() if each.address in again][-1:]
        yield from ((by.place, f"{pdo.title} maps {each.where} twice") for each, by in last)


@RULES.rule("W648", "CiA 301, objects 0x1600 and 0x1A00")
def half_writable(device: LintedDevice) -> Violations:
    """Sub-index 0 and the entries of a mapping can be written, or none can."""
    for pdo, variable, _ in _counts(device):
        entries = [each for sub, each in pdo.mapping.subs.items() if sub] if pdo.mapping else []
        if entries and any(each.is_writable is not variable.is_writable for each in entries):
            at = variable.section.at("accesstype")
            yield at, f"sub 0 of {pdo.title}'s mapping is {variable.access}, its entries are not"


@RULES.rule("W649", "CiA 301, objects 0x1400 and 0x1800")
def fixed_cob_id(device: LintedDevice) -> Violations:
    """A PDO with a writable mapping has a writable COB-ID."""
    for pdo in device.pdos:
        setting = pdo.setting(1)
        # Bit 31 of the COB-ID must be set to change the mapping (CiA 301, 7.5.2.36).
        if setting and setting.access in ("ro", "const") and pdo.mapping and pdo.mapping.is_writable:
            at = setting.section.at("accesstype")
            text = f"{pdo.title}'s mapping is writable, but its COB-ID is not"
            yield at, f"{text}: nobody can make it invalid to change it"


@RULES.rule("E650", "CiA 301, objects 0x1600 and 0x1A00")
def relative_entry(device: LintedDevice) -> Violations:
    """A mapping entry is index, sub-index and length."""
    for pdo, _, count in _counts(device):
        for sub, variable in device.subs(pdo.mapping_index).items():
            value = variable.value
            if 0 < sub <= count and value and (value.relative or not 0 <= value.value <= values.UNSIGNED32.high):
                yield variable.place, f"entry {sub} of {pdo.title} is not an index, a sub-index and a length"


RULES += (
    Rule("E641", "An RPDO maps objects that a PDO may write: wo, rww, rw.", "CiA 306, AccessType",
         direction_of(PdoDirection.RPDO)),
    Rule("E642", "A TPDO maps objects that a PDO may read: ro, const, rwr, rw.", "CiA 306, AccessType",
         direction_of(PdoDirection.TPDO)),
)  # fmt: skip
