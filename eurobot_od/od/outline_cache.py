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
from enum import IntEnum
from functools import cache, partial
from importlib.machinery import PathFinder
from pathlib import Path

from eurobot_od.errors import DictionaryError
from eurobot_od.od import dictionary, outline
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline, Plain, plain_objects, plain_outline

VARIABLE = "EUROBOT_OD_CACHE"
"""Environment variable that names the folder; empty: nothing is kept."""

HOME = os.path.expanduser("~/.cache")  # noqa: PTH111  # pathlib's raises where there is no home; this one is relative then
PRIVATE = 0o700


def load(file: str | Path) -> Outline:
    """Return the outline of an EDS or DCF with its own node-ID; raises DictionaryError, MappingError."""
    path = Path(file)
    plain = _kept(path, Part.OUTLINE)
    if plain is not None:
        with suppress(LookupError, TypeError, ValueError):  # as good as no entry
            return Outline(path, plain, partial(_objects, path))
    return _made(path)


def folder() -> Path | None:
    """Return the folder of the entries, None if nothing is to be kept."""
    named = os.environ.get(VARIABLE)
    if named is not None:
        return Path(named) if named else None
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or HOME)
    return home / "eurobot-od" if home.is_absolute() else None


class Part(IntEnum):
    """The lines of an entry before the file that it was made from."""

    READ_BY = 0
    OUTLINE = 1
    OBJECTS = 2


def _entry(path: Path) -> Path | None:
    """Return the one place for what is kept of a file, wherever it lies."""
    home = folder()
    return home and home / f"{path.stem}-{crc32(os.fsencode(path.absolute())):08x}"


def _kept(path: Path, part: Part) -> Plain | None:
    """Return a part of what is kept of a file as it is now, None without it."""
    entry = _entry(path)
    try:
        *parts, made_from = entry.read_bytes().split(b"\n", len(Part)) if entry else (b"",)
        if made_from != _content(path) or json.loads(parts[Part.READ_BY]) != _read_by():
            return None
        plain: Plain = json.loads(parts[part])
        return plain
    except (OSError, ValueError, LookupError):
        return None


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DictionaryError(path, None, error.strerror or str(error)) from error


def _objects(path: Path) -> Plain:
    """Return the descriptions of the objects, from the file itself if nothing is kept of it any more."""
    plain = _kept(path, Part.OBJECTS)
    return plain_objects(Dictionary.load(path)) if plain is None else plain


def _made(path: Path) -> Outline:
    """Have a file read, and keep what was read, unless the file has changed meanwhile."""
    entry, content = _entry(path), _content(path)
    loaded = Dictionary.load(path)
    plain = plain_outline(loaded)
    made = Outline(path, plain, lambda: plain_objects(loaded))
    made.dictionary = loaded
    if entry and _content(path) == content:
        parts = _read_by(), plain, plain_objects(loaded)
        with suppress(OSError):
            _write(entry, b"\n".join([*(json.dumps(part).encode() for part in parts), content]))
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
