"""Texts for values of objects, by the device's profile: `Operation enabled, target reached` for 1591; and for errors.

A value that no profile describes has no text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.od import cia401, cia402
from eurobot_od.od import objects as od
from eurobot_od.od.cia402 import BitPattern, DriveCommand, Mode, State
from eurobot_od.od.standard import DEVICE_TYPE, ErrorCode
from eurobot_od.od.units import objects_of
from eurobot_od.od.values import UNSIGNED16, Address, Value

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODVariable


READABLE = 2
"""Most names of a bit that are shown together; with more, its number is shown."""


class ValueMeaning(NamedTuple):
    """Function for the texts of an object's values; `codes` lists them if they are a list."""

    says: Callable[[ObjectDictionary, int], str]
    codes: Mapping[int, str] = MappingProxyType({})


def _coded(codes: Mapping[int, str]) -> ValueMeaning:
    return ValueMeaning(lambda _, value: codes.get(value, ""), codes)


def _set_bits(names: Mapping[int, str], value: int) -> list[str]:
    return [name for bit, name in sorted(names.items()) if value >> bit & 1]


def _bits(names: Mapping[int, str], none: str = "none", between: str = ", ", after: str = "") -> ValueMeaning:
    return ValueMeaning(lambda _, value: (between.join(_set_bits(names, value)) or none) + after)


# Controlword and statusword of a drive


def _by_mode(bits: Mapping[Mode, Mapping[int, str]], objects: ObjectDictionary) -> Mapping[int, str]:
    """Return the names of bits that depend on the mode of operation, for the modes that the drive has."""
    # The frame does not have the mode, and the mode in an earlier frame may be outdated.
    names: dict[int, dict[str, None]] = {}
    # Without 0x6502, a drive may have any mode.
    for mode in cia402.supported(_default(objects, (cia402.SUPPORTED_MODES, 0)) or 0) or Mode:
        for bit, name in bits.get(mode, {}).items():
            names.setdefault(bit, {})[name] = None
    return {bit: " or ".join(each) if len(each) <= READABLE else f"bit {bit}" for bit, each in names.items()}


def _word(
    kind: type[BitPattern], none: str, bits: Mapping[int, str], mode_bits: Mapping[Mode, Mapping[int, str]]
) -> ValueMeaning:
    """Return the meaning of a word: its state or command, and the names of its other bits."""

    def says(objects: ObjectDictionary, value: int) -> str:
        found = kind.of(value)
        return ", ".join([found.words if found else none, *_set_bits({**bits, **_by_mode(mode_bits, objects)}, value)])

    return ValueMeaning(says)


# Profiles

DRIVE: Mapping[Address, ValueMeaning] = {
    (cia402.ERROR_CODE, 0): ValueMeaning(lambda _, value: f"0x{value:04X} {error_words(value, {}, cia402.PROFILE)}"),
    (cia402.CONTROLWORD, 0): _word(DriveCommand, "no command", cia402.CONTROL_BITS, cia402.MODE_CONTROL_BITS),
    (cia402.STATUSWORD, 0): _word(State, "no state", cia402.STATUS_BITS, cia402.MODE_STATUS_BITS),
    (cia402.MODE, 0): _coded(cia402.MODE_WORDS),
    (cia402.MODE_DISPLAY, 0): _coded(cia402.MODE_WORDS),
    (cia402.HOMING_METHOD, 0): _coded(cia402.METHOD_WORDS),
    (cia402.DIGITAL_INPUTS, 0): _bits(cia402.INPUT_BITS),
    (cia402.DIGITAL_OUTPUTS, 1): _bits(cia402.OUTPUT_BITS),
    (cia402.SUPPORTED_MODES, 0): _bits(cia402.MODE_BITS),
    (0x607E, 0): _bits(cia402.POLARITY_BITS, "not inverted"),
    **{(index, 0): _coded(words) for index, words in cia402.OPTION_WORDS.items()},
}

