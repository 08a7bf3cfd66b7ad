"""Timers, which call a node's functions at a time; deadlines; a node's plan; and flows, which ask and wait.

There is no clock in here: the time, in seconds, is what the caller says it is. Timers that are due at the same time are
called in the order in which they were set. Otherwise a simulated match would not be the same twice.
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
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message

TimerAction: TypeAlias = Callable[[float], None]
"""What to do when a timer is due; gets the time it was set for."""


LATE = 1.0
"""Seconds by which a node may be late and still catch up; what is later was missed, as the process stood still."""


def caught_up(due: float, now: float) -> float:
    """Return the time from which to plan what follows something `due`: that time, or now if it was missed.

    So one late call does not delay the next, and a node that has stood still for minutes does not do everything at once
    that it has missed.
    """
    return due if now - due <= LATE else now


class Timer:
    """A function waiting for its time; after `cancel` it is never called."""

    __slots__ = ("action", "time")

    def __init__(self, time: float, action: TimerAction) -> None:
        self.time = time
        self.action: TimerAction | None = action

    def cancel(self) -> None:
        """Forget the function; the heap drops the timer once it is at the top, which is cheaper than a search."""
        self.action = None


class Timers:
    """The timers of one node, soonest first; `planned` gets the time of each new one."""

    def __init__(self, planned: Callable[[float], object] = lambda _: None) -> None:
        self._planned = planned
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def at(self, time: float, action: TimerAction) -> Timer:
        """Have `action` called when the time comes."""
        timer = Timer(time, action)
        # The number keeps timers of the same time in order, and keeps the heap from comparing timers, which it cannot.
        heapq.heappush(self._heap, (time, next(self._order), timer))
        self._planned(time)
        return timer

    @property
    def next(self) -> float:
        """Time of the soonest timer, infinite if there is none."""
        while self._heap and self._heap[0][2].action is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else inf

    def due(self, now: float) -> Iterator[tuple[TimerAction, float]]:
        """Yield what is due, each with the time it was set for, including what becomes due meanwhile.

        A late node gets the planned times, so that what repeats itself by adding a period to them does not drift. What
        it has missed (see `caught_up`) it gets once, with the present time.
        """
        while self.next <= now:
            time, _, timer = heapq.heappop(self._heap)
            if timer.action is not None:
                yield timer.action, caught_up(time, now)

    def clear(self) -> None:
        """Forget all timers."""
        self._heap.clear()


class Plan:
    """The soonest of all times that a node has planned; timers note theirs with `at`.

    After each frame the receiving thread compares this one number, instead of asking every timer of the node, to see
    whether the thread that keeps the time has to be woken. It is never later than the first thing that is due. It may
    be sooner, as a plan may be dropped: that costs one needless look. The keeper of the time sets `soonest` when it
    asks the node.
    """

    __slots__ = ("soonest",)

    def __init__(self) -> None:
        self.soonest = inf

    def at(self, time: float) -> None:
        """Note that something is due at a time in seconds."""
        if time < self.soonest:
            self.soonest = time


# Deadlines


Awaited = TypeVar("Awaited", bound=Hashable)


class Deadlines(Generic[Awaited]):
    """Things that have to come again within their times; `missed` are those that have not come in time.

    A device has deadlines for its RPDOs (CiA 301, 7.5.2.35: event timer of an RPDO) and for other nodes' heartbeats.
    """

    def __init__(self) -> None:
        self.times: Mapping[Awaited, float] = {}
        self._deadlines: dict[Awaited, float] = {}
        self.missed: set[Awaited] = set()

    def restart(self, times: Mapping[Awaited, float]) -> None:
        """Start over with these times; nothing is awaited before it has come once."""
        self.times = times
        self._deadlines.clear()
        self.missed.clear()

    def change(self, times: Mapping[Awaited, float]) -> None:
        """Take over other times; whatever does not change goes on."""
        kept = {each for each in times if times[each] == self.times.get(each)}
        self.times = times
        # To their old deadlines: otherwise each write to 0x1016 would give all other nodes more time.
        self._deadlines = {each: self._deadlines[each] for each in kept & self._deadlines.keys()}
        self.missed &= kept

    def awaits(self, what: Awaited) -> bool:
        """Return whether it has come, and has to come again in time."""
        return what in self._deadlines

    def heard(self, what: Awaited, now: float) -> bool:
        """Note that it has come; return whether it had been missed."""
        if what not in self.times:
            return False
        self._deadlines[what] = now + self.times[what]
        return self.back(what)

    def back(self, what: Awaited) -> bool:
        """Note that it is there, without a new deadline; return whether it had been missed."""
        was_missed = what in self.missed
        self.missed.discard(what)
        return was_missed

    @property
    def next(self) -> float:
        """Time at which the next one is late, infinite if none is awaited."""
        return min(self._deadlines.values()) if self._deadlines else inf

    def overdue(self, now: float) -> list[Awaited]:
        """Return what has not come in time by now, each once."""
        late = [each for each, deadline in self._deadlines.items() if deadline <= now]
        for each in late:
            del self._deadlines[each]  # reported once; when it comes again the watch starts over
            self.missed.add(each)
        return late


Result = TypeVar("Result")


class Ask(NamedTuple):
    """Send `request` up to `attempts` times, `wait` seconds apart, until the `answer` comes; None is not sent.

    The answer to a message is a message type, that to an SDO request the COB-ID of a frame about the same object.
    """

    request: Message | Frame | None
    answer: type[Message] | int
    wait: float
    attempts: int

    def fits(self, heard: Message | Frame) -> bool:
        """Return whether this is the answer."""
        if isinstance(heard, Frame):
            # A late answer to an earlier question, or one to somebody else's, is about another object (bytes 1 to 3).
            asked = self.request.data[1:4] if isinstance(self.request, Frame) else heard.data[1:4]
            return heard.cob_id == self.answer and heard.data[1:4] == asked
        return not isinstance(self.answer, int) and isinstance(heard, self.answer)

    def unanswered(self) -> NoAnswer:
        """Return the error for a request that nobody has answered."""
        request = str(self.request or "") if isinstance(self.request, Frame | None) else type(self.request).__name__
        answer = f"0x{self.answer:03X}" if isinstance(self.answer, int) else self.answer.__name__
        return NoAnswer(request, answer, self.attempts, self.wait)


class Pause(NamedTuple):
    """Do nothing for `seconds`."""

    seconds: float


START = Pause(0.0)
"""What every script yields first; it is resumed with the time."""


Script: TypeAlias = Generator[Ask | Pause, Any, Result]
"""A flow's generator: resumed with the answer (Ask) or the time (Pause); NoAnswer is thrown into it."""


