"""Sets up a match: the nodes from their EDS files, the world, the bus; simulated or live.

Rule of this file: simulated and live matches differ only in what keeps the time and carries the frames.
"""

from __future__ import annotations

import asyncio
import io
import sys
import time
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from math import isnan, nan
from pathlib import Path
from typing import Any, NamedTuple, TextIO, cast

import can

from eurobot_od import loading
from eurobot_od.bus import live as runtime
from eurobot_od.bus.live import Live
from eurobot_od.bus.live.event_loop import EndedBySigterm, Watchdog, apart, passing, run, run_in, watched_loop
from eurobot_od.bus.simulated import loop as simulated_loop
from eurobot_od.bus.simulated.network import Simulation, processing_time
from eurobot_od.controller import Report
from eurobot_od.device.objects import MemoryStore
from eurobot_od.device.timers import Result
from eurobot_od.errors import BusError, LocalError, ProgramFailed, UnknownName, WorldError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import all_objects, given
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, Value
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.plugin import Plugins
from eurobot_od.robot.match import strategy as shipped
from eurobot_od.robot.match.referee import Observer, Referee, Strategy, is_foreign
from eurobot_od.robot.match.summary import FrameCounter, Summary, counts, touches_of
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import OURS, Caption
from eurobot_od.robot.nodes import Core, Node
from eurobot_od.robot.nodes.node import make
from eurobot_od.robot.world import World
from eurobot_od.robot.world.bodies import Touch
from eurobot_od.robot.world.server import RemoteVehicle
from eurobot_od.robot.world.world import RIVAL, EventKind, MatchEvent, Timeline, equip
from eurobot_od.support.extras import complaint, place_of
from eurobot_od.traffic.recorder import recording

# Settings: values in a node's object dictionary that replace those of its EDS file


def stores(settings: Iterable[tuple[str, str]], dictionaries: Mapping[str, Dictionary]) -> dict[str, MemoryStore]:
    """Return what each node finds stored when it is switched on, from settings as a person writes them.

    A name is that of the node and of the object, `drive.Motion.Maximum speed` or `navigation.0x2101:1`. Raises
    UnknownName, LocalError, FieldError.
    """
    values: dict[str, dict[Address, Value]] = {node: {} for node in dictionaries}
    for name, text in settings:
        node, _, thing = name.partition(".")
        if node not in values:
            known = (f"{at}.{each.qualname}" for at, of in dictionaries.items() for each in all_objects(of.objects))
            raise UnknownName("setting", name, [*robot_file.names(), *known])
        address, value = given(thing, text, dictionaries[node].objects)
        values[node][address] = value
    return {node: MemoryStore(each) for node, each in values.items()}


# The stage


BOOT_TIMES = {"core": 0.0, "drive": 0.03, "navigation": 0.05}
"""Time after power-on at which each node has booted, in s; no two at once. Further nodes boot after these."""

BOOT_STEP = 0.001
"""Time between the boot-ups of further nodes, in s: there may be a hundred before the startup begins."""

POWER_UP = 0.1
"""Time after power-on at which the core begins the startup, in s (document 5.1)."""

Watcher = Callable[[float, Frame], None]
"""Called with each frame on the bus and its time in seconds."""

ShowEvent = Callable[[MatchEvent], None]
"""Called with each event of the timeline as it comes."""


def _nobody(*_: object) -> None:
    """Show, watch or tell nothing, as for a rival."""


class EdsFiles(NamedTuple):
    """The EDS files of a dialect, read once for any number of matches: each node's dictionary and all messages."""

    dialect: str
    dictionaries: dict[str, Dictionary]
    protocol: Protocol
    roles: dict[str, str]
    robot: str
    """The name of a team's own robot, empty for the one that this package brings."""

    @classmethod
    def read(cls, options: MatchOptions) -> EdsFiles:
        """Read the EDS files of a match; raises UnknownName, FileError, LocalError for a missing node."""
        robot = loading.find(options.robot)
        folder = robot.dialects.folder(options.dialect)
        dictionaries = {each.name: each for each in robot.dialects.load_all(options.dialect)}
        protocol = Protocol(((each, each.pdos) for each in dictionaries.values()), robot.catalogue())
        roles = {name: robot.role_of(each) for name, each in dictionaries.items()}
        for needed in BOOT_TIMES:
            if not roles.get(needed):
                raise LocalError(f"{folder}: a match needs a {needed}, and there is no {needed}.eds of a robot's")
        return cls(folder.name, dictionaries, protocol, roles, robot.name if robot.folder else "")


