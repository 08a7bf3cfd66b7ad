"""Requests with files: a browser sends them in parts, and a device file of them is added to the library."""

from __future__ import annotations

import re
from base64 import b64decode
from binascii import Error as NotBase64
from pathlib import Path
from typing import Protocol

from eurobot_od.errors import LocalError, look_up
from eurobot_od.library.adding import checked
from eurobot_od.library.library import Library
from eurobot_od.support.files import write_whole
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of, whole_of


class FileDesk(Protocol):
    """The part of a desk that stores files."""

    uploads: dict[object, dict[str, bytearray]]
    folder: Path

    @property
    def library(self) -> Library:
        """The user's device files."""


LARGEST = 32 << 20
"""Largest size of all files of one browser, in bytes."""

NAME = re.compile(r"\w[\w .()+-]{0,100}")
"""Names of files: no path leads out of a folder."""


def upload(desk: FileDesk, said: Arguments) -> int:
    """Store a part of a file, which begins `at` a place; return the stored length."""
    name = text_of(said, "name")
    at = whole_of(said, "at")
    if not NAME.fullmatch(name):
        raise LocalError(f"{name[:60]!r}: a file has letters, digits, blanks and . - + ( ) in its name")
    files = desk.uploads[said["who"]]
    if at == 0:
        files[name] = bytearray()
    content = files.get(name, bytearray())
    if at != len(content):
        raise LocalError(f"{name}: the part at {at} does not follow the {len(content)} bytes that are there")
    try:
        content += b64decode(text_of(said, "data"), validate=True)
    except NotBase64:
        raise LocalError(f"{name}: the part at {at} is not base64") from None
    if sum(map(len, files.values())) > LARGEST:
        files.clear()
        raise LocalError(f"files of more than {LARGEST} bytes")
    return len(content)


def sent_file(desk: FileDesk, said: Arguments) -> tuple[str, bytes]:
    """Return the name and the content of the file that a request names; raises UnknownName."""
    name = text_of(said, "file")
    return name, bytes(look_up("file", name, desk.uploads[said["who"]]))


def add_to_library(desk: FileDesk, said: Arguments) -> list[str]:
    """Add a device file to the library, as `devices add` does; return what it prints."""
    name, content = sent_file(desk, said)
    library = desk.library
    if not library.folders:
        raise LocalError("there is no library: start the server with --library FOLDER")
    path = Path(desk.folder, name)
    write_whole(path, content)
    try:
        added = checked(path, library.folders[0], fix=False, replace=False)
        added.put()
    finally:
        path.unlink()
    library.look_again()
    return list(added.lines(library))


REQUESTS = {
    "file": PageRequest(upload, Way.AT_ONCE, acts=True),
    "add to library": PageRequest(add_to_library, Way.SENDS, acts=True),
}
