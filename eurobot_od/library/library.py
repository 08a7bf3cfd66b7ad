"""A library of devices: which of its files fits a device that shows its identity (0x1018) and its type (0x1000)."""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.library.index import DATA, LibraryEntry, entries, user_folder
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.network import NodeFile
from eurobot_od.od.values import Address

VARIABLE = "EUROBOT_OD_LIBRARY"
"""Environment variable that names the folders where a command line does not, as PATH does."""


def users_folder() -> Path:
    """Return the folder of the user's own library, whether it is there or not."""
    return user_folder(DATA) / "devices"


def folders(typed: Sequence[str] = (), written: Sequence[str] = ()) -> list[Path]:
    """Return a library's folders: those that are `typed`, else the environment's, else `written`, else the user's.

    Raises LocalError for one that is named and is not there.
    """
    environment = [each for each in os.environ.get(VARIABLE, "").split(os.pathsep) if each]
    named = [Path(each) for each in typed or environment or written]
    missing = [each for each in named if not each.is_dir()]
    if missing:
        raise LocalError(f"library {missing[0]}: no such folder")
    return named or [users_folder()]


def contradiction(said: Identity, device: Identity) -> str | None:
    """Return in what a device is of another kind than a file says; what either does not say (0) is no difference."""
    pairs = [(mine or theirs, theirs or mine) for mine, theirs in zip(said, device)]
    return Identity(*(mine for mine, _ in pairs)).difference(Identity(*(theirs for _, theirs in pairs)))


class Fit(NamedTuple):
    """The file that fits a device best, and `others` of the same product, better ones first.

    `difference` says in what the best one is for another version; empty if it is for this one. `alike` counts the files
    that fit as well as the best one: which of them counts is chance.
    """

    entry: LibraryEntry
    others: tuple[LibraryEntry, ...] = ()
    difference: str = ""
    alike: int = 1

    @property
    def doubt(self) -> str:
        """Why another file may be the right one; empty if this one is."""
        if self.alike > 1:
            alike = ", ".join(each.path.name for each in self.others[: self.alike - 1])
            return f"{self.entry.path} is taken; as well fit {alike}"
        also = f"; also of this product: {', '.join(each.path.name for each in self.others)}" if self.others else ""
        return f"{self.entry.path} is for another version: it has {self.difference}{also}" if self.difference else ""

    @property
    def further(self) -> str:
        """What is to be said besides the file's name: the doubt, or which other files of the product there are."""
        others = ", ".join(each.path.name for each in self.others)
        return self.doubt or (f"also of this product: {others}" if others else "")


class Library:
    """Device files in folders; they are looked at when the first one is asked for."""

    def __init__(self, folders: Iterable[Path]) -> None:
        self.folders = tuple(folders)

    def look_again(self) -> None:
        """Forget which files there are: some were added."""
        for name in ("entries", "_products"):
            self.__dict__.pop(name, None)

    @cached_property
    def entries(self) -> tuple[LibraryEntry, ...]:
        """All files, folder by folder, by path."""
        return tuple(each for folder in self.folders for each in entries(folder))

    @cached_property
    def _products(self) -> Mapping[tuple[int, int], list[LibraryEntry]]:
        found: dict[tuple[int, int], list[LibraryEntry]] = {}
        for each in self.entries:
            if each.is_identified and not each.problem:
                found.setdefault((each.vendor, each.product), []).append(each)
        return found

    def find(self, identity: Identity, device_type: int | None = None) -> Fit | None:
        """Return the file that fits a device best, None if there is none of its vendor and product.

        The same major revision comes first, then the same device type, then the same revision, the nearest older one,
        and the nearest newer one. Without a product code the device type has to agree.
        """
        fitting = self._products.get(identity[:2], [])
        if not identity.product:
            fitting = [each for each in fitting if each.device_type == device_type is not None]
        if not fitting:
            return None

        def distance(entry: LibraryEntry) -> tuple[int, ...]:
            return _distance(entry, identity, device_type)

        best, *others = sorted(fitting, key=lambda each: (distance(each), each.path))
        alike = [distance(each) for each in fitting].count(distance(best))
        return Fit(best, tuple(others), contradiction(best.identity, identity) or "", alike)


