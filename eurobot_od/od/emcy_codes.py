"""Emergency error codes that device profiles give a meaning, beyond the classes of CiA 301 (Table 26).

A table for each profile, by its number in 0x1000. A code that ends in zeros is a class: a drive's 0x7312 belongs to
0x7310, speed.
"""

from __future__ import annotations

from collections.abc import Mapping

IO_MODULES, DRIVES = 401, 402
"""Profiles with codes of their own here."""

PHASES = ("L1", "L2", "L3")
"""Phases of the mains."""

OUTPUT_PHASES = ("U", "V", "W")
"""Phases of the motor."""


def _numbered(first: int, what: str, ends: tuple[str, ...] = ("1", "2")) -> dict[int, str]:
    """Return the codes from `first` on, whose words differ in their ends."""
    return {code: f"{what} {end}" for code, end in enumerate(ends, first)}


def _both(what: str, code: int) -> dict[int, str]:
    """Return the codes for what is too high and too low."""
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

OF_PROFILES: Mapping[int, Mapping[int, str]] = {DRIVES: OF_DRIVES, IO_MODULES: OF_IO_MODULES}

MASKS = (0xFFFF, 0xFFF0, 0xFF00)
"""The code itself, then the classes that it is in."""


def profile_words(profile: int, code: int) -> str | None:
    """Return what an emergency error code means in a device profile; None if the profile does not say."""
    codes = OF_PROFILES.get(profile, {})
    return next((codes[code & mask] for mask in MASKS if code & mask in codes), None)
