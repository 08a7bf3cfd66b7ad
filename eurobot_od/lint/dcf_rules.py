"""Rules about device configuration files: [DeviceComissioning] and what only a DCF has (CiA 306)."""

from __future__ import annotations

from eurobot_od.lint.file_rules import bit_rates, form_of, up_to
from eurobot_od.lint.findings import Rule, Rules, Violations
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.od import concise
from eurobot_od.od.keys import BIT_RATES
from eurobot_od.od.values import UNSIGNED32

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
        concise.unpack(bytes.fromhex(text))
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
