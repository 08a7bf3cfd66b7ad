"""The time from a request to its answer between two live nodes, compared with bare python-can.

The peer is an echo between two Notifiers. Both sides are in one process on one in-process bus; a round's figures are
those of its echoes.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import partial
from itertools import count, takewhile
from statistics import fmean, median

import can

from bench.measure import SELDOM, Claim, Contender, Figures, NotHere, Quantity, Scale, Series, Way, Wrong
from bench.shared import new_bus, new_channel, protocol
from eurobot_od.bus.live import Live
from eurobot_od.robot import dialects
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model.messages import CheckDriveRequest, CheckDriveResponse
from eurobot_od.robot.nodes import ROLES

PATIENCE = 5.0
"""Longest wait for an answer, in seconds."""

SHORT_INTERVAL = 0.0005
"""Python's switch interval in seconds for this row, in place of 0.005."""


class Answer:
    """Waits for the answer, and has its time, taken in the thread that receives it."""

    def __init__(self) -> None:
        self._came = threading.Event()
        self._time = 0.0

    def __call__(self, *_: object) -> None:
        self._time = time.perf_counter()
        self._came.set()

    def after(self, ask: Callable[[], None]) -> float:
        """Ask, and return the seconds until the answer came; raises Wrong if none came."""
        self._came.clear()
        begin = time.perf_counter()
        ask()
        if not self._came.wait(PATIENCE):
            raise Wrong(f"no answer within {PATIENCE:g} s")
        return self._time - begin


Answering = Callable[[can.BusABC], Live]
"""Makes the node, on a bus, that answers a Check Drive Request."""


def drive(bus: can.BusABC) -> Live:
    """Return our whole drive, a CANopen device with its object dictionary, as the side that answers."""
    return Live.node(bus, ROLES["drive"](dialects.load("drive")))


def function(bus: can.BusABC) -> Live:
    """Return a function in the thread of functions as the side that answers the typed message."""
    keeper = Gatekeeper(protocol())
    answering = Live(bus, keeper)
    keeper.add_function(CheckDriveRequest, lambda *_: answering.send(CheckDriveResponse()))
    return answering


@contextmanager
def ours(answering: Answering) -> Iterator[Callable[[], float]]:
    """Yield the function that sends a typed message and waits for the answer.

    The answer is received in the thread that reads the bus, like a Notifier's.
    """
    channel = new_channel()
    answer = Answer()
    keeper = Gatekeeper(protocol())
    keeper.add_node(lambda: (protocol().cob_id(CheckDriveResponse),), answer, "answer")
    with answering(new_bus(channel)), Live(new_bus(channel), keeper) as asking:
        yield lambda: answer.after(lambda: asking.send(CheckDriveRequest()))


@contextmanager
def notifiers() -> Iterator[Callable[[], float]]:
    """Yield the function that asks a bare Notifier, whose listener answers at once."""
    channel = new_channel()
    answer = Answer()
    request, response = (
        can.Message(arbitration_id=protocol().cob_id(each), data=b"", is_extended_id=False)
        for each in (CheckDriveRequest, CheckDriveResponse)
    )
    with ExitStack() as stack:
        answering, asking = (stack.enter_context(new_bus(channel)) for _ in range(2))
        stack.enter_context(can.Notifier(answering, [lambda _: answering.send(response)], timeout=0.1))
        stack.enter_context(can.Notifier(asking, [answer], timeout=0.1))
        yield lambda: answer.after(lambda: asking.send(request))


@contextmanager
def busy() -> Iterator[None]:
    """Run a second thread that computes without a pause."""
    ended = False

    def compute() -> None:
        while not ended:
            sum(range(100))

    thread = threading.Thread(target=compute, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended = True
        thread.join()


@contextmanager
def busy_but_fair() -> Iterator[None]:
    """Run a second thread that computes, with a shorter switch interval."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(SHORT_INTERVAL)
    try:
        with busy():
            yield
    finally:
        sys.setswitchinterval(interval)


@contextmanager
def on_one_cpu() -> Iterator[None]:
    """Restrict all threads that are started meanwhile to one processor."""
    if not hasattr(os, "sched_setaffinity"):
        raise NotHere("this system does not let a thread choose its processor")
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


Side = Callable[[], AbstractContextManager[Callable[[], float]]]
Beside = Callable[[], AbstractContextManager[None]]


def echoes(side: Side, beside: Beside, seconds: float) -> Figures:
    """Measure echoes for some seconds; median and mean differ where one echo in a hundred has to wait."""
    with beside(), side() as echo:
        echo()
        end = time.perf_counter() + seconds
        times = [echo(), *takewhile(lambda _: time.perf_counter() < end, (echo() for _ in count()))]
    return {Quantity.TIME: median(times), Quantity.MEAN: fmean(times)}


SIDES: dict[str, Side] = {
    "drive": partial(ours, drive),
    "function": partial(ours, function),
    "notifiers": notifiers,
}


@contextmanager
def opened(beside: Beside, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield all sides as contenders."""
    seconds = scale.of(400, 10) / 1000
    yield {name: partial(echoes, side, beside, seconds) for name, side in SIDES.items()}


def _claim(name: str, ours: str, wanted: float | None = None, quantity: Quantity = Quantity.TIME) -> Claim:
    return Claim(f"{name}: bare Notifiers", ours, "notifiers", Way.RATIO, wanted, quantity)


def _medians(prefix: str, wanted: float | None) -> tuple[Claim, ...]:
    return (
        _claim(f"{prefix}answer of a whole drive, median", "drive", wanted),
        _claim(f"{prefix}answer of a function in its own thread, median", "function"),
    )


def _reported(name: str, beside: Beside) -> Series:
    claims = _claim(f"{name}, median", "drive"), _claim(f"{name}, mean", "drive", quantity=Quantity.MEAN)
    return Series("echo", name, partial(opened, beside), claims, SELDOM)


SERIES = (
    Series("echo", "request to answer", partial(opened, nullcontext), _medians("", 1.5), often=3),
    Series("echo", "all threads on one CPU", partial(opened, on_one_cpu), _medians("on one CPU: ", None), SELDOM),
    _reported("beside a busy thread", busy),
    _reported("busy thread, switch interval 0.5 ms", busy_but_fair),
)
