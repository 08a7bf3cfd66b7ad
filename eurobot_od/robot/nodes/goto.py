"""How a goto ends: the drive says so when it is asked for its state, and its position shows it (document 2.1)."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.device.flow import Pause, Script
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import is_near
from eurobot_od.robot.model.values import FAULT_OUTCOME, Outcome
from eurobot_od.robot.nodes.node import RobotNode

GOTO_SETTINGS = ("Goto handshake.Confirm wait", "Goto handshake.Transmissions")
STATE_SETTINGS = ("Goto handshake.State answer wait", "Goto handshake.Transmissions")
"""The settings by which the drive is sent to a place, and asked for its state and its position: how long to wait, how
often to ask."""

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


def until_ended(core: RobotNode, goto: messages.GotoXY) -> Script[End]:
    """Ask for the state of a confirmed goto until it has ended; raises NoAnswer.

    It has arrived when the drive says so and is at the goto's place. Answers that know of no goto, or of another one
    that has arrived, are tolerated a few times in a row: the drive may have heard a request before its goto.
    """
    yield Pause(core.seconds("Goto handshake.First state request"))
    odd: list[str] = []
    while len(odd) < core.setting("Goto handshake.Lost after"):
        state = yield core.asking(messages.GotoStateRequest(), messages.GotoStateResponse, *STATE_SETTINGS)
        if state.time in FAULT_OUTCOME:
            return End(FAULT_OUTCOME[state.time])
        if state.time == 0:
            # The 0 may be that of an earlier goto: the place has to agree.
            place = yield from drive_position(core)
            distance, angle = core.setting("Arrival.Position tolerance"), core.setting("Arrival.Angle tolerance")
            if is_near(goto[:3], place[:3], distance, angle):
                return End(Outcome.ARRIVED)
            odd.append(f"the drive has arrived at ({place.x}, {place.y}) {place.angle} deg")
        elif state.time is None:
            odd.append(NO_GOTO)
        else:
            # In a row: a single odd answer between good ones is a frame that came out of turn.
            odd.clear()
        yield Pause(core.period("Goto handshake.State request period"))
    return End(Outcome.LOST, odd[-1])


def drive_position(core: RobotNode) -> Script[messages.KalmanPositionResponse]:
    """Ask the drive for the filtered position of our robot; raises NoAnswer."""
    answer: messages.KalmanPositionResponse = yield core.asking(
        messages.KalmanPositionRequest(), messages.KalmanPositionResponse, *STATE_SETTINGS
    )
    return answer
