"""Rules about PDOs: their communication parameters, their identifiers and their mappings (CiA 301)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from eurobot_od.lint.file_rules import Check, dummies
from eurobot_od.lint.findings import Problem, Problems, Rule
from eurobot_od.lint.model import MULTIPLEXED, LintedDevice, LintedPdo, MappingEntry
from eurobot_od.od.description import DescribedVariable
from eurobot_od.od.document import Entry, Section
from eurobot_od.od.values import (
    ACCESS_TYPES,
    BASE_IDENTIFIER,
    DATA_TYPES,
    DEFAULT_PDO_BASES,
    EXTENDED,
    MAPPABLE,
    MAPPING_OFFSET,
    NO_RTR,
    PREDEFINED,
    RESERVED,
    RESTRICTED,
    UNSIGNED32,
    IdentifierRange,
    PdoDirection,
    owner,
)

MOST_BITS = 64
MOST_OBJECTS = 64
RESERVED_BITS = 0x1FFFF800
"""Bits 11 to 28 of a COB-ID, which are 0 for a base frame."""


def _setting(device: LintedDevice, sub: int) -> Iterator[tuple[LintedPdo, Entry, int]]:
    """Give a communication parameter of every PDO that has it: the PDO, where it stands, its value without node-ID."""
    for pdo in device.pdos:
        variable = pdo.setting(sub)
        at, value = (variable.value_entry, variable.value) if variable else (None, None)
        if at and value:
            yield pdo, at, value.value


# Records


def mapping_only(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapping records without their communication record."""
    for pdo in device.pdos:
        if pdo.mapping and pdo.communication is None:
            yield Problem(
                pdo.mapping.place, f"{pdo.name} has a mapping, but no 0x{pdo.mapping.index - MAPPING_OFFSET:04X}"
            )


def communication_only(device: LintedDevice) -> Iterator[Problem]:
    """Yield communication records without their mapping record."""
    for pdo in device.pdos:
        if pdo.communication and pdo.mapping is None:
            yield Problem(
                pdo.communication.place, f"{pdo.name} has no mapping 0x{pdo.communication.index + MAPPING_OFFSET:04X}"
            )


def without_parameters(device: LintedDevice) -> Iterator[Problem]:
    """Yield communication records without COB-ID or transmission type."""
    for pdo in device.pdos:
        missing = [sub for sub in (1, 2) if pdo.setting(sub) is None]
        if pdo.communication and missing:
            what = "COB-ID" if missing[0] == 1 else "transmission type"
            yield Problem(pdo.communication.place, f"{pdo.name} has no {what} (sub {missing[0]})")


RECORD_RULES = (
    Rule("E601", "A PDO mapping has its communication record.", "CiA 301, objects 0x1600 and 0x1A00", mapping_only),
    Rule("E602", "A PDO communication record has its mapping.", "CiA 301, objects 0x1400 and 0x1800",
         communication_only),
    Rule("E603", "A PDO has a COB-ID and a transmission type.", "CiA 301, objects 0x1400 and 0x1800",
         without_parameters),
)  # fmt: skip

# Identifiers


def reserved_bits(device: LintedDevice) -> Iterator[Problem]:
    """Yield COB-IDs of base frames with bits that have to be 0."""
    for pdo, at, cob_id in _setting(device, 1):
        if not cob_id & EXTENDED and cob_id & RESERVED_BITS:
            yield Problem(at, f"COB-ID {at.value[:20]} of {pdo.name} has bits 11 to 28 set without bit 29")


def extended(device: LintedDevice) -> Iterator[Problem]:
    """Yield PDOs with 29-bit identifiers."""
    for pdo, at, cob_id in _setting(device, 1):
        if cob_id & EXTENDED:
            yield Problem(at, f"{pdo.name} has a 29-bit identifier, which few devices know")


def _identifiers(device: LintedDevice) -> Iterator[tuple[LintedPdo, Entry | Section, int]]:
    """Give every PDO that is valid with its identifier for the lowest node-ID, and where that stands."""
    for pdo in device.pdos:
        identifier, variable = pdo.identifier(device.node_ids[0]), pdo.setting(1)
        if identifier is not None and variable:
            yield pdo, variable.place, identifier