def cast_for(options: MatchOptions, files: EdsFiles, world: World, name: str = OURS) -> tuple[Core, list[Node]]:
    """Make the nodes of a robot in the world: its core, and all of them with the core first.

    Raises UnknownName for an unknown fault, node or object, LocalError for a value that is not allowed.
    """
    robot = Plugins(loading.find(options.robot))
    found = stores(options.of_nodes, files.dictionaries)
    names = dict.fromkeys((*BOOT_TIMES, *files.dictionaries))
    if options.faults:  # each match of a campaign comes here
        robot.check_faults([files.dictionaries[each] for each in names], options.faults)
    kinds = {each: robot.kind(files.dictionaries[each], options.faults) for each in names}
    nodes = [make(kind, files.dictionaries[each], found[each], world.facts) for each, kind in kinds.items()]
    # The rival's instruments have random streams of their own: with ours, both robots would slip at the same moments.
    seed = str(options.seed) if name == OURS else f"{options.seed} {name}"
    equip(nodes, world.vehicle(name), options.errors, seed)
    core = cast(Core, nodes[0])
    core.told.append(lambda words: world.captions.append(Caption(world.clock(), name, words)))
    return core, nodes


# What strategies print


class Prefixed(io.TextIOBase):
    """Writes each line with something before it, and at once, as other processes write to the same terminal."""

    def __init__(self, stream: TextIO, prefix: str) -> None:
        self._stream = stream
        self._prefix = prefix
        self._begun = ""

    def write(self, text: str) -> int:
        """Write a part of a text."""
        *lines, self._begun = (self._begun + text).split("\n")
        self._stream.write("".join(f"{self._prefix}{line}\n" for line in lines))
        return len(text)

    def flush(self) -> None:
        """Flush the stream."""
        self._stream.flush()

    def end(self) -> None:
        """Write a last line without its end."""
        if self._begun:
            self.write("\n")


IS_RIVAL = ContextVar("whether the second robot's strategy runs", default=False)


class _BySide:
    """Standard output for two strategies in one event loop: lines of the second robot's begin with its name."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.rivals = Prefixed(stream, f"{RIVAL}: ")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return (self.rivals if IS_RIVAL.get() else self._stream).write(text)


@contextmanager
def _marking_rival(is_there: bool) -> Iterator[None]:
    """Mark the lines that the second robot's strategy prints, if there is one."""
    if not is_there:
        yield
        return
    sides = _BySide(sys.stdout)
    with redirect_stdout(cast(TextIO, sides)):
        yield
    sides.rivals.end()


async def _as_rival(playing: Coroutine[Any, Any, None]) -> None:
    IS_RIVAL.set(True)  # for this task, and those that it makes
    await playing


