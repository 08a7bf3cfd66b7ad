"""Flows: asking again, pausing, results, errors, and calls that are cancelled."""

from __future__ import annotations

from concurrent.futures import Future
from math import inf
from typing import Any

import pytest

from eurobot_od.device.flow import START, Ask, Flow, Pause, Script
from eurobot_od.device.timers import Timers
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.message import Message
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviResponse,
    GotoStateRequest,
    GotoStateResponse,
)

CHECK = Ask(CheckDriveRequest(), CheckDriveResponse, wait=0.5, attempts=3)


class Run:
    """A flow that was started at 0 s; `sent` is what it sent and when, `ended` how often it said that it ended."""

    def __init__(self, script: Script[Any]) -> None:
        self.timers, self.now = Timers(), 0.0
        self.sent: list[tuple[float, Message | Frame]] = []
        self.ended = 0
        self.flow = Flow(script, self.timers, lambda message: self.sent.append((self.now, message)), self._end)
        self.flow.start(0.0)

    def _end(self, flow: Flow[Any]) -> None:
        assert flow is self.flow
        self.ended += 1

    @property
    def call(self) -> Future[Any]:
        return self.flow.call

    def until(self, end: float) -> Run:
        """Let the time pass from timer to timer."""
        while (time := self.timers.next) <= end:
            self.now = time
            for action, due in self.timers.due(time):
                action(due)
        self.now = end
        return self

    def hear(self, message: Message) -> bool:
        return self.flow.heard(message, self.now)


def asking(ask: Ask = CHECK) -> Script[Any]:
    yield START
    return (yield ask)


def pausing(seconds: float) -> Script[Any]:
    yield START
    return (yield Pause(seconds))


def test_nothing_is_sent_before_the_start() -> None:
    flow = Flow(asking(), Timers(), lambda _: pytest.fail("sent"), lambda _: pytest.fail("ended"))
    assert not flow.heard(CheckDriveResponse(), 0.0)
    assert not flow.call.done()


@pytest.mark.parametrize(
    ("answered", "times"),
    [
        (0.1, [0.0]),  # at once: asked once
        (0.6, [0.0, 0.5]),
        (1.4, [0.0, 0.5, 1.0]),  # the last attempt has its whole wait
    ],
)
def test_a_question_is_repeated_until_it_is_answered(answered: float, times: list[float]) -> None:
    run = Run(asking()).until(answered)
    assert run.hear(CheckDriveResponse())
    run.until(10.0)
    assert [time for time, _ in run.sent] == times
    assert run.call.result(0) == CheckDriveResponse()
    assert run.ended == 1
    assert run.timers.next == inf


def test_a_question_that_nobody_answers_names_request_answer_attempts_and_wait() -> None:
    run = Run(asking()).until(10.0)
    assert [time for time, _ in run.sent] == [0.0, 0.5, 1.0]
    error = run.call.exception(0)
    assert isinstance(error, NoAnswer)
    assert str(error) == "no CheckDriveResponse after 3 x CheckDriveRequest (500 ms each)"
    assert run.ended == 1


def test_an_answer_is_of_the_type_that_was_asked_for_and_counts_once() -> None:
    run = Run(asking())
    assert not run.hear(CheckNaviResponse())
    assert not run.call.done()
    assert run.hear(CheckDriveResponse())
    assert not run.hear(CheckDriveResponse())


def test_an_answer_carries_its_values() -> None:
    run = Run(asking(Ask(GotoStateRequest(), GotoStateResponse, 1.0, 1)))
    run.hear(GotoStateResponse(1234))
    assert run.call.result(0) == GotoStateResponse(1234)


def test_a_pause_hears_nothing_and_tells_the_time_it_ended() -> None:
    run = Run(pausing(2.0))
    assert not run.hear(CheckDriveResponse())
    run.until(1.999)
    assert not run.call.done()
    run.until(2.5)
    assert run.call.result(0) == 2.0


def test_an_error_in_the_script_is_that_of_the_call() -> None:
    def broken() -> Script[None]:
        yield START
        raise StateError("broken")

    run = Run(broken())
    assert isinstance(run.call.exception(0), StateError)
    assert run.ended == 1


def test_a_failed_flow_stops_asking() -> None:
    run = Run(asking())
    run.flow.fail(StateError("given up"), 0.2)
    run.until(10.0)
    assert len(run.sent) == 1
    assert isinstance(run.call.exception(0), StateError)


def test_a_script_may_turn_a_failure_into_a_result() -> None:
    def tolerant() -> Script[str]:
        yield START
        try:
            yield CHECK
        except NoAnswer as error:
            return error.request
        return "answered"

    assert Run(tolerant()).until(10.0).call.result(0) == "CheckDriveRequest"


# Cancelled calls


def test_a_cancelled_call_is_not_asked_again_and_its_flow_ends() -> None:
    run = Run(asking()).until(0.1)
    assert run.call.cancel()
    run.until(10.0)
    assert [time for time, _ in run.sent] == [0.0]
    assert run.ended == 1
    assert run.timers.next == inf


def test_a_cancelled_pause_ends_its_flow() -> None:
    run = Run(pausing(1.0))
    run.call.cancel()
    run.until(2.0)
    assert run.ended == 1


def test_an_answer_to_a_cancelled_call_ends_its_flow_quietly() -> None:
    run = Run(asking())
    run.call.cancel()
    run.hear(CheckDriveResponse())
    assert run.ended == 1
    assert run.call.cancelled()


def test_a_call_cancelled_while_its_script_ends_stays_cancelled() -> None:
    def cancelling() -> Script[str]:
        yield START
        yield CHECK
        run.call.cancel()  # as another thread may at this very moment
        return "too late"

    run = Run(cancelling())
    run.hear(CheckDriveResponse())
    assert run.call.cancelled()
    assert run.ended == 1


@pytest.mark.parametrize("failed", [False, True])
def test_a_call_cancelled_before_the_start_sends_nothing_and_ends_once(failed: bool) -> None:
    sent: list[Message | Frame] = []
    ended: list[Flow[Any]] = []
    flow = Flow(asking(), Timers(), sent.append, ended.append)
    flow.call.cancel()
    if failed:
        flow.fail(StateError("the node was reset"), 0.0)
    flow.start(0.0)
    assert (sent, ended) == ([], [flow])
