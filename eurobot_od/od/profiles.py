"""Objects of the profiles of drives and I/O modules, for devices without a file (CiA 401-1, CiA 402-2).

A device's profile is known from 0x1000, or from the objects that it has answered for. Names and types are here; `words`
and `units` give values their meaning, through `dictionary_of`, as for the objects of a file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from eurobot_od.od import cia401, cia402, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import UNSIGNED8, UNSIGNED16, UNSIGNED32, Address, DataType
from eurobot_od.od.words import SEVERAL

AREA = range(0x6000, 0xA000)
"""Indices of standardised device profiles (CiA 301, 7.4.1)."""

_I8, _I16, _I32 = (values.DATA_TYPES[code] for code in (0x02, 0x03, 0x04))


class ProfileObject(NamedTuple):
    """An object of a profile: name, data type, and the names of its members from sub-index 1 on, if any."""

    name: str
    type: DataType
    members: tuple[str, ...] = ()


OF_DRIVES: Mapping[int, ProfileObject] = {
    0x6007: ProfileObject("Abort connection option code", _I16),
    0x603F: ProfileObject("Error code", UNSIGNED16),
    0x6040: ProfileObject("Controlword", UNSIGNED16),
    0x6041: ProfileObject("Statusword", UNSIGNED16),
    0x6042: ProfileObject("vl target velocity", _I16),
    0x6043: ProfileObject("vl velocity demand", _I16),
    0x6044: ProfileObject("vl velocity actual value", _I16),
    0x605A: ProfileObject("Quick stop option code", _I16),
    0x605B: ProfileObject("Shutdown option code", _I16),
    0x605C: ProfileObject("Disable operation option code", _I16),
    0x605D: ProfileObject("Halt option code", _I16),
    0x605E: ProfileObject("Fault reaction option code", _I16),
    0x6060: ProfileObject("Modes of operation", _I8),
    0x6061: ProfileObject("Modes of operation display", _I8),
    0x6062: ProfileObject("Position demand value", _I32),
    0x6063: ProfileObject("Position actual internal value", _I32),
    0x6064: ProfileObject("Position actual value", _I32),
    0x6065: ProfileObject("Following error window", UNSIGNED32),
    0x6066: ProfileObject("Following error time out", UNSIGNED16),
    0x6067: ProfileObject("Position window", UNSIGNED32),
    0x6068: ProfileObject("Position window time", UNSIGNED16),
    0x6069: ProfileObject("Velocity sensor actual value", _I32),
    0x606B: ProfileObject("Velocity demand value", _I32),
    0x606C: ProfileObject("Velocity actual value", _I32),
    0x606D: ProfileObject("Velocity window", UNSIGNED16),
    0x606E: ProfileObject("Velocity window time", UNSIGNED16),
    0x606F: ProfileObject("Velocity threshold", UNSIGNED16),
    0x6071: ProfileObject("Target torque", _I16),
    0x6072: ProfileObject("Max torque", UNSIGNED16),
    0x6073: ProfileObject("Max current", UNSIGNED16),
    0x6074: ProfileObject("Torque demand", _I16),
    0x6075: ProfileObject("Motor rated current", UNSIGNED32),
    0x6076: ProfileObject("Motor rated torque", UNSIGNED32),
    0x6077: ProfileObject("Torque actual value", _I16),
    0x6078: ProfileObject("Current actual value", _I16),
    0x6079: ProfileObject("DC link circuit voltage", UNSIGNED32),
    0x607A: ProfileObject("Target position", _I32),
    0x607B: ProfileObject("Position range limit", _I32, ("Min", "Max")),
    0x607C: ProfileObject("Home offset", _I32),
    0x607D: ProfileObject("Software position limit", _I32, ("Min", "Max")),
    0x607E: ProfileObject("Polarity", UNSIGNED8),
    0x607F: ProfileObject("Max profile velocity", UNSIGNED32),
    0x6080: ProfileObject("Max motor speed", UNSIGNED32),
    0x6081: ProfileObject("Profile velocity", UNSIGNED32),
    0x6082: ProfileObject("End velocity", UNSIGNED32),
    0x6083: ProfileObject("Profile acceleration", UNSIGNED32),
    0x6084: ProfileObject("Profile deceleration", UNSIGNED32),
    0x6085: ProfileObject("Quick stop deceleration", UNSIGNED32),
    0x6086: ProfileObject("Motion profile type", _I16),
    0x6087: ProfileObject("Torque slope", UNSIGNED32),
    0x608F: ProfileObject("Position encoder resolution", UNSIGNED32, ("Encoder increments", "Motor revolutions")),
    0x6091: ProfileObject("Gear ratio", UNSIGNED32, ("Motor revolutions", "Shaft revolutions")),
    0x6092: ProfileObject("Feed constant", UNSIGNED32, ("Feed", "Shaft revolutions")),
    0x6096: ProfileObject("Velocity factor", UNSIGNED32, ("Numerator", "Divisor")),
    0x6098: ProfileObject("Homing method", _I8),
    0x6099: ProfileObject("Homing speeds", UNSIGNED32, ("Search for switch", "Search for zero")),
    0x609A: ProfileObject("Homing acceleration", UNSIGNED32),
    0x60A8: ProfileObject("SI unit position", UNSIGNED32),
    0x60A9: ProfileObject("SI unit velocity", UNSIGNED32),
    0x60B0: ProfileObject("Position offset", _I32),
    0x60B1: ProfileObject("Velocity offset", _I32),
    0x60B2: ProfileObject("Torque offset", _I16),
    0x60B8: ProfileObject("Touch probe function", UNSIGNED16),
    0x60B9: ProfileObject("Touch probe status", UNSIGNED16),
    0x60C0: ProfileObject("Interpolation sub mode select", _I16),
    0x60C1: ProfileObject("Interpolation data record", _I32, ("Set-point 1", "Set-point 2")),
    0x60C5: ProfileObject("Max acceleration", UNSIGNED32),
    0x60C6: ProfileObject("Max deceleration", UNSIGNED32),
    0x60E0: ProfileObject("Positive torque limit value", UNSIGNED16),
    0x60E1: ProfileObject("Negative torque limit value", UNSIGNED16),
    0x60F4: ProfileObject("Following error actual value", _I32),
    0x60FC: ProfileObject("Position demand internal value", _I32),
    0x60FD: ProfileObject("Digital inputs", UNSIGNED32),
    0x60FE: ProfileObject("Digital outputs", UNSIGNED32, ("Physical outputs", "Bit mask")),
    0x60FF: ProfileObject("Target velocity", _I32),
    0x6402: ProfileObject("Motor type", UNSIGNED16),
    0x6502: ProfileObject("Supported drive modes", UNSIGNED32),
}
"""Objects of an axis, by the index on the first axis (CiA 402-2)."""

_BLOCKS = tuple(f"Block {number}" for number in range(1, 9))
_CHANNELS = tuple(f"Channel {number}" for number in range(1, 17))

OF_MODULES: Mapping[int, ProfileObject] = {
    0x6000: ProfileObject("Read input 8-bit", UNSIGNED8, _BLOCKS),
    0x6002: ProfileObject("Polarity input 8-bit", UNSIGNED8, _BLOCKS),
    0x6003: ProfileObject("Filter constant input 8-bit", UNSIGNED8, _BLOCKS),
    0x6005: ProfileObject("Global interrupt enable digital", values.BOOLEAN),
    0x6006: ProfileObject("Interrupt mask any change 8-bit", UNSIGNED8, _BLOCKS),
    0x6007: ProfileObject("Interrupt mask low to high 8-bit", UNSIGNED8, _BLOCKS),
    0x6008: ProfileObject("Interrupt mask high to low 8-bit", UNSIGNED8, _BLOCKS),
    0x6100: ProfileObject("Read input 16-bit", UNSIGNED16, _BLOCKS),
    0x6120: ProfileObject("Read input 32-bit", UNSIGNED32, _BLOCKS),
    0x6200: ProfileObject("Write output 8-bit", UNSIGNED8, _BLOCKS),
    0x6202: ProfileObject("Polarity output 8-bit", UNSIGNED8, _BLOCKS),
    0x6206: ProfileObject("Error mode output 8-bit", UNSIGNED8, _BLOCKS),
    0x6207: ProfileObject("Error value output 8-bit", UNSIGNED8, _BLOCKS),
    0x6208: ProfileObject("Filter mask output 8-bit", UNSIGNED8, _BLOCKS),
    0x6300: ProfileObject("Write output 16-bit", UNSIGNED16, _BLOCKS),
    0x6320: ProfileObject("Write output 32-bit", UNSIGNED32, _BLOCKS),
    0x6400: ProfileObject("Read analogue input 8-bit", _I8, _CHANNELS),
    0x6401: ProfileObject("Read analogue input 16-bit", _I16, _CHANNELS),
    0x6402: ProfileObject("Read analogue input 32-bit", _I32, _CHANNELS),
    0x6410: ProfileObject("Write analogue output 8-bit", _I8, _CHANNELS),
    0x6411: ProfileObject("Write analogue output 16-bit", _I16, _CHANNELS),
    0x6412: ProfileObject("Write analogue output 32-bit", _I32, _CHANNELS),
    0x6421: ProfileObject("Analogue input interrupt trigger selection", UNSIGNED8, _CHANNELS),
    0x6423: ProfileObject("Analogue input global interrupt enable", values.BOOLEAN),
    0x6424: ProfileObject("Analogue input interrupt upper limit", _I32, _CHANNELS),
    0x6425: ProfileObject("Analogue input interrupt lower limit", _I32, _CHANNELS),
    0x6426: ProfileObject("Analogue input interrupt delta", UNSIGNED32, _CHANNELS),
    0x6443: ProfileObject("Analogue output error mode", UNSIGNED8, _CHANNELS),
    0x6444: ProfileObject("Analogue output error value", _I32, _CHANNELS),
}
"""Objects of an I/O module; further blocks and channels have no names (CiA 401-1)."""

OF_ANY: Mapping[int, ProfileObject] = {0x1001: ProfileObject("Error register", UNSIGNED8)}
"""Objects that devices of any profile map into PDOs."""

PROFILES: Mapping[int, Mapping[int, ProfileObject]] = {cia402.PROFILE: OF_DRIVES, cia401.PROFILE: OF_MODULES}

SIGNS: Mapping[int, tuple[frozenset[int], frozenset[int]]] = {
    cia402.PROFILE: (
        frozenset((cia402.STATUSWORD,)),
        frozenset((cia402.ERROR_CODE, cia402.CONTROLWORD, cia402.MODE, cia402.MODE_DISPLAY, cia402.POSITION)),
    ),
    cia401.PROFILE: (
        frozenset(each.value for each in cia401.DIGITAL_INPUTS[:1] + cia401.ANALOGUE_INPUTS[1:2]),
        frozenset(each.value for each in cia401.DIGITAL_OUTPUTS[:1] + cia401.ANALOGUE_OUTPUTS[1:2]),
    ),
}
"""Two groups of objects for each profile; a device with an object of each group has the profile."""


def profile_shown(device_type: int, objects: Collection[int]) -> int:
    """Return the observed profile of a device; 0 if unknown.

    Args:
        device_type: value of 0x1000; 0 if it is not known
        objects: indices that the device has answered for, as on the first axis (`cia402.on_first_axis`)
    """
    said = device_type & 0xFFFF
    if said not in (0, SEVERAL):
        return said
    return next((each for each, signs in SIGNS.items() if all(group.intersection(objects) for group in signs)), 0)


def object_of(profile: int, address: Address) -> ProfileObject | None:
    """Return an object of a profile, or of any profile if it is 0; None if there is none.

    Of several profiles, one is preferred that has the object with, or without, sub-indices as in the address.
    """
    index, sub = address
    found = list(_named(profile, index))
    return next((each for each in found if bool(each.members) is bool(sub)), found[0] if found else OF_ANY.get(index))


def _named(profile: int, index: int) -> Iterator[ProfileObject]:
    profiles = (profile,) if profile in PROFILES else PROFILES
    for each in profiles:
        first = cia402.on_first_axis(index) if each == cia402.PROFILE else index
        if found := PROFILES[each].get(first):
            axis = (index - first) // cia402.AXIS_STEP + 1
            yield found if axis == 1 else found._replace(name=f"{found.name} (axis {axis})")


@lru_cache
def dictionary_of(profile: int) -> Dictionary | None:
    """Return a dictionary with the objects of a profile, for a drive of all axes; None for an unknown profile."""
    if profile not in PROFILES:
        return None
    axes = range(cia402.MOST_AXES if profile == cia402.PROFILE else 1)
    indices = (index + cia402.AXIS_STEP * axis for axis in axes for index in PROFILES[profile])
    text = "".join((device_type_text(profile), *(_text(profile, index) for index in indices)))
    return Dictionary.read(text.encode(), Path(f"CiA {profile}"), values.NODE_IDS[0], f"CiA {profile}")


def device_type_text(profile: int) -> str:
    """Return the section of an EDS for 0x1000 with a profile."""
    return variable_text(f"{DEVICE_TYPE[0]:X}", "Device type", UNSIGNED32.code, f"DefaultValue={profile}\n")


def _text(profile: int, index: int) -> str:
    found = object_of(profile, (index, 0))
    assert found
    if not found.members:
        return variable_text(f"{index:X}", found.name, found.type.code)
    members = (variable_text(f"{index:X}sub{n:X}", each, found.type.code) for n, each in enumerate(found.members, 1))
    head = f"[{index:X}]\nParameterName={found.name}\nObjectType=9\nSubNumber={len(found.members) + 1}\n"
    return "".join((head, variable_text(f"{index:X}sub0", "Number of entries", UNSIGNED8.code), *members))


def variable_text(section: str, name: str, type_: int, more: str = "") -> str:
    """Return the section of an EDS for a variable."""
    return f"[{section}]\nParameterName={name}\nObjectType=7\nDataType={type_}\nAccessType=rw\nPDOMapping=1\n{more}"
