"""Tells the timeline what a core's strategy has it do, and what comes of it.

Rule of this file: it watches, and changes nothing. So a strategy is written for any core, and need not tell.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from typing import Any

from eurobot_od.bus.live.watchdog import caller
from eurobot_od.device.flow import Call
from eurobot_od.robot.model.messages import GotoXY, KalmanPositionResponse
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.goto import GotoReport
from eurobot_od.robot.world.timeline import EventKind, Timeline

AHEAD = " ahead"
"""How the core ends the reason of a stop for what its distance sensor saw."""


class Observer:
    """Watches a core's gotos and tasks; `truth` gives the true pose of its robot.

    `errors` are the distances between the position that the robot believed in and the true one, at each arrival, mm.
    """

    def __init__(self, core: Core, timeline: Timeline, truth: Callable[[], Pose]) -> None:
        self.errors: list[float] = []
        self._core, self._timeline, self._truth = core, timeline, truth
        core.observe = self._began

    def _began(self, what: GotoXY | str, call: Call[Any]) -> None:
        begin = self._timeline.clock()
        # `caller` is looked up now: when the call ends, the strategy's line is no longer on the stack.
        call.add_done_callback(partial(self._ask_for, "act" if isinstance(what, str) else "goto", caller()))
        if isinstance(what, str):
            call.add_done_callback(partial(self._did, what))
            return
        place = f"({what.x}, {what.y}) {what.angle} deg, {what.speed} %"
        self._timeline.tell(
            EventKind.GOTO, place, goto=what._asdict() | {"barriers": self._core.facts.words(what.barriers)}
        )
        call.add_done_callback(partial(self._ended, begin))

    def _ask_for(self, name: str, where: str, call: Call[Any]) -> None:
        """Warn of a call that has ended and that nobody has waited for."""
        if not call.is_wanted:
            self._timeline.tell(
                EventKind.WARNING, f"{where}: nobody awaits this {name}; write `await core.{name}(...)`"
            )

    def _did(self, task: str, call: Future[int]) -> None:
        if not call.cancelled() and call.exception() is None:
            self._timeline.tell(EventKind.TASK, f"{task}: {call.result() or 'nothing'}", task=task, gain=call.result())

    def _ended(self, begin: float, call: Future[GotoReport]) -> None:
        try:
            report = call.result()
        except CancelledError:
            self._tell_end("cancelled", "", self._timeline.clock() - begin)
        except Exception as error:  # the strategy gets it as well: it may know what to do
            self._tell_end("failed", str(error), self._timeline.clock() - begin)
        else:
            if report.outcome is Outcome.ARRIVED:
                self._tell_arrival(report)
                return
            # The core stopped by itself: there was no call of the strategy's that could be observed.
            if report.why.endswith(AHEAD):
                self._timeline.tell(EventKind.STOP, f"emergency stop: {report.why}", obstacle=report.why[: -len(AHEAD)])
            self._tell_end(report.outcome.value, report.why, report.ended)

    def _tell_end(self, outcome: str, why: str, seconds: float) -> None:
        text = f"{outcome} after {seconds:.2f} s" + f": {why}" * bool(why)
        self._timeline.tell(EventKind.GIVEN_UP, text, outcome=outcome, why=why or None, seconds=seconds)

    def _tell_arrival(self, report: GotoReport) -> None:
        # Where it believes it is, not where it was sent: the distance from the truth is then the filter's error alone.
        place = self._core.positions[KalmanPositionResponse].position
        truth, goto, seconds = self._truth(), report.goto, report.ended
        error = truth.distance(Point(place.x or 0, place.y or 0))
        self.errors.append(error)
        off = {"error": round(error, 1), "distance": round(truth.distance(Point(goto.x, goto.y)), 1)}
        details = f"confirmed after {(report.confirmed or 0) * 1000:.1f} ms, position error {error:.0f} mm"
        text = f"after {seconds:.2f} s ({details})"
        self._timeline.tell(EventKind.ARRIVED, text, seconds=seconds, confirmed=report.confirmed, **off)
