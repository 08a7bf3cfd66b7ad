"""Loses messages and nodes in simulated matches, and checks that the robot stops.

Messages are lost, delayed and doubled; nodes are killed, rebooted and frozen. Each cell of the matrix is a short match
in which one thing goes wrong: with a navigation that is there, that died before, or that sends heartbeats and no
answers; and with a plan that tries again at once, or after 2 s. The plan drives at full speed from place to place, and
stops some gotos on the way; nothing stands there, and the sensor stops no goto. Each match is measured:

- *uncommanded*: how long, and how far, the robot moves while no running core has a goto under way, or the bus is off.
Braking after an ordinary stop counts, too, so that it is never 0. It has to end within BOUND seconds.
- *off*: how far the robot truly is from its target when it has arrived, beyond the deviation that the drive reports.
- *open calls*: calls of the core that have not ended at the end. There must be none.
- *went on*: whether another place was reached after the fault. Not every match can go on (GOES_ON). Without the
navigation one that has driven on for DROVE_ON counts, too, as by its wheels alone it may lose its way later. If it has
lost it before the fault, half of what the same match drives without the fault is enough.

With `--live` the pauses without the navigation are tried in real time, on a bus in this process (live_network.py).

A drive that is dead or frozen moves nothing here: what a motor does without its controller is not in the protocol.

The exit status is 0 if every cell is right, else 1.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib import import_module
from itertools import cycle, product
from random import Random
from typing import Annotated, NamedTuple

from environment import ROOT
from live_network import LiveNetwork

from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import ON_TIME, Simulation, processing_time
from eurobot_od.cli.options import Campaign, counted
from eurobot_od.cli.signature import HelpGroup, Option, Parser, describe, summary
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.errors import EurobotError, RemoteError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import field_name
from eurobot_od.robot import dialects
from eurobot_od.robot.match import stage
from eurobot_od.robot.match.referee import Observer, Referee
from eurobot_od.robot.model.messages import GotoXY, StartConfigurationSet
from eurobot_od.robot.model.options import NOISE_ONLY, MatchOptions
from eurobot_od.robot.model.values import Barriers, Obstacle, Outcome, Passage, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive
from eurobot_od.robot.nodes.core.agreement import SdoClientParameter
from eurobot_od.robot.nodes.motion import AT_REST, Chassis, Odometry, WheelCommand
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import EventKind, MatchEvent, Timeline, equip
from eurobot_od.season.campaign import run as in_blocks

FINE, WRONG = 0, 1

BOUND = 3.0
"""Seconds within which an uncommanded robot has to stand: the core's Standstill wait of 2 s, and braking."""

DEVIATIONS = 3
"""How many of the drive's standard deviations the robot may be off."""

TOLERANCE = 25.0
"""How much farther, in mm, an arrived robot may be from its target: what core (20) and drive (5) call arrived."""

DROVE_ON = 1000.0
"""How far a robot drives, in mm, whose match certainly goes on without the navigation."""

UNDATED = ("Navi Position Request", "Navi Position Response")
"""Positions without a time: if all of them are late, the drive cannot know."""

DURATION = 20.0
"""Length of a match, in s: enough for several gotos and stops."""

MUSHROOM = "Emergency Shutdown"
MUSHROOM_AT = 12.0
"""When the message that only an emergency sends is expected, in seconds of the match."""

BEGIN = 2.3
"""Time from power-on to the beginning of a match, in s."""

BOOTING = 0.4
"""Time for a node to boot, in s."""

FROZEN = 5.0
OFF = 1.0
"""How long a node hangs, and how long the bus is off, in s."""

TIMES = 10
"""At how many moments of a match the same fault is tried."""

AFTERWARDS = 12.0
"""Time after the match in which everything has to end, in s: a node check alone waits for 10 s."""

NEVER = 1 << 30

# What goes wrong

DELAYS = {"1 ms late": 0.001, "20 ms late": 0.02, "0.5 s late": 0.5, "2 s late": 2.0}
LOST = {"lost once": 1, "lost 3 times": 3, "lost for ever": NEVER}
DOUBLED = "doubled"
MESSAGE_FATES = (*LOST, *DELAYS, DOUBLED)
KILLED, REBOOTED, CHANGED = "killed", "rebooted", "rebooted in another dialect"
HANGS = "frozen 5 s"
NODE_FATES = (KILLED, REBOOTED, HANGS, CHANGED)
MIXED = "in another dialect"
"""A node has the EDS files of another dialect from the start."""