MODULE: Mapping[int, ValueMeaning] = {
    # Inputs and outputs are numbered from 1, bits from 0.
    **{
        index: _bits({bit: str(bit + 1) for bit in range(bits)}, between=" ", after=f" {cia401.SWITCHED_ON}")
        for index, bits in cia401.BIT_BLOCKS.items()
    },
    **{each.error_mode: _coded(cia401.ERROR_MODE_WORDS) for each in cia401.ANALOGUE_OUTPUTS},
    cia401.ANALOGUE_TRIGGER: _bits(cia401.TRIGGER_BITS),
}


PROFILES: Mapping[int, Callable[[Address], ValueMeaning | None]] = {
    # Sub-index 0 is the number of blocks (CiA 401-1).
    cia401.PROFILE: lambda address: MODULE.get(address[0]) if address[1] else None,
    # Each axis has its objects 0x800 higher (CiA 402-2, clause 6.2).
    cia402.PROFILE: lambda address: DRIVE.get((cia402.on_first_axis(address[0]), address[1])),
}
"""Functions from an address to its meaning, by profile."""


SEVERAL = 0xFFFF
"""Profile number of a device with several profiles (CiA 301, 7.5.2.1)."""


def profile_of(objects: ObjectDictionary) -> int:
    """Return the device profile in 0x1000 (CiA 301, 7.5.2.1); 0 for none.

    Without a single profile, a device with controlword and statusword, which CiA 402 requires, is a drive.
    """
    said = (_default(objects, DEVICE_TYPE) or 0) & 0xFFFF
    # With their types, because other profiles have 0x6040 and 0x6041, too, such as CiA 418.
    control_and_status = (od.variable_at(objects, (each, 0)) for each in (cia402.CONTROLWORD, cia402.STATUSWORD))
    is_drive = all(each is not None and od.data_type(each) is UNSIGNED16 for each in control_and_status)
    return cia402.PROFILE if is_drive and said in (0, SEVERAL) else said


def _default(objects: ObjectDictionary, address: Address) -> int | None:
    variable = od.variable_at(objects, address)
    default = None if variable is None else od.default_of(variable)
    return default if isinstance(default, int) else None


def meaning_of(variable: ODVariable) -> ValueMeaning | None:
    """Return the meaning of an object's values, by the manufacturer or else the profile, or None."""
    if variable.value_descriptions or variable.bit_definitions:
        return _of_maker(variable)
    objects = objects_of(variable)
    of_profile = PROFILES.get(profile_of(objects)) if objects is not None else None
    return of_profile(od.address_of(variable)) if of_profile else None


def _of_maker(variable: ODVariable) -> ValueMeaning:
    """Return the manufacturer's texts for values, with the names of set bits for other values."""
    codes: Mapping[int, str] = variable.value_descriptions
    names = {bit: name for name, bits in variable.bit_definitions.items() for bit in bits}

    def says(_: ObjectDictionary, value: int) -> str:
        return codes.get(value) or ", ".join(_set_bits(names, value))

    return ValueMeaning(says, codes)


def words(variable: ODVariable, value: Value) -> str:
    """Return the text for a value, by the manufacturer or the device's profile; empty without one."""
    meaning, objects = meaning_of(variable), objects_of(variable)
    return meaning.says(objects, value) if meaning and objects is not None and isinstance(value, int) else ""


def with_words(text: str, said: str) -> str:
    """Format a value with its text: `567 (Operation enabled)`."""
    return f"{text} ({said})" if said else text


def written(variable: ODVariable, value: Value) -> str:
    """Format a value: the physical one with its unit if it has one, and its text."""
    return with_words(od.measured(variable, value), words(variable, value))


PHASES = ("L1", "L2", "L3")
"""Phases of the mains."""

OUTPUT_PHASES = ("U", "V", "W")
"""Phases of the motor."""


def _numbered(first: int, what: str, ends: tuple[str, ...] = ("1", "2")) -> dict[int, str]:
    """Return the codes from `first` on, whose texts have different ends."""
    return {code: f"{what} {end}" for code, end in enumerate(ends, first)}