class Performance:
    """A match of one robot, ready to be played with any clock and bus: its nodes, referee, observers and counters.

    Raises LocalError for contradictory options.
    """

    def __init__(
        self,
        options: MatchOptions,
        files: EdsFiles,
        world: World,
        show: ShowEvent = _nobody,
        watch: Watcher = _nobody,
        name: str = OURS,
    ) -> None:
        self._dialect = files.dialect
        self.name = name
        self._world = world
        self._whose = f"{files.robot}: " if files.robot else ""
        self._faults = "; faults: " + ", ".join(options.faults) if options.faults else ""
        core, self.nodes = cast_for(options, files, world, name)
        self._counter = FrameCounter(files.protocol)
        self._timeline = Timeline(world.clock, show)
        self._observer = Observer(core, self._timeline, self._truth)
        self.referee = Referee(core, options, self._timeline, self._truth)
        self._watch = watch
        world.watchers.append(self._tell_touch)

    def _truth(self) -> Pose:
        return self._world.robots[self.name].pose

    def _tell_touch(self, touch: Touch) -> None:
        if touch.robot == self.name or touch.thing == self.name:
            self._timeline.tell(EventKind.TOUCH, str(touch), **touch._asdict())

    def seen(self, now: float, frame: Frame) -> None:
        """Take in a frame that was on the bus."""
        self._counter.count(frame)
        self._watch(now, frame)

    async def play(self, strategy: Strategy, bitrate: int, how: str) -> None:
        """Play from power-on to the end; raises NoAnswer."""
        who = ", ".join(node.name for node in self.nodes)
        where = f"{bitrate // 1000} kbit/s, {how}; EDS files: {self._dialect}{self._faults}"
        self._timeline.tell(EventKind.START, f"{self._whose}{who} at {where}")
        await asyncio.sleep(POWER_UP)
        await self.referee.play(strategy)

    def result(self, seconds: float, bitrate: int, reports: Sequence[Report]) -> Summary:
        """Return the summary of the match, `seconds` after power-on."""
        touches = touches_of(self.name, self._world.touches)
        return replace(
            self._counter.summary(seconds, bitrate),
            errors=self._observer.errors,
            reports=[*dict.fromkeys(blame(each, self.nodes) or str(each) for each in reports)],
            points={self.name: self._world.game.points(self.name)},
            touches=counts(touches),
            at_fault=sum(touch.at_fault for touch in touches),
            failure=self.referee.failure,
        )


def switch_on(nodes: Iterable[Node], network: Simulation, seed: int) -> None:
    """Attach nodes to a simulated bus; each boots at its time."""
    last = max(BOOT_TIMES.values())
    for number, node in enumerate(nodes, 1 - len(BOOT_TIMES)):
        boots = BOOT_TIMES.get(node.name, last + number * BOOT_STEP)
        network.attach(node, boots, processing_time(seed, node.name))


def play_simulated(
    options: MatchOptions,
    show: ShowEvent,
    watch: Watcher,
    files: EdsFiles | None = None,
    strategy: Strategy = shipped.play,
    against: Strategy | None = None,
    tell: Callable[[str], object] = _nobody,
) -> tuple[Summary, World]:
    """Play a match in simulated time; without `files` the EDS files are read.

    `against` is the strategy of a second robot, which takes enemy 1's place on a bus of its own. Raises NoAnswer,
    UnknownName, FileError, LocalError. `tell` gets a line about each line of a strategy that blocks.
    """
    if against is not None and not options.enemies:
        raise LocalError("a second robot takes the place of an enemy, and the match has none")
    files = files or EdsFiles.read(options)
    networks = [Simulation() for _ in range(1 if against is None else 2)]
    clock = networks[0] if against is None else simulated_loop.Several(*networks)
    world = World(options, lambda: clock.now, rival=against is not None)
    match = Performance(options, files, world, show, watch)
    sides = [match] if against is None else [match, Performance(_rival(options), files, world, name=RIVAL)]
    for side, network in zip(sides, networks):
        switch_on(side.nodes, network, options.seed)
        network.observers.append(side.seen)
    bitrate = networks[0].bitrate
    plays = [match.play(strategy, bitrate, "simulated")]
    if against is not None:
        plays.append(_as_rival(sides[1].play(against, bitrate, "simulated")))
    marking = _marking_rival(against is not None)
    blaming = _blaming(match.nodes, networks[0].reports, tell)
    with marking, Watchdog(passing(lambda: clock.now), tell) as watchdog, blaming:
        simulated_loop.run(clock, _together(plays))
    summary = match.result(clock.now, bitrate, networks[0].reports)
    points = {side.name: world.game.points(side.name) for side in sides}
    failures = [each.referee.failure for each in sides if each.referee.failure] or [watchdog.hang]
    return replace(summary, points=points, failure="\n".join(failures) or None), world


