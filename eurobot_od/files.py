"""Files that are there whole or not at all: a crash at any moment leaves the old one or the new one."""

from __future__ import annotations

import os
from pathlib import Path


def write_whole(file: Path, content: bytes) -> None:
    """Put a file in place of another in one step, safe on the disk; raises OSError, and leaves the other then."""
    beside = file.with_name(f"{file.name}.new")
    with beside.open("wb") as new:
        new.write(content)
        new.flush()
        os.fsync(new.fileno())
    beside.replace(file)
    if os.name == "posix":  # the new name is in the folder, which elsewhere cannot be brought to the disk
        folder = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
