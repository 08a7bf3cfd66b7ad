"""Rules about the modules of a modular device (CiA 306-1, chapter 8), and what a DCF connects of them."""

from __future__ import annotations

from collections.abc import Callable

from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.od.document import Section
from eurobot_od.od.modules import CONNECTED, COUNT, SUPPORTED
from eurobot_od.od.standard import MODULE_LIST
from eurobot_od.od.values import MOST_SUBS, Number, parse_number

RULES = Rules()
CLAUSE = "CiA 306, modular devices"

INFO_KEYS = ("ProductName", "ProductVersion", "ProductRevision", "OrderCode")
DESCRIBED_BY = {"fixedobjects": "Fixed", "subextends": "SubExt"}
"""A module's lists, and how the sections of the listed objects begin after the module's number."""


@RULES.rule("E461", CLAUSE)
def module_count(device: LintedDevice) -> Violations:
    """NrOfEntries of [SupportedModules] is the number of modules that are described."""
    section, real = device.section(SUPPORTED), len(device.modules.supported)
    if section and parse_number(section.text("nrofentries")) != Number(real):
        yield section.at("nrofentries"), f"NrOfEntries is not {real}, the number of [M...ModuleInfo] sections"
    elif section is None and real:
        yield device.section(f"m{min(device.modules.supported)}moduleinfo") or TOP, "[SupportedModules] is missing"


@RULES.rule("W462", CLAUSE)
def module_info(device: LintedDevice) -> Violations:
    """A module has a name, a version, a revision and an order code."""
    for number in device.modules.supported:
        section = device.section(f"m{number}moduleinfo")
        for key in INFO_KEYS if section else ():
            if section and not section.text(key.lower()):
                yield section.at(key.lower()), f"{key} is missing in [{section.name}]"


@RULES.rule("E463", CLAUSE)
def undescribed_module_object(device: LintedDevice) -> Violations:
    """An object in a module's list has a section that describes it."""
    for number in device.modules.supported:
        for part, head in DESCRIBED_BY.items():
            for entry in device.modules.listed(number, part):
                index = parse_number(entry.value)
                names = (
                    (f"m{number}{head}{index.value:04x}".lower(), f"m{number}{head}{index.value:x}".lower())
                    if index
                    else ()
                )
                if not any(device.section(name) for name in names):
                    shown = f"{index.value:04X}" if index else "..."
                    yield entry, f"{entry.value[:40]} is listed, but there is no section [M{number}{head}{shown}]"


@RULES.rule("E464", CLAUSE)
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


def _extensions(device: LintedDevice) -> list[Section]:
    """Return the sections that describe what modules add to arrays."""
    modules = device.modules
    # [M1SubExt6000] describes what [M1SubExtends] lists; both begin alike.
    heads = tuple(f"m{number}subext" for number in modules.supported)
    return [
        s for name, s in device.document.sections.items() if name.startswith(heads) and not name.endswith("extends")
    ]


@RULES.rule("E465", CLAUSE)
def unknown_module(device: LintedDevice) -> Violations:
    """A connected module is one that the file supports."""
    for entry in device.modules.connected:
        if entry.value != "0" and device.modules.find(entry.value) is None:
            yield entry, f"module {entry.value[:40]} is connected, but there is no [M{entry.value[:40]}ModuleInfo]"


@RULES.rule("W466", "CiA 301, object 0x1027")
def module_list(device: LintedDevice) -> Violations:
    """A device with modules has the module list, 0x1027, and no other has it."""
    section = device.section(SUPPORTED) or device.section(CONNECTED)
    there = device.objects.get(MODULE_LIST)
    if section and there is None:
        yield section, "there are modules, but no module list (0x1027)"
    if there and section is None and not device.modules.supported:
        yield there.place, "there is a module list (0x1027), but no [SupportedModules]"


@RULES.rule("E467", CLAUSE)
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


def missing_of(key: str) -> Callable[[LintedDevice], Violations]:
    """Make the rule that what describes an extension has a key."""

    def check(device: LintedDevice) -> Violations:
        for section in _extensions(device):
            if not section.text(key.lower()):
                yield section.at(key.lower()), f"{key} is missing in [{section.name}]"

    return check


RULES += (
    Rule("E468", "An extension of an array has a DataType.", CLAUSE, missing_of("DataType")),
    Rule("E469", "An extension of an array has an AccessType.", CLAUSE, missing_of("AccessType")),
)
