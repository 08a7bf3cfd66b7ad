"""Decodes a candump log by a loop over cantools' API, as a user would write it: `peer_loop.py LOG DBC`."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import cantools

LINE = re.compile(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]+)#([0-9A-F]*)")


def main() -> None:
    """Print a line for each frame."""
    database: Any = cantools.database.load_file(sys.argv[2])
    messages = {each.frame_id: each for each in database.messages}
    write = sys.stdout.write
    with Path(sys.argv[1]).open() as log:
        for line in log:
            found = LINE.match(line)
            if found is None:
                continue
            time, channel, identifier, data = found.groups()
            message = messages.get(int(identifier, 16))
            if message is None:
                write(f"{time} {channel} {identifier} {data}\n")
            else:
                values = message.decode(bytes.fromhex(data))
                write(
                    f"{time} {channel} {message.name} {', '.join(f'{key}={value}' for key, value in values.items())}\n"
                )


main()
