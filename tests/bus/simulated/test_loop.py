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
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import CheckDriveRequest, GotoXY, KalmanPositionRequest, StopDrive
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from tests.robot.nodes.harness import RED, Bench, as_if_started


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
    bench = Bench()
    bench.play(asyncio.sleep(10.1))
    # each boots up; the core's heartbeat comes every 250 ms, those of drive and navigation every second
    assert Counter(frame.cob_id for _, frame in bench.others) == {0x701: 1 + 40, 0x702: 1 + 10, 0x703: 1 + 10}


def test_waiting_for_gives_up_in_simulated_time_and_cancels_the_call() -> None:
    bench = Bench("drive", "navigation")

    async def main(core: Core) -> None:
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(core.position(), 0.7)

    bench.play(main(bench.core))
    assert bench.now == pytest.approx(0.71, abs=0.001)
    bench.run(5.0)
    assert len(bench.times(KalmanPositionRequest)) == 2  # at 0 and 0.5 s, none after the cancelling


def test_an_answer_in_time_is_the_result() -> None:
    bench = Bench()
    bench.configure()

    async def main(core: Core) -> Outcome:
        report = await asyncio.wait_for(core.goto(300, 1800, 0, 50), 10.0)
        return report.outcome

    assert bench.play(main(bench.core)) is Outcome.ARRIVED


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
    bench = Bench()
    bench.configure()

    async def main(core: Core) -> tuple[Any, ...]:
        return await asyncio.gather(core.goto(300, 1800, 0, 50), core.position(), core.check_nodes())

    report, position, checks = bench.play(main(bench.core))
    assert report.outcome is Outcome.ARRIVED
    assert position.x == 200
    assert set(checks) == {"drive", "navigation"}


def test_a_cancelled_task_cancels_its_call() -> None:
    bench = Bench("drive", "navigation")
    as_if_started(bench.core)

    async def main(core: Core) -> None:
        task = asyncio.ensure_future(_wait(core))
        await asyncio.sleep(0.2)
        task.cancel()
        await asyncio.sleep(5.0)
        assert task.cancelled()

    async def _wait(core: Core) -> None:
        await core.goto(1500, 1000, 90, 80)

    bench.play(main(bench.core))
    assert bench.messages()[:2] == [GotoXY(1500, 1000, 90, 80), StopDrive()]
    assert len(bench.sent(GotoXY)) == 1


def test_an_error_of_the_main_coroutine_comes_out() -> None:
    bench = Bench("drive")

    async def main(core: Core) -> None:
        await core.check_nodes()

    with pytest.raises(NoAnswer):
        bench.play(main(bench.core))
    assert len(bench.times(CheckDriveRequest)) == 10


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


def test_what_nobody_waits_for_any_more_leaves_nothing_behind() -> None:
    bench = Bench("drive", "navigation")

    async def main(core: Core) -> None:
        core.configure_start(*RED)
        await asyncio.sleep(0.1)

    bench.play(main(bench.core))
    bench.run(10.0)  # the call ends with nobody there to hear it
    assert bench.core.configuration is None


# Several buses on one clock


def robot(network: Simulation) -> Core:
    """Put a whole robot on a bus; return its core."""
    core = Core(dialects.load("core"))
    network.attach(core)
    network.attach(Drive(dialects.load("drive")), 0.03)
    network.attach(Navigation(dialects.load("navigation")), 0.05)
    return core


def test_two_robots_start_up_on_buses_of_their_own() -> None:
    networks = Simulation(), Simulation()
    clock = Several(*networks)
    cores = [robot(network) for network in networks]
    seen: list[tuple[int, float, Frame]] = []

    def observe(number: int, now: float, frame: Frame) -> None:
        seen.append((number, now, frame))

    for number, network in enumerate(networks):
        network.observers.append(partial(observe, number))

    async def play() -> list[float]:
        await asyncio.sleep(0.1)
        await asyncio.gather(*(core.check_nodes() for core in cores))
        return await asyncio.gather(*(core.configure_start(TeamColour.RED) for core in cores))

    assert all(0 < seconds < 0.01 for seconds in run(clock, play()))
    times = [now for _, now, _ in seen]
    assert times == sorted(times)
    assert {number for number, _, frame in seen if frame.cob_id == 0x2C0} == {0, 1}


def test_their_clocks_are_one() -> None:
    networks = Simulation(), Simulation()
    clock = Several(*networks)
    robot(networks[0])
    while clock.advance(0.5):
        assert networks[0].now == networks[1].now == clock.now
    assert clock.now == networks[0].now == networks[1].now == 0.5


def test_nothing_happens_on_empty_buses() -> None:
    clock = Several(Simulation(), Simulation())
    assert clock.next_event == inf
    assert not clock.advance(1.0)
    assert clock.now == 1.0
