"""Annotations that declare more of a value than its type: `radius: Annotated[float, Within(10, 1000, "mm")]`.

A class states its ranges and units here without importing YAML; `yaml_shapes` makes its reader from them.
"""

from __future__ import annotations

from typing import NamedTuple


class Within(NamedTuple):
    """A number from `low` to `high`, both included, in `unit`; `form` formats both in errors."""

    low: float
    high: float
    unit: str = ""
    form: str = "{}"

    def __str__(self) -> str:
        return f"{self.form.format(self.low)}..{self.form.format(self.high)} {self.unit}".rstrip()


class Listed:
    """A named tuple that YAML writes as a list, such as `[900, 1400]`; `ranges` has one range for each field."""

    def __init__(self, *ranges: Within) -> None:
        self.ranges = ranges


class ByName:
    """Values that YAML writes as a mapping; each key is the `name` of its value."""


class OneOrMore:
    """A list that is written without brackets if it has one item."""
