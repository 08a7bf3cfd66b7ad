"""Where a device's settings are kept over power-off: in a DCF file (objects 0x1010 and 0x1011).

Rule of this file: the DCF is there whole or not at all. A new one is written next to the old one, brought to the disk,
and takes its place in one step, so that a crash at any moment leaves the old one or the new one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from eurobot_od.device.objects import is_configuration
from eurobot_od.errors import DictionaryError, FieldError, UnknownName
from eurobot_od.files import write_whole
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value

IDENTITY: tuple[Address, ...] = ((0x1018, 1), (0x1018, 2), (0x1018, 3))
"""Vendor-ID, product code and revision number: what a configuration has to have in common with its device."""

ANY_BYTES = "latin-1"
"""The encoding that keeps every byte of an EDS as it is; CiA 306 asks for ASCII, which is part of it."""


class Store(Protocol):
    """Keeps the values that a device's configuration has beyond its file's."""

    def load(self) -> dict[Address, Value]:
        """Return what was saved last, nothing if nothing was; raises DictionaryError if it cannot be used."""

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Keep these values in place of the earlier ones; raises OSError or DictionaryError if that fails."""


class MemoryStore:
    """Keeps settings as long as the program runs, see Store; it begins with `values`."""

    def __init__(self, values: Mapping[Address, Value]) -> None:
        self._values = dict(values)

    def load(self) -> dict[Address, Value]:
        """Return the settings."""
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], _node_id: int) -> None:
        """Keep these settings."""
        self._values = dict(values)


class FileStore:
    """Keeps the settings of the device that `dictionary` describes in the DCF `file`, see Store."""

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
        never_there = dcf.missing(self._dictionary.content.decode(ANY_BYTES))
        for section in dcf.missing(stored.content.decode(ANY_BYTES)):
            if section not in never_there:
                raise DictionaryError(self.file, None, f"incomplete: [{section}] is missing")
        for index, sub in IDENTITY:
            ours, theirs = self._dictionary.default((index, sub)), stored.default((index, sub))
            if ours != theirs:
                what = f"sub {sub} is {theirs!r}, not {ours!r}: the configuration of another device"
                raise DictionaryError(self.file, index, what)
        variables = {each: stored.variable(each) for each in stored.addresses() if is_configuration(stored, each)}
        # what the file's own EDS says by DefaultValue alone is not stored: a later EDS may say something else
        return {a: v.value for a, v in variables.items() if v is not None and v.writable and v.value is not None}

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Replace the file by one with these settings.

        Raises OSError, or DictionaryError if the EDS is gone or has no place for a value, and leaves the old one then.
        """
        eds = self._dictionary.content.decode(ANY_BYTES)
        try:
            text = dcf.with_values(eds, values, node_id, self._dictionary.name, self._baudrate)
            content = text.encode(ANY_BYTES)
        except (UnknownName, FieldError, UnicodeEncodeError) as error:
            raise DictionaryError(self._dictionary.file, None, f"no place in its DCF: {error}") from error
        write_whole(self.file, content)
