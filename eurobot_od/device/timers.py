"""Timers of a node, deadlines, plans, and flows, which send requests and wait for answers.

There is no clock in this module: callers pass the time in s. Timers with the same time are called in the order in which
they were set, so that a simulated match is reproducible.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from inspect import GEN_CLOSED, getgeneratorstate
from math import inf
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, NoReturn, TypeAlias, TypeVar

from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message

TimerAction: TypeAlias = Callable[[float], None]
"""Function that a timer calls with the time for which it was set."""


LATE = 1.0
"""Largest delay of an action that is still made up for, in s; after a longer standstill it was missed."""


def caught_up(due: float, now: float) -> float:
    """Return the time from which the next action is planned: `due`, or now if that was missed.

    A late call then does not delay the next one, and after a long standstill missed actions are not all repeated.
    """
    return due if now - due <= LATE else now


class Timer:
    """A function to be called at a time, unless `cancel` is called before."""

    __slots__ = ("action", "time")

    def __init__(self, time: float, action: TimerAction) -> None:
        self.time = time
        self.action: TimerAction | None = action

    def cancel(self) -> None:
        """Cancel the timer; the heap drops it later."""
        self.action = None


class Timers:
    """Timers of one node; `planned` is called with the time of each new one."""

    def __init__(self, planned: Callable[[float], object] = lambda _: None) -> None:
        self._planned = planned
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def at(self, time: float, action: TimerAction) -> Timer:
        """Call `action` at a time."""
        timer = Timer(time, action)
        # The number keeps timers with the same time in order; timers themselves cannot be compared.
        heapq.heappush(self._heap, (time, next(self._order), timer))
        self._planned(time)
        return timer

    @property
    def next(self) -> float:
        """Time of the next timer, infinite if there is none."""
        while self._heap and self._heap[0][2].action is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else inf

    def due(self, now: float) -> Iterator[tuple[TimerAction, float]]:
        """Yield the due actions, each with the time for which it was set; timers that are added meanwhile are included.

        The planned times prevent drift of periodic actions. A missed action (see `caught_up`) has the present time.
        """
        while self.next <= now:
            time, _, timer = heapq.heappop(self._heap)
            if timer.action is not None:
                yield timer.action, caught_up(time, now)

    def clear(self) -> None:
        """Forget all timers."""
        self._heap.clear()


class Plan:
    """The earliest of all times that a node has planned; timers note theirs by `at`.

    After each frame, the receiving thread compares this number to decide whether the keeper has to be woken. It is
    never later than the first due action, but may be earlier if a plan was dropped, which costs one needless check. The
    keeper sets `soonest` when it asks the node.
    """

    __slots__ = ("soonest",)

    def __init__(self) -> None:
        self.soonest = inf

    def at(self, time: float) -> None:
        """Note an action at a time in s."""
        if time < self.soonest:
            self.soonest = time


# Deadlines


Awaited = TypeVar("Awaited", bound=Hashable)


class Deadlines(Generic[Awaited]):
    """Events that must come again within their times; `missed` are those that have not.

    A device has deadlines for its RPDOs (CiA 301, 7.5.2.35: event timer of an RPDO) and for heartbeats of other nodes.
    """

    def __init__(self) -> None:
        self.times: Mapping[Awaited, float] = {}
        self._deadlines: dict[Awaited, float] = {}
        self.missed: set[Awaited] = set()

    def restart(self, times: Mapping[Awaited, float]) -> None:
        """Start over with these times; supervision of each event begins with its first occurrence."""
        self.times = times
        self._deadlines.clear()
        self.missed.clear()

    def change(self, times: Mapping[Awaited, float]) -> None:
        """Set other times; unchanged ones are continued."""
        kept = {each for each in times if times[each] == self.times.get(each)}
        self.times = times
        # With their old deadlines, so that a write to 0x1016 does not extend them.
        self._deadlines = {each: self._deadlines[each] for each in kept & self._deadlines.keys()}
        self.missed &= kept

    def awaits(self, what: Awaited) -> bool:
        """Return whether an event has come, and must come again in time."""
        return what in self._deadlines

    def heard(self, what: Awaited, now: float) -> bool:
        """Note an event; return whether it had been missed."""
        if what not in self.times:
            return False
        self._deadlines[what] = now + self.times[what]
        return self.back(what)

    def back(self, what: Awaited) -> bool:
        """Note an event without a new deadline; return whether it had been missed."""
        was_missed = what in self.missed
        self.missed.discard(what)
        return was_missed

    @property
    def next(self) -> float:
        """Earliest deadline, infinite if there is none."""
        return min(self._deadlines.values()) if self._deadlines else inf

    def overdue(self, now: float) -> list[Awaited]:
        """Return the events that are overdue by now, each once."""
        late = [each for each, deadline in self._deadlines.items() if deadline <= now]
        for each in late:
            del self._deadlines[each]  # reported once; supervision restarts with its next occurrence
            self.missed.add(each)
        return late


Result = TypeVar("Result")


class Ask(NamedTuple):
    """Send `request` up to `attempts` times, `wait` s apart, until the `answer` comes; a request of None is not sent.

    The answer to a message is a message type; to an SDO request, the COB-ID of a frame about the same object.
    """

    request: Message | Frame | None
    answer: type[Message] | int
    wait: float
    attempts: int

    def fits(self, heard: Message | Frame) -> bool:
        """Return whether a frame or message is the answer."""
        if isinstance(heard, Frame):
            # Answers to other requests are about another object (bytes 1 to 3).
            asked = self.request.data[1:4] if isinstance(self.request, Frame) else heard.data[1:4]
            return heard.cob_id == self.answer and heard.data[1:4] == asked
        return not isinstance(self.answer, int) and isinstance(heard, self.answer)

    def unanswered(self) -> NoAnswer:
        """Return the error about a request without an answer."""
        request = str(self.request or "") if isinstance(self.request, Frame | None) else type(self.request).__name__
        answer = f"0x{self.answer:03X}" if isinstance(self.answer, int) else self.answer.__name__
        return NoAnswer(request, answer, self.attempts, self.wait)


class Pause(NamedTuple):
    """Wait for `seconds`."""

    seconds: float


START = Pause(0.0)
"""First value that every script yields; it is resumed with the time."""


Script: TypeAlias = Generator[Ask | Pause, Any, Result]
"""Generator of a flow: resumed with the answer (Ask) or the time (Pause); NoAnswer is thrown into it."""


class Call(Future[Result], Generic[Result]):
    """The result of a flow: `await` it in asyncio, or call `result(timeout)` from another thread.

    `is_wanted` is set once the call was used.
    """

    is_wanted = False

    if not TYPE_CHECKING:  # so that mypy still finds a name that no call has

        def __getattr__(self, name: str) -> NoReturn:
            raise AttributeError(f"a call has no attribute {name!r}; write (await ...).{name} for that of its result")

    def __await__(self) -> Generator[Any, None, Result]:
        self.is_wanted = True
        return asyncio.wrap_future(self).__await__()

    def result(self, timeout: float | None = None) -> Result:
        """Return the result once it is available; raises the flow's error, CancelledError, TimeoutError."""
        self.is_wanted = True
        return super().result(timeout)

    def done(self) -> bool:
        """Return whether the call has ended."""
        self.is_wanted = True
        return super().done()

    def cancel(self) -> bool:
        """Cancel the call; return whether that was still possible."""
        self.is_wanted = True
        return super().cancel()


