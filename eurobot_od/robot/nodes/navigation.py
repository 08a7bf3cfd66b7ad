"""The navigation node: tells where our robot, the enemies and the confederate are, when it is asked.

Rule of this file: a robot that the beacons do not see is unknown, never where they last saw it: it moves on unseen.
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
"""x = y = 255 mm with an unknown angle would mean "position unknown" (document Table 2); it is sent 1 mm off.
"""


class Fix(NamedTuple):
    """A measured place in mm and a heading in degrees, None if it cannot be measured."""

    x: float
    y: float
    angle: float | None = None


class Beacons(Protocol):
    """The navigation's sensors, real or simulated."""

    def locate(self, whom: Source, now: float) -> Fix | None:
        """Measure where our robot (INTERNAL) or another one is; None if it is not seen."""


POSITIONS = [each for each in messages.POSITIONS if each.response is not messages.KalmanPositionResponse]
"""All positions but the filtered one, which is the drive's."""


def _tell(position: messages.Position, node: Navigation, *_: Message) -> Message:
    return node.position(position)


class Navigation(FollowingNode):
    """The navigation node (document 2.2, 2.3 and 4.2.2 Navigation); `beacons` are its sensors, None if it has none.

    After an Emergency Shutdown it goes on answering, as nothing in it moves.
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
        self._measured, self._fixes = -math.inf, dict[Source, Fix | None]()

    def deviations(self) -> tuple[float, float]:
        """Return the standard deviations of simulated beacons: mm and degrees."""
        return self.position_noise, self.angle_noise

    def position(self, asked: messages.Position) -> messages.PositionResponse:
        """Return where a robot is, or that it is unknown, within the limits that an object has for a place."""
        record, _, response, whom = asked
        # Before the start configuration, any robot may be there.
        expected = self.configuration is None or self.configuration.includes(whom)
        # One measurement at a time, as each has its own noise: an SDO, a PDO and an answer at one moment must agree.
        if self._measured != self.now:
            self._measured, self._fixes = self.now, {}
        if expected and whom not in self._fixes:
            self._fixes[whom] = self.beacons.locate(whom, self.now) if self.beacons else None
        fix = self._fixes[whom] if expected else None
        across, along = self.coordinates(record)
        # A place outside the field is a wrong measurement, which Table 2 cannot express.
        if fix is None or not (across.low <= fix.x <= across.high and along.low <= fix.y <= along.high):
            return response(None, None, None, whom)
        x, y = round(fix.x), round(fix.y)
        if fix.angle is None:
            return response(x + (x == y == AMBIGUOUS), y, None, whom)
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