def _is_own(device: LintedDevice, pdo: LintedPdo) -> bool:
    """Whether a PDO's COB-ID is made from the node-ID, as in the pre-defined connection set."""
    cob_id = pdo.value(1)
    return cob_id is not None and (cob_id.relative or device.node_id is not None)


def in_range_of(ranges: tuple[IdentifierRange, ...], sentence: str) -> Check:
    """Make the rule that no PDO has an identifier in some ranges."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        for pdo, at, identifier in _identifiers(device):
            found = owner(identifier, ranges)
            if found:
                yield Problem(at, f"{pdo.name} has identifier 0x{identifier:03X}, {sentence} {found.whose(identifier)}")

    return check


def in_predefined(device: LintedDevice) -> Iterator[Problem]:
    """Yield identifiers that are not made from the node-ID, but lie where another node's default could be."""
    for pdo, at, identifier in _identifiers(device):
        found = owner(identifier, PREDEFINED)
        if found and not _is_own(device, pdo):
            text = f"{pdo.name} has the custom identifier 0x{identifier:03X}, by default {found.whose(identifier)}"
            yield Problem(at, text)


def on_default_base(device: LintedDevice) -> Iterator[Problem]:
    """Yield identifiers equal to the base of the PDO's own default, without the node-ID."""
    for pdo, at, identifier in _identifiers(device):
        bases = DEFAULT_PDO_BASES[pdo.direction]
        if pdo.number <= len(bases) and identifier == bases[pdo.number - 1]:
            yield Problem(
                at, f"{pdo.name} has 0x{identifier:03X}, the base of its default: CANopenNode adds the node-ID to it"
            )


def one_identifier(device: LintedDevice) -> Iterator[Problem]:
    """Yield identifiers that two valid PDOs of the device have."""
    first: dict[int, LintedPdo] = {}
    for pdo, at, identifier in _identifiers(device):
        if first.setdefault(identifier, pdo) is not pdo:
            yield Problem(at, f"{pdo.name} has identifier 0x{identifier:03X}, as {first[identifier].name} has")


def outside_cob_id(device: LintedDevice) -> Iterator[Problem]:
    """Yield COB-IDs whose node-ID carries over into the bits above the identifier."""
    for pdo, at, cob_id in _setting(device, 1):
        value = pdo.value(1)
        if value and value.relative and (cob_id & BASE_IDENTIFIER) + device.node_ids[-1] > BASE_IDENTIFIER:
            yield Problem(at, f"COB-ID {at.value[:20]} of {pdo.name} leaves 11 bits for the highest node-ID")


IDENTIFIER_RULES = (
    Rule("E604", "Bits 11 to 28 of the COB-ID of a base frame are 0.", "CiA 301, objects 0x1400 and 0x1800",
         reserved_bits),
    Rule("W605", "PDOs have 11-bit identifiers.", "CiA 301, objects 0x1400 and 0x1800", extended),
    Rule("E606", "No PDO has an identifier of NMT, SDO, heartbeat or LSS.",
         "CiA 301, restricted CAN-IDs; public: CANopenNode, CO_IS_RESTRICTED_CAN_ID",
         in_range_of(RESTRICTED, "restricted to")),
    Rule("I607", "A custom identifier is not one of those restricted to services that the network may not have.",
         "CiA 301, restricted CAN-IDs; public: CANopenNode, CO_IS_RESTRICTED_CAN_ID, refuses them by SDO; they work as "
         "long as no such service is in the network, hence no error",
         in_range_of(RESERVED, "restricted to services not every network has:")),
    Rule("I608", "A custom identifier is not where a node has its default one.",
         "CiA 301, pre-defined connection set; an error only if that node-ID is in the network (E808)", in_predefined),
    Rule("W609", "No identifier is the base of the PDO's own default.",
         "public: CANopenNode, CO_PDO.c, adds the node-ID to such an identifier", on_default_base),
    Rule("E610", "The valid PDOs of a device have different identifiers.", "CiA 301, PDO", one_identifier),
    Rule("E611", "$NODEID+... stays inside 11 bits.", "CiA 301, objects 0x1400 and 0x1800", outside_cob_id),
)  # fmt: skip

# Transmission

SYNCHRONOUS, RTR_TYPES = range(241), (252, 253)


