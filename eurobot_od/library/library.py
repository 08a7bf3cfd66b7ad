"""A library of device files, and the search for the one that fits a device's identity (0x1018) and type (0x1000).

Reading 500 files takes seconds, checking their times and sizes a few milliseconds. So the identities are stored in an
index, one for each folder, among the user's cache files. A file with another time or size is read again. An index that
is lost, damaged or not writable only costs time.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from hashlib import blake2b
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.od import standard
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import read_bytes
from eurobot_od.od.formats import SUFFIXES, completed, read
from eurobot_od.od.identity import Identity, contradiction, misfit, stranger
from eurobot_od.od.network import NodeFile
from eurobot_od.od.values import Address
from eurobot_od.support.files import UNREADABLE

VERSION = 1
"""Version of the index's format; bump it if files would be described differently."""

APPLICATION = "eurobot-od"
"""Name of the folder among the user's data and cache files."""

DEEPEST = 8
"""Number of levels of subfolders that are searched."""


class FolderKind(NamedTuple):
    """Location of one kind of user's files: the variable, and the defaults on Linux, macOS and Windows."""

    variable: str
    linux: str
    macos: str
    windows: str


DATA = FolderKind("XDG_DATA_HOME", ".local/share", "Library/Application Support", "")
CACHE = FolderKind("XDG_CACHE_HOME", ".cache", "Library/Caches", "Cache")


def user_folder(kind: FolderKind) -> Path:
    """Return the folder of a user's data or cache files, as platformdirs does, whose import takes 25 ms."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local"
        return Path(local, APPLICATION, kind.windows)
    if sys.platform == "darwin":
        return Path.home() / kind.macos / APPLICATION
    return Path(os.environ.get(kind.variable, "").strip() or Path.home() / kind.linux, APPLICATION)


class LibraryEntry(NamedTuple):
    """A device file: its `path`, and the identity and names of its device.

    `device_type` is 0x1000, None if the file does not have it. `problem` is why the file cannot be used.
    """

    path: Path
    vendor: int = 0
    product: int = 0
    revision: int = 0
    device_type: int | None = None
    vendor_name: str = ""
    product_name: str = ""
    problem: str = ""

    @property
    def is_identified(self) -> bool:
        """Whether the file has a vendor-ID or product code; otherwise no device fits it."""
        return bool(self.vendor or self.product)

    @property
    def identity(self) -> Identity:
        """The identity in the file, without a serial number; 0 for missing numbers."""
        return Identity(self.vendor, self.product, self.revision)


def described(path: Path) -> LibraryEntry:
    """Read a file's description; an unusable file has a `problem`."""
    try:
        document = read(read_bytes(path))
        device = DescribedDevice(completed(document))
        if document.hiding or not device.objects:
            return LibraryEntry(path, problem="not a readable EDS (`lint` says more)")
        identity = Identity.described(device)
        type_ = device.value(standard.DEVICE_TYPE[0])
    except DictionaryError as error:
        return LibraryEntry(path, problem=error.what)
    names = (document.text("deviceinfo", key) for key in ("vendorname", "productname"))
    return LibraryEntry(path, *identity[:3], type_.value if type_ else None, *names)


Rows = dict[str, list[Any]]
"""Rows of an index by path in the folder: modification time in ns, size, and the entry's fields."""


def entries(folder: Path) -> list[LibraryEntry]:
    """Return the entries of all device files in a folder and its subfolders, by path; reads files that have changed."""
    states = sorted(_states(folder))
    kept = _read(folder) if states else Rows()
    rows = Rows()
    for name, state in states:
        row = kept.get(name)
        rows[name] = row if row and row[:2] == state else [*state, *described(folder / name)[1:]]
    if rows != kept:
        _write(folder, rows)
    return [LibraryEntry(folder / name, *row[2:]) for name, row in rows.items()]


def _states(folder: Path, below: str = "", depth: int = 0) -> Iterator[tuple[str, list[int]]]:
    """Yield the device files in a folder and its subfolders: path in the folder, modification time in ns, and size."""
    with suppress(OSError), os.scandir(folder / below) as found:  # a missing or inaccessible folder
        for each in found:
            if each.is_dir(follow_symlinks=False):
                if depth < DEEPEST and not each.name.startswith("."):
                    yield from _states(folder, f"{below}{each.name}/", depth + 1)
            elif each.name.lower().endswith(SUFFIXES):
                with suppress(OSError):  # a broken link
                    status = each.stat()
                    yield f"{below}{each.name}", [status.st_mtime_ns, status.st_size]


def file_of(folder: Path) -> Path:
    """Return the path of a folder's index."""
    name = blake2b(os.fsencode(folder.resolve()), digest_size=8).hexdigest()
    return user_folder(CACHE) / "library" / f"{name}.json"


def _read(folder: Path) -> Rows:
    """Return the rows of an index; none if it is missing, damaged, or of another version."""
    import json  # most commands start without a library

    with suppress(OSError, *UNREADABLE, TypeError, AttributeError):
        content: Mapping[str, Any] = json.loads(file_of(folder).read_bytes())
        fields = len(LibraryEntry._fields) + 1
        rows = content["files"] if content["version"] == VERSION else {}
        if all(len(row) == fields for row in rows.values()):
            return dict(rows)
    return {}


def _write(folder: Path, rows: Rows) -> None:
    import json

    from eurobot_od.support.files import write_whole

    with suppress(OSError):  # without an index, the files are read each time
        file = file_of(folder)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps({"version": VERSION, "folder": str(folder), "files": rows}).encode())