def shielded(call: Call[Result]) -> Call[Result]:
    """Return a call with the same result; cancelling it does not cancel the flow."""
    mirror: Call[Result] = Call()

    def settle(done: Future[Result]) -> None:
        # False if the mirror was cancelled, when setting a result would raise.
        if mirror.set_running_or_notify_cancel():
            error = done.exception()
            mirror.set_result(done.result()) if error is None else mirror.set_exception(error)

    call.add_done_callback(settle)
    return mirror


class Flow(Generic[Result]):
    """A running script; `send` sends a message, `ended` is called once with the flow."""

    def __init__(
        self,
        script: Script[Result],
        timers: Timers,
        send: Callable[[Message | Frame], None],
        ended: Callable[[Flow[Any]], None],
    ) -> None:
        self.call: Call[Result] = Call()
        self._script, self._timers, self._send, self._ended = script, timers, send, ended
        self._ask: Ask | None = None
        self._sent = 0
        self._timer: Timer | None = None
        # Up to START, so that errors can be thrown into the script.
        next(script)

    def go_on(self, now: float) -> None:
        """Resume the script from START or a Pause, unless it has ended.

        The script of a cancelled call is closed.
        """
        if getgeneratorstate(self._script) != GEN_CLOSED:
            self._resume(lambda: self._script.send(now), now)

    def heard(self, message: Message | Frame, now: float) -> bool:
        """Handle a received message or SDO answer; return whether it was the awaited answer."""
        if self._ask is None or not self._ask.fits(message):
            return False
        self._resume(lambda: self._script.send(message), now)
        return True

    def fail(self, error: Exception, now: float) -> None:
        """Throw an error into the script, which may handle it."""
        self._resume(lambda: self._script.throw(error), now)

    def _resume(self, step: Callable[[], Ask | Pause], now: float) -> None:
        self._ask = None
        if self._timer:
            self._timer.cancel()
        if self.call.cancelled():
            self._script.close()  # runs its `finally` now and in this thread
            self._ended(self)
            return
        try:
            wanted = step()
        except StopIteration as end:
            self._end(partial(self.call.set_result, end.value))
        except Exception as error:  # also for a bug in the script, which must not stop the node
            self._end(partial(self.call.set_exception, error))
        else:
            if isinstance(wanted, Pause):
                self._timer = self._timers.at(now + wanted.seconds, self.go_on)
            else:
                self._ask = wanted
                self._sent = 0
                self._transmit(now)

    def _end(self, settle: Callable[[], None]) -> None:
        self._ended(self)
        if self.call.set_running_or_notify_cancel():  # it cannot be cancelled any more
            settle()

    def _transmit(self, now: float) -> None:
        ask = self._ask
        if ask is None:
            return
        # After the full wait of the last attempt.
        if self._sent == ask.attempts or self.call.cancelled():
            self.fail(ask.unanswered(), now)
            return
        self._sent += 1
        self._timer = self._timers.at(now + ask.wait, self._transmit)
        if ask.request is not None:
            self._send(ask.request)