def transmission_of(direction: PdoDirection, is_reserved: Callable[[int], bool], sentence: str) -> Check:
    """Make the rule that no PDO of a direction has a reserved transmission type."""

    def check(device: LintedDevice) -> Iterator[Problem]:
        for pdo, at, value in _setting(device, 2):
            if pdo.direction is direction and is_reserved(value):
                yield Problem(at, f"transmission type {value} of {pdo.name}: {sentence}")

    return check


def rtr_forbidden(device: LintedDevice) -> Iterator[Problem]:
    """Yield TPDOs that are sent on a remote frame only, and allow none."""
    for pdo, at, value in _setting(device, 2):
        cob_id = pdo.value(1)
        if pdo.direction is PdoDirection.TPDO and value in RTR_TYPES and cob_id and cob_id.value & NO_RTR:
            yield Problem(
                at, f"{pdo.name} is sent on a remote frame (type {value}), but bit 30 of its COB-ID forbids them"
            )


def synchronous_without_sync(device: LintedDevice) -> Iterator[Problem]:
    """Yield synchronous PDOs of a device without SYNC."""
    for pdo, at, value in _setting(device, 2):
        if (value in SYNCHRONOUS or value == RTR_TYPES[0]) and 0x1005 not in device.objects and pdo.is_valid:
            yield Problem(at, f"{pdo.name} is synchronous (type {value}), but the device has no SYNC (0x1005)")


def compatibility_entry(device: LintedDevice) -> Iterator[Problem]:
    """Yield values of the reserved sub-index 4."""
    for pdo, at, value in _setting(device, 4):
        if value:
            yield Problem(at, f"sub 4 of {pdo.name} is {at.value[:20]}, but is reserved")


def inhibited_rpdo(device: LintedDevice) -> Iterator[Problem]:
    """Yield RPDOs with an inhibit time or a SYNC start value, which only TPDOs have."""
    for sub in (3, 6):
        for pdo, at, value in _setting(device, sub):
            if pdo.direction is PdoDirection.RPDO and value:
                yield Problem(
                    at,
                    f"{pdo.name} has {'an inhibit time' if sub == 3 else 'a SYNC start value'}, which RPDOs do not use",
                )


def sync_start(device: LintedDevice) -> Iterator[Problem]:
    """Yield SYNC start values above the highest counter."""
    for pdo, at, value in _setting(device, 6):
        if not 0 <= value <= 240:
            yield Problem(at, f"SYNC start value {value} of {pdo.name} is not 0 to 240")


def slower_than_event(device: LintedDevice) -> Iterator[Problem]:
    """Yield event timers shorter than the inhibit time (100 us against ms)."""
    for pdo, at, milliseconds in _setting(device, 5):
        inhibit = pdo.value(3)
        if pdo.direction is PdoDirection.TPDO and inhibit and 0 < milliseconds * 10 < inhibit.value:
            yield Problem(
                at,
                f"event timer {milliseconds} ms of {pdo.name} is shorter than its inhibit time {inhibit.value}",
            )


TRANSMISSION_RULES = (
    Rule("E620", "A TPDO's transmission type is 0 to 240 or 252 to 255.",
         "CiA 301, object 0x1800 sub 2; public: manuals of Lika RD4, Applied Motion ST10, Gefran RK5C",
         transmission_of(PdoDirection.TPDO, lambda v: not (v in SYNCHRONOUS or 252 <= v <= 255),
                         "241 to 251 are reserved")),
    Rule("E621", "An RPDO's transmission type is 0 to 240, 254 or 255.",
         "CiA 301, object 0x1400 sub 2; public: manual of Lika RD4, object 1400",
         transmission_of(PdoDirection.RPDO, lambda v: not (v in SYNCHRONOUS or v in (252, 253, 254, 255)),
                         "241 to 253 are reserved")),
    Rule("W622", "No RPDO is for remote frames only.",
         "CiA 301, object 0x1400 sub 2; public: Lika RD4 lists 252 and 253 for RPDOs too, hence a warning",
         transmission_of(PdoDirection.RPDO, lambda v: v in RTR_TYPES,
                         "remote frames ask for TPDOs; reserved for RPDOs")),
    Rule("E623", "A TPDO sent on remote frames allows them.", "CiA 301, object 0x1800", rtr_forbidden),
    Rule("W624", "A device with synchronous PDOs has a SYNC.", "CiA 301, object 0x1005", synchronous_without_sync),
    Rule("W625", "Sub-index 4 is reserved.", "CiA 301, objects 0x1400 and 0x1800", compatibility_entry),
    Rule("W626", "Inhibit time and SYNC start value are for TPDOs.", "CiA 301, object 0x1400", inhibited_rpdo),
    Rule("E627", "A SYNC start value is 0 to 240.", "CiA 301, object 0x1800 sub 6", sync_start),
    Rule("W628", "An event timer is not shorter than the inhibit time.", "CiA 301, object 0x1800", slower_than_event),
)  # fmt: skip

