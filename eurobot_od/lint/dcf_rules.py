"""Rules about device configuration files: [DeviceComissioning] and what only a DCF has (CiA 306)."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.lint.file_rules import BIT_RATES, TOP, Check, bit_rates, form_of, in_range_of
from eurobot_od.lint.findings import Problem, Rule
from eurobot_od.lint.model import LintedDevice
from eurobot_od.od.document import Section
from eurobot_od.od.values import DOMAIN, NODE_IDS, UNSIGNED32, parse_number

DCF_KEYS = ("parametervalue", "denotation", "uploadfile", "downloadfile", "paramrefd")
"""Keys of objects that only a DCF has."""


def without_commissioning(device: LintedDevice) -> Iterator[Problem]:
    """Yield a file named as a DCF that commissions nothing."""
    if device.is_dcf and device.commissioning is None:
        yield Problem(TOP, "a DCF without [DeviceComissioning]: nobody knows the node-ID")


def other_spelling(device: LintedDevice) -> Iterator[Problem]:
    """Yield the spelling with two m."""
    section = device.section("devicecommissioning")
    if section:
        yield Problem(
            section, "[DeviceCommissioning] is spelled [DeviceComissioning] in CiA 306, and tools look for that"
        )


def _commissioned(device: LintedDevice, key: str) -> tuple[Section, str]:
    section = device.commissioning
    return (section, section.text(key)) if section else (Section("", 1, 1, {}), "")


def node_id(device: LintedDevice) -> Iterator[Problem]:
    """Yield a node-ID outside 1 to 127."""
    section, text = _commissioned(device, "nodeid")
    if device.commissioning and device.node_id is None:
        yield Problem(section.at("nodeid"), f"NodeID is {text[:20] or 'missing'}, not {NODE_IDS[0]} to {NODE_IDS[-1]}")


def bit_rate(device: LintedDevice) -> Iterator[Problem]:
    """Yield a bit rate that CANopen has not."""
    section, text = _commissioned(device, "baudrate")
    number = parse_number(text)
    if device.commissioning and (number is None or number.value not in BIT_RATES):
        yield Problem(section.at("baudrate"), f"Baudrate is {text[:20] or 'missing'}, not one of {BIT_RATES} kbit/s")


def unsupported_bit_rate(device: LintedDevice) -> Iterator[Problem]:
    """Yield a bit rate that the device does not support."""
    section, text = _commissioned(device, "baudrate")
    number = parse_number(text)
    if number and number.value in BIT_RATES and bit_rates(device) and number.value not in bit_rates(device):
        yield Problem(
            section.at("baudrate"), f"Baudrate is {number.value} kbit/s, but BaudRate_{number.value} is not 1"
        )


def form_of_commissioning(keys: tuple[str, ...], high: int) -> Check:
    """Make the rule that values of the section, in either spelling, are numbers up to `high`."""
    names = "devicecomissioning", "devicecommissioning"
    checks = [form_of(name, keys, in_range_of(0, high), f"0 to {high}") for name in names]
    return lambda device: [each for check in checks for each in check(device)]


def serial_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield a serial number that is not the identity object's."""
    section, text = _commissioned(device, "lss_serialnumber")
    said, real = parse_number(text), device.value(0x1018, 4)
    if said and real and said != real:
        at = section.at("lss_serialnumber")
        yield Problem(at, f"LSS_SerialNumber is 0x{said.value:08X}, but 0x1018 sub 4 is 0x{real.value:08X}")


def without_last_eds(device: LintedDevice) -> Iterator[Problem]:
    """Yield a DCF that does not say from which EDS it was made."""
    section = device.section("fileinfo")
    if device.is_dcf and section and not section.text("lasteds"):
        yield Problem(section.at("lasteds"), "LastEDS is missing: nobody knows from which EDS this DCF was made")


