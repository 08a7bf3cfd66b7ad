"""Outlines of EDS files, kept between runs, so that decoding and showing messages start without importing canopen.

Rule of this file: nothing kept is believed. An entry holds the file that it was made from and what read it; it counts
only if both are what is there now, to the byte. Whatever is wrong with an entry, or with the folder, the file is read
by canopen as if there were no entry. (`import canopen` alone takes longer than to decode 50 000 lines of a log, and
twice the memory.)
"""

from __future__ import annotations

import json
import os
from binascii import crc32
from contextlib import suppress
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path

from eurobot_od import dictionary, outline
from eurobot_od.dictionary import Dictionary
from eurobot_od.errors import DictionaryError
from eurobot_od.outline import Outline

VARIABLE = "EUROBOT_OD_CACHE"
"""Environment variable that names the folder; empty: nothing is kept."""

HOME = os.path.expanduser("~/.cache")  # noqa: PTH111  # pathlib's raises where there is no home; this one is relative then
PRIVATE = 0o700


def load(file: str | Path) -> Outline:
    """Return the outline of an EDS or DCF with its own node-ID; raises DictionaryError, MappingError."""
    path = Path(file)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise DictionaryError(path, None, error.strerror or str(error)) from error
    entry = _entry(path)
    known = _read(entry, path, content) if entry else None
    return known or _made(entry, path, content)


def folder() -> Path | None:
    """Return the folder of the entries, None if nothing is to be kept."""
    named = os.environ.get(VARIABLE)
    if named is not None:
        return Path(named) if named else None
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or HOME)
    return home / "eurobot-od" if home.is_absolute() else None


def _entry(path: Path) -> Path | None:
    """Return the one place for what is kept of a file, wherever it lies."""
    home = folder()
    return home and home / f"{path.stem}-{crc32(os.fsencode(path.absolute())):08x}"


def _read(entry: Path, path: Path, content: bytes) -> Outline | None:
    try:
        kept, _, made_from = entry.read_bytes().partition(b"\n")
        if made_from != content:
            return None
        plain = json.loads(kept)
        return Outline(path, plain) if plain["read_by"] == _read_by() else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def _made(entry: Path | None, path: Path, content: bytes) -> Outline:
    made = Outline.of(Dictionary.load(path))
    if entry and path.read_bytes() == content:
        with suppress(OSError):
            _write(entry, json.dumps(made.plain | {"read_by": _read_by()}).encode() + b"\n" + content)
    return made


def _write(entry: Path, content: bytes) -> None:
    """Write an entry in one step: another process finds all of it or nothing."""
    entry.parent.mkdir(PRIVATE, parents=True, exist_ok=True)
    new = entry.with_suffix(f".{os.getpid()}")
    try:
        new.write_bytes(content)
        new.replace(entry)
    finally:
        new.unlink(missing_ok=True)


@cache
def _read_by() -> list[list[int]]:
    """Return size and time of the files that read an EDS: canopen's and ours."""
    found = PathFinder.find_spec("canopen")
    folders = (found and found.submodule_search_locations) or ()
    readers = [*(f"{each}/objectdictionary/eds.py" for each in folders), dictionary.__file__, outline.__file__]
    return [[status.st_size, status.st_mtime_ns] for status in map(os.stat, readers)]
