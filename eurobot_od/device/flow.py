"""Flows: what a node does over time, written as a generator that asks, waits and returns a result.

Rule of this file: no clock, no bus, no thread. A flow yields an `Ask` or a `Pause` and is resumed with the answer;
the node that runs it sends the frames and tells the time. Its `Call` is the caller's side: it can be awaited in any
asyncio loop and waited for from another thread.
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
        """Return the error that nobody answered."""
        request = str(self.request) if isinstance(self.request, Frame) else type(self.request).__name__
        answer = f"0x{self.answer:03X}" if isinstance(self.answer, int) else self.answer.__name__
        return NoAnswer(request, answer, self.attempts, self.wait)


class Pause(NamedTuple):
    """Do nothing for `seconds`."""

    seconds: float


START = Pause(0.0)
"""What every script yields first: it is resumed with the time, and from there on it can be made to end."""


Script: TypeAlias = Generator[Ask | Pause, Any, Result]
"""A flow's generator: resumed with the answer (Ask) or the time (Pause); NoAnswer is thrown into it."""


class Call(Future[Result], Generic[Result]):
    """The result of a flow, to come: `await` it in asyncio, or `result(timeout)` from another thread."""

    def __await__(self) -> Generator[Any, None, Result]:
        return asyncio.wrap_future(self).__await__()


class Flow(Generic[Result]):
    """One running script; `send` puts a message on the bus, `ended` is called once with the flow."""

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
        next(script)

    def start(self, now: float) -> None:
        """Run the script from its START to its first Ask or Pause, unless it was made to end before."""
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
            self._script.close()
            self._ended(self)
            return
        try:
            wanted = step()
        except StopIteration as end:
            self._end(partial(self.call.set_result, end.value))
        except Exception as error:
            self._end(partial(self.call.set_exception, error))
        else:
            self._await(wanted, now)

    def _end(self, settle: Callable[[], None]) -> None:
        self._ended(self)
        if self.call.set_running_or_notify_cancel():  # from here on nobody can cancel it any more
            settle()

    def _await(self, wanted: Ask | Pause, now: float) -> None:
        if isinstance(wanted, Pause):
            self._timer = self._timers.at(now + wanted.seconds, self._paused)
            return
        self._ask, self._sent = wanted, 0
        self._transmit(now)

    def _paused(self, now: float) -> None:
        self._resume(lambda: self._script.send(now), now)

    def _transmit(self, now: float) -> None:
        ask = self._ask
        if ask is None:
            return
        if self._sent == ask.attempts or self.call.cancelled():
            self.fail(ask.unanswered(), now)
            return
        self._sent += 1
        self._timer = self._timers.at(now + ask.wait, self._transmit)
        self._send(ask.request)
