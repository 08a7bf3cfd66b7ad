"""A listener that does not return: with real threads, the others go on and nobody misses or repeats a message."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from eurobot_od.gatekeeper import Event, Gatekeeper, Received
from eurobot_od.robot.messages import StopDrive
from eurobot_od.robot.protocol import EurobotProtocol

PROTOCOL = EurobotProtocol.load()
FRAME = PROTOCOL.encode(StopDrive())
PATIENCE = 10.0
"""Seconds after which a test that hangs fails."""


class Sticky:
    """A listener whose first call does not return before `release`; it notes what it heard and in which thread."""

    def __init__(self) -> None:
        self.entered, self.released = threading.Event(), threading.Event()
        self.heard: list[float] = []
        self.threads: list[threading.Thread] = []

    def __call__(self, _: object, timestamp: float) -> None:
        self.heard.append(timestamp)
        self.threads.append(threading.current_thread())
        self.entered.set()
        assert self.released.wait(PATIENCE)


class Stuck:
    """A gatekeeper with a reader thread that is stuck in the first of two functions, or of two nodes."""

    def __init__(self, register: Callable[[Gatekeeper, Sticky], object]) -> None:
        self.sticky, self.heard, self.went_on = Sticky(), list[float](), list[bool]()
        self.got: list[object] = []
        self.aside: list[Callable[[], None]] = []
        self.gatekeeper = Gatekeeper(PROTOCOL, aside=self.aside.append, slow_after=PATIENCE)
        self.queue = self.gatekeeper.add_queue(StopDrive)
        register(self.gatekeeper, self.sticky)
        self.gatekeeper.add_frames(lambda: (FRAME.cob_id,), lambda frame, _: self.got.append(frame))
        self.gatekeeper.add_function(StopDrive, self.hear)
        self.gatekeeper.start()
        self.reader = threading.Thread(target=lambda: self.went_on.append(self.gatekeeper.receive(FRAME, 1.0)))
        self.reader.start()
        assert self.sticky.entered.wait(PATIENCE)

    def hear(self, message: StopDrive, timestamp: float) -> None:
        self.got.append(message)
        self.heard.append(timestamp)

    def release(self) -> None:
        self.sticky.released.set()
        self.reader.join(PATIENCE)


REGISTER: dict[str, Callable[[Gatekeeper, Sticky], object]] = {
    "function": lambda gatekeeper, sticky: gatekeeper.add_function(StopDrive, sticky, "sticky"),
    "node": lambda gatekeeper, sticky: gatekeeper.add_frames(lambda: (FRAME.cob_id,), sticky, "sticky"),
}


@pytest.fixture(params=REGISTER.values(), ids=list(REGISTER))
def stuck(request: pytest.FixtureRequest) -> Iterator[Stuck]:
    stuck = Stuck(request.param)
    yield stuck
    stuck.release()


def test_the_watchdog_sees_which_listener_is_being_called(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    assert running.name == "sticky"
    stuck.release()
    assert stuck.gatekeeper.running() is None


def test_queues_and_nodes_do_not_wait_for_functions() -> None:
    stuck = Stuck(REGISTER["function"])
    assert (stuck.queue.drain(), stuck.got) == ([Received(StopDrive(), 1.0)], [FRAME])
    stuck.release()


def test_whoever_is_behind_gets_of_the_successor_what_it_listens_to(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.gatekeeper.take_over(running)
    assert (stuck.queue.drain(), stuck.got) == ([Received(StopDrive(), 1.0)], [FRAME, StopDrive()])


def test_the_successor_goes_on_with_the_other_listeners_and_later_frames(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    assert stuck.heard == []
    assert stuck.gatekeeper.take_over(running)
    assert stuck.heard == [1.0]
    assert stuck.gatekeeper.receive(FRAME, 2.0)
    assert stuck.heard == [1.0, 2.0]
    assert stuck.sticky.heard == [1.0]
    assert [(each.event, each.name) for each in stuck.gatekeeper.reports] == [(Event.LISTENER_STUCK, "sticky")]


def test_the_thread_that_was_stuck_catches_up_and_stops_receiving(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.gatekeeper.take_over(running)
    for timestamp in (2.0, 3.0):
        stuck.gatekeeper.receive(FRAME, timestamp)
    stuck.release()
    assert stuck.went_on == [False]
    assert stuck.sticky.heard == [1.0, 2.0, 3.0]
    assert set(stuck.sticky.threads) == {stuck.reader}
    assert stuck.heard == [1.0, 2.0, 3.0]
    assert stuck.aside == []


def test_a_call_that_has_returned_is_not_taken_over(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.release()
    assert not stuck.gatekeeper.take_over(running)
    assert (stuck.went_on, stuck.heard, list(stuck.gatekeeper.reports)) == ([True], [1.0], [])


def test_a_call_is_taken_over_once(stuck: Stuck) -> None:
    running = stuck.gatekeeper.running()
    assert running is not None
    assert stuck.gatekeeper.take_over(running)
    assert not stuck.gatekeeper.take_over(running)
    assert stuck.heard == [1.0]


def test_a_function_that_was_stuck_is_aside_from_then_on() -> None:
    stuck = Stuck(REGISTER["function"])
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.gatekeeper.take_over(running)
    stuck.release()
    stuck.gatekeeper.receive(FRAME, 2.0)
    assert stuck.sticky.heard == [1.0]
    stuck.aside[0]()
    assert stuck.sticky.heard == [1.0, 2.0]


def test_a_node_that_was_stuck_is_called_in_place_again() -> None:
    stuck = Stuck(REGISTER["node"])
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.gatekeeper.take_over(running)
    stuck.release()
    stuck.gatekeeper.receive(FRAME, 2.0)
    assert stuck.sticky.heard == [1.0, 2.0]


def test_a_listener_that_was_slow_before_it_was_stuck_catches_up_in_one_thread() -> None:
    sticky, went_on = Sticky(), list[bool]()
    gatekeeper = Gatekeeper(PROTOCOL, slow_after=-1.0)  # every call is slow
    gatekeeper.add_function(StopDrive, sticky)
    gatekeeper.start()
    sticky.released.set()
    gatekeeper.receive(FRAME, 1.0)
    sticky.released.clear()
    sticky.entered.clear()
    reader = threading.Thread(target=lambda: went_on.append(gatekeeper.receive(FRAME, 2.0)))
    reader.start()
    assert sticky.entered.wait(PATIENCE)
    running = gatekeeper.running()
    assert running is not None
    assert gatekeeper.take_over(running)
    gatekeeper.receive(FRAME, 3.0)
    assert sticky.heard == [1.0, 2.0]
    sticky.released.set()
    reader.join(PATIENCE)
    gatekeeper.receive(FRAME, 4.0)
    this = threading.current_thread()
    assert (went_on, sticky.heard, sticky.threads) == ([False], [1.0, 2.0, 3.0, 4.0], [this, reader, reader, this])


def test_the_successor_can_be_stuck_as_well() -> None:
    gatekeeper = Gatekeeper(PROTOCOL, slow_after=PATIENCE)
    sticky = [Sticky(), Sticky()]
    heard: list[float] = []
    for number, each in enumerate(sticky):
        gatekeeper.add_function(StopDrive, each, f"sticky {number}")
    gatekeeper.add_function(StopDrive, lambda _, timestamp: heard.append(timestamp))
    gatekeeper.start()
    went_on: list[bool] = []

    def in_thread(step: Callable[[], bool]) -> threading.Thread:
        thread = threading.Thread(target=lambda: went_on.append(step()))
        thread.start()
        return thread

    def take_over() -> bool:
        running = gatekeeper.running()
        assert running is not None
        return gatekeeper.take_over(running)

    threads = [in_thread(lambda: gatekeeper.receive(FRAME, 1.0))]
    assert sticky[0].entered.wait(PATIENCE)
    threads.append(in_thread(take_over))
    assert sticky[1].entered.wait(PATIENCE)
    assert take_over()
    assert heard == [1.0]
    for each in sticky:
        each.released.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert went_on == [False, False]


@pytest.mark.parametrize("attempt", range(50))
def test_whoever_is_first_every_listener_hears_every_message_once(attempt: int) -> None:
    stuck = Stuck(REGISTER["function"])
    running = stuck.gatekeeper.running()
    assert running is not None
    stuck.sticky.released.set()
    for _ in range(attempt * 5):
        stuck.gatekeeper.statistics()  # a little later each time
    taken = stuck.gatekeeper.take_over(running)
    stuck.reader.join(PATIENCE)
    assert stuck.gatekeeper.receive(FRAME, 2.0)
    for work in stuck.aside:
        work()
    assert stuck.went_on == [not taken]
    assert stuck.sticky.heard == stuck.heard == [1.0, 2.0]
