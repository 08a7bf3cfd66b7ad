"""The core's flows around a goto: how it ends, how a stop is seen to work, and where the drive is after a loss.

A goto ends when the drive says so and its position shows it (document 2.1). A stop is one frame, and a frame can be
lost, so the core believes that the robot stands when it has seen it, not when it has said so. A drive that has booted
says "unknown", and once it is configured its team's start place, wherever it stands. Driven from there it would be off
by as much as it had come since the start, so the navigation has to see it first.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from eurobot_od.device.flow import START, Ask, Pause, Script
from eurobot_od.errors import NoAnswer, RemoteError, StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place, is_near
from eurobot_od.robot.model.values import FAULT_OUTCOME, GotoFault, Outcome
from eurobot_od.robot.nodes.node import CoreSettings


class GotoReport(NamedTuple):
    """The result of a goto, and `why` if the outcome does not say it.

    Times are in seconds from its first transmission; `confirmed` is None if it was never confirmed.
    """

    goto: messages.GotoXY
    outcome: Outcome
    confirmed: float | None
    ended: float
    why: str = ""


class End(NamedTuple):
    """How a goto has ended, and why if the outcome does not say it."""

    outcome: Outcome
    why: str = ""


def until_ended(core: CoreSettings, goto: messages.GotoXY) -> Script[End]:
    """Ask for the state of a confirmed goto until it has ended; raises NoAnswer.

    It has arrived when the drive says so and is at the goto's place. Answers that there is no goto, or that another one
    has arrived, are tolerated a few times in a row: the drive may have heard a request before its goto.
    """
    yield Pause(core.first_state_request)
    odd: list[str] = []
    while len(odd) < core.lost_after:
        state = yield core.ask_drive(messages.GotoStateRequest(), messages.GotoStateResponse)
        if state.time in FAULT_OUTCOME:
            return End(FAULT_OUTCOME[state.time])
        if state.time == 0:
            # The 0 may belong to an earlier goto: the place has to agree.
            place = yield from drive_position(core)
            if is_near(goto[:3], place[:3], core.arrival_distance, core.arrival_angle):
                return End(Outcome.ARRIVED)
            odd.append(f"the drive has arrived at ({place.x}, {place.y}) {place.angle} deg")
        elif state.time is None:
            odd.append("the drive knows of no goto")
        else:
            # In a row: a single odd answer between good ones has come out of turn.
            odd.clear()
        yield Pause(core.state_request_period)
    return End(Outcome.LOST, odd[-1])


def drive_position(core: CoreSettings) -> Script[messages.KalmanPositionResponse]:
    """Ask the drive for the filtered position of our robot; raises NoAnswer."""
    answer: messages.KalmanPositionResponse = yield core.ask_drive(
        messages.KalmanPositionRequest(), messages.KalmanPositionResponse
    )
    return answer


# Stops that are seen to work


class Standstill(NamedTuple):
    """Where the robot was seen to stand, and how many seconds after the stop."""

    position: messages.KalmanPositionResponse
    seconds: float


class NotStanding(RemoteError):
    """The robot was not seen to stand, whatever was sent; `seconds` is for how long the core has tried."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        text = "the robot was told to stop and was not seen to stand"
        super().__init__(f"{text} within {seconds:.1f} s; Emergency Shutdown is being sent")


def is_driving(state: messages.GotoStateResponse) -> bool:
    """Tell from an answer to a state request whether the drive carries out a goto."""
    return isinstance(state.time, int) and not isinstance(state.time, GotoFault) and state.time > 0


def until_standing(
    core: CoreSettings, stop: Callable[[], messages.StopMessage], patience: float = inf
) -> Script[Standstill | None]:
    """Send the latest stop again and again until the robot is seen to stand; None after `patience` seconds."""
    began: float = yield START
    while True:
        position = yield from _standing_place(core)
        if position is not None:
            return Standstill(position, core.now - began)
        if core.now - began >= patience:
            return None
        # If only this kind of stop does not get through, another one may.
        for each in dict.fromkeys((stop(), messages.StopDrive())):
            core.offer(each)


def _standing_place(core: CoreSettings) -> Script[messages.KalmanPositionResponse | None]:
    """Look at the drive for two stop periods; return where it stands, None if it moves or does not answer."""
    period = core.stop_period
    ask_position = Ask(messages.KalmanPositionRequest(), messages.KalmanPositionResponse, period, 1)
    yield Pause(period)
    try:
        state = yield Ask(messages.GotoStateRequest(), messages.GotoStateResponse, period, 1)
        # The place twice, a period apart: a drive that is still rolling to a stop says "no goto" as well.
        before = yield ask_position
        yield Pause(period)
        after = yield ask_position
    except NoAnswer:
        return None
    moved = not is_near(before[:3], after[:3], core.standstill_distance, core.standstill_turn)
    return None if moved or is_driving(state) else after


# After a node was lost


ANY_ANGLE = 180.0
"""Two headings are never further apart than this, degrees."""

AT_START = 50.0
"""A configured drive may not have been seen by the navigation yet if it is this near its start place, mm.
"""

LOOKS = 3
"""How often the navigation is asked for a drive that has booted. It believes the navigation when two positions agree,
and one of them may be unknown or wrong."""

LOST_PLACE = "the drive has lost its place"


class PlaceLost(StateError):
    """The drive is not where it was last seen; it has to be put at its start place, and the start configured."""


def find_place(core: CoreSettings, there: Place | None, start: Place) -> Script[messages.KalmanPositionResponse]:
    """Have the navigation look where the drive is, and check that it is where it was last seen (`there`), if it was.

    Raises PlaceLost if it is elsewhere, or so near its `start` place that nobody may have seen it there; NoAnswer.
    """
    for _ in range(LOOKS):
        core.offer(messages.NaviPositionRequest())
        # The drive hears the answers itself (document 4.2.2 Navigation), so there is nothing to wait for here.
        yield Pause(core.state_request_period)
    here = yield from drive_position(core)
    if there is None:
        return here
    moved = not is_near(there, here[:3], core.displacement, ANY_ANGLE)
    unseen = is_near(start, here[:3], AT_START, ANY_ANGLE) and not is_near(start, there, AT_START, ANY_ANGLE)
    if moved or unseen:
        text = f"it was last seen at {there[:2]}, and is at {here[:2]} now; configure the start"
        raise PlaceLost(f"{LOST_PLACE}: {text}")
    return here
