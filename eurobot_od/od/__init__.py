"""The object dictionary of a device of any vendor, from its EDS or DCF.

This module finds the files of a network before any is read.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.errors import LocalError, UnknownName

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary

DEFAULT = "eurobot-od.yaml"
"""Name of the network file in a working folder."""

DIALECT_VARIABLE = "EUROBOT_OD_DIALECT"
"""Environment variable with the dialect for commands without one."""


class Dialects(NamedTuple):
    """The dialects in the folder `root`; `default` is used if none is named (empty: the first).

    Without a `root` there are none, and a dialect is the path of any folder of EDS files.
    """

    root: Path | None = None
    default: str = ""

    def network_file(self) -> Path | None:
        """Return the dialects' network file with messages and their periods, or None."""
        file = None if self.root is None else self.root / "network.yaml"
        return file if file is not None and file.is_file() else None

    def names(self) -> list[str]:
        """Return the names of all dialects."""
        folders = self.root.iterdir() if self.root is not None and self.root.is_dir() else ()
        return sorted(each.name for each in folders if any(each.glob("*.eds")))

    def folder(self, dialect: str | Path | None = None) -> Path:
        """Return the folder of a dialect given by name or path; None is the environment's or the default one.

        Raises UnknownName, or LocalError if there is no dialect to use.
        """
        if not (dialect or self.root):
            raise LocalError("which devices? Name them by --eds or --network, or a robot by --robot")
        names = self.names()
        wanted = dialect or os.environ.get(DIALECT_VARIABLE) or self.default or next(iter(names), None)
        if wanted is None:
            raise LocalError(f"which devices? no EDS files in {self.root}/*")
        # A dialect's name has priority over a folder with that name in the working directory.
        path = self.root / wanted if self.root is not None and str(wanted) in names else Path(wanted)
        if not any(path.glob("*.eds")):
            raise UnknownName("dialect", str(wanted), names)
        return path

    def load(self, node: str, dialect: str | Path | None = None, node_id: int | None = None) -> Dictionary:
        """Load the EDS file of one node of a dialect.

        Raises UnknownName for an unknown node or dialect, DictionaryError for an unusable file.
        """
        from eurobot_od.od.dictionary import Dictionary

        file = self.folder(dialect) / f"{node}.eds"
        if not file.is_file():
            raise UnknownName("node", node, sorted(each.stem for each in file.parent.glob("*.eds")))
        return Dictionary.load(file, node_id)

    def load_all(self, dialect: str | Path | None = None) -> tuple[Dictionary, ...]:
        """Load the EDS files of all nodes of a dialect, ordered by node-ID.

        Raises DictionaryError if two of them have the same node-ID.
        """
        from eurobot_od.od import network

        return network.load(network.read_network(self.folder(dialect)).nodes)
