"""How a goto ends: the drive says so when it is asked for its state, and its position shows it (document 2.1)."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.device.flow import Pause, Script
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import is_near
from eurobot_od.robot.model.values import FAULT_OUTCOME, Outcome
from eurobot_od.robot.nodes.node import CoreSettings

NO_GOTO = "the drive knows of no goto"


class GotoReport(NamedTuple):
    """What became of a goto, and `why` if its outcome does not say it.

    Times are in seconds from its first transmission, `confirmed` None if it never was.
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

    It has arrived when the drive says so and is at the goto's place. Answers that know of no goto, or of another one
    that has arrived, are tolerated a few times in a row: the drive may have heard a request before its goto.
    """
    yield Pause(core.first_state_request)
    odd: list[str] = []
    while len(odd) < core.lost_after:
        state = yield core.ask_drive(messages.GotoStateRequest(), messages.GotoStateResponse)
        if state.time in FAULT_OUTCOME:
            return End(FAULT_OUTCOME[state.time])
        if state.time == 0:
            # The 0 may be that of an earlier goto: the place has to agree.
            place = yield from drive_position(core)
            if is_near(goto[:3], place[:3], core.arrival_distance, core.arrival_angle):
                return End(Outcome.ARRIVED)
            odd.append(f"the drive has arrived at ({place.x}, {place.y}) {place.angle} deg")
        elif state.time is None:
            odd.append(NO_GOTO)
        else:
            # In a row: a single odd answer between good ones is a frame that came out of turn.
            odd.clear()
        yield Pause(core.state_request_period)
    return End(Outcome.LOST, odd[-1])


def drive_position(core: CoreSettings) -> Script[messages.KalmanPositionResponse]:
    """Ask the drive for the filtered position of our robot; raises NoAnswer."""
    answer: messages.KalmanPositionResponse = yield core.ask_drive(
        messages.KalmanPositionRequest(), messages.KalmanPositionResponse
    )
    return answer
