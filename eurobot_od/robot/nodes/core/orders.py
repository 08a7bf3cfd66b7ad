"""Gotos and start configurations that a user writes into the core's objects by SDO, for example on the page.

The core carries them out and watches them like those of a strategy. They are not awaited: a failure is an alarm.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from eurobot_od.device.timers import START, Call, Pause, Script
from eurobot_od.errors import Cause, Refused
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core.calls import LEAVING
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.core.match_clock import MatchClock
from eurobot_od.robot.nodes.core.resumption import Resumption
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.core.startup import Startup


class Orders:
    """Carries out orders by SDO; `goto` begins a goto, as a strategy does."""

    def __init__(
        self,
        core: CoreSettings,
        clock: MatchClock,
        startup: Startup,
        resumption: Resumption,
        goto: Callable[..., Call[GotoReport]],
    ) -> None:
        self._core = core
        self._clock = clock
        self._startup = startup
        self._resumption = resumption
        self._goto = goto

    def goto(self, goto: messages.GotoXY, shut_down: bool) -> None:
        """Carry out a goto; raises Refused after an Emergency Shutdown, and while the core is being switched off."""
        if shut_down or self._core.is_leaving:
            raise Refused(Cause.STATE, "no goto after an Emergency Shutdown, or at the end")
        self._tell_failure_of(self._core.begin(self._go(goto)).call)

    def _go(self, goto: messages.GotoXY) -> Script[None]:
        yield START
        startup = self._startup.running
        resumption = self._resumption
        if self._core.configuration is None and startup.call is None and not resumption.is_recalling:
            resumption.begin_recall()  # another core may have configured the start
        while startup.call is not None or resumption.is_recalling:
            yield Pause(self._core.state_request_period)
        self._tell_failure_of(self._goto(*goto))

    def start(self, configuration: messages.StartConfigurationSet) -> None:
        """Configure the start; in a match at the robot's present place, as it has left its start place.

        Raises Refused for a contradictory configuration, and while the core is being switched off.
        """
        if self._core.is_leaving:
            raise Refused(Cause.STATE, LEAVING)
        self._core.check_configuration(configuration)
        in_match = self._clock.end is not None and not self._clock.is_over
        self._resumption.end_recall()
        self._tell_failure_of(self._startup.begin(configuration, in_match))

    def _tell_failure_of(self, order: Call[Any]) -> None:
        def tell(ended: Future[Any]) -> None:
            if failure := _failure(ended):
                self._core.alarm(f"an order by SDO has failed: {failure}")

        order.is_wanted = True
        order.add_done_callback(tell)


def _failure(ended: Future[Any]) -> str:
    """Return why an order was not carried out; empty if it was, or if a newer one replaced it."""
    if ended.cancelled():
        return ""
    if (error := ended.exception()) is not None:
        return str(error)
    report = ended.result()
    if not isinstance(report, GotoReport) or report.outcome in (Outcome.ARRIVED, Outcome.REPLACED):
        return ""
    return f"goto {report.outcome.value}, {report.why}" if report.why else f"goto {report.outcome.value}"
