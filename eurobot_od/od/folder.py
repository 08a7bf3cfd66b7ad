"""A folder with one EDS file for each node of a network."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from eurobot_od.errors import DictionaryError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline

Loaded = TypeVar("Loaded", bound=Outline)


def outlines(folder: Path) -> tuple[Outline, ...]:
    """Return the outlines of all EDS files, ordered by node-ID; raises DictionaryError if two have one node-ID."""
    return _each(Outline.load, folder)


def dictionaries(folder: Path) -> tuple[Dictionary, ...]:
    """Return the dictionaries of all EDS files, ordered by node-ID; raises as `outlines`."""
    return _each(Dictionary.load, folder)


def _each(load: Callable[[Path], Loaded], folder: Path) -> tuple[Loaded, ...]:
    loaded = sorted(map(load, sorted(folder.glob("*.eds"))), key=lambda each: each.node_id)
    for one, other in pairwise(loaded):
        if one.node_id == other.node_id:
            raise DictionaryError(other.file, None, f"node-ID {other.node_id} is taken by {one.file.name}")
    return tuple(loaded)
