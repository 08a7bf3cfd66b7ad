"""The index of a folder of device files, with the identity of each.

Reading 500 files takes seconds, checking their times and sizes a few milliseconds. So the identities are stored in an
index, one for each folder, among the user's cache files. A file with another time or size is read again. An index that
is lost, damaged or not writable only costs time.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od import standard
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.document import read_bytes
from eurobot_od.od.formats import SUFFIXES, completed, read
from eurobot_od.od.identity import Identity
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
