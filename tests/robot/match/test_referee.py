"""The referee: startup, match, mushroom and end around any strategy; one that fails leaves the robot standing."""

from __future__ import annotations

import asyncio
import os
import threading
from contextlib import suppress
from dataclasses import replace

import pytest

from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.errors import RemoteError, StateError
from eurobot_od.plugin import Plugins
from eurobot_od.robot.match import EventKind, MatchEvent, MatchOptions, Summary
from eurobot_od.robot.match import strategy as shipped
from eurobot_od.robot.match.referee import Strategy
from eurobot_od.robot.match.stage import play_simulated
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.robot.world import World
from tests.rows import rows

ALONE = MatchOptions(enemies=0, confederates=0, duration=8.0, falling=False)
FAR = (1500, 1300, 0, 50)


def play(strategy: Strategy, options: MatchOptions = ALONE) -> tuple[list[MatchEvent], Summary, World]:
    events: list[MatchEvent] = []
    summary, world = play_simulated(options, events.append, lambda _time, _frame: None, strategy=strategy)
    return events, summary, world


def kinds(events: list[MatchEvent]) -> list[EventKind]:
    return [event.kind for event in events]


def stands(world: World) -> bool:
    """Return whether the robot has not moved in the last second."""
    vehicle = world.vehicle()
    return vehicle.pose(Source.INTERNAL) == vehicle.pose(Source.INTERNAL, 0.5)


async def wait(_: Core) -> None:
    """Do nothing, for ever."""
    await asyncio.Event().wait()


async def nothing(_: Core) -> None:
    """Do nothing, and end."""


@pytest.mark.parametrize("strategy", [wait, nothing])
def test_a_match_lasts_its_time_whatever_the_strategy_does(strategy: Strategy) -> None:
    events, summary, _ = play(strategy)
    assert kinds(events) == [
        EventKind.START,
        EventKind.CHECK,
        EventKind.CONFIGURE,
        EventKind.POSITION,
        EventKind.MATCH,
        EventKind.STOP,
        EventKind.END,
    ]
    assert events[-2].time - events[4].time == pytest.approx(8.0, abs=0.1)
    assert summary.failure is None


def test_a_goto_at_the_end_is_stopped_and_the_strategy_is_cancelled() -> None:
    seen: list[str] = []

    async def drive(core: Core) -> None:
        await asyncio.sleep(6.5)
        try:
            await core.goto(*FAR)
        except asyncio.CancelledError:
            seen.append("cancelled")
            raise

    events, _, world = play(drive)
    assert seen == ["cancelled"]
    assert stands(world)
    given_up = next(event for event in events if event.kind is EventKind.GIVEN_UP)
    assert given_up.data["why"] == "the match is over"


def test_actions_of_a_strategy_are_reported() -> None:
    async def one_task(core: Core) -> None:
        await core.goto(1400, 1800, 90, 80)
        await core.act("frescos")

    events, summary, _ = play(one_task)
    told = [event for event in events if event.kind in (EventKind.GOTO, EventKind.ARRIVED, EventKind.TASK)]
    assert kinds(told) == [EventKind.GOTO, EventKind.ARRIVED, EventKind.TASK]
    assert told[1].data["error"] < 20
    assert told[2].data == {"task": "frescos", "gain": summary.points["ours"]}
    assert summary.errors == [pytest.approx(told[1].data["error"], abs=0.05)]


# A strategy that fails


async def fail_at_once(_: Core) -> None:
    raise ZeroDivisionError("by zero")


async def fail_under_way(core: Core) -> None:
    call = core.goto(*FAR)
    await asyncio.sleep(1.5)
    raise ZeroDivisionError(f"{call.done()} is no number")


@pytest.mark.parametrize("strategy", [fail_at_once, fail_under_way])
def test_an_exception_ends_the_match_with_the_robot_standing(strategy: Strategy) -> None:
    events, summary, world = play(strategy)
    failed = next(event for event in events if event.kind is EventKind.FAILED)
    assert failed.text.startswith("the strategy raised ZeroDivisionError: ")
    assert summary.failure is not None
    assert summary.failure.splitlines()[-1].startswith("ZeroDivisionError: ")
    assert "test_referee.py" in summary.failure
    assert events[-1].kind is EventKind.END
    assert events[-1].data["moved"] == 0
    assert stands(world)


