"""Faults that are made from a table: a message, what becomes of it, and the step that finds it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from eurobot_od.device.faults.fault import Caught, Fault, Wrong, words
from eurobot_od.device.faults.hooks import FrameChange, arriving, leaving, lost
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.pdo.message import Message
from eurobot_od.robot.protocol import EurobotProtocol

DRIVES_ON = Wrong("drives on after {}", lambda message: arriving(message, lost))


def replaced_by(other: Message) -> Wrong:
    """Return what is wrong with a message that another node's is sent for."""
    return Wrong(f"sends {words(type(other))} for {{}}", lambda message: leaving(message, foreign(other)))


def foreign(message: Message) -> FrameChange:
    """Send a message of another node in a frame's place."""
    # The node's own EDS lacks that message, so all files of the folder are read, once.
    load = cache(EurobotProtocol.load)

    def changed(node: Node, _frame: Frame) -> Iterable[Frame]:
        return [load(node.device.dictionary.file.parent).encode(message)]

    return changed


def message_faults(suite: str, *rows: tuple[str, Wrong, type[Message], str]) -> dict[str, Fault]:
    """Make faults that steps of one suite find; a row has the fault's name, what is wrong, with what, and the step."""
    return {
        name: Caught(suite, step).fault(wrong.text.format(words(message)), wrong.mixin(message))
        for name, wrong, message, step in rows
    }