@contextmanager
def _blaming(nodes: Iterable[Node], reports: Sequence[Report], tell: Callable[[str], object]) -> Iterator[None]:
    """Add what a node has raised, and in which file, to an error: the core hears only that no answer comes."""
    try:
        yield
    finally:
        for line in dict.fromkeys(filter(None, [blame(each, nodes) for each in reports])):
            tell(line)


def blame(report: Report, nodes: Iterable[Node]) -> str:
    """Return who has raised the reported error, and in which file; empty if nobody has."""
    if report.error is None:  # to find the place of a class takes a reading of its whole file
        return ""
    # A value that is out of range is noticed when the handler that gave it has returned: its class is what is left.
    at = next((place_of(type(each)) for each in nodes if each.name == report.name), report.name)
    return f"{report.name}: {complaint(report.error, at, lambda frame: is_foreign(frame.f_code.co_filename))}"


def _rival(options: MatchOptions) -> MatchOptions:
    """Return the match from the other robot's side: in the other colour, with as many others around it."""
    return replace(
        options,
        team=options.team.other,
        # The rival's enemies are our robot and our confederate; our second enemy is its confederate.
        enemies=1 + options.confederates,
        confederates=max(options.enemies - 1, 0),
        emergency_at=None,
        faults=(),
        # Facts hold for both robots; settings and faults are only for our nodes.
        settings=tuple(each for each in options.settings if each not in options.of_nodes),
    )


async def _together(plays: Iterable[Coroutine[Any, Any, None]]) -> None:
    await asyncio.gather(*plays)


def play_live(
    options: MatchOptions,
    show: ShowEvent,
    watch: Watcher,
    open_bus: Callable[[], can.BusABC],
    strategy: Strategy = shipped.play,
    tell: Callable[[str], object] = _nobody,
    bit_rate: int = runtime.BITRATE,
) -> tuple[Summary, World]:
    """Play a match in real time; each node and the watcher get a bus of their own from `open_bus`.

    The bus's load is computed for `bit_rate`, in bit/s. Raises BusError, also if one of the nodes is on the bus
    already, NoAnswer, UnknownName, FileError, LocalError.
    """
    files = EdsFiles.read(options)
    _refuse_others(open_bus, files.dictionaries.values())
    begin = time.monotonic()

    def clock() -> float:
        return time.monotonic() - begin

    world = World(options, clock)
    match = Performance(options, files, world, show, watch)
    reports: list[Report] = []
    with ExitStack() as stack:
        sigterm = stack.enter_context(EndedBySigterm())
        stack.enter_context(_blaming(match.nodes, reports, tell))
        stack.enter_context(runtime.FrameReader(open_bus(), match.seen, clock))
        for node in reversed(match.nodes):  # the core leaves first: it stops the drive, and sees that it stands
            stack.enter_context(runtime.Live.node(open_bus(), node, clock, report=reports.append))
        stack.callback(sigterm.hold)
        loop, watchdog = watched_loop(tell)
        with watchdog:
            run_in(loop, match.play(strategy, bit_rate, "in real time"))
    summary = match.result(clock(), bit_rate, reports)
    return replace(summary, failure=summary.failure or watchdog.hang or None), world


PRESENCE = 1.1
"""Time for which a bus is heard before a match in real time, in s: longer than the period of the nodes' heartbeats."""


def _refuse_others(open_bus: Callable[[], can.BusABC], nodes: Iterable[Dictionary]) -> None:
    """Check that none of the nodes has a heartbeat on the bus; raises BusError."""
    heard: set[int] = set()
    with runtime.FrameReader(open_bus(), lambda _, frame: heard.add(frame.cob_id), time.monotonic):
        time.sleep(PRESENCE)
    there = [each.name for each in nodes if ERROR_CONTROL_BASE + each.node_id in heard]
    if there:
        what = f"{', '.join(there)}: on this bus already, and `match` brings its own"
        raise BusError(f"{what}; a program plays a strategy with those that are there: docs/real-robot.md")


# A match that a core leads in a process of its own


NOWHERE = Pose(nan, nan, nan)
"""The pose of a robot in a world that cannot be reached."""

LOOKS = 0.1
"""Time between two checks whether the bus has failed, in s."""


