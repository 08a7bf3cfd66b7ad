"""Files that are read whole, up to a limit, and replaced in one step.

After a crash at any moment, the file is the old one or the new one. Several programs may write the same file; the last
one wins. Each writes a temporary file `NAME.xxxxxxxx.new` beside it first; older temporary files are left from crashes.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import BinaryIO

from eurobot_od.errors import FileError, LocalError, meant
from eurobot_od.support.texts import described

MOST = 16 << 20
"""Largest EDS, DCF or YAML file that is read, in bytes; files of real devices have some hundred thousand."""

LONGEST_WAIT, WAIT = 0.5, 0.01
"""How long to wait while another program holds the file open (Windows), and the pause between two tries, in s."""

ALIKE = 0.88
"""Similarity from which a file's name is suggested; higher than for other names, because suffixes are alike."""

MOST_NAMED = 8
"""Maximum number of files of a folder that are named in place of one that does not exist."""

ABANDONED = 60.0
"""Age from which a temporary file counts as left by a crash, in s."""

NAME_BYTES = 4
"""Random bytes in the name of a temporary file."""


def check_new_folder(folder: Path) -> None:
    """Check that files may go into a folder, which is new or empty; raises LocalError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LocalError(f"{folder}: it is there, and not empty; name a new folder")


def opened(file: str | Path, buffering: int = -1) -> BinaryIO:
    """Open a file for reading; raises FileError."""
    try:
        return open(file, "rb", buffering)  # noqa: PTH123  # a name that no Path can hold; the caller closes
    except (OSError, ValueError) as error:
        raise FileError(file, (getattr(error, "strerror", None) or str(error)) + _meant(file, error)) from error


def _meant(file: str | Path, error: Exception) -> str:
    """Return a suggestion for a file that does not exist, from the names in its folder; empty if none is similar."""
    folder, name = os.path.split(file)
    if isinstance(error, IsADirectoryError):
        return f"; name its files, such as {os.path.join(str(file), '*')}"  # noqa: PTH118  # a name that no Path can hold
    if not isinstance(error, FileNotFoundError):
        return ""
    if "\\" in name and os.name != "nt":
        return "; this is not Windows: folders are separated by /"
    if "*" in name:
        return "; no file matches this pattern"
    if (number := re.match(r"(\d+):", name)) and os.path.exists(rest := name[number.end() :]):  # noqa: PTH110
        return f"; write {number[1]}={rest}"
    try:
        there = os.listdir(folder or ".")  # noqa: PTH208
    except OSError:  # the folder does not exist either
        return ""
    stem, suffix = os.path.splitext(name)  # noqa: PTH122
    like = [each for each in there if suffix and each.rpartition(".")[0] == stem]
    return meant(name, there, ALIKE) or (f"; did you mean {like[0]}?" if like else _of_a_kind(suffix, there))


def _of_a_kind(suffix: str, there: Iterable[str]) -> str:
    """Return the files with a suffix, if there are few."""
    found = sorted(each for each in there if suffix and each.lower().endswith(suffix.lower()))
    return f"; in this folder: {', '.join(found)}" if 0 < len(found) <= MOST_NAMED else ""


def read_whole(file: str | Path) -> bytes:
    """Return the content of a file; raises FileError if it cannot be read or has more than `MOST` bytes."""
    with opened(file) as stream:
        try:
            # One byte more than allowed. The file's size would be 0 for /dev/zero or a pipe.
            content = stream.read(MOST + 1)
        except OSError as error:
            raise FileError(file, error.strerror or str(error)) from error
    if len(content) > MOST:
        raise FileError(file, f"larger than {MOST >> 20} MB, which is the most that is read")
    return content


UNREADABLE = (ValueError, LookupError, ArithmeticError, MemoryError, RecursionError)
"""Exceptions of readers, ours and those of libraries, for a file that is malformed or too large."""


def why_unreadable(error: BaseException) -> str:
    """Return one line on why a file could not be read, for an exception of UNREADABLE."""
    if isinstance(error, MemoryError):
        return "the file needs more memory than there is"
    return "the file is nested too deeply" if isinstance(error, RecursionError) else f"unreadable: {described(error)}"


def write_whole(file: Path, content: bytes) -> None:
    """Replace a file in one step, synced to the disk.

    Raises OSError with the file's name; the old file then stays. A symbolic link stays one, and the file keeps its
    mode. A pipe or a device cannot be replaced, and is written to.
    """
    try:
        _put(file, content)
    except OSError as error:  # its own text names the temporary file, or none
        raise _with_folder(error, file) from error


def _with_folder(error: OSError, file: Path) -> OSError:
    """Return an error in writing a file, with what to do if the file's folder is missing."""
    is_missing = error.errno == errno.ENOENT and not file.parent.is_dir()
    hint = f"; make its folder first: {file.parent}" if is_missing else ""
    return OSError(error.errno, f"{error.strerror}{hint}", str(file))


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Add the file's name to an OSError that has none, as from a library or a write to a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        # The system's text is clearer than a library's.
        raise OSError(error.errno, os.strerror(error.errno) if error.errno else str(error), str(file)) from error