VARIABLE = "EUROBOT_OD_LIBRARY"
"""Environment variable with folders, separated as in PATH, for commands without any."""


def users_folder() -> Path:
    """Return the folder of the user's own library, which may not exist."""
    return user_folder(DATA) / "devices"


def folders(typed: Sequence[str] = (), written: Sequence[str] = ()) -> list[Path]:
    """Return a library's folders: those that are `typed`, else the environment's, else `written`, else the user's.

    Raises LocalError for a named folder that does not exist.
    """
    environment = [each for each in os.environ.get(VARIABLE, "").split(os.pathsep) if each]
    named = [Path(each) for each in typed or environment or written]
    missing = [each for each in named if not each.is_dir()]
    if missing:
        raise LocalError(f"library {missing[0]}: no such folder; `mkdir {missing[0]}` makes one")
    return named or [users_folder()]


class Fit(NamedTuple):
    """The file that fits a device best, and `others` of the same product, better ones first.

    `difference` is how the best one differs from the device's version; empty if it does not. `alike` is the number of
    files that fit equally well, of which one is chosen arbitrarily.
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
        """Remark beside the file's name: the doubt, or other files of the product."""
        others = ", ".join(each.path.name for each in self.others)
        return self.doubt or (f"also of this product: {others}" if others else "")


class Library:
    """Device files in folders, which are read on first use."""

    def __init__(self, folders: Iterable[Path]) -> None:
        self.folders = tuple(folders)

    def look_again(self) -> None:
        """Forget the files, because some were added."""
        for name in ("entries", "_products"):
            self.__dict__.pop(name, None)

    @cached_property
    def entries(self) -> tuple[LibraryEntry, ...]:
        """All files, by folder and path."""
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

        The order of preference is: same major revision, same device type, same revision, nearest older revision,
        nearest newer one. Without a product code, the device type must be equal.
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
    """Return the sort key of a file by its distance from a device of its product."""
    revision = entry.revision or identity.revision
    is_typed = entry.device_type is not None and device_type is not None
    return (
        revision >> 16 != identity.revision >> 16,
        is_typed and entry.device_type != device_type,
        entry.revision != identity.revision,
        revision > identity.revision,
        abs(revision - identity.revision),
        entry.path.suffix.lower() in (".dcf", ".xdc"),  # of a single device
    )


Numbers = Mapping[Address, int]
"""Observed values of 0x1000 and 0x1018, by address."""


def identity_of(numbers: Numbers) -> Identity:
    """Return the observed identity of a device; 0 for unknown numbers."""
    return Identity(*(numbers.get((standard.IDENTITY, sub), 0) for sub in range(1, len(Identity._fields) + 1)))


class LibraryDevices:
    """Finds dictionaries in a library by the observed identity of nodes; `tell` is called once for a doubtful node.

    `implied` are nodes whose files the user has not named: a fitting file of the library has priority. `nodes` has the
    other settings of nodes; `worded` adds the texts of a device package.
    """

    def __init__(
        self,
        library: Library,
        tell: Callable[[str], None],
        implied: Container[int] = (),
        nodes: Mapping[int, NodeFile] = MappingProxyType({}),
        worded: Callable[[Dictionary], Dictionary] = lambda device: device,
    ) -> None:
        self._library = library
        self._tell = tell
        self._implied = implied
        self._nodes = nodes
        self._worded = worded
        self._told: set[int] = set()
        self._made: dict[tuple[int, Path], Dictionary | None] = {}

    def __call__(self, node_id: int, numbers: Numbers, known: Dictionary | None = None) -> Dictionary | None:
        """Return the dictionary of a node by its observed identity; None if there is none, or `known` is right."""
        identity = identity_of(numbers)
        if known and not misfit(known, identity):
            return None
        is_ours = any(known is each for each in self._made.values())
        is_open = known is None or is_ours or node_id in self._implied
        found = self._described(node_id, identity, numbers) if is_open else None
        if found is None:
            self.check(node_id, identity, known, numbers.get(standard.DEVICE_TYPE))
        return found

    def check(self, node_id: int, identity: Identity, known: Dictionary | None, device_type: int | None = None) -> None:
        """Call `tell` if a node's file is for another device than observed."""
        if known and (other := stranger(known, node_id, identity, device_type)):
            self._tell_once(node_id, other)

    def _described(self, node_id: int, identity: Identity, numbers: Numbers) -> Dictionary | None:
        fit = self._library.find(identity, numbers.get(standard.DEVICE_TYPE))
        if fit is None:
            return None
        if fit.doubt and (standard.IDENTITY, 3) in numbers:  # not before the revision is known
            self._tell_once(node_id, f"node {node_id}: {fit.doubt}")
        key = node_id, fit.entry.path
        if key not in self._made:
            self._made[key] = self._loaded(node_id, fit)
        return self._made[key]

    def _loaded(self, node_id: int, fit: Fit) -> Dictionary | None:
        file = fit.entry.path
        said = self._nodes.get(node_id, NodeFile())
        try:
            return self._worded(said._replace(file=str(file), name=said.name or f"{file.stem}_{node_id}").load(node_id))
        except DictionaryError as error:
            self._tell_once(node_id, f"node {node_id}: {error}")
            return None

    def _tell_once(self, node_id: int, what: str) -> None:
        if node_id not in self._told:
            self._told.add(node_id)
            self._tell(what)