# Mappings


def _counts(device: LintedDevice) -> Iterator[tuple[LintedPdo, DescribedVariable, int]]:
    """Give the number of mapped objects of every PDO that says one: the PDO, sub-index 0, the number."""
    for pdo in device.pdos:
        variable, count = pdo.mapping.variable(0) if pdo.mapping else None, pdo.amount
        if variable and count:
            yield pdo, variable, count.value


def count_range(device: LintedDevice) -> Iterator[Problem]:
    """Yield numbers of mapped objects that cannot be."""
    for pdo, variable, count in _counts(device):
        if not 0 <= count <= MOST_OBJECTS and count not in MULTIPLEXED:
            yield Problem(variable.place, f"{pdo.name} maps {count} objects, not 0 to 64 (254 and 255: multiplexed)")


def too_few_entries(device: LintedDevice) -> Iterator[Problem]:
    """Yield numbers of mapped objects above the entries there are."""
    for pdo, variable, count in _counts(device):
        missing = next(
            (n for n in range(1, min(count, MOST_OBJECTS) + 1) if pdo.mapping and not pdo.mapping.variable(n)), 0
        )
        if missing and not pdo.is_multiplexed:
            yield Problem(variable.place, f"{pdo.name} maps {count} objects, but has no sub {missing}")


def no_entry(device: LintedDevice) -> Iterator[Problem]:
    """Yield entries among the mapped ones that map nothing."""
    for pdo, _, count in _counts(device):
        for n in range(1, min(count, MOST_OBJECTS) + 1) if not pdo.is_multiplexed else ():
            variable = pdo.mapping.variable(n) if pdo.mapping else None
            if variable and (variable.value is None or variable.value.value == 0):
                yield Problem(variable.place, f"{pdo.name} maps {count} objects, but entry {n} is empty")


def no_data(device: LintedDevice) -> Iterator[Problem]:
    """Yield PDOs without data."""
    for pdo, variable, count in _counts(device):
        if count == 0 and pdo.is_valid:
            yield Problem(variable.place, f"{pdo.name} has no data; some devices take 0 objects as a disabled mapping")


def left_over(device: LintedDevice) -> Iterator[Problem]:
    """Yield the first entry after the mapped ones that is not empty."""
    for pdo, _, count in _counts(device):
        unused = (v for sub, v in pdo.mapping.subs.items() if count < sub < 255 and v.value) if pdo.mapping else ()
        first = next((v for v in unused if v.value and v.value.value), None)
        if first and not pdo.is_multiplexed:
            yield Problem(first.place, f"{pdo.name} maps {count} objects, so that entry {first.sub} is not used")


def too_long(device: LintedDevice) -> Iterator[Problem]:
    """Yield mappings of more than 64 bits."""
    for pdo, variable, _ in _counts(device):
        if pdo.bits > MOST_BITS:
            yield Problem(variable.place, f"{pdo.name} maps {pdo.bits} bits, a PDO has at most 64")


def _objects(device: LintedDevice) -> Iterator[tuple[LintedPdo, MappingEntry, DescribedVariable]]:
    """Give every mapped object that is a variable."""
    for pdo, each in device.mapped:
        variable = device.variable(each.index, each.sub)
        if variable:
            yield pdo, each, variable


