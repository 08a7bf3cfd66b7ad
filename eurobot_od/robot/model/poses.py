"""Drawings of the robot's messages: the pose in a position response, and the one that a goto asks for.

The drawing is Foxglove's PoseInFrame: metres, and the angle as a quaternion around the upright axis. Its frame is the
playing field with its origin at the lower left.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Any

from eurobot_od.export.mcap import Drawing
from eurobot_od.pdo.catalogue import Message
from eurobot_od.pdo.kinds import OutOfRange
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.model.messages import SOURCES, GotoXY

FRAME = "field"
MILLIMETRES = 1000

NUMBER = {"type": "number"}
TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}


def _numbers(*names: str) -> dict[str, Any]:
    return {"type": "object", "properties": dict.fromkeys(names, NUMBER)}


PROPERTIES: Mapping[str, Any] = {
    "timestamp": TIME,
    "frame_id": {"type": "string"},
    "pose": {
        "type": "object",
        "properties": {"position": _numbers("x", "y", "z"), "orientation": _numbers("x", "y", "z", "w")},
    },
}


def pose(message: Message, time: dict[str, int]) -> dict[str, Any] | None:
    """Return the pose in a message; None if it has no place. An unknown heading is drawn as 0."""
    x, y, angle = (getattr(message, name) for name in ("x", "y", "angle"))
    if x is None or y is None or OutOfRange in map(type, (x, y, angle)):
        return None
    # A quaternion holds half the angle: (0, 0, sin a/2, cos a/2) turns by a around the upright axis.
    half = radians(angle or 0) / 2
    position = {"x": x / MILLIMETRES, "y": y / MILLIMETRES, "z": 0.0}
    orientation = {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)}
    return {"timestamp": time, "frame_id": FRAME, "pose": {"position": position, "orientation": orientation}}


POSE = Drawing("foxglove.PoseInFrame", PROPERTIES, pose)


def drawings(protocol: Protocol) -> dict[str, Drawing]:
    """Return the drawing for each message with a pose, by the names of the loaded files."""
    return {each.name: POSE for each in protocol.bindings if each.type in (GotoXY, *SOURCES)}
