"""Scales of numbers: unit, and factor and offset between raw and physical values.

They come from an EDS editor's `Unit`, `Factor` and `Offset`, an XDD's unit, a patch or a package; for positions and
velocities of a drive also from CiA 402's objects. Only texts have physical values; frames and SDOs are raw.
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
    """Converts raw values into physical ones, `raw * factor + offset` in `unit`, and back."""

    def __init__(self, unit: str = "", factor: float = 1, offset: float = 0) -> None:
        is_usable = isfinite(factor) and factor and isfinite(offset)
        self.unit = unit
        self.factor = factor if is_usable else 1
        self.offset = offset if is_usable else 0

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
        """Whether raw and physical values are equal."""
        return self.factor == 1 and self.offset == 0

    def physical(self, raw: float) -> float:
        """Return the physical value of a raw one."""
        if self.is_raw:
            return raw
        # Dividing by 10 is exact, multiplying by 0.1 is not.
        return raw / (1 / self.factor) + self.offset

    def raw(self, value: float) -> float:
        """Return the raw value of a physical one, without rounding."""
        return value if self.is_raw else (value - self.offset) / self.factor

    def text(self, raw: float) -> str:
        """Format a raw value as a physical one with its unit."""
        return f"{digits(self.physical(raw))} {self.unit}".rstrip()

    @property
    def step(self) -> str:
        """One step of the raw value with its unit, such as `0.1 degC`."""
        return self.unit if self.factor == 1 else f"{digits(self.factor)} {self.unit}".rstrip()


RAW = UnitScale()
"""Scale without unit, factor and offset."""


def digits(value: float) -> str:
    """Format a number without the digits of its binary rounding."""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def scale_of(variable: ODVariable) -> UnitScale:
    """Return the scale of an object: its own, or else that of CiA 402's objects for a drive."""
    own, objects = own_scale_of(variable), objects_of(variable)
    return _of_drive(objects, variable.index) if own == RAW and objects is not None else own


def own_scale_of(variable: ODVariable) -> UnitScale:
    """Return an object's own scale."""
    return UnitScale(variable.unit, variable.factor, getattr(variable, "offset", 0))


def objects_of(variable: ODVariable) -> ObjectDictionary | None:
    """Return the dictionary of a variable, or None."""
    parent = getattr(variable, "parent", None)
    parent = getattr(parent, "parent", parent)  # a member's parent is its record, whose parent is the dictionary
    return parent if hasattr(parent, "indices") else None


# Drives: units of positions and velocities

POSITIONS = (0x6062, 0x6064, 0x6065, 0x6067, 0x607A, 0x607B, 0x607C, 0x607D, 0x60B0, 0x60F4)
"""Objects in position units (CiA 402-2)."""

VELOCITIES = (0x606B, 0x606C, 0x606D, 0x606F, 0x607F, 0x6081, 0x6082, 0x6099, 0x60B1, 0x60F8, 0x60FF)
"""Objects in velocity units (CiA 402-2)."""

SI_UNITS: Mapping[int, str] = {
    0x01: "m", 0x02: "kg", 0x03: "s", 0x04: "A", 0x05: "K", 0x10: "rad", 0x41: "deg", 0x42: "arcmin", 0x43: "arcsec",
    0x47: "min", 0x48: "h", 0x49: "d", 0xAC: "steps", 0xB4: "rev", 0xB5: "inc", 0xC1: "in", 0xC2: "ft",
}  # fmt: skip
"""Units by their code (CiA 303-2; 0xAC and above are CiA 402's)."""

RPM = {("rev", "min"): "rpm"}
"""Names of fractions of two units."""

SI_PREFIXES: Mapping[int, str] = {-9: "n", -6: "u", -3: "m", -2: "c", 0: "", 3: "k"}
PREFIXED = ("m", "s", "rad")
"""Units with a prefix; for others the power of ten becomes the factor."""


def si_scale(code: int) -> UnitScale:
    """Return the scale for an SI unit of CiA 402: prefix, numerator and denominator in its three upper bytes."""
    power = int.from_bytes([code >> 24 & 0xFF], signed=True)
    over = code >> 16 & 0xFF
    under = code >> 8 & 0xFF
    if over not in SI_UNITS or under not in (0, *SI_UNITS):
        return RAW
    unit = SI_UNITS[over]
    per = SI_UNITS.get(under, "")
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
    """Return the scale of a position unit as a part of a turn, from the feed constant 0x6092.

    Turns are those of the driving shaft, or of the motor with a gear ratio in 0x6091 (CiA 402-2).
    """
    feed, turns = (_number(objects, cia402.FEED_CONSTANT + axis, sub) for sub in (1, 2))
    motor, shaft = (_number(objects, cia402.GEAR_RATIO + axis, sub) or 1 for sub in (1, 2))
    if feed <= 1 or turns < 1:  # 1 is the default
        return RAW
    return UnitScale("rev" if motor == shaft else "motor rev", turns * motor / (feed * shaft))


def _number(objects: ObjectDictionary, index: int, sub: int = 0) -> int:
    """Return the ParameterValue, else the DefaultValue, of an object; 0 without one."""
    entry = objects.indices.get(index)
    variable = getattr(entry, "subindices", {0: entry}).get(sub) if entry is not None else None
    value = variable and (variable.default if variable.value is None else variable.value)
    return value if isinstance(value, int) else 0
