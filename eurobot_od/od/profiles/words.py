"""What the value of an object says by the device's profile: `Operation enabled, target reached` for 1591.

Whatever prints a value asks here. A value that no profile explains has no words.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od.od import objects as od
from eurobot_od.od.profiles import cia401, cia402
from eurobot_od.od.profiles.cia402 import DriveCommand, Mode, State
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import Address, Value

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODVariable

Says: TypeAlias = Callable[["ObjectDictionary", int], str]
"""Gives the words for a value of an object of a dictionary."""


READABLE = 2
"""Most meanings of a bit that are named side by side; with more of them its number says as much."""


class ValueMeaning(NamedTuple):
    """How an object's values are said; `codes` has a word for each if it is a list of them."""

    says: Says
    codes: Mapping[int, str] = MappingProxyType({})


def _coded(codes: Mapping[int, str]) -> ValueMeaning:
    return ValueMeaning(lambda _, value: codes.get(value, ""), codes)


def _set_bits(names: Mapping[int, str], value: int) -> list[str]:
    return [name for bit, name in sorted(names.items()) if value >> bit & 1]


def _bits(names: Mapping[int, str], none: str = "none", between: str = ", ", after: str = "") -> ValueMeaning:
    return ValueMeaning(lambda _, value: (between.join(_set_bits(names, value)) or none) + after)


# The two words of a drive


def _by_mode(bits: Mapping[Mode, Mapping[int, str]], objects: ObjectDictionary) -> Mapping[int, str]:
    """Return what the bits mean whose meaning depends on the mode: the names in the modes that the drive has."""
    # The frame does not say in which mode the drive is, and another frame's word for it may be out of date.
    names: dict[int, dict[str, None]] = {}
    # A drive that does not say in 0x6502 which modes it has may have any.
    for mode in cia402.supported(_default(objects, (cia402.SUPPORTED_MODES, 0))) or Mode:
        for bit, name in bits.get(mode, {}).items():
            names.setdefault(bit, {})[name] = None
    return {bit: " or ".join(each) if len(each) <= READABLE else f"bit {bit}" for bit, each in names.items()}


def _word(
    find: Callable[[int], State | DriveCommand | None],
    none: str,
    bits: Mapping[int, str],
    mode_bits: Mapping[Mode, Mapping[int, str]],
) -> ValueMeaning:
    """Return the meaning of a word: the state or command that it says, and the names of its other bits."""

    def says(objects: ObjectDictionary, value: int) -> str:
        found = find(value)
        return ", ".join([found.words if found else none, *_set_bits({**bits, **_by_mode(mode_bits, objects)}, value)])

    return ValueMeaning(says)


# Profiles

DRIVE: Mapping[Address, ValueMeaning] = {
    (cia402.CONTROLWORD, 0): _word(cia402.command_of, "no command", cia402.CONTROL_BITS, cia402.MODE_CONTROL_BITS),
    (cia402.STATUSWORD, 0): _word(cia402.state_of, "no state", cia402.STATUS_BITS, cia402.MODE_STATUS_BITS),
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
    # Inputs and outputs count from 1, bits from 0.
    **{
        index: _bits({bit: str(bit + 1) for bit in range(bits)}, between=" ", after=f" {cia401.SWITCHED_ON}")
        for index, bits in cia401.BIT_BLOCKS.items()
    },
    **{each.error_mode: _coded(cia401.ERROR_MODE_WORDS) for each in cia401.ANALOGUE_OUTPUTS},
    cia401.ANALOGUE_TRIGGER: _bits(cia401.TRIGGER_BITS),
}


def _of_drive(address: Address) -> ValueMeaning | None:
    index, sub = address
    # Each axis has the first one's objects, 0x800 higher (CiA 402-2, clause 6.2).
    axis = index - cia402.FIRST_AXIS.start
    if not 0 <= axis < cia402.MOST_AXES * cia402.AXIS_STEP:
        return None
    return DRIVE.get((cia402.FIRST_AXIS.start + axis % cia402.AXIS_STEP, sub))


PROFILES: Mapping[int, Callable[[Address], ValueMeaning | None]] = {
    # Sub-index 0 is the number of blocks (CiA 401-1), and means nothing but itself.
    cia401.PROFILE: lambda address: MODULE.get(address[0]) if address[1] else None,
    cia402.PROFILE: _of_drive,
}
"""What the objects of a device mean, by its profile."""


def profile_of(objects: ObjectDictionary) -> int:
    """Return the device profile that 0x1000 says (CiA 301, 7.5.2.1); 0: none."""
    return _default(objects, DEVICE_TYPE) & 0xFFFF


def _default(objects: ObjectDictionary, address: Address) -> int:
    variable = od.variable_at(objects, address)
    default = None if variable is None else od.default_of(variable)
    return default if isinstance(default, int) else 0


def _objects_of(variable: ODVariable) -> ObjectDictionary | None:
    """Return the dictionary that a variable belongs to; None for one that no file describes."""
    parent = getattr(variable, "parent", None)
    parent = getattr(parent, "parent", parent)  # a member's parent is its record, and that one's the dictionary
    return parent if hasattr(parent, "indices") else None


def meaning_of(variable: ODVariable) -> ValueMeaning | None:
    """Return what a profile says about an object; None if it says nothing."""
    objects = _objects_of(variable)
    of_profile = PROFILES.get(profile_of(objects)) if objects is not None else None
    return of_profile(od.address_of(variable)) if of_profile else None


def words(variable: ODVariable, value: Value) -> str:
    """Return what a value says by the device's profile; empty if that says nothing."""
    meaning, objects = meaning_of(variable), _objects_of(variable)
    return meaning.says(objects, value) if meaning and objects is not None and isinstance(value, int) else ""


def with_words(text: str, said: str) -> str:
    """Write a value and behind it what it says: `567 (Operation enabled)`."""
    return f"{text} ({said})" if said else text


def written(variable: ODVariable, value: Value) -> str:
    """Write a value for a person as `od.objects.written` does, and what it says."""
    return with_words(od.written(variable, value), words(variable, value))
