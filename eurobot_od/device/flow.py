"""Flows: what a node does over time, written as a generator that asks, waits and returns a result.

Theory of operation. A handshake with retries is easiest to read as a sequence: ask, wait for the answer, ask again,
give up. Written as a thread it would block, written as callbacks it would be torn apart; as a generator, the script, it
is a sequence that stops at each `yield` and holds no thread while it waits:

    script: yield Ask(request, answer, 0.5, 6)      the flow sends the request, and sets a timer for 0.5 s
        the answer is heard                         the script goes on with it
        the timer is due                            the request is sent again; after the sixth, NoAnswer is thrown in
    script: yield Pause(0.2)                        the flow sets a timer; when it is due, the script goes on
    script: return result                           the call gets its result; the node forgets the flow

There is no clock, no bus and no thread in here. Two things resume a script: `heard`, which the node calls with each
message that it receives, and the node's timers. Both happen inside the node's `receive` and `tick`, so on whatever
thread runs the node, and one at a time. `fail` throws an error in from outside, under the node's guard, for a flow that
is to end early.

The `Call` is the other side. It belongs to whoever asked for the result, on any thread and in any event loop: they
await it, wait for it, or cancel it. That is all they can do, and the only thing that crosses threads: cancelling does
not touch the script, but is noticed at its next step, which then closes it. A repeated request is such a step, so
nothing is sent for a caller who has gone; `drop` is one that a node takes as soon as it knows.

Every script yields `START` first. The flow runs it up to there when it is made, on the caller's thread, without having
done anything; the first real step is the node's, with the node's time. From START on, the script is inside its `try`
and can be made to end as at any later place.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Generator
from concurrent.futures import Future
from functools import partial
from inspect import GEN_CLOSED, getgeneratorstate
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

from eurobot_od.device.timers import Timer, Timers
from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.pdo.message import Message

Result = TypeVar("Result")


class Ask(NamedTuple):
    """Send `request` up to `attempts` times, `wait` seconds apart, until the `answer` comes.

    The answer to a message is a message type, that to a frame a COB-ID.
    """

    request: Message | Frame
    answer: type[Message] | int
    wait: float
    attempts: int

    def fits(self, heard: Message | Frame) -> bool:
        """Tell whether this is the answer."""
        if isinstance(heard, Frame):
            return heard.cob_id == self.answer
        return not isinstance(self.answer, int) and isinstance(heard, self.answer)

    def unanswered(self) -> NoAnswer:
        """Return the error for a request that nobody has answered."""
        request = str(self.request) if isinstance(self.request, Frame) else type(self.request).__name__
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
        """Tell whether the call has ended."""
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

    def start(self, now: float) -> None:
        """Run the script from its START to its first Ask or Pause, unless it has been ended before."""
        if getgeneratorstate(self._script) != GEN_CLOSED:
            self._go_on(now)

    def heard(self, message: Message | Frame, now: float) -> bool:
        """Take in a received message or SDO answer; return whether it was the answer that the flow waits for."""
        if self._ask is None or not self._ask.fits(message):
            return False
        self._resume(lambda: self._script.send(message), now)
        return True

    def fail(self, error: Exception, now: float) -> None:
        """Throw an error into the script, which may turn it into a result."""
        self._resume(lambda: self._script.throw(error), now)

    def drop(self, now: float) -> None:
        """End the script of a call that was cancelled, unless it has ended."""
        if getgeneratorstate(self._script) != GEN_CLOSED:
            self._resume(lambda: self._script.send(now), now)

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
                self._timer = self._timers.at(now + wanted.seconds, self._go_on)
            else:
                self._ask, self._sent = wanted, 0
                self._transmit(now)

    def _end(self, settle: Callable[[], None]) -> None:
        self._ended(self)
        if self.call.set_running_or_notify_cancel():  # from here on it is too late to cancel it
            settle()

    def _go_on(self, now: float) -> None:
        self._resume(lambda: self._script.send(now), now)

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
        self._send(ask.request)
