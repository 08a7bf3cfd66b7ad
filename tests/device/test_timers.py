"""Timers: what is due when, in which order, and what cancelling does."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from math import inf
from typing import Any

import pytest

from eurobot_od.device.timers import START, Ask, Call, Flow, Pause, Script, Timers
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from tests.kit.lift import CheckCabinRequest, CheckCabinResponse, CheckDoorResponse, StateRequest, StateResponse


def due(timers: Timers, now: float) -> list[float]:
    """Call what is due and return the times the actions got."""
    times = []
    for action, time in timers.due(now):
        action(time)
        times.append(time)
    return times


@pytest.mark.parametrize(
    ("set_for", "now", "expected"),
    [
        ([], 1.0, []),
        ([1.0], 0.999, []),  # not yet
        ([1.0], 1.0, [1.0]),  # on the dot
        ([1.0], 2.0, [1.0]),  # late: it still gets the time it was set for
        ([1.0], 5.0, [5.0]),  # missed: what repeats itself goes on from here
        ([3.0, 1.0, 2.0], 2.0, [1.0, 2.0]),  # soonest first, the rest stays
    ],
)
def test_due_timers_run_in_order_of_time(set_for: list[float], now: float, expected: list[float]) -> None:
    timers = Timers()
    for time in set_for:
        timers.at(time, lambda _: None)
    assert due(timers, now) == expected
    assert timers.next == min((time for time in set_for if time > now), default=inf)


def test_equal_times_keep_their_order() -> None:
    timers, called = Timers(), list[int]()
    for number in range(5):
        timers.at(1.0, lambda _, number=number: called.append(number))  # type: ignore[misc]
    due(timers, 1.0)
    assert called == [0, 1, 2, 3, 4]


def test_timers_that_become_due_meanwhile_also_run() -> None:
    timers, called = Timers(), list[float]()

    def again(time: float) -> None:
        called.append(time)
        timers.at(time + 0.25, again)

    timers.at(1.0, again)
    due(timers, 1.6)
    assert called == [1.0, 1.25, 1.5]
    assert timers.next == 1.75


def test_a_cancelled_timer_is_never_called_and_wakes_nobody() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: pytest.fail("cancelled")).cancel()
    assert timers.next == inf
    assert due(timers, 2.0) == []


def test_a_timer_cancelled_by_the_one_before_is_not_called() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: second.cancel())
    second = timers.at(1.0, lambda _: pytest.fail("cancelled"))
    assert due(timers, 1.0) == [1.0]


def test_clear_forgets_all() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: pytest.fail("cleared"))
    timers.clear()
    assert timers.next == inf
    assert due(timers, 2.0) == []


def test_each_new_timer_is_told() -> None:
    told: list[float] = []
    timers = Timers(told.append)
    for time in (2.0, 3.0, 1.0):
        timers.at(time, lambda _: None)
    assert told == [2.0, 3.0, 1.0]


CHECK = Ask(CheckCabinRequest(), CheckCabinResponse, wait=0.5, attempts=3)


class Run:
    """A flow that was started at 0 s; `sent` is what it sent and when, `ended` how often it said that it ended."""

    def __init__(self, script: Script[Any]) -> None:
        self.timers, self.now = Timers(), 0.0
        self.sent: list[tuple[float, Message | Frame]] = []
        self.ended = 0
        self.flow = Flow(script, self.timers, lambda message: self.sent.append((self.now, message)), self._end)
        self.flow.go_on(0.0)

    def _end(self, flow: Flow[Any]) -> None:
        assert flow is self.flow
        self.ended += 1

    @property
    def call(self) -> Future[Any]:
        return self.flow.call

    def until(self, end: float) -> Run:
        """Advance the time from timer to timer."""
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
    assert not flow.heard(CheckCabinResponse(), 0.0)
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
    assert run.hear(CheckCabinResponse())
    run.until(10.0)
    assert [time for time, _ in run.sent] == times
    assert run.call.result(0) == CheckCabinResponse()
    assert run.ended == 1
    assert run.timers.next == inf


def test_a_question_that_nobody_answers_names_request_answer_attempts_and_wait() -> None:
    run = Run(asking()).until(10.0)
    assert [time for time, _ in run.sent] == [0.0, 0.5, 1.0]
    error = run.call.exception(0)
    assert isinstance(error, NoAnswer)
    assert str(error) == "no CheckCabinResponse after 3 x CheckCabinRequest (500 ms each)"
    assert run.ended == 1


def test_an_answer_is_of_the_type_that_was_asked_for_and_counts_once() -> None:
    run = Run(asking())
    assert not run.hear(CheckDoorResponse())
    assert not run.call.done()
    assert run.hear(CheckCabinResponse())
    assert not run.hear(CheckCabinResponse())


def test_an_answer_carries_its_values() -> None:
    run = Run(asking(Ask(StateRequest(), StateResponse, 1.0, 1)))
    run.hear(StateResponse(1234))
    assert run.call.result(0) == StateResponse(1234)


def test_a_pause_hears_nothing_and_tells_the_time_it_ended() -> None:
    run = Run(pausing(2.0))
    assert not run.hear(CheckCabinResponse())
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


def test_an_sdo_answer_about_another_object_is_none() -> None:
    ask = Ask(Frame(0x602, bytes.fromhex("4018100300000000")), 0x582, 1.0, 1)
    assert ask.fits(Frame(0x582, bytes.fromhex("4318100304000000")))
    assert ask.fits(Frame(0x582, bytes.fromhex("8018100311000906")))
    assert not ask.fits(Frame(0x582, bytes.fromhex("4318100204000000")))
    assert not ask.fits(Frame(0x583, bytes.fromhex("4318100304000000")))
    assert not ask.fits(Frame(0x582, b"\x43\x18"))


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

    assert Run(tolerant()).until(10.0).call.result(0) == "CheckCabinRequest"


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
    run.hear(CheckCabinResponse())
    assert run.ended == 1
    assert run.call.cancelled()


def test_a_call_cancelled_while_its_script_ends_stays_cancelled() -> None:
    def cancelling() -> Script[str]:
        yield START
        yield CHECK
        run.call.cancel()  # as another thread may at this very moment
        return "too late"

    run = Run(cancelling())
    run.hear(CheckCabinResponse())
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
    flow.go_on(0.0)
    assert (sent, ended) == ([], [flow])


@pytest.mark.parametrize("ask", [Call.done, Call.cancel, lambda call: call.result(0)])
def test_use_of_a_call_marks_it_as_wanted(ask: Callable[[Call[int]], object]) -> None:
    call = Call[int]()
    assert not call.is_wanted
    with suppress(TimeoutError):  # nothing is there yet
        ask(call)
    assert call.is_wanted


def test_an_attribute_of_the_result_is_refused_before_it_is_awaited() -> None:
    with pytest.raises(AttributeError, match=r"^a call has no attribute 'x'; write \(await \.\.\.\)\.x for that"):
        Call[int]().x  # type: ignore[attr-defined]  # noqa: B018
