"""The dialects: the folders of `eds/`, each with one EDS file for each node.

Rule of this file: the only place that names a dialect or a folder. Adding a dialect is adding a folder of EDS files.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from eurobot_od.errors import DictionaryError, UnknownName
from eurobot_od.od import outline_cache
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline

DEFAULT = "canopen"
"""Bits in CiA 301 order."""

VARIABLE = "EUROBOT_OD_DIALECT"
"""Environment variable that names the dialect where a command line does not."""

Loaded = TypeVar("Loaded", Dictionary, Outline)


def eds_folder() -> Path:
    """Return the folder of the dialects: inside an installed package, or beside the package in a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "eds"
    return inside if inside.is_dir() else package.parent / "eds"


def names() -> list[str]:
    """Return the names of all dialects."""
    return sorted(each.name for each in eds_folder().iterdir() if any(each.glob("*.eds")))


def folder(dialect: str | Path | None = None) -> Path:
    """Return the folder of a dialect given by name or by path; None is the environment's or the default one.

    Raises UnknownName.
    """
    wanted = dialect or os.environ.get(VARIABLE) or DEFAULT
    path = eds_folder() / wanted if str(wanted) in names() else Path(wanted)
    if not any(path.glob("*.eds")):
        raise UnknownName("dialect", str(wanted), names())
    return path


def load(node: str, dialect: str | Path | None = None, node_id: int | None = None) -> Dictionary:
    """Load the EDS file of one node of a dialect.

    Raises UnknownName for a node or dialect that is not there, DictionaryError for a file that cannot be used.
    """
    file = folder(dialect) / f"{node}.eds"
    if not file.is_file():
        raise UnknownName("node", node, sorted(each.stem for each in file.parent.glob("*.eds")))
    return Dictionary.load(file, node_id)


def load_all(dialect: str | Path | None = None) -> tuple[Dictionary, ...]:
    """Load the EDS files of all nodes of a dialect, ordered by node-ID.

    Raises DictionaryError if two of them have one node-ID.
    """
    return _each(Dictionary.load, dialect)


def outlines(dialect: str | Path | None = None) -> tuple[Outline, ...]:
    """Return the outlines of the EDS files of all nodes of a dialect, ordered by node-ID; errors as `load_all`.

    That is all that decoding needs, and comes from `outline_cache` if these files have been loaded before.
    """
    return _each(outline_cache.load, dialect)


def _each(load: Callable[[Path], Loaded], dialect: str | Path | None) -> tuple[Loaded, ...]:
    loaded = sorted(map(load, sorted(folder(dialect).glob("*.eds"))), key=lambda each: each.node_id)
    for one, other in pairwise(loaded):
        if one.node_id == other.node_id:
            raise DictionaryError(other.file, None, f"node-ID {other.node_id} is taken by {one.file.name}")
    return tuple(loaded)
