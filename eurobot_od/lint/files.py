"""Reads the files that are to be checked or compared; rule: the only place of this package that opens a file."""

from __future__ import annotations

from eurobot_od.errors import DictionaryError
from eurobot_od.lint.model import Device
from eurobot_od.lint.rules import load


def read_bytes(file: str) -> bytes:
    """Read a file; raises DictionaryError if that cannot be."""
    try:
        with open(file, "rb") as stream:  # noqa: PTH123  # pathlib costs a third of the start-up time
            return stream.read()
    except (OSError, ValueError) as error:
        raise DictionaryError(file, None, getattr(error, "strerror", None) or str(error)) from error


def read_device(file: str) -> Device:
    """Read an EDS or DCF for a comparison; raises DictionaryError if it cannot be read or describes nothing."""
    device = load(read_bytes(file), file)
    if not device.objects:
        raise DictionaryError(file, None, "not an EDS: it describes no object")
    return device
