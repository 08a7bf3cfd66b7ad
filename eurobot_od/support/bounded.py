"""Files that are read whole, up to a limit, whatever is behind their names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eurobot_od.errors import DictionaryError

if TYPE_CHECKING:
    from pathlib import Path

MOST = 16 << 20
"""Bytes of the largest EDS, DCF or YAML file that is read; those of real devices have some hundred thousand."""


def read(file: str | Path) -> bytes:
    """Return what a file holds; raises OSError, DictionaryError if that is more than `MOST` bytes."""
    with open(file, "rb") as stream:  # noqa: PTH123  # `lint` starts without pathlib
        content = stream.read(MOST + 1)  # one more than may be; a size asked beforehand is 0 for /dev/zero or a pipe
    if len(content) > MOST:
        raise DictionaryError(file, None, f"larger than {MOST >> 20} MB, which is the most that is read")
    return content
