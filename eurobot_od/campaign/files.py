"""What tells the files that a campaign reads from all others: with other ones its results are others, too."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def digest_of(files: Iterable[Path | None]) -> str:
    """Return a hash of what is in some files, in their order; one that is not there counts as that."""
    digest = hashlib.blake2b(digest_size=8)
    for file in files:
        digest.update(file.read_bytes() if file and file.is_file() else b"-")
    return digest.hexdigest()
