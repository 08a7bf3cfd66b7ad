"""Decodes a candump log by a loop over bitstruct's formats, one compiled for each message: `peer_bits.py LOG DBC`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import bitstruct.c as bitstruct  # type: ignore[import-untyped]
import cantools


def compiled(message: Any) -> Any:
    """Return the format of a message's bytes in reverse order: its last signal comes first."""
    parts = list[str]()
    names = list[str]()
    end = 8 * message.length
    for signal in sorted(message.signals, key=lambda each: -each.start):
        above = end - signal.start - signal.length
        parts += [f"p{above}"] * bool(above) + [f"{'s' if signal.is_signed else 'u'}{signal.length}"]
        names.append(signal.name)
        end = signal.start
    return bitstruct.compile("".join(parts), names)


def main() -> None:
    """Print a line for each frame."""
    database: Any = cantools.database.load_file(sys.argv[2])
    known = {f"{each.frame_id:03X}": (each.name, compiled(each).unpack) for each in database.messages}
    write = sys.stdout.write
    from_hex = bytes.fromhex
    with Path(sys.argv[1]).open() as log:
        for line in log:
            time, channel, frame = line.split()
            identifier, _, data = frame.partition("#")
            if identifier in known:
                name, unpack = known[identifier]
                values = unpack(from_hex(data)[::-1]) if data else {}
                data = f"{name} {', '.join([f'{key}={value}' for key, value in values.items()])}"
            write(f"{time[1:-1]} {channel} {identifier} {data}\n")


main()
