"""The event loop on the bus's clock: sleeping, waiting, giving up, and coming to an end."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from functools import partial
from math import inf
from typing import Any

import pytest

from eurobot_od.bus.simulated.loop import NothingHappens, Several, run
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from tests.kit import lift
from tests.kit.bench import Lift
from tests.kit.lift import (
    OFFICE,
    Cabin,
    CheckCabinRequest,
    Configure,
    ConfigureConfirm,
    Door,
    Halt,
    MoveTo,
    Panel,
    PlaceRequest,
    PlaceResponse,
    Ride,
)

UP = MoveTo(300, Ride.NORMAL, 50)


def test_sleeping_takes_simulated_time_only() -> None:
    network = Simulation()

    async def sleep() -> float:
        await asyncio.sleep(86_400)
        return asyncio.get_running_loop().time()

    assert run(network, sleep()) == pytest.approx(86_400)
    assert network.now == pytest.approx(86_400)


def test_sleepers_wake_in_the_order_of_their_times() -> None:
    woken: list[str] = []

    async def sleeper(name: str, *seconds: float) -> None:
        for each in seconds:
            await asyncio.sleep(each)
            woken.append(name)

    async def main() -> None:
        await asyncio.gather(sleeper("a", 3.0), sleeper("b", 1.0, 1.0, 2.0), sleeper("c", 2.5))

    run(Simulation(), main())
    assert woken == ["b", "b", "c", "a", "b"]


def test_a_second_run_goes_on_where_the_first_ended() -> None:
    network = Simulation()
    run(network, asyncio.sleep(1.0))
    run(network, asyncio.sleep(2.0))
    assert network.now == pytest.approx(3.0)


def test_the_bus_lives_while_tasks_sleep() -> None:
    bench = Lift()
    bench.play(asyncio.sleep(10.1))
    # each boots up; the panel's heartbeat comes every 250 ms, those of the others every second
    assert Counter(frame.cob_id for _, frame in bench.others) == {0x701: 1 + 40, 0x702: 1 + 10, 0x703: 1 + 10}


def test_waiting_for_gives_up_in_simulated_time_and_cancels_the_call() -> None:
    bench = Lift("cabin", "door")

    async def main(panel: Panel) -> None:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(panel.ask(PlaceRequest(), PlaceResponse), 1.5)

    bench.play(main(bench.panel))
    assert bench.now == pytest.approx(1.51, abs=0.001)
    bench.run(5.0)
    assert len(bench.times(PlaceRequest)) == 2  # at 0 and 1 s, none after the cancelling


def test_an_answer_in_time_is_the_result() -> None:
    bench = Lift()

    async def main(panel: Panel) -> None:
        await asyncio.wait_for(panel.move(UP), 10.0)

    bench.play(main(bench.panel))
    assert bench.cabin.height == UP.height


def test_a_future_that_an_event_settles_wakes_who_awaits_it_before_the_next_event() -> None:
    network = Simulation()

    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        first, second = loop.create_future(), loop.create_future()
        for time, future in ((1.0, first), (2.0, second)):
            network.plan(time, partial(future.set_result, None))  # directly, as Python 3.14 passes a result on
        return [await first or loop.time(), await second or loop.time()]

    assert run(network, main()) == [1.0, 2.0]


def test_calls_run_side_by_side() -> None:
    bench = Lift()

    async def main(panel: Panel) -> tuple[Any, ...]:
        return await asyncio.gather(panel.move(UP), panel.ask(PlaceRequest(), PlaceResponse), panel.check())

    _, place, there = bench.play(main(bench.panel))
    assert bench.cabin.height == UP.height
    assert place.height == 0
    assert there == ["cabin", "door"]


def test_a_cancelled_task_cancels_its_call() -> None:
    bench = Lift("cabin", "door")

    async def main(panel: Panel) -> None:
        task = asyncio.ensure_future(_wait(panel))
        await asyncio.sleep(0.2)
        task.cancel()
        await asyncio.sleep(5.0)
        assert task.cancelled()

    async def _wait(panel: Panel) -> None:
        await panel.move(UP)

    bench.play(main(bench.panel))
    assert bench.messages()[:2] == [UP, Halt()]
    assert len(bench.sent(MoveTo)) == 1


def test_an_error_of_the_main_coroutine_comes_out() -> None:
    bench = Lift("cabin")

    async def main(panel: Panel) -> None:
        await panel.check()

    with pytest.raises(NoAnswer):
        bench.play(main(bench.panel))
    assert len(bench.times(CheckCabinRequest)) == 10


def test_waiting_for_what_never_happens_is_an_error() -> None:
    async def main() -> None:
        await asyncio.get_running_loop().create_future()

    with pytest.raises(NothingHappens):
        run(Simulation(), main())


def test_another_thread_can_wake_a_task() -> None:
    network = Simulation()

    async def main() -> str:
        loop = asyncio.get_running_loop()
        future: asyncio.Future[str] = loop.create_future()
        thread = threading.Thread(target=lambda: loop.call_soon_threadsafe(future.set_result, "woken"))
        thread.start()
        thread.join()
        return await future

    assert run(network, main()) == "woken"


@pytest.mark.parametrize("fails", [False, True])
def test_tasks_left_over_are_cancelled_at_the_end(fails: bool) -> None:
    ended: list[str] = []

    async def background() -> None:
        try:
            await asyncio.sleep(1000)
        finally:
            ended.append("background")

    async def main() -> None:
        task = asyncio.ensure_future(background())
        await asyncio.sleep(1.0)
        assert not task.done()
        if fails:
            raise ValueError("main has failed")

    if fails:
        with pytest.raises(ValueError, match="main has failed"):
            run(Simulation(), main())
    else:
        run(Simulation(), main())
    assert ended == ["background"]


def test_cancelled_waits_leave_nothing_behind() -> None:
    bench = Lift("cabin", "door")

    async def main(panel: Panel) -> None:
        call = panel.ask(OFFICE, ConfigureConfirm)
        await asyncio.sleep(0.1)
        assert not call.done()

    bench.play(main(bench.panel))
    bench.run(10.0)  # the call ends with nobody there to hear it
    assert len(bench.sent(Configure)) == 10


# Several buses on one clock


def attached(network: Simulation) -> Panel:
    """Put the whole lift on a bus; return its panel."""
    panel = Panel(lift.dictionary("panel"))
    network.attach(panel)
    network.attach(Cabin(lift.dictionary("cabin")), 0.03)
    network.attach(Door(lift.dictionary("door")), 0.05)
    return panel


def test_two_lifts_have_buses_of_their_own() -> None:
    networks = Simulation(), Simulation()
    clock = Several(*networks)
    panels = [attached(network) for network in networks]
    seen: list[tuple[int, float, Frame]] = []

    def observe(number: int, now: float, frame: Frame) -> None:
        seen.append((number, now, frame))

    for number, network in enumerate(networks):
        network.observers.append(partial(observe, number))

    async def play() -> list[list[str]]:
        await asyncio.sleep(0.1)
        return await asyncio.gather(*(panel.check() for panel in panels))

    assert run(clock, play()) == [["cabin", "door"]] * 2
    assert 0.1 < clock.now < 0.11
    times = [now for _, now, _ in seen]
    assert times == sorted(times)
    assert {number for number, _, frame in seen if frame.cob_id == 0x3C5} == {0, 1}


def test_their_clocks_are_one() -> None:
    networks = Simulation(), Simulation()
    clock = Several(*networks)
    attached(networks[0])
    while clock.advance(0.5):
        assert networks[0].now == networks[1].now == clock.now
    assert clock.now == networks[0].now == networks[1].now == 0.5


def test_empty_buses_have_no_events() -> None:
    clock = Several(Simulation(), Simulation())
    assert clock.next_event == inf
    assert not clock.advance(1.0)
    assert clock.now == 1.0