def _distance(entry: LibraryEntry, identity: Identity, device_type: int | None) -> tuple[int, ...]:
    """Return how far a file is from a device of its product, for sorting."""
    revision = entry.revision or identity.revision
    is_typed = entry.device_type is not None and device_type is not None
    return (
        revision >> 16 != identity.revision >> 16,
        is_typed and entry.device_type != device_type,
        entry.revision != identity.revision,
        revision > identity.revision,
        abs(revision - identity.revision),
        entry.path.suffix.lower() in (".dcf", ".xdc"),  # of one device, where an EDS is of all
    )


Numbers = Mapping[Address, int]
"""What a device has shown of 0x1000 and 0x1018, by address."""


def identity_of(numbers: Numbers) -> Identity:
    """Return the identity that a device has shown; 0 for what it has not."""
    return Identity(*(numbers.get((standard.IDENTITY, sub), 0) for sub in range(1, len(Identity._fields) + 1)))


class LibraryDevices:
    """Describes nodes that show what they are, by the files of a library; what is odd is told once for each node.

    `implied` are nodes whose files nobody has named: a file of the library that fits wins over theirs. `nodes` say all
    but the file of a node; `worded` gives a device what its package says.
    """

    def __init__(
        self,
        library: Library,
        tell: Callable[[str], None],
        implied: Container[int] = (),
        nodes: Mapping[int, NodeFile] = MappingProxyType({}),
        worded: Callable[[Dictionary], Dictionary] = lambda device: device,
    ) -> None:
        self._library, self._tell, self._implied, self._nodes, self._worded = library, tell, implied, nodes, worded
        self._told: set[int] = set()
        self._made: dict[tuple[int, Path], Dictionary | None] = {}

    def __call__(self, node_id: int, numbers: Numbers, known: Dictionary | None = None) -> Dictionary | None:
        """Return the description of a node by what it has shown; None if there is none, or `known` is right."""
        identity = identity_of(numbers)
        different = known and contradiction(Identity.of(known), identity)
        if known and not different:
            return None
        is_ours = any(known is each for each in self._made.values())
        is_open = known is None or is_ours or node_id in self._implied
        found = self._described(node_id, identity, numbers) if is_open else None
        if found is None:
            self.check(node_id, identity, known)
        return found

    def check(self, node_id: int, identity: Identity, known: Dictionary | None) -> None:
        """Tell if the file of a node is for another device than it has shown."""
        different = known and contradiction(Identity.of(known), identity)
        if known and different:
            self._tell_once(node_id, f"{known.file} is for another device: node {node_id} has {different}")

    def _described(self, node_id: int, identity: Identity, numbers: Numbers) -> Dictionary | None:
        fit = self._library.find(identity, numbers.get(standard.DEVICE_TYPE))
        if fit is None:
            return None
        if fit.doubt and (standard.IDENTITY, 3) in numbers:  # the revision, which may come later, decides
            self._tell_once(node_id, f"node {node_id}: {fit.doubt}")
        key = node_id, fit.entry.path
        if key not in self._made:
            self._made[key] = self._loaded(node_id, fit)
        return self._made[key]

    def _loaded(self, node_id: int, fit: Fit) -> Dictionary | None:
        file, said = fit.entry.path, self._nodes.get(node_id, NodeFile())
        try:
            return self._worded(said._replace(file=str(file), name=said.name or f"{file.stem}_{node_id}").load(node_id))
        except DictionaryError as error:
            self._tell_once(node_id, f"node {node_id}: {error}")
            return None

    def _tell_once(self, node_id: int, what: str) -> None:
        if node_id not in self._told:
            self._told.add(node_id)
            self._tell(what)
