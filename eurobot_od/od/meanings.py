"""Meaning of an object's numbers that no key of an EDS has: unit, plain values, and codes.

It comes from a protocol table; `make-eds` writes it into the file's [Comments], one line for each object after `HEAD`,
because every tool keeps comments. Loading a file sets it on the objects, like units from an editor or a device.yaml;
`units` and `words` then use it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.od.values import Address, Limits

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

HEAD = "Units and codes (object | unit | plain values | codes):"
"""Comment before the lines with units and codes."""

RESERVED_SIGNS = "|,=;#"
"""Characters that separate the parts of a line, or begin a comment for some tools; no part may contain them."""

LINE = re.compile(r"([0-9A-F]{4}):(\d+) \| *([^|]*)\| *(?:(-?\d+)\.\.(-?\d+))? *\| *([^|]*)")
SCALE = re.compile(r"(\d+(?:\.\d+)?)(?: +(.+))?")


class ObjectMeaning(NamedTuple):
    """Meaning of an object's numbers: `unit`, range of `plain` values, and `codes` by name.

    The unit is as in the table, such as `mm`, `0.1 N` or `2`: with the step where that is not 1.
    """

    unit: str = ""
    plain: Limits | None = None
    codes: Mapping[str, int] = {}

    @property
    def step(self) -> float:
        """Value of one step, in the unit."""
        found = SCALE.fullmatch(self.unit)
        return float(found[1]) if found else 1

    @property
    def unit_alone(self) -> str:
        """The unit without the step."""
        found = SCALE.fullmatch(self.unit)
        return (found[2] or "") if found else self.unit

    def describe(self, variable: ODVariable) -> None:
        """Set unit, plain values and codes of an object; a unit from the file's own keys has priority."""
        if not variable.unit and variable.factor == 1:
            variable.unit, variable.factor = self.unit_alone, self.step
        variable.value_descriptions = {number: name for name, number in self.codes.items()}
        if self.plain and self.codes:
            variable.plain = self.plain  # type: ignore[attr-defined]  # canopen has none

    def line(self, address: Address) -> str:
        """Return the comment for this meaning of the object at an address."""
        plain = f"{self.plain.low}..{self.plain.high}" if self.plain else ""
        codes = ", ".join(f"{name}={number}" for name, number in self.codes.items())
        index, sub = address
        return f"{index:04X}:{sub} | {self.unit} | {plain} | {codes}".rstrip()


NO_MEANING = ObjectMeaning()
"""Meaning of an object without a comment."""


def read_meanings(comments: Iterable[str]) -> dict[Address, ObjectMeaning]:
    """Return the meanings of objects from a file's comments."""
    lines = iter(comments)
    if HEAD not in (line.strip() for line in lines):  # consumes the lines up to HEAD
        return {}
    found = (LINE.fullmatch(line.strip()) for line in lines)
    return {(int(each[1], 16), int(each[2])): _meaning(*each.groups()[2:]) for each in found if each}


def _meaning(unit: str, low: str | None, high: str | None, codes: str) -> ObjectMeaning:
    named = (each.partition("=") for each in codes.split(",") if each.strip())
    plain = Limits(int(low), int(high)) if low and high else None
    return ObjectMeaning(unit.strip(), plain, {name.strip(): int(number) for name, _, number in named})
