"""Reads a device's file whatever its form: EDS and DCF (CiA 306), or XDD and XDC, their like in XML (CiA 311)."""

from __future__ import annotations

from codecs import BOM_UTF8
from pathlib import Path

from eurobot_od.errors import DictionaryError
from eurobot_od.od import document
from eurobot_od.od.document import WIDE_MARKS, Document

SUFFIXES = (".xdd", ".eds", ".xdc", ".dcf")
"""Files of devices in a folder; of two with one name the later counts: a DCF is the EDS as it is configured."""


def files_in(folder: str | Path) -> list[Path]:
    """Return a folder's device files, in the order of SUFFIXES and by name; raises DictionaryError if it has none."""
    files = [each for suffix in SUFFIXES for each in sorted(Path(folder).iterdir()) if each.suffix.lower() == suffix]
    if not files:
        raise DictionaryError(folder, None, "no EDS, DCF, XDD or XDC in this folder")
    return files


def read(data: bytes) -> Document:
    """Read the bytes of a file; nothing raises, what is odd is in the document."""
    if not is_xml(data):
        return document.read(data)
    from eurobot_od.od import xdd  # most files are none

    return xdd.read(data)


def is_xml(data: bytes) -> bool:
    """Whether a file begins as one in XML: no EDS begins so."""
    is_wide = data.startswith(WIDE_MARKS)
    start = data[:200].decode("utf-16", "replace") if is_wide else data[:200].removeprefix(BOM_UTF8).decode("latin-1")
    return start.lstrip().startswith("<")
