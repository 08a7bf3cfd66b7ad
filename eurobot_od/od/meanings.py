"""What no key of an EDS says about an object: its unit, its plain values, and the values that mean something else.

A protocol table says it, and `make-eds` writes it into the file's [Comments], one line for each object behind `HEAD`.
CiA 306 leaves comments free and every tool keeps them, so this travels with the file. When a file is loaded, its
objects get it, as they get what an editor's keys or a device.yaml say; from then on `units` and `words` say it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.od.values import Address, Limits

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

HEAD = "Units and codes (object | unit | plain values | codes):"
"""The comment behind which a file says units and codes."""

RESERVED_SIGNS = "|,=;#"
"""What stands between the parts of a line, or begins a comment for some tools, and so is in none of them."""

LINE = re.compile(r"([0-9A-F]{4}):(\d+) \| *([^|]*)\| *(?:(-?\d+)\.\.(-?\d+))? *\| *([^|]*)")
SCALE = re.compile(r"(\d+(?:\.\d+)?)(?: +(.+))?")


class ObjectMeaning(NamedTuple):
    """What the numbers of an object mean: steps of a `unit`, `plain` numbers of them, and `codes` by name.

    The unit is as the table writes it, such as `mm`, `0.1 N` or `2`: with the size of a step where that is not 1.
    """

    unit: str = ""
    plain: Limits | None = None
    codes: Mapping[str, int] = {}

    @property
    def step(self) -> float:
        """How many units one step is."""
        found = SCALE.fullmatch(self.unit)
        return float(found[1]) if found else 1

    @property
    def unit_alone(self) -> str:
        """The unit without the size of a step."""
        found = SCALE.fullmatch(self.unit)
        return (found[2] or "") if found else self.unit

    def describe(self, variable: ODVariable) -> None:
        """Give an object its unit, plain values and codes; a unit of the file's own keys counts more."""
        if not variable.unit and variable.factor == 1:
            variable.unit, variable.factor = self.unit_alone, self.step
        variable.value_descriptions = {number: name for name, number in self.codes.items()}
        if self.plain and self.codes:
            variable.plain = self.plain  # type: ignore[attr-defined]  # canopen has none

    def line(self, address: Address) -> str:
        """Return the comment that says this about the object at an address."""
        plain = f"{self.plain.low}..{self.plain.high}" if self.plain else ""
        codes = ", ".join(f"{name}={number}" for name, number in self.codes.items())
        index, sub = address
        return f"{index:04X}:{sub} | {self.unit} | {plain} | {codes}".rstrip()


NO_MEANING = ObjectMeaning()
"""For an object of which a file says nothing more than its keys."""


def read_meanings(comments: Iterable[str]) -> dict[Address, ObjectMeaning]:
    """Return what the comments of a file say about its objects."""
    lines = iter(comments)
    if HEAD not in (line.strip() for line in lines):  # which leaves the lines behind it
        return {}
    found = (LINE.fullmatch(line.strip()) for line in lines)
    return {(int(each[1], 16), int(each[2])): _meaning(*each.groups()[2:]) for each in found if each}


def _meaning(unit: str, low: str | None, high: str | None, codes: str) -> ObjectMeaning:
    named = (each.partition("=") for each in codes.split(",") if each.strip())
    plain = Limits(int(low), int(high)) if low and high else None
    return ObjectMeaning(unit.strip(), plain, {name.strip(): int(number) for name, _, number in named})