# The mushroom


def broken(*_: object) -> None:
    raise ValueError("broken")


async def break_later(core: Core) -> None:
    await core.goto(600, 1700, 90, 60)
    broken()


async def in_a_task(core: Core) -> None:
    task = asyncio.ensure_future(break_later(core))
    await asyncio.sleep(5.0)
    assert task.done()


async def in_a_task_that_it_keeps(core: Core) -> None:
    task = asyncio.ensure_future(break_later(core))
    await asyncio.Event().wait()
    await task


async def in_a_thread(core: Core) -> None:
    await core.goto(600, 1700, 90, 60)
    thread = threading.Thread(target=broken)
    thread.start()
    thread.join()
    await asyncio.Event().wait()


async def by_an_exit(core: Core) -> None:
    await core.goto(600, 1700, 90, 60)
    os._exit(0)


@pytest.mark.parametrize(
    ("strategy", "said"),
    [
        (in_a_task, "ValueError: broken"),
        (in_a_task_that_it_keeps, "ValueError: broken"),
        (in_a_thread, "ValueError: broken"),
        (by_an_exit, "os._exit(0) ends the whole program: write `return`"),
    ],
)
def test_a_strategy_that_fails_elsewhere_is_a_failed_match(strategy: Strategy, said: str) -> None:
    before = threading.excepthook, os._exit
    events, summary, world = play(strategy)
    assert summary.failure is not None
    assert summary.failure.endswith(said)
    assert f'File "{__file__}", line ' in summary.failure
    assert [each for each in kinds(events) if each is EventKind.FAILED] == [EventKind.FAILED]
    assert events[-1].kind is EventKind.END
    assert stands(world)
    assert (threading.excepthook, os._exit) == before


async def until_refused(core: Core) -> None:
    async def drive() -> None:
        while True:
            await core.goto(600, 1700, 90, 60)
            await core.goto(900, 1700, 90, 60)

    asyncio.ensure_future(drive())  # noqa: RUF006 (nobody awaits it)
    await asyncio.Event().wait()


def test_a_task_that_goes_on_until_the_match_is_over_has_not_failed() -> None:
    _, summary, _ = play(until_refused)
    assert summary.failure is None


async def handles_it_later(core: Core) -> None:
    task = asyncio.ensure_future(break_later(core))
    await asyncio.sleep(4.0)
    with suppress(ValueError):
        await task
    await asyncio.gather(break_later(core), return_exceptions=True)


def test_a_task_whose_error_is_handled_later_has_not_failed() -> None:
    _, summary, _ = play(handles_it_later)
    assert summary.failure is None


def test_a_core_that_does_not_end_the_match_is_a_failed_match() -> None:
    events, summary, world = play(wait, replace(ALONE, faults=("match-without-end",)))
    assert summary.failure == "the core does not end the match"
    assert events[-1].time < 13.0
    assert stands(world)


def test_the_emergency_mushroom_ends_gotos_tasks_and_strategy() -> None:
    events, summary, world = play(to_and_fro, replace(ALONE, emergency_at=4.0))
    emergency = next(event for event in events if event.kind is EventKind.EMERGENCY)
    assert emergency.time - events[4].time == pytest.approx(4.0, abs=0.001)
    later = [event for event in events if event.time > emergency.time]
    assert EventKind.GOTO not in kinds(later)
    assert summary.frames["Emergency Shutdown"] >= 1
    assert events[-1].data["moved"] == 0
    assert stands(world)


async def to_and_fro(core: Core) -> None:
    """Drive from place to place, for ever."""
    while True:
        await core.goto(*FAR)
        await core.goto(500, 1700, 0, 50)


@pytest.mark.long
@rows("name", [name for name in Plugins(ROBOT).fault_names() if name not in DRIVE_FAULTS])
def test_a_match_with_any_fault_has_an_end(name: str) -> None:
    """Some faults block the start: then NoAnswer, or another error, says so."""
    with suppress(RemoteError, StateError):
        events, *_ = play(shipped.play, replace(ALONE, enemies=2, confederates=1, faults=(name,)))
        assert events[-1].kind is EventKind.END
        assert events[-1].time < 60.0