def dcf_keys_in_eds(device: LintedDevice) -> Iterator[Problem]:
    """Yield what only a DCF has in another file."""
    for key in DCF_KEYS if not device.is_dcf else ():
        for section, entry in device.entries(key):
            yield Problem(entry, f"{entry.key} of [{section.name}] belongs in a DCF")


def parameter_of_constant(device: LintedDevice) -> Iterator[Problem]:
    """Yield values for constants that are not the constant."""
    for each in device.variables:
        given, default = each.number("parametervalue"), each.number("defaultvalue")
        if each.access == "const" and given and default and given != default:
            at = each.section.at("parametervalue")
            yield Problem(at, f"ParameterValue of {each.where}, which is const, is not its DefaultValue")


def file_of_number(device: LintedDevice) -> Iterator[Problem]:
    """Yield files to be loaded into, or from, something else than a DOMAIN."""
    for each in device.variables:
        for key in ("uploadfile", "downloadfile"):
            entry = each.section.entries.get(key)
            if entry and entry.value and each.type and each.type is not DOMAIN:
                yield Problem(entry, f"{entry.key} of {each.where}, a {each.type.name}")


def is_concise(text: str) -> bool:
    """Whether hexadecimal bytes are a concise DCF: a count, then index, sub-index, size and data so often."""
    try:
        data = bytes.fromhex(text)
    except ValueError:
        return False
    position, count = 4, int.from_bytes(data[:4], "little")
    while count and position + 7 <= len(data):
        position += 7 + int.from_bytes(data[position + 3 : position + 7], "little")
        count -= 1
    return count == 0 and position == len(data)


def concise_dcf(device: LintedDevice) -> Iterator[Problem]:
    """Yield concise DCFs that are malformed."""
    found = device.objects.get(0x1F22)
    for sub, variable in found.subs.items() if found else ():
        at = variable.value_entry
        if sub and at and at.value and not is_concise(at.value):
            yield Problem(
                at, f"{variable.where} is not a concise DCF: count, then index, sub-index, size and data for each"
            )


RULES = (
    Rule("E701", "A DCF has [DeviceComissioning].", "CiA 306, DCF", without_commissioning),
    Rule("W702", "The section is spelled [DeviceComissioning].", "CiA 306, DCF", other_spelling),
    Rule("E703", "NodeID is 1 to 127.", "CiA 306, [DeviceComissioning]", node_id),
    Rule("E704", "Baudrate is a bit rate of CANopen in kbit/s.", "CiA 306, [DeviceComissioning]", bit_rate),
    Rule("E705", "Baudrate is one that the device supports.", "CiA 306, [DeviceComissioning]", unsupported_bit_rate),
    Rule("E706", "NetNumber and LSS_SerialNumber are UNSIGNED32.", "CiA 306, [DeviceComissioning]",
         form_of_commissioning(("NetNumber", "LSS_SerialNumber"), UNSIGNED32.high)),
    Rule("E707", "CANopenManager is 0 or 1.", "CiA 306, [DeviceComissioning]",
         form_of_commissioning(("CANopenManager",), 1)),
    Rule("E708", "LSS_SerialNumber is 0x1018 sub 4.", "CiA 306, [DeviceComissioning]", serial_number),
    Rule("W709", "A DCF says from which EDS it was made.", "CiA 306, LastEDS", without_last_eds),
    Rule("W710", "ParameterValue, Denotation, UploadFile and DownloadFile are a DCF's.", "CiA 306, DCF",
         dcf_keys_in_eds),
    Rule("E711", "A constant's ParameterValue is its DefaultValue.", "CiA 306, DCF", parameter_of_constant),
    Rule("E712", "UploadFile and DownloadFile are a DOMAIN's.", "CiA 306, DCF", file_of_number),
    Rule("E713", "A concise DCF is whole.", "CiA 302-3, object 0x1F22; public: dcf-tools, dcfgen", concise_dcf),
)  # fmt: skip
