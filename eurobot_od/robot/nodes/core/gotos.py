"""Runs one goto at a time, the newest (document 2.1): it waits for lost nodes, is sent, and is watched to its end.

`Orders` are gotos and start configurations that a user writes into the core's objects by SDO, for example on the page.
The core carries them out and watches them like those of a strategy. They are not awaited: a failure is an alarm.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from eurobot_od.device.timers import START, Ask, Call, Pause, Script
from eurobot_od.errors import Cause, NoAnswer, Refused, StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.agreement import SdoClientParameter, number_in
from eurobot_od.robot.nodes.core.distrust import Distrust, GotoConfirms
from eurobot_od.robot.nodes.core.equipment import Lookout
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.core.match_clock import MatchClock
from eurobot_od.robot.nodes.core.resumption import Resumption
from eurobot_od.robot.nodes.core.settings import LEAVING, CoreSettings
from eurobot_od.robot.nodes.core.startup import Startup
from eurobot_od.robot.nodes.core.stops import GotoEnded, Stops
from eurobot_od.robot.nodes.node import DEVIATION, UNKNOWN


class Gotos:
    """Sends the drive to places; `deviation` is that of the last place in mm, None if the drive has not reported it."""

    def __init__(
        self,
        core: CoreSettings,
        stops: Stops,
        clock: MatchClock,
        startup: Startup,
        resumption: Resumption,
        lookout: Lookout,
        distrust: Distrust,
    ) -> None:
        self._core = core
        self._stops = stops
        self._clock = clock
        self._startup = startup
        self._resumption = resumption
        self._lookout = lookout
        self._distrust = distrust
        self.deviation: int | None = None
        self._confirms: GotoConfirms | None = None

    def begin(self, goto: messages.GotoXY, timeout: float | None) -> Call[GotoReport]:
        """Begin a goto, and replace the one before; raises StateError if it must not be sent."""
        if self._resumption.is_unanswered and not self._resumption.is_recalling:
            self._resumption.begin_recall()
        if not self._resumption.is_recalling:
            self._check_may_drive()
        if self._clock.is_over:
            # Raised when it is awaited: a strategy that catches it in a loop yields, and can be cancelled.
            late: Call[GotoReport] = Call()
            late.set_exception(StateError("no goto after the match"))
            return late
        if self._resumption.is_due and self._stops.is_commanding:
            self._stops.stop(messages.StopDrive(), Outcome.REPLACED)  # the drive is not watched meanwhile
        self._stops.goto.end(GotoEnded(Outcome.REPLACED))
        # From now on a stop is needed, even if this goto is never awaited.
        call = self._stops.goto.begin(self._goto(goto, timeout))
        self._stops.latest = messages.StopDrive()
        return call

    def _check_may_drive(self) -> None:
        """Check that a goto may be sent; raises StateError with what is missing."""
        if self._stops.shut_down:
            raise StateError("no goto after an emergency shutdown: `await core.recover()` ends it")
        is_ready = self._resumption.is_due or self._clock.is_over
        if not is_ready and (missing := self._core.readiness.missing()):
            raise StateError(f"no goto yet: {missing}")

    def _goto(self, goto: messages.GotoXY, timeout: float | None) -> Script[GotoReport]:
        try:
            yield START
            if self._resumption.is_recalling:
                yield from self._resumption.until_recalled()
            self._check_may_drive()  # the questions before may have got no answer
            if self._clock.is_over:  # as the drive remembers
                raise StateError("no goto after the match")
            yield from self._resumption.before_goto()
        except GotoEnded as ended:
            return GotoReport(goto, ended.end.outcome, None, 0.0, ended.end.why)
        return (yield from self._drive(goto, self._core.goto_timeout if timeout is None else timeout))

    def _drive(self, goto: messages.GotoXY, timeout: float) -> Script[GotoReport]:
        core = self._core
        stops = self._stops
        stops.goto_begins()
        for frame in core.device.error_control.first_heartbeat():  # from now on the drive has to watch this core
            core.put(frame)
        started = core.now
        confirmed = None
        self.deviation = None
        self._confirms = GotoConfirms(started, core.confirm_wait, core.transmissions)
        limit = core.at(started + timeout, self._run_out_of_time)
        # From the start, not from the confirm: the drive may be rolling while its confirm is lost.
        self._lookout.begin()
        try:
            yield Ask(goto, messages.GotoConfirm, core.confirm_wait, core.transmissions)
            confirmed = core.now - started
            end = yield from flows.until_ended(core, goto)
            if end.outcome is Outcome.ARRIVED:
                self.deviation = yield from self._ask_deviation()
        except GotoEnded as ended:  # the code that ended it has stopped the drive
            end = ended.end
        except BaseException:  # no answer, or the call was cancelled
            stops.halt(messages.StopDrive())
            raise
        else:
            if end.outcome is Outcome.LOST:
                core.readiness.lost = end.why
                stops.halt(messages.StopDrive())
        finally:
            limit.cancel()
            self._lookout.end()
        return GotoReport(goto, end.outcome, confirmed, core.now - started, end.why, self.deviation)

    def _run_out_of_time(self, _: float) -> None:
        self._stops.stop(messages.StopDrive(), Outcome.TIMED_OUT)

    def _ask_deviation(self) -> Script[int | None]:
        """Ask the drive for the deviation of its place in mm; None if it does not know or report it."""
        channel = SdoClientParameter.to("drive", self._core.device)
        if channel is None or not self._startup.tells_deviation:
            return None
        address = self._core.device.dictionary.address(DEVIATION)
        try:
            answer = yield Ask(channel.ask(address), channel.answer, self._core.identity_wait, 1)
        except NoAnswer:
            self._startup.tells_deviation = False  # a drive without SDO would cost each goto this wait
            return None
        deviation = number_in(answer, address)
        return None if deviation == UNKNOWN else deviation

    def confirmed(self) -> None:
        """Process a confirm of the drive; stop if no goto explains it."""
        confirms = self._confirms if self._stops.is_commanding else None
        if confirms is not None and not confirms.is_asked_for(self._core.now):
            self._distrust.stop("the drive has confirmed a goto that the core did not send")
        else:
            self._stops.stop_late_goto()


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