def _both(what: str, code: int) -> dict[int, str]:
    """Return the codes for "too high" and "too low"."""
    return {code | 0x10: f"{what} too high", code | 0x20: f"{what} too low"}


OF_DRIVES: Mapping[int, str] = {
    # current
    0x2110: "short circuit or earth leakage at the input", 0x2120: "earth leakage at the input",
    **_numbered(0x2121, "earth leakage at the input, phase", PHASES),
    0x2130: "short circuit at the input",
    **_numbered(0x2131, "short circuit at the input, phases", ("L1-L2", "L2-L3", "L3-L1")),
    **_numbered(0x2211, "current inside the device, no."),
    0x2213: "overcurrent in a ramp", 0x2214: "overcurrent in a sequence",
    0x2220: "continuous overcurrent inside the device", **_numbered(0x2221, "continuous overcurrent inside, no."),
    0x2230: "short circuit or earth leakage inside the device", 0x2240: "earth leakage inside the device",
    0x2250: "short circuit inside the device",
    0x2310: "continuous overcurrent at the output", **_numbered(0x2311, "continuous overcurrent at the output, no."),
    0x2320: "short circuit or earth leakage at the output", 0x2330: "earth leakage at the output",
    **_numbered(0x2331, "earth leakage at the output, phase", OUTPUT_PHASES),
    0x2340: "short circuit at the output",
    **_numbered(0x2341, "short circuit at the output, phases", ("U-V", "V-W", "W-U")),
    # voltage
    0x3110: "mains overvoltage", **_numbered(0x3111, "mains overvoltage, phase", PHASES),
    0x3120: "mains undervoltage", **_numbered(0x3121, "mains undervoltage, phase", PHASES),
    0x3130: "phase failure", **_numbered(0x3131, "phase failure,", PHASES), 0x3134: "phase sequence",
    0x3140: "mains frequency", 0x3141: "mains frequency too high", 0x3142: "mains frequency too low",
    0x3210: "DC link overvoltage", **_numbered(0x3211, "DC link overvoltage, no."),
    0x3220: "DC link undervoltage", **_numbered(0x3221, "DC link undervoltage, no."), 0x3230: "load error",
    0x3310: "output overvoltage", **_numbered(0x3311, "output overvoltage, phase", OUTPUT_PHASES),
    0x3320: "armature circuit", 0x3321: "armature circuit interrupted",
    0x3330: "field circuit", 0x3331: "field circuit interrupted",
    # temperature
    **_both("ambient temperature", 0x4100), 0x4130: "temperature of the supply air",
    0x4140: "temperature of the air outlet",
    **_both("device temperature", 0x4200), 0x4300: "drive temperature", **_both("drive temperature", 0x4300),
    0x4400: "supply temperature", **_both("supply temperature", 0x4400),
    # hardware
    0x5100: "supply", 0x5110: "supply, low voltage", **_numbered(0x5111, "supply", ("U1, 15 V", "U2, 24 V", "U3, 5 V")),
    0x5120: "supply of the intermediate circuit", 0x5200: "control", 0x5210: "measurement circuit",
    0x5220: "computing circuit", 0x5300: "operating unit", 0x5400: "power section", 0x5410: "output stages",
    0x5420: "chopper", 0x5430: "input stages", 0x5440: "contacts", 0x5450: "fuses",
    **_numbered(0x5451, "fuse of", PHASES),
    0x5500: "data storage", 0x5510: "working memory (RAM)", 0x5520: "program memory (EPROM)",
    0x5530: "non-volatile memory (EEPROM)",
    # software
    0x6010: "software reset by the watchdog",
    **_numbered(0x6301, "data record no.", tuple(map(str, range(1, 16)))),
    0x6310: "loss of parameters", 0x6320: "parameter error",
    # additional modules
    0x7100: "power", 0x7110: "brake chopper", 0x7111: "brake chopper failure", 0x7112: "brake chopper overcurrent",
    0x7113: "brake chopper, protective circuit", 0x7120: "motor", 0x7121: "motor blocked",
    0x7122: "motor error or commutation malfunction", 0x7123: "motor tilted",
    0x7200: "measurement circuit", 0x7300: "sensor", 0x7301: "tachometer fault", 0x7302: "tachometer wrong polarity",
    **_numbered(0x7303, "resolver fault, no."),
    **_numbered(0x7305, "incremental sensor fault, no.", ("1", "2", "3")),
    0x7310: "speed", 0x7320: "position", 0x7400: "computation circuit", 0x7500: "communication",
    **_numbered(0x7510, "serial interface no.", ("1",)), **_numbered(0x7520, "serial interface no.", ("2",)),
    0x7600: "data storage (external)",
    # monitoring
    0x8300: "torque control", 0x8311: "torque too high", 0x8312: "difficult start-up", 0x8313: "standstill torque",
    0x8321: "insufficient torque", 0x8331: "torque fault", 0x8400: "velocity controller", 0x8500: "position controller",
    0x8600: "positioning controller", 0x8611: "following error", 0x8612: "reference limit",
    0x8700: "synchronisation controller", 0x8800: "winding controller", 0x8900: "process data monitoring",
    0x8A00: "control monitoring",
    # additional functions
    0xF001: "deceleration", 0xF002: "sub-synchronous run", 0xF003: "stroke operation", 0xF004: "control",
}  # fmt: skip
"""Codes of drives (CiA 402-2; IEC 61800-7-201)."""

