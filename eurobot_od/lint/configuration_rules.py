"""Rules about what is configured: [DeviceComissioning], what only a DCF has, and the modules of a device (CiA 306)."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.lint.file_rules import bit_rates, form_of, missing_of, up_to
from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.od import dcf
from eurobot_od.od.document import BIT_RATES, Section
from eurobot_od.od.modules import CONNECTED, COUNT, SUPPORTED
from eurobot_od.od.standard import MODULE_LIST
from eurobot_od.od.values import MOST_SUBS, UNSIGNED32, Number, parse_number

RULES = Rules()

SPELLINGS = ("devicecomissioning", "devicecommissioning")
"""The section, as CiA 306 misspells it and as the dictionary spells it."""

DCF_KEYS = ("parametervalue", "denotation", "uploadfile", "downloadfile", "paramrefd")
"""Keys of objects that only a DCF has."""


@RULES.rule("E701", "CiA 306, DCF")
def without_commissioning(device: LintedDevice) -> Violations:
    """A DCF has [DeviceComissioning]."""
    if device.is_dcf and device.commissioning is None:
        yield TOP, "a DCF without [DeviceComissioning]: its node-ID is unknown"


@RULES.rule("W702", "CiA 306, DCF")
def other_spelling(device: LintedDevice) -> Violations:
    """The section is spelled [DeviceComissioning]."""
    section = device.section("devicecommissioning")
    if section:
        yield section, "[DeviceCommissioning] is spelled [DeviceComissioning] in CiA 306, and tools look for that"


@RULES.rule("E703", "CiA 306, [DeviceComissioning]")
def node_id(device: LintedDevice) -> Violations:
    """NodeID is 1 to 127."""
    section = device.commissioning
    if section and device.node_id is None:
        yield section.at("nodeid"), f"NodeID is {section.text('nodeid')[:20] or 'missing'}, not 1 to 127"


@RULES.rule("E704", "CiA 306, [DeviceComissioning]")
def bit_rate(device: LintedDevice) -> Violations:
    """Baudrate is a bit rate of CANopen in kbit/s."""
    section, number = device.commissioning, device.commissioned("baudrate")
    if section and (number is None or number.value not in BIT_RATES):
        text = section.text("baudrate")[:20] or "missing"
        yield section.at("baudrate"), f"Baudrate is {text}, not one of {BIT_RATES} kbit/s"


@RULES.rule("E705", "CiA 306, [DeviceComissioning]")
def unsupported_bit_rate(device: LintedDevice) -> Violations:
    """Baudrate is one that the device supports."""
    section, number, rates = device.commissioning, device.commissioned("baudrate"), bit_rates(device)
    if section and number and number.value in BIT_RATES and rates and number.value not in rates:
        yield section.at("baudrate"), f"Baudrate is {number.value} kbit/s, but BaudRate_{number.value} is not 1"


@RULES.rule("E708", "CiA 306, [DeviceComissioning]")
def serial_number(device: LintedDevice) -> Violations:
    """LSS_SerialNumber equals 0x1018 sub 4."""
    section, declared, real = device.commissioning, device.commissioned("lss_serialnumber"), device.value(0x1018, 4)
    if section and declared and real and declared != real:
        at = section.at("lss_serialnumber")
        yield at, f"LSS_SerialNumber is 0x{declared.value:08X}, but 0x1018 sub 4 is 0x{real.value:08X}"


@RULES.rule("W709", "CiA 306, LastEDS")
def without_last_eds(device: LintedDevice) -> Violations:
    """A DCF says which EDS it was made from."""
    section = device.section("fileinfo")
    if device.is_dcf and section and not section.text("lasteds"):
        yield section.at("lasteds"), "LastEDS is missing, which says from which EDS this DCF was made"


@RULES.rule("W710", "CiA 306, DCF")
def dcf_keys_in_eds(device: LintedDevice) -> Violations:
    """ParameterValue, Denotation, UploadFile and DownloadFile are only in a DCF."""
    for key in DCF_KEYS if not device.is_dcf else ():
        for section, entry in device.entries[key]:
            yield entry, f"{entry.key} of [{section.name}] belongs in a DCF"


@RULES.rule("E711", "CiA 306, DCF")
def parameter_of_constant(device: LintedDevice) -> Violations:
    """A constant's ParameterValue equals its DefaultValue."""
    for each in device.variables:
        given, default = each.number("parametervalue"), each.number("defaultvalue")
        if each.access == "const" and given and default and given != default:  # no master could write it
            at = each.section.at("parametervalue")
            yield at, f"ParameterValue of {each.where}, which is const, is not its DefaultValue"


@RULES.rule("E712", "CiA 306, DCF")
def file_of_number(device: LintedDevice) -> Violations:
    """Only a DOMAIN, or a string that no line can hold, has UploadFile or DownloadFile."""
    for each in device.variables:
        for key in ("uploadfile", "downloadfile"):
            entry = each.section.entries.get(key)
            # A number fits into its line.
            if entry and entry.value and each.type and each.type.size:
                yield entry, f"{entry.key} of {each.where}, a {each.type.name}"


def is_concise(text: str) -> bool:
    """Whether a text is a concise DCF in hexadecimal digits."""
    try:
        dcf.unpack(bytes.fromhex(text))
    except ValueError:  # not hexadecimal, or concise.Truncated
        return False
    return True


@RULES.rule("E713", "CiA 302-3, object 0x1F22; public: dcf-tools, dcfgen")
def concise_dcf(device: LintedDevice) -> Violations:
    """A concise DCF is complete."""
    found = device.objects.get(0x1F22)
    for sub, variable in found.subs.items() if found else ():
        at = variable.value_entry
        if sub and at and at.value and not is_concise(at.value):  # an empty one is of a node without configuration
            yield at, f"{variable.where} is not a concise DCF: count, then index, sub-index, size and data for each"