class Call(Future[Result], Generic[Result]):
    """The result of a flow: `await` it in asyncio, or get it with `result(timeout)` from another thread.

    `is_wanted` tells whether anybody has awaited it or asked it for anything.
    """

    is_wanted = False

    def __await__(self) -> Generator[Any, None, Result]:
        self.is_wanted = True
        return asyncio.wrap_future(self).__await__()

    def result(self, timeout: float | None = None) -> Result:
        """Return the result once it is there; raises what the flow raised, CancelledError, TimeoutError."""
        self.is_wanted = True
        return super().result(timeout)

    def done(self) -> bool:
        """Return whether the call has ended."""
        self.is_wanted = True
        return super().done()

    def cancel(self) -> bool:
        """Give the call up; return whether it was still possible."""
        self.is_wanted = True
        return super().cancel()


def shielded(call: Call[Result]) -> Call[Result]:
    """Return a call with the same result; cancelling it leaves the flow alone."""
    mirror: Call[Result] = Call()

    def settle(done: Future[Result]) -> None:
        # False if the mirror was cancelled; setting a result would raise then.
        if mirror.set_running_or_notify_cancel():
            error = done.exception()
            mirror.set_result(done.result()) if error is None else mirror.set_exception(error)

    call.add_done_callback(settle)
    return mirror


class Flow(Generic[Result]):
    """One running script; `send` puts a message on the bus, `ended` is called once, with the flow."""

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
        # Up to its START: only a script that has begun can have an error thrown into it, and runs its `finally`.
        next(script)

    def go_on(self, now: float) -> None:
        """Run the script to its next Ask or Pause, unless it has ended: from its START, or after a Pause.

        The script of a call that was cancelled is ended.
        """
        if getgeneratorstate(self._script) != GEN_CLOSED:
            self._resume(lambda: self._script.send(now), now)

    def heard(self, message: Message | Frame, now: float) -> bool:
        """Take in a received message or SDO answer; return whether it was the answer that the flow waits for."""
        if self._ask is None or not self._ask.fits(message):
            return False
        self._resume(lambda: self._script.send(message), now)
        return True

    def fail(self, error: Exception, now: float) -> None:
        """Throw an error into the script, which may turn it into a result."""
        self._resume(lambda: self._script.throw(error), now)

    def _resume(self, step: Callable[[], Ask | Pause], now: float) -> None:
        self._ask = None
        if self._timer:
            self._timer.cancel()
        if self.call.cancelled():
            self._script.close()  # its `finally` runs now, on this thread, and not whenever it is garbage collected
            self._ended(self)
            return
        try:
            wanted = step()
        except StopIteration as end:
            self._end(partial(self.call.set_result, end.value))
        except Exception as error:  # including a bug in a script: it is the caller's, and must not stop the node
            self._end(partial(self.call.set_exception, error))
        else:
            if isinstance(wanted, Pause):
                self._timer = self._timers.at(now + wanted.seconds, self.go_on)
            else:
                self._ask, self._sent = wanted, 0
                self._transmit(now)

    def _end(self, settle: Callable[[], None]) -> None:
        self._ended(self)
        if self.call.set_running_or_notify_cancel():  # from here on it is too late to cancel it
            settle()

    def _transmit(self, now: float) -> None:
        ask = self._ask
        if ask is None:
            return
        # The last attempt gets its full wait, too: only the timer after it says that nobody answered.
        if self._sent == ask.attempts or self.call.cancelled():
            self.fail(ask.unanswered(), now)
            return
        self._sent += 1
        self._timer = self._timers.at(now + ask.wait, self._transmit)
        if ask.request is not None:
            self._send(ask.request)