OF_IO_MODULES: Mapping[int, str] = {
    0x2310: "current at the outputs too high", 0x2320: "short circuit at the outputs",
    0x2330: "load dump at the outputs",
    0x3110: "input voltage too high", 0x3120: "input voltage too low",
    0x3210: "internal voltage too high", 0x3220: "internal voltage too low",
    0x3310: "output voltage too high", 0x3320: "output voltage too low",
}  # fmt: skip
"""Codes of I/O modules (CiA 401-1)."""

OF_PROFILES: Mapping[int, Mapping[int, str]] = {cia402.PROFILE: OF_DRIVES, cia401.PROFILE: OF_IO_MODULES}

MASKS = (0xFFFF, 0xFFF0, 0xFF00)
"""Masks of a code for itself and for its classes."""


def profile_words(profile: int, code: int) -> str | None:
    """Return the text for an emergency error code in a device profile, or None."""
    codes = OF_PROFILES.get(profile, {})
    return next((codes[code & mask] for mask in MASKS if code & mask in codes), None)


# Error codes of EMCY

NAMED = frozenset(ErrorCode) - {ErrorCode.VALUE_OUT_OF_RANGE}
"""Codes with the same meaning in any device; 0xFF00 is device-specific."""

CLASSES = {
    0x00: "no error", 0x10: "generic error", 0x20: "current", 0x21: "current, device input side",
    0x22: "current inside the device", 0x23: "current, device output side", 0x30: "voltage", 0x31: "mains voltage",
    0x32: "voltage inside the device", 0x33: "output voltage", 0x40: "temperature", 0x41: "ambient temperature",
    0x42: "device temperature", 0x50: "device hardware", 0x60: "device software", 0x61: "internal software",
    0x62: "user software", 0x63: "data set", 0x70: "additional modules", 0x80: "monitoring", 0x81: "communication",
    0x82: "protocol error", 0x90: "external error", 0xF0: "additional functions", 0xFF: "device specific",
}  # fmt: skip
"""Classes of emergency error codes by their upper byte (CiA 301, Table 26)."""


def error_words(code: int, own: Mapping[int, str], profile: int = 0) -> str:
    """Return the text for an emergency error code.

    It is the device's `own` text, that of CiA 301, that of its `profile` (0: none), or else its class in CiA 301.
    """
    if code in own:
        return own[code]
    if code in NAMED:
        return ErrorCode(code).name.lower().replace("_", " ")
    if found := profile_words(profile, code):
        return found
    return CLASSES.get(code >> 8, CLASSES.get(code >> 8 & 0xF0, "reserved"))