RULES += (
    Rule("E706", "NetNumber and LSS_SerialNumber are UNSIGNED32.", "CiA 306, [DeviceComissioning]",
         form_of(("NetNumber", "LSS_SerialNumber"), up_to(UNSIGNED32.high), *SPELLINGS)),
    Rule("E707", "CANopenManager is 0 or 1.", "CiA 306, [DeviceComissioning]",
         form_of(("CANopenManager",), up_to(1), *SPELLINGS)),
)  # fmt: skip


# Modules of a device that may have several: they bring objects that are there as soon as they are connected (CiA 306-1)


MODULE_RULES = Rules()
CLAUSE = "CiA 306, modular devices"

INFO_KEYS = ("ProductName", "ProductVersion", "ProductRevision", "OrderCode")
DESCRIBED_BY = {"fixedobjects": "Fixed", "subextends": "SubExt"}
"""A module's lists, and how the sections of the listed objects begin after the module's number."""


@MODULE_RULES.rule("E461", CLAUSE)
def module_count(device: LintedDevice) -> Violations:
    """NrOfEntries of [SupportedModules] is the number of modules that are described."""
    section, real = device.section(SUPPORTED), len(device.modules.supported)
    if section and parse_number(section.text("nrofentries")) != Number(real):
        yield section.at("nrofentries"), f"NrOfEntries is not {real}, the number of [M...ModuleInfo] sections"
    elif section is None and real:
        yield device.section(f"m{min(device.modules.supported)}moduleinfo") or TOP, "[SupportedModules] is missing"


@MODULE_RULES.rule("E463", CLAUSE)
def undescribed_module_object(device: LintedDevice) -> Violations:
    """An object in a module's list has a section that describes it."""
    for number in device.modules.supported:
        for part, head in DESCRIBED_BY.items():
            for entry in device.modules.listed(number, part):
                index = parse_number(entry.value)
                names = [f"m{number}{head.lower()}{index.value:{form}}" for form in ("04x", "x")] if index else []
                if not any(device.section(name) for name in names):
                    shown = f"{index.value:04X}" if index else "..."
                    yield entry, f"{entry.value[:40]} is listed, but there is no section [M{number}{head}{shown}]"


@MODULE_RULES.rule("E464", CLAUSE)
def extension_count(device: LintedDevice) -> Violations:
    """Count is a number of sub-indices, or `0;` and the bits of one; ObjExtend is a sub-index."""
    for section in _extensions(device):
        # COUNT takes a 0 as any number, but nothing is added by it.
        if not COUNT.fullmatch(section.text("count")) or section.text("count") == "0":
            yield section.at("count"), f"Count of [{section.name}] is neither a number of sub-indices nor 0;bits"
        last = section.text("objextend")
        number = parse_number(last)
        if last and (number is None or not 0 <= number.value <= MOST_SUBS):
            yield section.at("objextend"), f"ObjExtend of [{section.name}] is not a sub-index from 0 to {MOST_SUBS}"


def _infos(device: LintedDevice) -> Iterator[Section]:
    return (device.document.sections[f"m{number}moduleinfo"] for number in device.modules.supported)


def _extensions(device: LintedDevice) -> list[Section]:
    """Return the sections that describe what modules add to arrays."""
    modules = device.modules
    # [M1SubExt6000] describes what [M1SubExtends] lists; both begin alike.
    heads, sections = tuple(f"m{number}subext" for number in modules.supported), device.document.sections
    return [each for name, each in sections.items() if name.startswith(heads) and not name.endswith("extends")]


@MODULE_RULES.rule("E465", CLAUSE)
def unknown_module(device: LintedDevice) -> Violations:
    """A connected module is one that the file supports."""
    for entry in device.modules.connected:
        if entry.value != "0" and device.modules.find(entry.value) is None:
            yield entry, f"module {entry.value[:40]} is connected, but there is no [M{entry.value[:40]}ModuleInfo]"


@MODULE_RULES.rule("W466", "CiA 301, object 0x1027")
def module_list(device: LintedDevice) -> Violations:
    """A device with modules has the module list, 0x1027, and no other has it."""
    section = device.section(SUPPORTED) or device.section(CONNECTED)
    there = device.objects.get(MODULE_LIST)
    if section and there is None:
        yield section, "there are modules, but no module list (0x1027)"
    if there and section is None and not device.modules.supported:
        yield there.place, "there is a module list (0x1027), but no [SupportedModules]"


@MODULE_RULES.rule("E467", CLAUSE)
def doubly_described(device: LintedDevice) -> Violations:
    """An object that a module brings once is not extended by it, nor described for the device itself."""
    for number in device.modules.supported:
        extended = device.modules.indices(number, "subextends")
        for entry in device.modules.listed(number, "fixedobjects"):
            index = parse_number(entry.value)
            if index and index.value in extended:
                yield entry, f"0x{index.value:04X} is both in [M{number}FixedObjects] and in [M{number}SubExtends]"
            # a DCF of connected modules describes their objects in sections of their own
            elif index and index.value in device.objects and not device.modules.connected:
                yield entry, f"0x{index.value:04X} of module {number} is described as an object of the device, too"


MODULE_RULES += (
    Rule(
        "W462", "A module has a name, a version, a revision and an order code.", CLAUSE, missing_of(_infos, *INFO_KEYS)
    ),
    Rule("E468", "An extension of an array has a DataType.", CLAUSE, missing_of(_extensions, "DataType")),
    Rule("E469", "An extension of an array has an AccessType.", CLAUSE, missing_of(_extensions, "AccessType")),
)
