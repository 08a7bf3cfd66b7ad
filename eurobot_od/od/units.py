"""What a number counts: its unit, and the factor and offset between the raw value and the physical one.

An EDS editor's `Unit`, `Factor` and `Offset` say it, an XDD's unit, a patch or a package; of a drive's positions and
velocities also CiA 402's own objects. Whatever prints or reads a value asks here; what a frame or an SDO carries stays
raw.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING

from eurobot_od.od import cia402

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODVariable


class UnitScale:
    """Turns raw values into physical ones, `raw * factor + offset` in a `unit`, and back."""

    def __init__(self, unit: str = "", factor: float = 1, offset: float = 0) -> None:
        is_usable = isfinite(factor) and factor and isfinite(offset)
        self.unit, self.factor, self.offset = unit, factor if is_usable else 1, offset if is_usable else 0

    def __repr__(self) -> str:
        return f"UnitScale({self.unit!r}, {self.factor!r}, {self.offset!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UnitScale) and self.parts == other.parts

    __hash__ = None  # type: ignore[assignment]

    @property
    def parts(self) -> tuple[str, float, float]:
        """Unit, factor and offset."""
        return self.unit, self.factor, self.offset

    @cached_property
    def is_raw(self) -> bool:
        """Whether a raw value is the physical one; it may have a unit all the same."""
        return self.factor == 1 and self.offset == 0

    def physical(self, raw: float) -> float:
        """Return the physical value of a raw one."""
        if self.is_raw:
            return raw
        # By 10 a raw value is divided exactly, by 0.1 it is not multiplied so.
        return raw / (1 / self.factor) + self.offset

    def raw(self, value: float) -> float:
        """Return the raw value of a physical one, which is not rounded."""
        return value if self.is_raw else (value - self.offset) / self.factor

    def text(self, raw: float) -> str:
        """Return a raw value as a physical one with its unit, for a person."""
        return f"{digits(self.physical(raw))} {self.unit}".rstrip()

    @property
    def step(self) -> str:
        """What one step of the raw value is, such as `0.1 degC`."""
        return self.unit if self.factor == 1 else f"{digits(self.factor)} {self.unit}".rstrip()


RAW = UnitScale()
"""The scale of what nobody has given a unit."""


def digits(value: float) -> str:
    """Return a number without the digits that only its binary form has."""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def scale_of(variable: ODVariable) -> UnitScale:
    """Return the scale of an object: what its file says, or else what CiA 402's objects say of a drive's."""
    own, objects = own_scale_of(variable), objects_of(variable)
    return _of_drive(objects, variable.index) if own == RAW and objects is not None else own


def own_scale_of(variable: ODVariable) -> UnitScale:
    """Return the scale that is said of an object itself."""
    return UnitScale(variable.unit, variable.factor, getattr(variable, "offset", 0))


def objects_of(variable: ODVariable) -> ObjectDictionary | None:
    """Return the dictionary that a variable belongs to; None for one that no file describes."""
    parent = getattr(variable, "parent", None)
    parent = getattr(parent, "parent", parent)  # a member's parent is its record, and that one's the dictionary
    return parent if hasattr(parent, "indices") else None


# Drives: the units of positions and velocities, where they are set

POSITIONS = (0x6062, 0x6064, 0x6065, 0x6067, 0x607A, 0x607B, 0x607C, 0x607D, 0x60B0, 0x60F4)
"""Positions, and differences of two, in position units (CiA 402-2)."""

VELOCITIES = (0x606B, 0x606C, 0x606D, 0x606F, 0x607F, 0x6081, 0x6082, 0x6099, 0x60B1, 0x60F8, 0x60FF)
"""Velocities, in velocity units (CiA 402-2)."""

SI_UNITS: Mapping[int, str] = {
    0x01: "m", 0x02: "kg", 0x03: "s", 0x04: "A", 0x05: "K", 0x10: "rad", 0x41: "deg", 0x42: "arcmin", 0x43: "arcsec",
    0x47: "min", 0x48: "h", 0x49: "d", 0xAC: "steps", 0xB4: "rev", 0xB5: "inc", 0xC1: "in", 0xC2: "ft",
}  # fmt: skip
"""Units by their code (CiA 303-2; 0xAC and above are CiA 402's)."""

RPM = {("rev", "min"): "rpm"}
"""Fractions of two units that have a name of their own."""

SI_PREFIXES: Mapping[int, str] = {-9: "n", -6: "u", -3: "m", -2: "c", 0: "", 3: "k"}
PREFIXED = ("m", "s", "rad")
"""Units that are used with a prefix; with others the power of ten becomes the factor."""


def si_scale(code: int) -> UnitScale:
    """Return the scale that an SI unit of CiA 402 says: prefix, numerator and denominator in its three upper bytes."""
    power, over, under = int.from_bytes([code >> 24 & 0xFF], signed=True), code >> 16 & 0xFF, code >> 8 & 0xFF
    if over not in SI_UNITS or under not in (0, *SI_UNITS):
        return RAW
    unit, per = SI_UNITS[over], SI_UNITS.get(under, "")
    is_prefixed = unit in PREFIXED and power in SI_PREFIXES
    unit = f"{SI_PREFIXES[power]}{unit}" if is_prefixed else unit
    return UnitScale(RPM.get((unit, per), f"{unit}/{per}".rstrip("/")), 1 if is_prefixed else 10.0**power)


def _of_drive(objects: ObjectDictionary, index: int) -> UnitScale:
    on_first = cia402.on_first_axis(index)
    if on_first not in POSITIONS and on_first not in VELOCITIES:
        return RAW
    axis = index - on_first
    if on_first in VELOCITIES:
        return si_scale(_number(objects, cia402.SI_VELOCITY + axis))
    code = _number(objects, cia402.SI_POSITION + axis)
    return si_scale(code) if code else _of_feed(objects, axis)


def _of_feed(objects: ObjectDictionary, axis: int) -> UnitScale:
    """Return what a position unit is of a turn, where 0x6092 says how many there are in one.

    They are turns of the driving shaft, or of the motor where 0x6091 has a gear between the two (CiA 402-2).
    """
    feed, turns = (_number(objects, cia402.FEED_CONSTANT + axis, sub) for sub in (1, 2))
    motor, shaft = (_number(objects, cia402.GEAR_RATIO + axis, sub) or 1 for sub in (1, 2))
    if feed <= 1 or turns < 1:  # 1 is what a file has if nobody has set one
        return RAW
    return UnitScale("rev" if motor == shaft else "motor rev", turns * motor / (feed * shaft))


def _number(objects: ObjectDictionary, index: int, sub: int = 0) -> int:
    """Return the ParameterValue, or else the DefaultValue, of an object; 0 without one."""
    entry = objects.indices.get(index)
    variable = getattr(entry, "subindices", {0: entry}).get(sub) if entry is not None else None
    value = variable and (variable.default if variable.value is None else variable.value)
    return value if isinstance(value, int) else 0
