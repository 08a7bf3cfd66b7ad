"""Faults that are made from a table: a message, what becomes of it, and the step that finds it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from eurobot_od import durations
from eurobot_od.device.node import Node
from eurobot_od.faults.fault import Caught, Fault
from eurobot_od.faults.hooks import FrameChange, Mixin, arriving, data, late, leaving, lost, moved, twice
from eurobot_od.frame import Frame
from eurobot_od.pdo.message import Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.protocol import EurobotProtocol


class Wrong(NamedTuple):
    """What may be wrong with any message: how the fault's sentence goes, `{}` for the message, and what makes it."""

    text: str
    mixin: Callable[[type[Message]], Mixin]


NOT_SENT = Wrong("sends no {}", lambda message: leaving(message, lost))
NOT_ANSWERED = Wrong("answers no {}", lambda message: arriving(message, lost))
DRIVES_ON = Wrong("drives on after {}", lambda message: arriving(message, lost))
TWICE = Wrong("sends {} two times", lambda message: leaving(message, twice))
MOVED = Wrong("sends {} one identifier too high", lambda message: leaving(message, moved(1)))
REVERSED = Wrong("sends the bytes of {} the wrong way round", lambda message: leaving(message, data(_reversed)))
READ_REVERSED = Wrong("reads the bytes of {} the wrong way round", lambda message: arriving(message, data(_reversed)))


def sent_late(seconds: float) -> Wrong:
    """Return what is wrong with a message that is held back for some seconds."""
    return Wrong(f"sends {{}} {durations.text(seconds)} late", lambda message: late(message, seconds))


def replaced_by(other: Message) -> Wrong:
    """Return what is wrong with a message that another node's is sent for."""
    return Wrong(f"sends {_words(type(other))} for {{}}", lambda message: leaving(message, foreign(other)))


def foreign(message: Message) -> FrameChange:
    """Send a message of another node in a frame's place."""

    def changed(node: Node, _frame: Frame) -> Iterable[Frame]:
        return [_whole_protocol(node.device.dictionary.file.parent).encode(message)]

    return changed


@cache
def _whole_protocol(folder: Path) -> Protocol:
    return EurobotProtocol.load(folder)


def message_faults(suite: str, *rows: tuple[str, Wrong, type[Message], str]) -> dict[str, Fault]:
    """Make faults that steps of one suite find; a row has the fault's name, what is wrong, with what, and the step."""
    return {
        name: Caught(suite, step).fault(wrong.text.format(_words(message)), wrong.mixin(message))
        for name, wrong, message, step in rows
    }


def _reversed(content: bytes) -> bytes:
    return content[::-1]


def _words(message: type[Message]) -> str:
    """Write a message's name as the document does: `Goto XY`, `Enemy 1 Position Request`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z0-9])|(?<=[0-9])(?=[A-Z])", " ", message.__name__)
