"""Records frames in a log file of python-can's; the suffix says the format.

Rule of this file: every frame that was given is in the file at the end, or there is an error.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from can.io.generic import MessageWriter

    from eurobot_od.frame import Frame


@contextmanager
def recording(file: Path | None) -> Iterator[Callable[[float, Frame], None]]:
    """Give a function that writes a frame and its time in seconds to a new file, or nowhere if that is None.

    Raises LocalError for a format that python-can cannot write, OSError for a file that cannot be written.
    """
    if file is None:
        yield lambda _time, _frame: None
        return
    import can

    writer, given = _open(file), 0

    def write(time: float, frame: Frame) -> None:
        nonlocal given
        given += 1
        message = can.Message(timestamp=time, arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        writer.on_message_received(message)

    try:
        yield write
    finally:
        writer.stop()
    if isinstance(writer, can.SqliteWriter) and writer.num_frames != given:
        raise OSError(f"{file}: {given - writer.num_frames} of {given} frames could not be written")


def _open(file: Path) -> MessageWriter:
    import can

    if file.suffix.lower() == ".db":
        file.write_bytes(b"")  # SqliteWriter would append to what is there, and fail in a thread where nobody hears it
    try:
        writer = can.Logger(file)
    except (ValueError, NotImplementedError) as error:
        raise LocalError(f"{file}: {error}") from error
    if isinstance(writer, can.SqliteWriter):
        # Its stop() writes one more batch and drops what comes after that: there is to be one batch only.
        writer.MAX_BUFFER_SIZE_BEFORE_WRITES = writer.MAX_TIME_BETWEEN_WRITES = sys.maxsize
    return writer
