"""Files that are read whole, up to a limit, and written completely or not at all.

A crash at any moment leaves the old file or the new one. Any number of programs may write one file at once; the last
one wins. Each writes a file with a name of its own, which takes the old one's place in one step. New files beside the
file that are not young any more were left there by a crash.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import BinaryIO

from eurobot_od.errors import FileError, meant
from eurobot_od.support.texts import described

MOST = 16 << 20
"""Bytes of the largest EDS, DCF or YAML file that is read; those of real devices have some hundred thousand."""

LONGEST_WAIT, WAIT = 0.5, 0.01
"""How long another program may hold the file, and the pause before looking again, in seconds."""

ALIKE = 0.88
"""How much of two files' names has to be the same: more than in other names, which have no suffix in common."""

ABANDONED = 60.0
"""Seconds after which a new file that has not taken an old one's place counts as left by a crash."""

NAME_BYTES = 4
"""Random bytes, in hexadecimal digits, that make the name of a new file unique."""


def opened(file: str | Path, buffering: int = -1) -> BinaryIO:
    """Open a file to be read; raises FileError."""
    try:
        return open(file, "rb", buffering)  # noqa: PTH123  # a name may hold what no path can; the caller closes
    except (OSError, ValueError) as error:
        raise FileError(file, (getattr(error, "strerror", None) or str(error)) + _meant(file, error)) from error


def _meant(file: str | Path, error: Exception) -> str:
    """Return a question for the files beside one that is not there; `` if none has a name like it."""
    folder, name = os.path.split(file)
    try:
        return meant(name, os.listdir(folder or "."), ALIKE) if isinstance(error, FileNotFoundError) else ""  # noqa: PTH208
    except OSError:  # nor is the folder
        return ""


def read_whole(file: str | Path) -> bytes:
    """Return what a file holds; raises FileError if it cannot be read, or holds more than `MOST` bytes."""
    with opened(file) as stream:
        try:
            # One more than may be. A size asked beforehand is 0 for /dev/zero or a pipe.
            content = stream.read(MOST + 1)
        except OSError as error:
            raise FileError(file, error.strerror or str(error)) from error
    if len(content) > MOST:
        raise FileError(file, f"larger than {MOST >> 20} MB, which is the most that is read")
    return content


UNREADABLE = (ValueError, LookupError, ArithmeticError, MemoryError, RecursionError)
"""What readers raise, ours and those of libraries, for a file that they cannot read or that is too much for them."""


def why_unreadable(error: BaseException) -> str:
    """Say in one line what one of UNREADABLE means for the file that was being read."""
    if isinstance(error, MemoryError):
        return "the file needs more memory than there is"
    return "the file is nested too deeply" if isinstance(error, RecursionError) else f"unreadable: {described(error)}"


def write_whole(file: Path, content: bytes) -> None:
    """Put a file in place of another in one step, safe on the disk.

    Raises OSError with the file's name, and leaves the other then. A link stays one, to the new file, which has the
    other's mode. A pipe or a device is only written to: nothing can take its place.
    """
    try:
        _put(file, content)
    except OSError as error:  # its own names the file beside, or none
        raise OSError(error.errno, error.strerror, str(file)) from error


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Have an OSError that names no file, as from a library or a write to a full disk, name this one."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        # a library's words say less than the system's, or the same once more
        raise OSError(error.errno, os.strerror(error.errno) if error.errno else str(error), str(file)) from error


def _put(file: Path, content: bytes) -> None:
    if file.exists() and not file.is_file():  # `-o /dev/stdout`
        file.write_bytes(content)
        return
    # A link stays one. The new file lies beside the real one: only within one file system it can take its place.
    file = Path(os.path.realpath(file))
    beside = file.with_name(f"{file.name}.{os.urandom(NAME_BYTES).hex()}.new")
    with _folder(file):
        try:
            with beside.open("xb") as new:
                with suppress(FileNotFoundError):
                    beside.chmod(stat.S_IMODE(file.stat().st_mode))
                new.write(content)
                new.flush()
                # Before the replacing: after a power cut there must not be the new name with nothing in it.
                os.fsync(new.fileno())
            _replace(file, beside)
        except BaseException:  # Ctrl-C, too, must leave nothing behind
            with suppress(KeyboardInterrupt):  # nor must a second one while this runs
                beside.unlink(missing_ok=True)
            beside.unlink(missing_ok=True)
            raise


def _replace(file: Path, beside: Path) -> None:
    """Put a new file in the old one's place; on Windows it waits until nobody reads the old one."""
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
    """Clear a file's folder of what a crash has left, and bring what happens there to the disk; on POSIX only."""
    if os.name != "posix":
        yield
        return
    for left in file.parent.glob(f"{escape(file.name)}.{'[0-9a-f]' * 2 * NAME_BYTES}.new"):
        with suppress(FileNotFoundError):
            if time.time() - left.stat().st_mtime > ABANDONED:  # not a young one: a program may just be writing it
                left.unlink()
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        yield
        os.fsync(folder)  # the name is the folder's content, not the file's
    finally:
        os.close(folder)


def check_writable(path: Path) -> None:
    """Raise the OSError that `write_whole` would, as far as it can be known without writing anything."""
    wrong = {
        errno.ENOENT: not path.parent.is_dir(),
        errno.EISDIR: path.is_dir(),
        errno.EACCES: (path.is_file() or not path.exists()) and not os.access(path.parent, os.W_OK),
    }
    for number, applies in wrong.items():
        if applies:
            raise OSError(number, os.strerror(number), str(path))


def digest_of(files: Iterable[Path | None]) -> str:
    """Return a hash of the content of files, in their order; a file that is not there counts as such."""
    digest = hashlib.blake2b(digest_size=8)
    for file in files:
        digest.update(file.read_bytes() if file and file.is_file() else b"-")  # not nothing: its place counts
    return digest.hexdigest()