def _put(file: Path, content: bytes) -> None:
    if file.exists() and not file.is_file():  # `-o /dev/stdout`
        file.write_bytes(content)
        return
    # The temporary file is beside the link's target: a file can be replaced only within one file system.
    file = Path(os.path.realpath(file))
    beside = file.with_name(f"{file.name}.{os.urandom(NAME_BYTES).hex()}.new")
    with _folder(file):
        try:
            with beside.open("xb") as new:
                with suppress(FileNotFoundError):
                    beside.chmod(stat.S_IMODE(file.stat().st_mode))
                new.write(content)
                new.flush()
                # Before it replaces the old file: otherwise a power cut may leave an empty file.
                os.fsync(new.fileno())
            _replace(file, beside)
        except BaseException:  # Ctrl-C included
            with suppress(KeyboardInterrupt):  # a second Ctrl-C
                beside.unlink(missing_ok=True)
            beside.unlink(missing_ok=True)
            raise


def _replace(file: Path, beside: Path) -> None:
    """Move the temporary file to its place; on Windows, wait until nobody reads the old file."""
    end = time.monotonic() + LONGEST_WAIT
    while True:
        try:
            beside.replace(file)
        except PermissionError:
            if os.name != "nt" or time.monotonic() > end:
                raise
            time.sleep(WAIT)
        else:
            return


@contextmanager
def _folder(file: Path) -> Iterator[None]:
    """On POSIX, delete temporary files that a crash has left in the file's folder, and sync the folder at the end."""
    if os.name != "posix":
        yield
        return
    for left in file.parent.glob(f"{escape(file.name)}.{'[0-9a-f]' * 2 * NAME_BYTES}.new"):
        with suppress(FileNotFoundError):
            if time.time() - left.stat().st_mtime > ABANDONED:  # another program may still be writing a younger one
                left.unlink()
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        yield
        os.fsync(folder)  # names belong to the folder, not to the file
    finally:
        os.close(folder)


def check_writable(path: Path) -> None:
    """Check that a file can be written, as far as possible without writing; raises OSError as `write_whole`."""
    wrong = {
        errno.ENOENT: not path.parent.is_dir(),
        errno.EISDIR: path.is_dir(),
        errno.EACCES: (path.is_file() or not path.exists()) and not os.access(path.parent, os.W_OK),
    }
    for number, applies in wrong.items():
        if applies:
            raise _with_folder(OSError(number, os.strerror(number)), path)


def digest_of(files: Iterable[Path | None]) -> str:
    """Return a hash of the files' content, in their order; a missing file also changes it."""
    digest = hashlib.blake2b(digest_size=8)
    for file in files:
        digest.update(file.read_bytes() if file and file.is_file() else b"-")  # a missing file keeps its position
    return digest.hexdigest()