BUS, BUS_FATE = "bus", "off 1 s"
PAUSES = {f"pause {seconds:g} s": seconds for seconds in (0.2, 0.5, 1.0, 2.0, 3.0, 5.0)}
"""What core, drive or bus do. Without the navigation only the drive knows the place then, and the match has to go on.
With a pause of 1 s the drive gives up its goto, and the core only hears of no goto. One of 3 s may end in Emergency
Shutdown, after which a start configuration has to come, in which the drive keeps its place."""

RESETS = {"reset": 1, "reset all": 0}
"""NMT resets, and their node-ID: that of the core, or 0 for all nodes."""

SECOND = "second core"
"""Another core is switched on."""

STRAY = "stray"
"""A stranger sends the message once."""

ORDERED = "goto by SDO"
"""A stranger writes a goto to the drive."""

GOES_ON = (*PAUSES, "reset", STRAY, ORDERED)
"""Faults after which the match has to go on, as after a reboot of the core, whose place the drive remembers."""

PLACE = "Kalman Position Response"
"""A false one is not believed, and without a navigation the robot's place is unknown then (decision 24)."""

STRANGER = 9
"""The node-ID of the stranger that sends unexpected frames."""

FREEZES = {HANGS: FROZEN, **PAUSES}
"""How long a node hangs that works again afterwards."""

PAUSE_FROM, PAUSE_UNTIL = 4.0, 12.0
"""Between which times of the match what has to go on goes wrong, in s; stray messages come in each phase of it."""

# What else is so

ALIVE, DEAD, SILENT = "alive", "dead", "silent"
NAVIGATIONS = (ALIVE, DEAD, SILENT)
"""The navigation: it answers; it died before; it sends heartbeats, but no answers."""

NAVIGATION_DIES = 1.0
"""When the navigation dies, or stops answering, in seconds of the match."""

AT_ONCE, LATER = 0.05, 2.0
"""Pauses of the plan after a goto that has not arrived, in s."""


class Cell(NamedTuple):
    """What goes wrong: a message, a node or the bus.

    `when` is in seconds since power-on; a message goes wrong from then on. The state of the `navigation`, and after how
    many seconds the plan tries again, are part of it. A `live` one is tried in real time.
    """

    what: str
    how: str
    time: float = 0.0
    seed: int = 1
    dialect: str = dialects.DEFAULT
    navigation: str = ALIVE
    again: float = LATER
    live: bool = False

    def __str__(self) -> str:
        when = f"at {self.time:.3f} s, seed {self.seed}"
        return f"{self.what} {self.how}, navigation {self.navigation}, again after {self.again:g} s, {when}"

    @property
    def has_to_go_on(self) -> bool:
        """Whether the match has to go on."""
        if self.what == PLACE and self.navigation != ALIVE:
            return False
        return self.how in GOES_ON or (self.what, self.how) == ("core", REBOOTED)


class Result(NamedTuple):
    """The result of a cell: seconds and mm uncommanded, whether the match went on, and what is wrong, if anything."""

    cell: Cell
    seconds: float
    distance: float
    went_on: bool
    wrong: str


