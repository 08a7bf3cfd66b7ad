"""What an EDS or DCF says: the object dictionary of a device, of any vendor.

In here is what is asked for before any file is read: where a network's files are.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.errors import LocalError, UnknownName

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary

DEFAULT = "eurobot-od.yaml"
"""The network file of a working folder."""

DIALECT_VARIABLE = "EUROBOT_OD_DIALECT"
"""Environment variable that names the dialect where a command line does not."""


class Dialects(NamedTuple):
    """The dialects in the folder `root`; `default` is the one that counts where none is named, `` for the first.

    Without a `root` there are none, and a dialect is the path of any folder of EDS files.
    """

    root: Path | None = None
    default: str = ""

    def network_file(self) -> Path | None:
        """Return the network file: what the nodes share, and how often what is sent; None if there is none."""
        file = None if self.root is None else self.root / "network.yaml"
        return file if file is not None and file.is_file() else None

    def names(self) -> list[str]:
        """Return the names of all dialects."""
        folders = self.root.iterdir() if self.root is not None and self.root.is_dir() else ()
        return sorted(each.name for each in folders if any(each.glob("*.eds")))

    def folder(self, dialect: str | Path | None = None) -> Path:
        """Return the folder of a dialect given by name or by path; None is the environment's or the default one.

        Raises UnknownName; LocalError if none is named and there is none.
        """
        if not (dialect or self.root):
            raise LocalError("which devices? Name them by --eds or --network, or a robot by --robot")
        names = self.names()
        wanted = dialect or os.environ.get(DIALECT_VARIABLE) or self.default or next(iter(names), None)
        if wanted is None:
            raise LocalError(f"which devices? no EDS files in {self.root}/*")
        # A dialect's name comes before a folder of the same name in the working directory.
        path = self.root / wanted if self.root is not None and str(wanted) in names else Path(wanted)
        if not any(path.glob("*.eds")):
            raise UnknownName("dialect", str(wanted), names)
        return path

    def load(self, node: str, dialect: str | Path | None = None, node_id: int | None = None) -> Dictionary:
        """Load the EDS file of one node of a dialect.

        Raises UnknownName for a node or dialect that is not there, DictionaryError for a file that cannot be used.
        """
        from eurobot_od.od.dictionary import Dictionary

        file = self.folder(dialect) / f"{node}.eds"
        if not file.is_file():
            raise UnknownName("node", node, sorted(each.stem for each in file.parent.glob("*.eds")))
        return Dictionary.load(file, node_id)

    def load_all(self, dialect: str | Path | None = None) -> tuple[Dictionary, ...]:
        """Load the EDS files of all nodes of a dialect, ordered by node-ID.

        Raises DictionaryError if two of them have one node-ID.
        """
        from eurobot_od.od import network

        return network.load(network.read_network(self.folder(dialect)).nodes)
