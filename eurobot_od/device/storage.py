"""Where a device's settings are kept over power-off: in a DCF file (objects 0x1010 and 0x1011).

Rule of this file: the DCF is there whole or not at all. A new one is written next to the old one, brought to the disk,
and takes its place in one step, so that a crash at any moment leaves the old one or the new one.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from eurobot_od.device.objects import is_configuration, out_of_limits
from eurobot_od.errors import DamagedFile, DictionaryError, FieldError, UnknownName
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import read_bytes
from eurobot_od.od.objects import data_type, limits
from eurobot_od.od.standard import IDENTITY
from eurobot_od.od.values import Address, Value, label
from eurobot_od.support.files import write_whole

KIND: tuple[Address, ...] = tuple((IDENTITY, sub) for sub in (1, 2, 3))
"""Vendor-ID, product code and revision number: what a configuration has to have in common with its device."""

ANY_BYTES = "latin-1"
"""The encoding that keeps every byte of an EDS as it is; CiA 306 asks for ASCII, which is part of it."""


CHECKSUM = re.compile(rb"; CRC-32 of all that follows: 0x([0-9A-F]{8})\n")
"""The first line of a stored file: a comment, so that every tool reads the rest as the DCF that it is."""


class Store(Protocol):
    """Keeps the values that a device's configuration has beyond its file's."""

    def load(self) -> dict[Address, Value]:
        """Return what was saved last, nothing if nothing was.

        Raises DamagedFile if it is not what was saved, DictionaryError if it is not for this device.
        """

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

        Raises DamagedFile if its checksum says so, DictionaryError if it is not a DCF, incomplete, or that of another
        device. A DCF of other programs has no checksum, and is believed.
        """
        if not self.file.exists():
            return {}
        content = read_bytes(self.file)
        line = CHECKSUM.match(content)
        # Before it is read: a flipped bit may still be a DCF, with another value in it.
        if line and int(line[1], 16) != zlib.crc32(content[line.end() :]):
            what = "damaged: the checksum in its first line is not that of the rest (changed by hand? delete that line)"
            raise DamagedFile(self.file, None, what)
        stored = Dictionary.load(self.file)
        # What the EDS itself leaves out its DCF cannot have; any other section that is missing has been cut off.
        never_there = dcf.missing(self._dictionary.content.decode(ANY_BYTES))
        for section in dcf.missing(stored.content.decode(ANY_BYTES)):
            if section not in never_there:
                raise DictionaryError(self.file, None, f"incomplete: [{section}] is missing")
        # Not by the serial number: a device that replaces a broken one is to take over its configuration.
        for index, sub in KIND:
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
        device = self._dictionary.device
        try:
            content = dcf.with_values(device, values, node_id, self._dictionary.name, self._baudrate).encode()
        except (UnknownName, FieldError, UnicodeEncodeError) as error:
            raise DictionaryError(self._dictionary.file, None, f"no place in its DCF: {error}") from error
        write_whole(self.file, b"; CRC-32 of all that follows: 0x%08X\n" % zlib.crc32(content) + content)


def refused(dictionary: Dictionary, values: Mapping[Address, Value]) -> Iterator[tuple[Address, str]]:
    """Give the stored values that a device cannot have: its file has no such object, or they are outside its limits."""
    for address, value in values.items():
        variable = dictionary.variable(address)
        if variable is None:
            yield address, f"{label(address)} is no object of the device"
            continue
        try:
            data_type(variable).write(value)
            fits = out_of_limits(variable, value) is None
        except (ValueError, OverflowError):  # it is not of the type that the object has in this EDS
            fits = False
        if not fits:
            range_ = limits(variable)
            allowed = data_type(variable).name if range_ is None else f"{range_.low}..{range_.high}"
            what = f"{label(address, variable.name)} = {value!r}, allowed: {allowed}"
            yield address, f"{what}; the default is taken"
