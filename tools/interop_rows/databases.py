"""Compares what other programs read in the DBC files that we export.

Both dialects and all messages are read, by random frames; raw values are compared, since rounding could hide a bit.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import canmatrix.formats
import cantools

from eurobot_od.export.dbc import dbc_text
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol
from interop_rows.row import Answer, agree

FRAMES = 500
"""Random frames for each message."""


def by_cantools(_: Path) -> Answer:
    """Decode and encode random frames with cantools."""
    for dialect in dialects.names():
        protocol = EurobotProtocol.load(dialect)
        database: Any = cantools.database.load_string(dbc_text(protocol), "dbc", strict=True)
        agree("the identifiers", {each.frame_id for each in database.messages}, {b.cob_id for b in protocol.bindings})
        for binding, data in _random_frames(protocol):
            message = database.get_message_by_frame_id(binding.cob_id)
            values = message.decode(data, decode_choices=False)
            agree(f"values of {binding.name} {data.hex()}", values, binding.unpack(data))
            agree(f"bytes of {binding.name}", message.encode(values, strict=False), binding.pack(values))
    return Answer(f"both dialects, all messages: {FRAMES} random frames of each decoded and encoded as by us")


def by_canmatrix(_: Path) -> Answer:
    """Decode random frames with canmatrix."""
    for dialect in dialects.names():
        protocol = EurobotProtocol.load(dialect)
        loaded: Any = canmatrix.formats.loads(dbc_text(protocol), "dbc")
        (matrix,) = loaded.values()
        agree("complaints while reading", matrix.load_errors, [])
        frames = {each.arbitration_id.id: each for each in matrix.frames}
        agree("the identifiers", set(frames), {each.cob_id for each in protocol.bindings})
        for binding, data in _random_frames(protocol):
            values = {name: each.raw_value for name, each in frames[binding.cob_id].decode(data).items()}
            agree(f"values of {binding.name} {data.hex()}", values, binding.unpack(data))
    return Answer(f"both dialects, all messages: {FRAMES} random frames of each decoded as by us")


def _random_frames(protocol: Protocol) -> Iterator[tuple[Binding, bytes]]:
    for binding in protocol.bindings:
        chance = random.Random(binding.name)
        if not binding.layout.fields:
            continue
        for _ in range(FRAMES):
            yield binding, chance.randbytes(binding.layout.length)
