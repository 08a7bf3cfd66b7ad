"""Several buses on one clock: none is ever ahead, each has its own frames, and a loop runs on all of them."""

from __future__ import annotations

import asyncio
from functools import partial
from math import inf

from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.bus.simulated.several import Several
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation


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

    assert all(0 < seconds < 0.01 for seconds in loop.run(clock, play()))
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
