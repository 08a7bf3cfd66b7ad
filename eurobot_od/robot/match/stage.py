"""Sets up a match: the nodes from their EDS files, the world, the bus; simulated or live.

Rule of this file: simulated and live differ in what keeps the time and carries the frames, and in nothing else.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine, Iterable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od import live as runtime
from eurobot_od.device.flow import Result
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Report
from eurobot_od.live.signals import EndedBySigterm
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.assembly import assemble
from eurobot_od.robot.match.player import Player
from eurobot_od.robot.match.summary import FrameCounter, Summary
from eurobot_od.robot.match.timeline import EventKind, MatchEvent, Timeline
from eurobot_od.robot.messages import CATALOGUE
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.world import World
from eurobot_od.simulation import loop
from eurobot_od.simulation.network import Network, processing_time

if TYPE_CHECKING:
    import can

BOOT_TIMES = {"core": 0.0, "drive": 0.03, "navigation": 0.05}
"""When each node has booted after power-on, s: no two at once."""

POWER_UP = 0.1
"""When the core begins with the startup (document 5.1), s."""

DEFAULTS = MatchOptions()

Watcher = Callable[[float, Frame], None]
"""Called with the time in seconds and each frame on the bus."""

ShowEvent = Callable[[MatchEvent], None]
"""Called with each event of the timeline as it comes."""


class EdsFiles(NamedTuple):
    """The EDS files of a dialect, read once for any number of matches: each node's dictionary and all messages."""

    dialect: str
    dictionaries: dict[str, Dictionary]
    protocol: Protocol

    @classmethod
    def read(cls, dialect: str | None) -> EdsFiles:
        """Read the EDS files of a dialect; raises UnknownName, DictionaryError."""
        dictionaries = {each.name: each for each in dialects.load_all(dialect)}
        protocol = Protocol(((each, each.pdos) for each in dictionaries.values()), CATALOGUE)
        return cls(dialects.folder(dialect).name, dictionaries, protocol)


def cast_for(
    options: MatchOptions, files: EdsFiles, clock: Callable[[], float]
) -> tuple[tuple[Core, Drive, Navigation], World]:
    """Make the nodes, which are ordered by node-ID, and put them into their world."""
    core, drive = Core(files.dictionaries["core"]), Drive(files.dictionaries["drive"])
    nodes = (core, drive, Navigation(files.dictionaries["navigation"]))
    return nodes, assemble(nodes, options, clock)


class Performance:
    """A match that is ready to be played, by whatever clock and bus: its nodes and world, and who watches and counts.

    Raises LocalError for options that do not fit each other.
    """

    def __init__(
        self, options: MatchOptions, files: EdsFiles, clock: Callable[[], float], show: ShowEvent, watch: Watcher
    ) -> None:
        self._dialect = files.dialect
        self.nodes, self._world = cast_for(options, files, clock)
        self._counter, self._timeline = FrameCounter(files.protocol), Timeline(clock, show)
        self._player = Player(self.nodes[0], self._world, options, self._timeline)
        self._watch = watch

    def seen(self, now: float, frame: Frame) -> None:
        """Take in a frame that was on the bus."""
        self._counter.count(frame)
        self._watch(now, frame)

    async def play(self, bitrate: int, how: str) -> None:
        """Play from power-on to the end; raises NoAnswer."""
        who = ", ".join(node.name for node in self.nodes)
        where = f"{bitrate // 1000} kbit/s, {how}; EDS files: {self._dialect}"
        self._timeline.tell(EventKind.START, f"{who} at {where}")
        await asyncio.sleep(POWER_UP)
        await self._player.play()

    def result(self, seconds: float, bitrate: int, reports: Sequence[Report]) -> tuple[Summary, World]:
        """Return what the match came to, `seconds` after power-on, and its world."""
        summary = self._counter.summary(seconds, bitrate, self._player.errors, [str(each) for each in reports])
        return summary, self._world


def _switch_on(nodes: Iterable[Node], network: Network, seed: int) -> None:
    for node in nodes:
        network.attach(node, BOOT_TIMES[node.name], processing_time(seed, node.name))


def rehearse(strategy: Callable[[Core], Coroutine[Any, Any, Result]], options: MatchOptions = DEFAULTS) -> Result:
    """Run a team's strategy in simulated time against simulated nodes, and return its result.

    The strategy starts when the nodes have booted. Raises what the strategy raises, DictionaryError.
    """
    network = Network()
    nodes, _ = cast_for(options, EdsFiles.read(options.dialect), lambda: network.now)
    _switch_on(nodes, network, options.seed)
    network.run(POWER_UP)
    return loop.run(network, strategy(nodes[0]))


def play_simulated(
    options: MatchOptions, show: ShowEvent, watch: Watcher, files: EdsFiles | None = None
) -> tuple[Summary, World]:
    """Play a match in simulated time; without `files` the EDS files are read.

    Raises NoAnswer, UnknownName, DictionaryError, LocalError.
    """
    network = Network()
    match = Performance(options, files or EdsFiles.read(options.dialect), lambda: network.now, show, watch)
    _switch_on(match.nodes, network, options.seed)
    network.observers.append(match.seen)
    loop.run(network, match.play(network.bitrate, "simulated"))
    return match.result(network.now, network.bitrate, network.reports)


def play_live(
    options: MatchOptions, show: ShowEvent, watch: Watcher, open_bus: Callable[[], can.BusABC]
) -> tuple[Summary, World]:
    """Play a match in real time; each node, and the watcher, gets a bus of its own from `open_bus`.

    Raises BusError, NoAnswer, UnknownName, DictionaryError, LocalError.
    """
    begin = time.monotonic()

    def clock() -> float:
        return time.monotonic() - begin

    match = Performance(options, EdsFiles.read(options.dialect), clock, show, watch)
    reports: list[Report] = []
    with ExitStack() as stack:
        sigterm = stack.enter_context(EndedBySigterm())
        stack.enter_context(runtime.Watch(open_bus(), match.seen, clock))
        for node in reversed(match.nodes):  # the core leaves first: it stops the drive, and sees that it stands
            stack.enter_context(runtime.Live.node(open_bus(), node, clock, report=reports.append))
        stack.callback(sigterm.hold)
        asyncio.run(match.play(runtime.BITRATE, "in real time"))
    return match.result(clock(), runtime.BITRATE, reports)