def play_led(
    live: Live,
    core: Core,
    vehicle: RemoteVehicle,
    options: MatchOptions,
    strategy: Strategy,
    counter: FrameCounter,
    show: ShowEvent,
) -> Summary:
    """Play a match from the node checks to its end, with a core running on a bus, and the truth from the world.

    `counter` counts the frames. An arrival for which the world did not answer has no position error. Raises BusError,
    NoAnswer.
    """
    begin = live.clock()
    points = dict[str, int]()

    def truth() -> Pose:
        try:
            seen = vehicle.truth()
        except WorldError:
            return NOWHERE
        points[OURS] = seen.points
        return seen.pose

    timeline = Timeline(lambda: live.clock() - begin, show)
    observer = Observer(core, timeline, truth)
    referee = Referee(core, options, timeline, truth)
    run(_as_long_as_it_runs(live, referee.play(strategy)))
    truth()  # the points at the end, unless the world has gone
    summary = counter.summary(timeline.clock(), runtime.BITRATE)
    errors = [x for x in observer.errors if not isnan(x)]
    return replace(summary, errors=errors, points=points, failure=referee.failure)


async def _as_long_as_it_runs(live: Live, playing: Coroutine[Any, Any, None]) -> None:
    """Await a match, and give it up if the bus fails."""
    task = asyncio.ensure_future(playing)
    while not task.done() and live.failure is None:
        await asyncio.wait([task], timeout=LOOKS)
    if live.failure is not None:
        # The strategy's `finally` may still await something, so it is awaited before the failure is raised.
        task.cancel()
        await asyncio.wait([task])
        raise live.failure
    task.result()


DEFAULTS = MatchOptions(falling=False)


def rehearse(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions = DEFAULTS,
    *,
    log: str | Path | None = None,
    picture: str | Path | None = None,
) -> Result:
    """Run a team's strategy in simulated time against simulated nodes, and return its result.

    It also works in a notebook. The strategy starts when the nodes have booted; the files are written even if it
    raises.

    Args:
        strategy: called with the core
        options: options of the match
        log: file for all frames, in the format of its suffix
        picture: file for the drawing: .svg, .html or .png

    Raises:
        ProgramFailed: the strategy hangs
        LocalError: a suffix or an option is wrong
        FileError, OSError: a file cannot be read or written; also what the strategy raises
    """
    return apart(lambda: _rehearse(strategy, options, log, picture))


async def rehearse_async(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions = DEFAULTS,
    **files: str | Path | None,
) -> Result:
    """Do what `rehearse` does, for a program with an event loop of its own, which keeps running meanwhile."""
    return await asyncio.to_thread(lambda: rehearse(strategy, options, **files))


def _rehearse(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions,
    log: str | Path | None,
    picture: str | Path | None,
) -> Result:
    network = Simulation()
    world = World(options, lambda: network.now)
    core, nodes = cast_for(options, EdsFiles.read(options), world)
    switch_on(nodes, network, options.seed)
    with ExitStack() as stack:
        if picture is not None:
            from eurobot_od.robot.scene.files import draw, form

            form(Path(picture))  # raises for a suffix before anything is played
            frames: list[tuple[float, Frame]] = []
            network.observers.append(lambda time, frame: frames.append((time, frame)))
            stack.callback(draw, Path(picture), frames, options, world)
        network.observers.append(
            stack.enter_context(recording(None if log is None else Path(log), tell=partial(print, file=sys.stderr)))
        )
        # Otherwise a program's first call would meet nodes that have not booted, and wait for a whole check attempt.
        network.run(POWER_UP)
        with Watchdog(passing(lambda: network.now), partial(print, file=sys.stderr)) as watchdog:
            try:
                result = simulated_loop.run(network, strategy(core))
            except BaseException:
                # As on the robot: however a program ends, the drive is stopped, and gets the time it needs.
                if core.leave() is not None:
                    network.run(network.now + core.standstill_wait)
                raise
        if watchdog.hang:  # in a task that nobody has awaited
            raise ProgramFailed(watchdog.hang)
        return result
