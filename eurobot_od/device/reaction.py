"""What the parts of a device have in common: what a frame, or the time, did to the device."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message


class Reaction(NamedTuple):
    """What a frame, or the time, did to a device.

    The `frames` to send, the `message` for the application, whether it was `reset`, the node-IDs whose heartbeats were
    `lost`, an SDO `answer` to the device as a client, the node-ID of a watched node that has `booted`, and the
    `synchronous` messages, which had waited for SYNC.
    """

    frames: list[Frame]
    message: Message | None = None
    reset: bool = False
    lost: tuple[int, ...] = ()
    answer: Frame | None = None
    booted: int | None = None
    synchronous: tuple[Message, ...] = ()


Ear = Callable[[Frame, float], Reaction]
"""What a device does with the frames of one COB-ID, and the time at which they come, in s."""
