"""The dialects: the folders of `eds/`, each with one EDS file for each node.

Rule of this file: the only place that names a dialect or a folder. Adding a dialect is adding a folder of EDS files.
"""

from __future__ import annotations

import os
from pathlib import Path

from eurobot_od.errors import UnknownName
from eurobot_od.od import network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline

DEFAULT = "canopen"
"""Bits in CiA 301 order."""

DIALECT_VARIABLE = "EUROBOT_OD_DIALECT"
"""Environment variable that names the dialect where a command line does not."""


def eds_folder() -> Path:
    """Return the folder of the dialects: inside an installed package, or next to the package in a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "eds"
    return inside if inside.is_dir() else package.parent / "eds"


def network_file() -> Path:
    """Return the network file of the dialects: what the robot's nodes share, and how often what is sent."""
    return eds_folder() / "network.yaml"


def names() -> list[str]:
    """Return the names of all dialects."""
    return sorted(each.name for each in eds_folder().iterdir() if any(each.glob("*.eds")))


def folder(dialect: str | Path | None = None) -> Path:
    """Return the folder of a dialect given by name or by path; None is the environment's or the default one.

    Raises UnknownName.
    """
    wanted = dialect or os.environ.get(DIALECT_VARIABLE) or DEFAULT
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
    return network.load(network.read_network(folder(dialect)).nodes, Dictionary)


def outlines(dialect: str | Path | None = None) -> tuple[Outline, ...]:
    """Return the outlines of the EDS files of all nodes of a dialect, ordered by node-ID; errors as `load_all`."""
    return network.load(network.read_network(folder(dialect)).nodes, Outline)
