"""What an annotation declares of a value beyond its type: `radius: Annotated[float, Within(10, 1000, "mm")]`.

A noun says its ranges and units itself, once, and starts without YAML: `yaml_shapes` makes its reader from them.
"""

from __future__ import annotations

from typing import NamedTuple


class Within(NamedTuple):
    """A number from `low` to `high`, both included, in a `unit`; errors write the two in a `form`."""

    low: float
    high: float
    unit: str = ""
    form: str = "{}"

    def __str__(self) -> str:
        return f"{self.form.format(self.low)}..{self.form.format(self.high)} {self.unit}".rstrip()


class Listed:
    """A named tuple that is written as a list, `[900, 1400]`; each of its fields has one of the `ranges`."""

    def __init__(self, *ranges: Within) -> None:
        self.ranges = ranges


class ByName:
    """Values that are written as a mapping: each key is the `name` of its value, which does not say it itself."""


class OneOrMore:
    """A list that is written without brackets if it has one item."""
