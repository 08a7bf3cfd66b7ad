"""The result type that the parts of a device share."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message


class Reaction(NamedTuple):
    """Result of a frame, or of the time, for a device.

    `frames` to send, the `message` for the application, whether it was `reset`, the node-IDs whose heartbeats were
    `lost`, an SDO `answer` to the device as a client, the node-ID of a watched node that has `booted`, and the
    `synchronous` messages, which have waited for SYNC.
    """

    frames: list[Frame]
    message: Message | None = None
    reset: bool = False
    lost: tuple[int, ...] = ()
    answer: Frame | None = None
    booted: int | None = None
    synchronous: tuple[Message, ...] = ()


FrameHandler = Callable[[Frame, float], Reaction]
"""Handler of frames with one COB-ID; called with the frame and the time in s."""