def missing_object(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped objects that are not there."""
    for pdo, each in device.mapped:
        if not _is_dummy(each) and device.variable(each.index, each.sub) is None:
            yield Problem(each.at, f"{pdo.name} maps {each.where}, which is missing")


def _is_dummy(each: MappingEntry) -> bool:
    return each.index < 0x20


def not_mappable(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped objects that must not be mapped."""
    for pdo, each, variable in _objects(device):
        if not variable.is_mappable and not _is_dummy(each):
            yield Problem(each.at, f"{pdo.name} maps {each.where}, whose PDOMapping is not 1")


def longer_than_type(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped lengths above the object's."""
    for pdo, each, variable in _objects(device):
        if variable.type and 0 < variable.type.bits < each.bits:
            yield Problem(each.at, f"{pdo.name} maps {each.bits} bits of {each.where}, a {variable.type.name}")


def _shorter(device: LintedDevice) -> Iterator[tuple[LintedPdo, MappingEntry, DescribedVariable]]:
    return (row for row in _objects(device) if row[2].type and 0 < row[1].bits < row[2].type.bits)


def _fits(each: MappingEntry, variable: DescribedVariable) -> bool:
    """Whether the limits of an object leave no value that the mapped bits cut."""
    low, high = variable.number("lowlimit"), variable.number("highlimit")
    if high is None or variable.type is None:
        return False
    signed = variable.type.low < 0
    lowest = low.value if low else variable.type.low
    return lowest >= -(1 << each.bits - 1) * signed and high.value < 1 << each.bits - signed


def cut(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped lengths that cut values."""
    for pdo, each, variable in _shorter(device):
        if not _fits(each, variable):
            text = f"{pdo.name} maps {each.bits} bits of {each.where}, whose values need more: the upper bits are lost"
            yield Problem(each.at, text)


def shortened(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped lengths below the type's that cut no value."""
    for pdo, each, variable in _shorter(device):
        if _fits(each, variable) and variable.type:
            text = f"{pdo.name} maps {each.bits} of {variable.type.bits} bits of {each.where}; CANopenNode maps bytes"
            yield Problem(each.at, text)


def direction_of(direction: PdoDirection) -> Check:
    """Make the rule that PDOs of a direction map objects whose access type allows it."""
    refused = set(ACCESS_TYPES) - set(MAPPABLE[direction])

    def check(device: LintedDevice) -> Iterator[Problem]:
        for pdo, each, variable in _objects(device):
            if pdo.direction is direction and variable.access in refused:
                yield Problem(each.at, f"{pdo.name} maps {each.where}, which is {variable.access}")

    return check


def dummy_in_tpdo(device: LintedDevice) -> Iterator[Problem]:
    """Yield dummies in TPDOs."""
    for pdo, each in device.mapped:
        if _is_dummy(each) and pdo.direction is PdoDirection.TPDO:
            yield Problem(each.at, f"{pdo.name} maps dummy 0x{each.index:04X}; only RPDOs skip bits")


def disabled_dummy(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped dummies that [DummyUsage] does not allow."""
    enabled = {code for code, entry in dummies(device).items() if entry.value == "1"}
    for pdo, each in device.mapped:
        if _is_dummy(each) and each.index not in enabled and pdo.direction is PdoDirection.RPDO:
            yield Problem(each.at, f"{pdo.name} maps dummy 0x{each.index:04X}, which [DummyUsage] does not enable")


def dummy_length(device: LintedDevice) -> Iterator[Problem]:
    """Yield dummies of another length than their type's."""
    for pdo, each in device.mapped:
        type_ = DATA_TYPES.get(each.index)
        if type_ and type_.bits != each.bits:
            yield Problem(each.at, f"{pdo.name} maps {each.bits} bits of dummy {type_.name}, which has {type_.bits}")


def no_bits(device: LintedDevice) -> Iterator[Problem]:
    """Yield mapped objects of length 0."""
    for pdo, each in device.mapped:
        if each.bits == 0:
            yield Problem(each.at, f"{pdo.name} maps {each.where} with 0 bits")


def mapped_twice(device: LintedDevice) -> Iterator[Problem]:
    """Yield objects that one PDO maps twice."""
    for pdo in device.pdos:
        counts = Counter((each.index, each.sub) for each in pdo.mapped() if not _is_dummy(each))
        again = {key for key, number in counts.items() if number > 1}
        last = [each for each in pdo.mapped() if (each.index, each.sub) in again][-1:]
        yield from (Problem(each.at, f"{pdo.name} maps {each.where} twice") for each in last)


def half_writable(device: LintedDevice) -> Iterator[Problem]:
    """Yield mappings of which only the number of objects, or only the entries, can be written."""
    for pdo, variable, _ in _counts(device):
        entries = [each for sub, each in pdo.mapping.subs.items() if sub] if pdo.mapping else []
        if entries and any(each.is_writable is not variable.is_writable for each in entries):
            yield Problem(
                variable.section.at("accesstype"),
                f"sub 0 of {pdo.name}'s mapping is {variable.access}, its entries are not",
            )


def fixed_cob_id(device: LintedDevice) -> Iterator[Problem]:
    """Yield writable mappings of PDOs that cannot be made invalid."""
    for pdo in device.pdos:
        setting = pdo.setting(1)
        if setting and setting.access in ("ro", "const") and pdo.mapping and pdo.mapping.is_writable:
            at = setting.section.at("accesstype")
            yield Problem(
                at, f"{pdo.name}'s mapping is writable, but its COB-ID is not: nobody can make it invalid to change it"
            )


def relative_entry(device: LintedDevice) -> Problems:
    """Yield mapping entries that are no plain UNSIGNED32."""
    for pdo, _, count in _counts(device):
        for sub, variable in pdo.mapping.subs.items() if pdo.mapping else ():
            value = variable.value
            if 0 < sub <= count and value and (value.relative or not 0 <= value.value <= UNSIGNED32.high):
                yield Problem(variable.place, f"entry {sub} of {pdo.name} is no index, sub-index and length")


MAPPING_RULES = (
    Rule("E630", "A PDO maps 0 to 64 objects, or is multiplexed.", "CiA 301, objects 0x1600 and 0x1A00", count_range),
    Rule("E631", "A mapping has as many entries as sub-index 0 says.", "CiA 301, objects 0x1600 and 0x1A00",
         too_few_entries),
    Rule("E632", "Mapped entries have no gap.", "CiA 301, objects 0x1600 and 0x1A00", no_entry),
    Rule("I633", "A PDO has data.",
         "CiA 301, objects 0x1600 and 0x1A00; public: Kollmorgen AKD manual, `0: PDO is not active`", no_data),
    Rule("I634", "Entries after the mapped ones are empty.", "CiA 301, objects 0x1600 and 0x1A00", left_over),
    Rule("E635", "A PDO has at most 64 bits.", "CiA 301, PDO mapping", too_long),
    Rule("E636", "A mapped object is there.", "CiA 301, PDO mapping", missing_object),
    Rule("E637", "A mapped object is mappable.", "CiA 301, PDO mapping (abort 0604 0041)", not_mappable),
    Rule("E638", "A mapped length is not above the type's.", "CiA 301, PDO mapping (abort 0604 0042)",
         longer_than_type),
    Rule("W639", "A mapped length leaves room for every value of the object.", "CiA 301, PDO mapping", cut),
    Rule("I640", "A mapped length is the type's.",
         "CiA 301, PDO mapping; public: CANopenNode, CO_PDO.c, refuses lengths that are no whole bytes",
         shortened),
    Rule("E641", "An RPDO maps objects that a PDO may write: wo, rww, rw.", "CiA 306, AccessType",
         direction_of(PdoDirection.RPDO)),
    Rule("E642", "A TPDO maps objects that a PDO may read: ro, const, rwr, rw.", "CiA 306, AccessType",
         direction_of(PdoDirection.TPDO)),
    Rule("E643", "Only RPDOs map dummies.", "CiA 301, dummy entries", dummy_in_tpdo),
    Rule("E644", "A mapped dummy is enabled in [DummyUsage].", "CiA 306, [DummyUsage]", disabled_dummy),
    Rule("E645", "A mapped dummy has the length of its type.", "CiA 301, dummy entries", dummy_length),
    Rule("E646", "A mapped object has at least one bit.", "CiA 301, PDO mapping", no_bits),
    Rule("W647", "A PDO maps an object once.", "CiA 301, PDO mapping", mapped_twice),
    Rule("W648", "Sub-index 0 and the entries of a mapping can be written, or none can.",
         "CiA 301, objects 0x1600 and 0x1A00", half_writable),
    Rule("W649", "A PDO with a writable mapping has a writable COB-ID.", "CiA 301, objects 0x1400 and 0x1800",
         fixed_cob_id),
    Rule("E650", "A mapping entry is index, sub-index and length.", "CiA 301, objects 0x1600 and 0x1A00",
         relative_entry),
)  # fmt: skip

RULES = RECORD_RULES + IDENTIFIER_RULES + TRANSMISSION_RULES + MAPPING_RULES
