"""A device's settings in a DCF file, which survive a restart (the file side of objects 0x1010 and 0x1011).

Rule of this file: the file is there whole or not at all. A new one is written beside the old one, brought to the disk,
and takes its place in one step, so that a crash at any moment leaves the old one or the new one.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from eurobot_od.device.objects import is_configuration
from eurobot_od.errors import DictionaryError
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value

IDENTITY: tuple[Address, ...] = ((0x1018, 1), (0x1018, 2), (0x1018, 3))
"""Vendor-ID, product code and revision number: what a configuration has to have in common with its device."""

ANY_BYTES = "latin-1"
"""The encoding that keeps every byte of an EDS as it is; CiA 306 asks for ASCII, which is part of it."""


class FileStore:
    """Keeps the settings of the device that `dictionary` describes in the DCF `file`; see device.store.Store."""

    def __init__(self, file: str | Path, dictionary: Dictionary, baudrate_kbit: int = 500) -> None:
        self.file = Path(file)
        self._dictionary, self._baudrate = dictionary, baudrate_kbit

    def load(self) -> dict[Address, Value]:
        """Return the settings in the file, none without a file.

        Raises DictionaryError if it is no DCF, incomplete, or that of another device.
        """
        if not self.file.exists():
            return {}
        stored = Dictionary.load(self.file)
        missing = dcf.missing(stored.content.decode(ANY_BYTES))
        if missing:
            raise DictionaryError(self.file, None, f"incomplete: [{missing[0]}] is missing")
        for address in IDENTITY:
            self._check_identity(stored, address)
        return _settings(stored)

    def _check_identity(self, stored: Dictionary, address: Address) -> None:
        ours, theirs = self._dictionary.default(address), stored.default(address)
        if ours != theirs:
            what = f"sub {address[1]} is {theirs!r}, not {ours!r}: the configuration of another device"
            raise DictionaryError(self.file, address[0], what)

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Replace the file by one with these settings.

        Raises OSError, or DictionaryError if the EDS is gone, and leaves the old one then.
        """
        eds = self._dictionary.content.decode(ANY_BYTES)
        text = dcf.with_values(eds, values, node_id, self._dictionary.name, self._baudrate)
        write_whole(self.file, text.encode(ANY_BYTES))


def _settings(stored: Dictionary) -> dict[Address, Value]:
    found: dict[Address, Value] = {}
    for entry in stored.objects.values():
        for variable in getattr(entry, "subindices", {0: entry}).values():
            address = variable.index, variable.subindex
            if variable.value is not None and variable.writable and is_configuration(address):
                found[address] = variable.value
    return found


def write_whole(file: Path, content: bytes) -> None:
    """Put a file in place of another in one step, safe on the disk; raises OSError, and leaves the other then."""
    beside = file.with_name(f"{file.name}.new")
    with beside.open("wb") as new:
        new.write(content)
        new.flush()
        os.fsync(new.fileno())
    beside.replace(file)
    if os.name == "posix":  # elsewhere a folder cannot be brought to the disk
        _sync(file.parent)


def _sync(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
