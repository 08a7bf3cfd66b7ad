"""The thread of functions: order, a call that does not return, calls that find no room, and the end."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from eurobot_od.bus.live.reader import STUCK_AFTER, FunctionThread
from eurobot_od.controller import Event, FunctionListener, Report

LONG = 60.0
"""Timeout of a test, in s; what it waits for comes at once."""


class Scene:
    """A thread of functions with a clock that stands, and two functions: one that waits, one that hears."""

    def __init__(self) -> None:
        self.now = 0.0
        self.reports: list[Report] = []
        self.entered, self.release = threading.Event(), threading.Event()
        self.heard: SimpleQueue[tuple[object, threading.Thread]] = SimpleQueue()
        self.waits = self.listener("waits", self._wait)
        self.hears = self.listener("hears", lambda message, _: self.heard.put((message, threading.current_thread())))
        self.thread = FunctionThread("functions", self.reports.append, lambda: self.now, backlog=3)
        self.thread.start()

    def listener(self, name: str, function: object) -> FunctionListener[object]:
        return FunctionListener(name, function, self.reports.append, lambda: 0.0, 1.0)  # type: ignore[arg-type]

    def _wait(self, *_: object) -> None:
        self.entered.set()
        assert self.release.wait(LONG)

    def hang(self) -> None:
        """Make the thread hang in a function."""
        self.thread.submit(self.waits, "wait", 0.0)
        assert self.entered.wait(LONG)

    def hear(self, count: int) -> list[object]:
        return [self.heard.get(timeout=LONG)[0] for _ in range(count)]


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene()
    yield scene
    scene.release.set()
    scene.thread.stop()


def test_functions_are_called_in_one_other_thread_in_the_order_submitted(scene: Scene) -> None:
    for number in range(3):
        scene.thread.submit(scene.hears, number, 0.0)
    calls = [scene.heard.get(timeout=LONG) for _ in range(3)]
    assert [message for message, _ in calls] == [0, 1, 2]
    [thread] = {thread for _, thread in calls}
    assert thread is not threading.current_thread()


def test_a_function_that_hangs_makes_others_later(scene: Scene) -> None:
    scene.hang()
    scene.thread.submit(scene.hears, "late", 0.0)
    assert scene.heard.empty()
    scene.release.set()
    assert scene.hear(1) == ["late"]


def test_a_function_that_hangs_is_reported_once(scene: Scene) -> None:
    scene.thread.watch()
    scene.hang()
    scene.now = STUCK_AFTER
    scene.thread.watch()
    assert scene.reports == []
    scene.now = STUCK_AFTER + 0.001
    scene.thread.watch()
    scene.thread.watch()
    assert [str(each) for each in scene.reports] == [
        "listener stuck: waits: does not return; other functions wait for it, nodes and queues do not"
    ]


def test_each_call_that_hangs_is_reported(scene: Scene) -> None:
    for _ in range(2):
        scene.hang()
        scene.now += 1.0
        scene.thread.watch()
        scene.thread.submit(scene.hears, "between", 0.0)
        scene.release.set()
        scene.hear(1)
        scene.entered.clear()
        scene.release.clear()
    assert [(each.event, each.name) for each in scene.reports] == [(Event.LISTENER_STUCK, "waits")] * 2


def test_when_too_many_calls_wait_the_oldest_are_lost_counted_and_reported(scene: Scene) -> None:
    scene.hang()
    for number in range(6):
        scene.thread.submit(scene.hears, number, float(number))
    scene.release.set()
    assert scene.hear(3) == [3, 4, 5]
    assert scene.hears.statistics().lost == 3
    assert [(each.event, each.name, each.timestamp) for each in scene.reports] == [
        (Event.QUEUE_OVERFLOW, "hears", 0.0),
        (Event.QUEUE_OVERFLOW, "hears", 1.0),
    ]
    assert str(scene.reports[0]).endswith("too many calls wait, 1 message lost so far; the newest are kept")


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    "leave", [lambda *_: sys.exit(), interrupted, lambda *_: 1 / 0], ids=["exit", "interrupt", "error"]
)
def test_a_function_that_raises_is_reported_and_ends_no_other(scene: Scene, leave: object) -> None:
    scene.thread.submit(scene.listener("leaves", leave), 0, 0.0)
    scene.thread.submit(scene.hears, "still here", 0.0)
    assert scene.hear(1) == ["still here"]
    assert [(each.event, each.name) for each in scene.reports] == [(Event.LISTENER_FAILED, "leaves")]


def test_at_the_end_what_was_submitted_is_called(scene: Scene) -> None:
    for number in range(3):
        scene.thread.submit(scene.hears, number, 0.0)
    scene.thread.stop()
    assert scene.hear(3) == [0, 1, 2]
    assert scene.hears.statistics().lost == 0


def test_the_end_does_not_wait_for_a_function_that_hangs_and_counts_what_is_lost(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.bus.live.reader.PATIENCE", 0.01)
    scene.hang()
    scene.thread.submit(scene.hears, "too late", 0.0)
    scene.thread.stop()
    assert (scene.release.is_set(), scene.hears.lost, scene.reports) == (False, 1, [])


def test_a_function_may_end_the_thread_it_runs_in(scene: Scene) -> None:
    def end(*_: object) -> None:
        scene.thread.stop()
        scene.release.set()

    scene.thread.submit(scene.listener("ends", end), 0, 0.0)
    assert scene.release.wait(LONG)
    assert scene.reports == []
