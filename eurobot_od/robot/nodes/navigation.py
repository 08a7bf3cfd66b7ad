"""The navigation node: it answers requests for the positions of our robot, the enemies and the confederate.

A robot that the beacons do not see is unknown; its last position is not repeated, as it may have moved.
"""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar, NamedTuple, Protocol

from eurobot_od.device.bound import BoundObject, setting
from eurobot_od.device.objects import Store
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.node import FollowingNode, Handlers, Objects

AMBIGUOUS = 255
"""x = y = 255 mm with an unknown angle would mean "position unknown" (document Table 2), so 256 mm is sent."""


class Fix(NamedTuple):
    """A measured place in mm and a heading in degrees, None if it cannot be measured."""

    x: float
    y: float
    angle: float | None = None


class Beacons(Protocol):
    """The navigation's sensors, real or simulated."""

    def locate(self, whom: Source, now: float) -> Fix | None:
        """Return the measured place of our robot (INTERNAL) or another one; None if it is not seen."""


POSITIONS = [each for each in messages.POSITIONS if each.response is not messages.KalmanPositionResponse]
"""All positions but the filtered one, which the drive sends."""


def _tell(position: messages.Position, node: Navigation, *_: Message) -> Message:
    return node.position(position)


class Navigation(FollowingNode):
    """The navigation node (document 2.2, 2.3 and 4.2.2 Navigation).

    After an Emergency Shutdown it still answers, as nothing in it moves.

    Args:
        dictionary: the navigation's EDS
        beacons: its sensors, None if it has none
        store: keeps the settings over a restart
        facts: the robot and its match; default: the file beside the EDS
    """

    position_noise = setting("Noise.Position deviation")
    angle_noise = setting("Noise.Angle deviation")

    def __init__(
        self,
        dictionary: Dictionary,
        beacons: Beacons | None = None,
        *,
        store: Store | None = None,
        facts: Facts | None = None,
    ) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self.beacons = beacons
        self._measured = -math.inf
        self._fixes = dict[Source, Fix | None]()

    def deviations(self) -> tuple[float, float]:
        """Return the standard deviations of simulated beacons, in mm and degrees."""
        return self.position_noise, self.angle_noise

    def position(self, asked: messages.Position) -> messages.PositionResponse:
        """Return the position of a robot, or that it is unknown; it is within the limits of its objects."""
        record, _, response, whom = asked
        # Before the start configuration, all robots may be there.
        expected = self.configuration is None or self.configuration.includes(whom)
        # One measurement per moment, as each has its own noise, and SDO, PDO and answer must be equal.
        if self._measured != self.now:
            self._measured = self.now
            self._fixes = {}
        if expected and whom not in self._fixes:
            self._fixes[whom] = self.beacons.locate(whom, self.now) if self.beacons else None
        fix = self._fixes[whom] if expected else None
        across, along = self.coordinates(record)
        # A place outside the field is a wrong measurement, and Table 2 has no code for it.
        if fix is None or not (across.low <= fix.x <= across.high and along.low <= fix.y <= along.high):
            return response(None, None, None, whom)
        x, y = round(fix.x), round(fix.y)
        if fix.angle is None:
            return response(x + 1 if x == y == AMBIGUOUS else x, y, None, whom)
        return response(x, y, round(fix.angle) % 360, whom)

    OBJECTS: ClassVar[Objects] = {
        **{each.record: BoundObject(read=partial(_tell, each)) for each in POSITIONS},
        "Start configuration": BoundObject(write=messages.StartConfigurationSet),
    }
    HANDLERS: ClassVar[Handlers] = {
        messages.CheckNaviRequest: lambda *_: messages.CheckNaviResponse(),
        **FollowingNode.COMMANDS,
        **{type(each.request): partial(_tell, each) for each in POSITIONS},
    }
