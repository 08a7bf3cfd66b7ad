"""Where a device's settings are kept over a reset and over power-off (objects 0x1010 and 0x1011).

Rule of this file: what a store is, and the one that keeps nothing beyond the program's end; files are elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from eurobot_od.od.values import Address, Value


class Store(Protocol):
    """Keeps the values that a device's configuration has beyond its file's."""

    def load(self) -> dict[Address, Value]:
        """Return what was saved last, nothing if nothing was; raises DictionaryError if it cannot be used."""

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Keep these values in place of the earlier ones; raises OSError or DictionaryError if that fails."""


class Memory:
    """A store for as long as the program runs."""

    def __init__(self) -> None:
        self._values: dict[Address, Value] = {}

    def load(self) -> dict[Address, Value]:
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        self._values = dict(values)