class Watched:
    """The wheels of the robot in its world, with the time and way that they move uncommanded; `driven` is in mm."""

    def __init__(self, world: World, wheels: Chassis, commanded: Callable[[], bool]) -> None:
        self.world = world
        self._wheels = wheels
        self._commanded = commanded
        self._rolled = 0.0
        self._from = world.robot
        self.seconds = self.distance = self.driven = 0.0
        self.moving = False

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Move the robot."""
        before = self.world.robot
        odometry = self._wheels.advance(command, dt)
        self.moving = command != AT_REST
        self.driven += abs(odometry.distance)
        if not self.moving or self._commanded():
            self._rolled = 0.0
        else:
            self._from = self._from if self._rolled else before
            self._rolled += dt  # not by the clock: a drive that hangs does not roll meanwhile
            self.seconds = max(self.seconds, self._rolled)
            self.distance = max(self.distance, self.world.robot.distance(self._from.point))
        return odometry


# The plan

SPEED = 100
"""Per cent: at full speed the robot rolls farthest."""

PLACES = ((2600, 1650, 180), (600, 400, 0), (2500, 400, 90), (700, 1650, 0))
AVOIDED = Barriers.of(dict.fromkeys(range(1, 9), Passage.NORMAL))
STOPPED_EACH, STOPPED_AFTER = 3, 0.7
"""Which gotos are stopped on the way, and when, in s."""


async def plan(core: Core, again: float) -> None:
    """Drive from place to place for ever; stop some gotos on the way, and go on after any fault."""
    for number, place in enumerate(cycle(PLACES), 1):
        try:
            if core.shut_down:
                await core.recover()
            going = core.goto(*place, SPEED, AVOIDED)
            if number % STOPPED_EACH == 0:
                await asyncio.sleep(STOPPED_AFTER)
                await (core.stop() if number % 2 else core.emergency_stop(Obstacle.ENEMY))
            if (await going).outcome is Outcome.ARRIVED:
                continue
        except (RemoteError, StateError):
            pass
        await asyncio.sleep(again)


@cache
def files(dialect: str) -> stage.EdsFiles:
    """Return the EDS files of a dialect, read once in each process."""
    return stage.EdsFiles.read(MatchOptions(dialect=dialect))


def other(dialect: str) -> str:
    """Return another dialect."""
    return next(each for each in dialects.names() if each != dialect)


class Trial:
    """One cell while it is tried."""

    def __init__(self, cell: Cell, *, is_faultless: bool = False) -> None:
        self.cell = cell
        self.is_faultless = is_faultless
        self.files = files(cell.dialect)
        self.changed = files(other(cell.dialect)).dictionaries
        # Judged is what is lost, and not what beacons take for something else or who stands in the way.
        self.duration = 2 * DURATION if cell.has_to_go_on else DURATION  # there must be time to go on
        self.options = MatchOptions(
            seed=cell.seed,
            duration=self.duration,
            emergency_at=MUSHROOM_AT if cell.what == MUSHROOM and cell.how != STRAY else None,
            dialect=cell.dialect,
            errors=NOISE_ONLY,
            solid=False,
            settings=(("core.Obstacle.Stop distance", "0"),),
        )
        self.network: Simulation | LiveNetwork = LiveNetwork() if cell.live else Simulation()
        self.world = World(self.options, self._clock)
        has = {**self.files.dictionaries}
        if cell.how == MIXED:
            has[cell.what] = self.changed[cell.what]
        _, nodes = stage.cast_for(self.options, self.files._replace(dictionaries=has), self.world)
        self.nodes: dict[str, Node] = {node.name: node for node in nodes}
        self.stations: dict[str, Station] = {}
        self.wheels = Watched(self.world, self.drive.chassis, self._is_commanded)
        self.drive.chassis = self.wheels
        for node in nodes:
            self._attach(node, stage.BOOT_TIMES[node.name])
        self.stranger = Node(Dictionary.load(ROOT / "docs" / "io.eds", STRANGER))
        if cell.how in (*RESETS, STRAY, ORDERED):
            self.network.attach(self.stranger, 0.0, 0.0)
        if isinstance(self.network, Simulation):
            self.network.disturb = self._disturb
        self.silent_from = float("inf")
        self.seen = 0
        self.off_until = 0.0
        self.without_core = False
        self.reached: list[float] = []
        self.driven_before = 0.0
        self.last = self.off = ""
        self.playing: asyncio.Task[None] | None = None

    def _clock(self) -> float:
        return self.network.now

    @property
    def core(self) -> Core:
        core = self.nodes["core"]
        assert isinstance(core, Core)
        return core

    @property
    def drive(self) -> Drive:
        drive = self.nodes["drive"]
        assert isinstance(drive, Drive)
        return drive

    def _attach(self, node: Node, start: float) -> None:
        self.nodes[node.name] = node
        self.stations[node.name] = self.network.attach(node, start, processing_time(self.cell.seed, node.name))

    def _is_commanded(self) -> bool:
        return not self.without_core and self.network.now >= self.off_until and self.core.is_commanding

    # What goes wrong

    def _disturb(self, now: float, frame: Frame) -> Sequence[float]:
        """Return the times at which a frame reaches the nodes."""
        if now >= self.silent_from and frame.cob_id in self._answers_of_navigation:
            return ()
        how = self.cell.how
        if how not in MESSAGE_FATES or frame.cob_id != self._cob_id or now < self.cell.time:
            return ON_TIME
        self.seen += 1
        if how in LOST:
            return () if self.seen <= LOST[how] else ON_TIME
        return (DELAYS[how],) if how in DELAYS else (0.0, 0.001)

    @property
    def _cob_id(self) -> int:
        return self.files.protocol.cob_id(self.cell.what)

    @property
    def _answers_of_navigation(self) -> set[int]:
        # The drive confirms under the same identifier, but never so that one of the two frames could be told apart.
        return {each.cob_id for each in self.files.protocol.bindings if [*each.senders] == ["navigation"]}

    def _lose_navigation(self) -> None:
        if self.cell.navigation == DEAD:
            self.network.detach(self.stations["navigation"])
        elif self.cell.navigation == SILENT:
            self.silent_from = self.network.now

    def _go_wrong(self) -> None:
        how = self.cell.how
        now = self.network.now
        self.driven_before = self.wheels.driven
        if self.is_faultless:
            return
        if how == SECOND:
            self.network.attach(Core(self.files.dictionaries["core"]), now, processing_time(self.cell.seed, SECOND))
        elif how in RESETS:
            self.stranger.put(Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, RESETS[how]])))
        elif how in (STRAY, ORDERED):
            frames = [self._stray_frame()] if how == STRAY else self._orders()
            for each in frames:
                self.stranger.put(each)
        elif self.cell.what == BUS:
            self.off_until = now + PAUSES.get(how, OFF)
            self.network.cut(self.off_until)
        elif how in FREEZES:
            end = now + FREEZES[how]
            self.network.freeze(self.stations[self.cell.what], end)
            self._miss_core_until(end)
        else:
            self._end_node()

    def _end_node(self) -> None:
        """Kill a node, or reboot it."""
        name = self.cell.what
        how = self.cell.how
        now = self.network.now
        self.network.detach(self.stations[name])
        self._miss_core_until(float("inf") if how == KILLED else now + BOOTING)
        if how == KILLED:
            return
        found = self.changed if how == CHANGED else self.files.dictionaries
        node = ROLES[name](found[name], store=stage.stores(self.options.settings, found)[name])
        equip([node], self.world.vehicle(), self.options.errors, f"{self.cell.seed} again")
        if isinstance(node, Drive):
            node.chassis = self.wheels
        self._attach(node, now + BOOTING)

    def _stray_frame(self) -> Frame:
        """Return a frame of the message: a goto to the middle, our own team's start, or zeros in any other message."""
        protocol = self.files.protocol
        for each in (STRAY_GOTO, StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0)):
            if self.cell.what == protocol.name(type(each)):
                return protocol.encode(each)
        binding = protocol.binding(self.cell.what)
        return Frame(binding.cob_id, binding.pack(dict.fromkeys(binding.layout.fields, 0)))

    def _orders(self) -> Iterator[Frame]:
        """Yield the SDO requests that write a goto to the drive."""
        channel = SdoClientParameter.to("drive", self.core.device)
        drive = self.files.dictionaries["drive"]
        _, raw = self.files.protocol.unpack(*self.files.protocol.encode(STRAY_GOTO))
        index = drive.data_index("Goto XY")
        assert channel is not None
        assert index is not None
        for variable in drive.members[index].values():
            if (field := field_name(variable.name)) in raw:
                yield channel.order(drive, f"Goto XY.{variable.name}", raw[field])

    def _miss_core_until(self, time: float) -> None:
        if self.cell.what != "core":
            return
        self.without_core = True
        if time < float("inf"):
            asyncio.get_running_loop().call_later(time - self.network.now, self._core_is_back)
        if self.cell.how not in FREEZES and self.playing is not None:
            self.playing.cancel()  # the plan is part of the program that has died

    def _core_is_back(self) -> None:
        self.without_core = False
        if self.cell.how not in FREEZES:
            self.playing = asyncio.ensure_future(self._play(BEGIN + self.duration - self.network.now))

    # The match

    async def _play(self, duration: float) -> None:
        options = replace(self.options, duration=max(duration, 1.0))
        await asyncio.sleep(stage.POWER_UP)
        with suppress(EurobotError):  # a match that cannot be played has an end, too
            timeline = Timeline(self._clock, self._record)
            Observer(self.core, timeline, lambda: self.world.robot)
            referee = Referee(self.core, options, timeline, lambda: self.world.robot)
            await referee.play(lambda core: plan(core, self.cell.again))

    def _record(self, event: MatchEvent) -> None:
        if event.kind in (EventKind.GIVEN_UP, EventKind.FAILED):
            self.last = event.text
        if event.kind is EventKind.ARRIVED:
            self.reached.append(event.time)
            distance = event.data["distance"]
            deviation = event.data["deviation"] or 0
            if distance > TOLERANCE + DEVIATIONS * deviation and self.cell.what not in UNDATED:
                self.off = f"arrived {distance:.0f} mm off, says {deviation} mm, at {event.time:.2f} s"

    async def _run(self) -> bool:
        """Play the match with its fault, and return whether everything ended in time."""
        self.playing = asyncio.ensure_future(self._play(self.duration))
        asyncio.get_running_loop().call_later(BEGIN + NAVIGATION_DIES, self._lose_navigation)
        if self.cell.how not in (*MESSAGE_FATES, MIXED):
            await asyncio.sleep(self.cell.time - self.network.now)
            self._go_wrong()
        await asyncio.sleep(BEGIN + self.duration + AFTERWARDS - self.network.now)
        return self.playing.done()

    def play(self) -> bool:
        """Play the match to its end; return whether everything ended in time."""
        network = self.network
        return network.run(self._run()) if isinstance(network, LiveNetwork) else loop.run(network, self._run())

    @property
    def driven_on(self) -> float:
        """How far the robot has driven since the fault, in mm."""
        return self.wheels.driven - self.driven_before

    def _has_driven_on(self) -> bool:
        """Return whether a match without the navigation has gone on, by how far it has driven since the fault."""
        if self.cell.navigation == ALIVE or self.driven_on > DROVE_ON:
            return self.cell.navigation != ALIVE
        faultless = Trial(self.cell._replace(live=False), is_faultless=True)
        faultless.play()
        return self.driven_on >= faultless.driven_on / 2

    def result(self) -> Result:
        """Try the cell."""
        cell = self.cell
        ended = self.play()
        killed = cell.what if cell.how == KILLED else None
        # A second core has the robot stopped, and watched, with each of its heartbeats.
        must_end = killed != "core" and cell.how != SECOND
        wrong = {
            "moves at the end": killed != "drive" and self.wheels.moving,
            f"uncommanded for {self.wheels.seconds:.2f} s": self.wheels.seconds > BOUND,
            self.off: bool(self.off),
            "the match does not end": not ended,
            f"{self.core.open_calls} open calls": must_end and self.core.open_calls > 0,
        }
        went_on = any(time > cell.time for time in self.reached)
        has_to_go_on = cell.has_to_go_on and cell.time < BEGIN + DURATION
        wrong[f"the match does not go on: {self.last}"] = has_to_go_on and not (went_on or self._has_driven_on())
        text = "; ".join(text for text, is_so in wrong.items() if is_so)
        return Result(cell, self.wheels.seconds, self.wheels.distance, went_on, text)


