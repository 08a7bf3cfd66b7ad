"""Keeps a device's settings over power-off, in a DCF file (objects 0x1010 and 0x1011).

The DCF is there whole or not at all. A new one is written next to the old one, flushed to the disk, and takes its place
in one step, so that a crash at any moment leaves the old one or the new one.
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
"""Vendor-ID, product code and revision number: these must be the same in a configuration and its device."""

ANY_BYTES = "latin-1"
"""An encoding that keeps every byte of an EDS as it is; CiA 306 asks for ASCII, which is part of it."""


CHECKSUM = re.compile(rb"; CRC-32 of all that follows: 0x([0-9A-F]{8})\n")
"""The first line of a stored file: a comment, so that every tool still reads the file as a DCF."""


class Store(Protocol):
    """Keeps the values in which a device's configuration differs from its file."""

    def load(self) -> dict[Address, Value]:
        """Return what was saved last; nothing if nothing was saved.

        Raises DamagedFile if it is not what was saved, DictionaryError if it is not for this device.
        """

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Keep these values in place of the earlier ones; raises OSError or DictionaryError if that fails."""


class MemoryStore:
    """A store that keeps settings while the program runs; it begins with `values`."""

    def __init__(self, values: Mapping[Address, Value]) -> None:
        self._values = dict(values)

    def load(self) -> dict[Address, Value]:
        """Return the settings."""
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], _node_id: int) -> None:
        """Keep these settings."""
        self._values = dict(values)


class FileStore:
    """A store that keeps the settings of the device described by `dictionary` in the DCF `file`."""

    def __init__(self, file: str | Path, dictionary: Dictionary, baudrate_kbit: int = 500) -> None:
        self.file = Path(file)
        self._dictionary, self._baudrate = dictionary, baudrate_kbit

    def load(self) -> dict[Address, Value]:
        """Return the settings in the file; none without a file.

        Raises DamagedFile if its checksum is wrong, DictionaryError if it is not a DCF, is incomplete, or is the DCF of
        another device. A DCF that another program has written has no checksum, and is trusted.
        """
        if not self.file.exists():
            return {}
        content = read_bytes(self.file)
        line = CHECKSUM.match(content)
        # Checked before it is read: with a flipped bit it may still be a DCF, with another value in it.
        if line and int(line[1], 16) != zlib.crc32(content[line.end() :]):
            what = "damaged: the checksum in its first line is not that of the rest (changed by hand? delete that line)"
            raise DamagedFile(self.file, None, what)
        stored = Dictionary.load(self.file)
        # Its DCF cannot have what the EDS itself leaves out; any other missing section has been cut off.
        never_there = dcf.missing(self._dictionary.content.decode(ANY_BYTES))
        for section in dcf.missing(stored.content.decode(ANY_BYTES)):
            if section not in never_there:
                raise DictionaryError(self.file, None, f"incomplete: [{section}] is missing")
        # The serial number does not count: a device that replaces a broken one takes over its configuration.
        for index, sub in KIND:
            ours, theirs = self._dictionary.default((index, sub)), stored.default((index, sub))
            if ours != theirs:
                what = f"sub {sub} is {theirs!r}, not {ours!r}: the configuration of another device"
                raise DictionaryError(self.file, index, what)
        variables = {each: stored.variable(each) for each in stored.addresses() if is_configuration(stored, each)}
        # what the file's own EDS gives only as DefaultValue is not a stored value: a later EDS may have another default
        return {a: v.value for a, v in variables.items() if v is not None and v.writable and v.value is not None}

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        """Replace the file by one with these settings.

        Raises OSError, or DictionaryError if the EDS is gone or has no place for a value; the old file stays then.
        """
        device = self._dictionary.device
        try:
            content = dcf.with_values(device, values, node_id, self._dictionary.name, self._baudrate).encode()
        except (UnknownName, FieldError, UnicodeEncodeError) as error:
            raise DictionaryError(self._dictionary.file, None, f"no place in its DCF: {error}") from error
        write_whole(self.file, b"; CRC-32 of all that follows: 0x%08X\n" % zlib.crc32(content) + content)


def refused(dictionary: Dictionary, values: Mapping[Address, Value]) -> Iterator[tuple[Address, str]]:
    """Yield the stored values that a device cannot have: its file lacks the object, or its limits exclude them."""
    for address, value in values.items():
        variable = dictionary.variable(address)
        if variable is None:
            yield address, f"{label(address)} is not an object of the device"
            continue
        try:
            data_type(variable).write(value)
            fits = out_of_limits(variable, value) is None
        except (ValueError, OverflowError):  # it does not have the type of the object in this EDS
            fits = False
        if not fits:
            range_ = limits(variable)
            allowed = data_type(variable).name if range_ is None else f"{range_.low}..{range_.high}"
            what = f"{label(address, variable.name)} = {value!r}, allowed: {allowed}"
            yield address, f"{what}; the default is taken"
