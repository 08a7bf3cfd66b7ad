"""Decodes a log of any format with python-can and cantools, and prints it as `cantools decode -s` does candump logs.

It is what a user of the two libraries would write: `peer_decode.py LOG DBC`.
"""

from __future__ import annotations

import sys
from typing import Any

import can
import cantools
from cantools.subparsers.__utils__ import format_message


def main() -> None:
    """Print a line for each frame."""
    log, dbc = sys.argv[1:]
    database: Any = cantools.database.load_file(dbc)
    with can.LogReader(log) as reader:
        for frame in reader:
            data = bytes(frame.data)
            head = f"({frame.timestamp:f}) {frame.channel} {frame.arbitration_id:03X}#{data.hex().upper()} ::"
            print(f"{head}{meaning(database, frame.arbitration_id, data)}")


def meaning(database: Any, identifier: int, data: bytes) -> str:
    """Return cantools' text of a frame."""
    try:
        message = database.get_message_by_frame_id(identifier)
    except KeyError:
        return f" Unknown frame id {identifier} (0x{identifier:x})"
    return format_message(message, database.decode_message(identifier, data), True)


if __name__ == "__main__":
    main()