STRAY_GOTO = GotoXY(1500, 1000, 0, 50)


def attempt(cell: Cell) -> Result:
    """Try a cell, in any process."""
    return Trial(cell).result()


# Which cells


def cells(dialect: str, times: int, seed: int = 1) -> Iterator[Cell]:
    """Yield all cells of a dialect, in the order of the table; faults within a match at `times` moments of it."""
    variants = list(product(NAVIGATIONS, (AT_ONCE, LATER)))
    for what, how, begin, end in causes(dialect):
        chance = Random(f"{seed} {what} {how}")
        for number in range(1 if begin == end else times):
            time = round(BEGIN + chance.uniform(begin, end), 3)
            for navigation, again in variants[: VARIANTS.get((what == "navigation", how))]:
                yield Cell(what, how, 0.0 if begin == end else time, seed + number, dialect, navigation, again)


VARIANTS = {(is_navigation, MIXED): 1 for is_navigation in (True, False)} | {(True, how): 2 for how in NODE_FATES}
"""How many of the variants a cause has, by whether it is the navigation's: one that is lost itself has not died before.
"""

Cause = tuple[str, str, float, float]
"""What goes wrong, how, and between which times of the match, in s; twice the same time for a permanent fault."""


def causes(dialect: str) -> Iterator[Cause]:
    """Yield all causes."""
    names = files(dialect).protocol.names()
    yield from ((name, how, 0.0, 0.0) for name, how in product(names, MESSAGE_FATES))
    yield from ((name, MIXED, 0.0, 0.0) for name in ROLES)
    losses = (*product(ROLES, NODE_FATES), (BUS, BUS_FATE))
    yield from ((what, how, 0.0, DURATION) for what, how in losses if (what, how) != ("core", REBOOTED))
    goes_on = (*product(("core", "drive", BUS), PAUSES), ("core", REBOOTED), *product(["core"], (*RESETS, SECOND)))
    yield from ((what, how, PAUSE_FROM, PAUSE_UNTIL) for what, how in (*goes_on, ("drive", ORDERED)))
    # Before the start, on the way, and after the match.
    yield from ((name, STRAY, 0.1 - BEGIN, 2 * DURATION + 1.0) for name in names)


