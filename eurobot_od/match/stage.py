"""Sets up a match: the nodes from their EDS files, the world, the bus; simulated or live.

Rule of this file: the only difference between the two is who keeps the time and carries the frames.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from eurobot_od import dialects
from eurobot_od.frame import Frame
from eurobot_od.match.options import Options
from eurobot_od.match.play import Player
from eurobot_od.match.summary import Summary, Traffic
from eurobot_od.match.timeline import Event, EventKind, Timeline
from eurobot_od.nodes import Core, Drive, Navigation, Node
from eurobot_od.protocol import Protocol
from eurobot_od.simulation import loop
from eurobot_od.simulation.network import Network
from eurobot_od.simulation.world import World

if TYPE_CHECKING:
    import can

BOOT_TIMES = {"core": 0.0, "drive": 0.03, "navigation": 0.05}
"""When each node is through with its start after power-on, s: no two at once."""

POWER_UP = 0.1
"""When the core begins with the startup (document 5.1), s."""

DEFAULTS = Options()

Result = TypeVar("Result")

Watcher = Callable[[float, Frame], None]
"""Called with the time in seconds and each frame on the bus."""


class Cast(NamedTuple):
    """The three nodes and the world they act in."""

    core: Core
    drive: Drive
    navigation: Navigation
    world: World
    protocol: Protocol

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes by node-ID."""
        return self.core, self.drive, self.navigation


def assemble(options: Options, clock: Callable[[], float]) -> Cast:
    """Make the nodes from their EDS files, and the world that gives the drive its wheels and the navigation its eyes.

    Raises UnknownName, DictionaryError.
    """
    dictionaries = {each.name: each for each in dialects.load_all(options.dialect)}
    protocol = Protocol((each, each.pdos) for each in dictionaries.values())
    core, drive = Core(dictionaries["core"]), Drive(dictionaries["drive"])
    navigation = Navigation(dictionaries["navigation"])
    world = World(options.seed, options.team, options.enemies, options.confederates, navigation.deviations, clock)
    drive.chassis, navigation.beacons = world, world
    return Cast(core, drive, navigation, world, protocol)


def _opening(cast: Cast, options: Options, bitrate: int, how: str) -> str:
    folder = dialects.folder(options.dialect).name
    return f"{', '.join(node.name for node in cast.nodes)} at {bitrate // 1000} kbit/s, {how}; EDS files: {folder}"


def _network(options: Options) -> tuple[Network, Cast]:
    """Put the cast on a simulated bus."""
    network = Network()
    cast = assemble(options, lambda: network.now)
    for node in cast.nodes:
        network.attach(node, BOOT_TIMES[node.name])
    return network, cast


def rehearse(strategy: Callable[[Core], Coroutine[Any, Any, Result]], options: Options = DEFAULTS) -> Result:
    """Run a team's strategy in simulated time against simulated nodes, and return its result.

    The strategy starts when the nodes have booted. Raises what the strategy raises, DictionaryError.
    """
    network, cast = _network(options)
    network.run(POWER_UP)
    return loop.run(network, strategy(cast.core))


def play_simulated(options: Options, show: Callable[[Event], None], watch: Watcher) -> tuple[Summary, World]:
    """Play a match in simulated time; raises NoAnswer, DictionaryError."""
    network, cast = _network(options)
    clock: Callable[[], float] = lambda: network.now  # noqa: E731
    traffic, timeline = Traffic(cast.protocol), Timeline(clock, show)
    network.observers += [lambda _, frame: traffic.count(frame), watch]
    player = Player(cast.core, cast.world, options, timeline, clock)

    async def main() -> None:
        timeline.tell(EventKind.START, _opening(cast, options, network.bitrate, "simulated"))
        await asyncio.sleep(POWER_UP)
        await player.play()

    loop.run(network, main())
    reports = [str(report) for report in network.reports]
    return traffic.summary(network.now, network.bitrate, player.errors, reports), cast.world


def play_live(
    options: Options, show: Callable[[Event], None], watch: Watcher, open_bus: Callable[[], can.BusABC]
) -> tuple[Summary, World]:
    """Play a match in real time; each node, and the watcher, gets a bus of its own from `open_bus`.

    Raises BusError, NoAnswer, DictionaryError.
    """
    from eurobot_od import runtime

    begin = time.monotonic()
    clock: Callable[[], float] = lambda: time.monotonic() - begin  # noqa: E731
    cast = assemble(options, clock)
    traffic, timeline = Traffic(cast.protocol), Timeline(clock, show)
    reports: list[str] = []
    player = Player(cast.core, cast.world, options, timeline, clock)

    def seen(now: float, frame: Frame) -> None:
        traffic.count(frame)
        watch(now, frame)

    async def main() -> None:
        timeline.tell(EventKind.START, _opening(cast, options, runtime.BITRATE, "in real time"))
        await asyncio.sleep(POWER_UP)
        await player.play()

    with ExitStack() as stack:
        stack.enter_context(runtime.Watch(open_bus(), seen, clock))
        for node in cast.nodes:
            report = lambda each: reports.append(str(each))  # noqa: E731
            stack.enter_context(runtime.Live.node(open_bus(), node, clock, report=report))
        asyncio.run(main())
    return traffic.summary(clock(), runtime.BITRATE, player.errors, reports), cast.world
