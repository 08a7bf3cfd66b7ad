"""Stops that are seen to work: repeated until the drive's state and two of its positions agree that the robot stands.

A stop is one frame, and a frame can be lost. So the core believes that the robot stands when it has seen it, and not
when it has said so.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from eurobot_od.device.flow import START, Ask, Pause, Script
from eurobot_od.errors import NoAnswer, RemoteError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import is_near
from eurobot_od.robot.model.values import GotoFault
from eurobot_od.robot.nodes.node import CoreSettings


class Standstill(NamedTuple):
    """Where the robot was seen to stand, and how many seconds after the stop."""

    position: messages.KalmanPositionResponse
    seconds: float


class NotStanding(RemoteError):
    """A robot that was not seen to stand, whatever was sent; `seconds` is how long the core has tried."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        text = "the robot was told to stop and was not seen to stand"
        super().__init__(f"{text} within {seconds:.1f} s; Emergency Shutdown is being sent")


def is_driving(state: messages.GotoStateResponse) -> bool:
    """Tell whether the drive carries out a goto, by its answer to a state request."""
    return isinstance(state.time, int) and not isinstance(state.time, GotoFault) and state.time > 0


def until_standing(
    core: CoreSettings, stop: Callable[[], messages.StopMessage], patience: float = inf
) -> Script[Standstill | None]:
    """Send the latest stop again and again until the robot is seen to stand; None if not within `patience` seconds."""
    began: float = yield START
    while True:
        position = yield from _standing_place(core)
        if position is not None:
            return Standstill(position, core.now - began)
        if core.now - began >= patience:
            return None
        # Should it be only this kind of stop that does not get through, another one may.
        for each in dict.fromkeys((stop(), messages.StopDrive())):
            core.offer(each)


def _standing_place(core: CoreSettings) -> Script[messages.KalmanPositionResponse | None]:
    """Look at the drive for two stop periods; return where it stands, None if it does not, or does not answer."""
    period = core.stop_period
    ask_position = Ask(messages.KalmanPositionRequest(), messages.KalmanPositionResponse, period, 1)
    yield Pause(period)
    try:
        state = yield Ask(messages.GotoStateRequest(), messages.GotoStateResponse, period, 1)
        # The place twice, a period apart: a drive still rolling to a stop says "no goto" as well.
        before = yield ask_position
        yield Pause(period)
        after = yield ask_position
    except NoAnswer:
        return None
    moved = not is_near(before[:3], after[:3], core.standstill_distance, core.standstill_turn)
    return None if moved or is_driving(state) else after