# The table


def table(results: Iterable[Result]) -> Iterator[str]:
    """Yield the lines of two tables: one of messages, one of losses of a node or the bus."""
    found = list(results)
    yield f"| message | {' | '.join(MESSAGE_FATES)} |"
    yield "|---" * (1 + len(MESSAGE_FATES)) + "|"
    spoiled = [each for each in found if each.cell.how in MESSAGE_FATES]
    for what in dict.fromkeys(each.cell.what for each in spoiled):
        own = [each for each in spoiled if each.cell.what == what]
        yield f"| {what} | {' | '.join(_figures([e for e in own if e.cell.how == how]) for how in MESSAGE_FATES)} |"
    yield ""
    yield f"| cause | {' | '.join(f'navigation {each}' for each in NAVIGATIONS)} |"
    yield "|---" * (1 + len(NAVIGATIONS)) + "|"
    rows: dict[str, list[Result]] = {}
    for each in found:
        if each.cell.how not in MESSAGE_FATES:
            name = "any message, stray" if each.cell.how == STRAY else f"{each.cell.what} {each.cell.how}"
            rows.setdefault(name, []).append(each)
    for name, own in rows.items():
        parts = ([each for each in own if each.cell.navigation == navigation] for navigation in NAVIGATIONS)
        yield f"| {name} | {' | '.join(map(_with_counts, parts))} |"


def _figures(results: Sequence[Result]) -> str:
    """Return the worst figures of some results; a star marks that no match went on."""
    if not results:
        return ""
    seconds, distance = max(each.seconds for each in results), max(each.distance for each in results)
    return f"{seconds:.2f} s, {distance:.0f} mm" + ("" if any(each.went_on for each in results) else "*")


def _with_counts(results: Sequence[Result]) -> str:
    return f"{_figures(results)}; {sum(each.went_on for each in results)} of {len(results)}" if results else ""


def in_one_line(results: Sequence[Result]) -> str:
    """Return the worst figures in one line."""
    worst, farthest = max(results, key=lambda r: r.seconds), max(results, key=lambda r: r.distance)
    return (
        f"{len(results)} cells, {sum(bool(r.wrong) for r in results)} wrong; uncommanded for {worst.seconds:.2f} s at "
        f"most ({worst.cell.what} {worst.cell.how}), {farthest.distance:.0f} mm at most "
        f"({farthest.cell.what} {farthest.cell.how})"
    )


def run_all(
    *,
    dialect: Annotated[str, f"EDS files (default: {dialects.DEFAULT})"] = dialects.DEFAULT,
    times: Annotated[int, Option(metavar="N"), f"moments of a match (default: {TIMES})"] = TIMES,
    seed: Annotated[int, "of the moments and the matches (default: 1)"] = 1,
    only: Annotated[str, Option(metavar="TEXT"), "only cells whose name has this in it"] = "",
    live: Annotated[bool, "the pauses without the navigation, in real time"] = False,
    campaign: Annotated[Campaign, HelpGroup("many at once, with all of it")],
) -> int:
    """Lose messages and nodes in matches and check that the robot stops; print table, errors and figures."""
    chosen = [each for each in cells(dialect, times, seed) if only in str(each)]
    if live:
        chosen = [each._replace(live=True) for each in chosen if each.how in PAUSES and each.navigation == DEAD]
    kept = campaign.kept(Result, lambda: {"campaign": "losses", "dialect": dialect, "seed": seed, "times": times})
    with campaign.workers(len(chosen)) as workers:
        results = list(counted(in_blocks(attempt, chosen, workers, kept), len(chosen), "cells", workers))
    print(*table(results), sep="\n")
    print()
    wrong = [each for each in results if each.wrong]
    print(*(f"{each.cell}: {each.wrong}" for each in wrong), sep="\n")
    print(in_one_line(results))
    return WRONG if wrong else FINE


def main(words: Sequence[str] | None = None) -> int:
    """Run the tool with the words of a command line, by default those of this process."""
    parser = Parser("loss_matrix", description=summary(run_all))
    status: int = describe(parser, run_all)(parser.parse_args(words))
    return status


if __name__ == "__main__":
    sys.exit(import_module("loss_matrix").main())  # other processes find it by this name
