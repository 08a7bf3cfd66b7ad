"""Loses, delays and doubles messages, kills, reboots and freezes nodes in simulated matches: does the robot stand?

Each cell of the matrix is a short match in which one thing goes wrong. What is measured:

- *uncommanded*: how long, and how far, the robot moves while no living core has a goto under way, or the bus is off.
  Braking after an ordinary stop counts, too, so that it is never 0. It has to end within BOUND seconds.
- *off*: how far from its place the robot truly is when it has arrived: OFF_PLACE, or what the drive says of its place.
- *open calls*: calls of the core that have not ended when all is over. There must be none.
- *went on*: whether another place was reached after it went wrong. Not every match can go on. After a pause without the
  navigation it has to, or at least the robot drives on for DROVE_ON: by its wheels alone it may lose its way later.

With `--live` the pauses without the navigation are tried in real time, on a bus in this process (live_network.py).

A drive that is dead or frozen moves nothing here: what a motor does when nobody controls it is not in the protocol.

The exit status says whether every cell is as it has to be: 0 yes, 1 no.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib import import_module
from itertools import product
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
from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.robot import dialects
from eurobot_od.robot.match import stage, strategy
from eurobot_od.robot.match.referee import Observer, Referee
from eurobot_od.robot.model.messages import GotoXY, StartConfigurationSet
from eurobot_od.robot.model.options import NOISE_ONLY, MatchOptions
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive
from eurobot_od.robot.nodes.motion import AT_REST, Chassis, Odometry, WheelCommand
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import EventKind, MatchEvent, Timeline, equip
from eurobot_od.season.campaign import run as in_blocks

FINE, WRONG = 0, 1

BOUND = 3.0
"""Seconds within which a robot stands that nobody commands: the core's Standstill wait of 2 s, and braking."""

OFF_PLACE = 50.0
"""How far from its place, mm, the robot may truly be when it has arrived: more is a drive that has lost its way."""

DEVIATIONS = 3
"""How many of the standard deviations that the drive tells the robot may be off."""

DROVE_ON = 1000.0
"""How far a robot drives, mm, whose match goes on."""

UNDATED = ("Navi Position Request", "Navi Position Response")
"""Positions say nothing about their time: if they are all late, the drive cannot know, and without them it drifts."""

DURATION = 20.0
"""Seconds of a match: enough for several gotos and stops."""

MUSHROOM = "Emergency Shutdown"
MUSHROOM_AT = 12.0
"""The message that no match has without an emergency, and when it is then, in seconds of the match."""

BEGIN = 2.3
"""Seconds from power-on until a match has begun."""

BOOTING = 0.4
"""Seconds that a node takes to boot."""

FROZEN = 5.0
OFF = 1.0
"""Seconds that a node hangs, and that the bus is off."""

TIMES = 200
"""At how many times of the match a node is lost."""

AFTERWARDS = 12.0
"""Seconds after the match in which everything has to end: a node check alone waits for 10 s."""

NEVER = 1 << 30

DELAYS = {"1 ms late": 0.001, "20 ms late": 0.02, "0.5 s late": 0.5, "2 s late": 2.0}
LOST = {"lost once": 1, "lost 3 times": 3, "lost for ever": NEVER}
DOUBLED = "doubled"
MESSAGE_FATES = (*LOST, *DELAYS, DOUBLED)
NODE_FATES = ("killed", "rebooted", "frozen 5 s")
BUS, BUS_FATE = "bus", "off 1 s"
PAUSES = {f"pause {seconds:g} s, navigation dead": seconds for seconds in (0.2, 0.5, 1.0, 2.0, 3.0, 5.0)}
"""What core, drive or bus do after the navigation has died: only the drive knows the place then, and the match has to
go on. With a pause of 1 s the drive gives up its goto, and the core only hears of no goto. One of 3 s may end
in Emergency Shutdown, after which a start configuration has to come, in which the drive keeps its place."""

RESETS = {"reset": 1, "reset all": 0}
"""NMT resets, and whom they are for: the core alone, or every node."""

SECOND = "second core"
"""Another core is switched on."""

STRAY = "stray"
"""Somebody else sends the message once."""

DEAD = ", navigation dead"
"""The navigation has died before."""

BEGINNINGS = (*RESETS, SECOND, *(each + DEAD for each in (*RESETS, "rebooted", SECOND)))
"""What happens to the core, with the navigation alive and dead; `NODE_FATES` has its reboot with a living one."""

GOES_ON = (*PAUSES, "reset", "reset" + DEAD, "rebooted" + DEAD)
"""After this the match has to go on: the drive remembers what the core has forgotten."""

STRANGER = 9
"""The node-ID of who sends what nobody expects."""

FREEZES = {"frozen 5 s": FROZEN, **PAUSES}
"""How long a node hangs that is itself again afterwards."""

NAVIGATION_DIES = 1.0
PAUSE_FROM, PAUSE_UNTIL = 4.0, 12.0
"""When the navigation dies, and between which times the pauses begin, in seconds of the match."""


class Cell(NamedTuple):
    """What goes wrong: a message, a node or the bus, how, and when in seconds since power-on (a message: from then).

    A `live` one is tried in real time.
    """

    what: str
    how: str
    time: float = 0.0
    seed: int = 1
    dialect: str = dialects.DEFAULT
    live: bool = False


class Result(NamedTuple):
    """What became of a cell: seconds and mm uncommanded, whether the match went on, and what is wrong, if anything."""

    cell: Cell
    seconds: float
    distance: float
    went_on: bool
    wrong: str


class Watched:
    """The wheels of the robot in its world, which notice how long they are moved uncommanded; `driven` is in mm."""

    def __init__(self, world: World, wheels: Chassis, commanded: Callable[[], bool]) -> None:
        self.world, self._wheels, self._commanded = world, wheels, commanded
        self._rolled, self._from = 0.0, world.robot
        self.seconds = self.distance = self.driven = 0.0
        self.moving = False

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Move the robot."""
        before, odometry = self.world.robot, self._wheels.advance(command, dt)
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


@cache
def files(dialect: str) -> stage.EdsFiles:
    """Return the EDS files of a dialect, read once in each process."""
    return stage.EdsFiles.read(MatchOptions(dialect=dialect))


class Trial:
    """One cell being tried."""

    def __init__(self, cell: Cell) -> None:
        self.cell, self.files = cell, files(cell.dialect)
        emergency = MUSHROOM_AT if cell.what == MUSHROOM else None
        # Judged is what is lost, and not what beacons take for something else or who pushes whom.
        self.duration = 2 * DURATION if cell.how in GOES_ON else DURATION  # there must be time to go on
        self.options = MatchOptions(
            seed=cell.seed,
            duration=self.duration,
            emergency_at=emergency,
            dialect=cell.dialect,
            errors=NOISE_ONLY,
            solid=False,
        )
        self.network: Simulation | LiveNetwork = LiveNetwork() if cell.live else Simulation()
        self.world = World(self.options, self._clock)
        _, nodes = stage.cast_for(self.options, self.files, self.world)
        self.nodes: dict[str, Node] = {node.name: node for node in nodes}
        self.stations: dict[str, Station] = {}
        self.wheels = Watched(self.world, self.drive.chassis, self._is_commanded)
        self.drive.chassis = self.wheels
        for node in nodes:
            self._attach(node, stage.BOOT_TIMES[node.name])
        self.stranger = Node(Dictionary.load(ROOT / "docs" / "io.eds", STRANGER))
        if self._cause in (*RESETS, STRAY):
            self.network.attach(self.stranger, 0.0, 0.0)
        self.off_until = 0.0
        self.without_core = False
        self.reached: list[float] = []
        self.driven_before = 0.0
        self.last = ""
        self.off = 0.0
        self.playing: asyncio.Task[None] | None = None

    @property
    def _cause(self) -> str:
        """What goes wrong, without what became of the navigation before."""
        return self.cell.how.removesuffix(DEAD)

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

    def _spoil_message(self) -> None:
        cob_id, seen = self.files.protocol.cob_id(self.cell.what), 0
        assert isinstance(self.network, Simulation)

        def disturb(_: float, frame: Frame) -> Sequence[float]:
            nonlocal seen
            if frame.cob_id != cob_id or self.network.now < self.cell.time:
                return ON_TIME
            seen += 1
            if self.cell.how in LOST:
                return () if seen <= LOST[self.cell.how] else ON_TIME
            return (DELAYS[self.cell.how],) if self.cell.how in DELAYS else (0.0, 0.001)

        self.network.disturb = disturb

    def _go_wrong(self) -> None:
        how, now = self.cell.how, self.network.now
        self.driven_before = self.wheels.driven
        if self._cause == SECOND:
            self.network.attach(Core(self.files.dictionaries["core"]), now, processing_time(self.cell.seed, SECOND))
        elif self._cause in RESETS:
            self.stranger.put(Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, RESETS[self._cause]])))
        elif self._cause == STRAY:
            self.stranger.put(self._stray_frame())
        elif self.cell.what == BUS:
            self.off_until = now + PAUSES.get(how, OFF)
            self.network.cut(self.off_until)
        elif how in FREEZES:
            end = now + FREEZES[how]
            self.network.freeze(self.stations[self.cell.what], end)
            self._miss_core_until(end)
        else:
            self.network.detach(self.stations[self.cell.what])
            self._miss_core_until(now + BOOTING if self._cause == "rebooted" else float("inf"))
            if self._cause == "rebooted":
                role, dictionary = ROLES[self.cell.what], self.files.dictionaries[self.cell.what]
                node = role(dictionary)
                equip([node], self.world.vehicle(), self.options.errors, f"{self.cell.seed} again")
                if isinstance(node, Drive):
                    node.chassis = self.wheels
                self._attach(node, now + BOOTING)

    def _stray_frame(self) -> Frame:
        """Return a frame of the message: a goto to the middle, our own team's start; zeros in every other one."""
        protocol = self.files.protocol
        commands = (GotoXY(1500, 1000, 0, 50), StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0))
        for each in commands:
            if self.cell.what == protocol.name(type(each)):
                return protocol.encode(each)
        binding = protocol.binding(self.cell.what)
        return Frame(binding.cob_id, binding.pack(dict.fromkeys(binding.layout.fields, 0)))

    def _miss_core_until(self, time: float) -> None:
        if self.cell.what != "core":
            return
        self.without_core = True
        if time < float("inf"):
            asyncio.get_running_loop().call_later(time - self.network.now, self._core_is_back)
        if self.cell.how not in FREEZES and self.playing is not None:
            self.playing.cancel()  # the strategy is part of the program that has died

    def _core_is_back(self) -> None:
        self.without_core = False
        if self._cause == "rebooted":
            self.playing = asyncio.ensure_future(self._play(BEGIN + self.duration - self.network.now))

    # The match

    async def _play(self, duration: float) -> None:
        options = replace(self.options, duration=max(duration, 1.0))
        await asyncio.sleep(stage.POWER_UP)
        with suppress(EurobotError):  # a match that cannot be played has an end, too
            timeline = Timeline(self._clock, self._told)
            Observer(self.core, timeline, lambda: self.world.robot)
            await Referee(self.core, options, timeline, lambda: self.world.robot).play(strategy.play)

    def _told(self, event: MatchEvent) -> None:
        if event.kind in (EventKind.GIVEN_UP, EventKind.FAILED):
            self.last = event.text
        if event.kind is EventKind.ARRIVED:
            self.reached.append(event.time)
            # A drive that says that it knows its place badly has not called anything a good arrival.
            if event.data["distance"] > DEVIATIONS * (event.data["deviation"] or 0):
                self.off = max(self.off, event.data["distance"])

    async def _run(self) -> bool:
        """Play the match, have it go wrong, and tell whether everything has ended in time."""
        self.playing = asyncio.ensure_future(self._play(self.duration))
        if self.cell.how in MESSAGE_FATES:
            self._spoil_message()
        else:
            if self.cell.how in PAUSES or self.cell.how.endswith(DEAD):
                await asyncio.sleep(BEGIN + NAVIGATION_DIES)
                self.network.detach(self.stations["navigation"])
            await asyncio.sleep(self.cell.time - self.network.now)
            self._go_wrong()
        await asyncio.sleep(BEGIN + self.duration + AFTERWARDS - self.network.now)
        return self.playing.done()

    def result(self) -> Result:
        """Try the cell."""
        network = self.network
        ended = network.run(self._run()) if isinstance(network, LiveNetwork) else loop.run(network, self._run())
        killed = self.cell.what if self.cell.how == "killed" else None
        wrong = {
            "moves at the end": killed != "drive" and self.wheels.moving,
            f"uncommanded for {self.wheels.seconds:.2f} s": self.wheels.seconds > BOUND,
            f"arrived {self.off:.0f} mm off": self.off > OFF_PLACE and self.cell.what not in UNDATED,
            "the match does not end": not ended,
            f"{self.core.open_calls} open calls": killed != "core" and self.core.open_calls > 0,
        }
        went_on = any(time > self.cell.time for time in self.reached)
        drove_on = went_on or self.wheels.driven - self.driven_before > DROVE_ON
        wrong[f"the match does not go on: {self.last}"] = self.cell.how in GOES_ON and not drove_on
        text = "; ".join(text for text, is_so in wrong.items() if is_so)
        return Result(self.cell, self.wheels.seconds, self.wheels.distance, went_on, text)


def attempt(cell: Cell) -> Result:
    """Try a cell, in any process."""
    return Trial(cell).result()


# Which cells


def cells(dialect: str, times: int) -> Iterator[Cell]:
    """Give all cells of a dialect, in the order of the table; a node is lost at each of the `times` of a match."""
    for name in files(dialect).protocol.names():
        yield from (Cell(name, how, dialect=dialect) for how in MESSAGE_FATES)
    losses = [(node, how) for node in ROLES for how in NODE_FATES]
    for what, how in (*losses, (BUS, BUS_FATE)):
        for number in range(times):
            yield Cell(what, how, BEGIN + DURATION * number / times, number + 1, dialect)
    span = PAUSE_UNTIL - PAUSE_FROM
    strange = [("core", how) for how in BEGINNINGS]
    strange += [(name, STRAY + dead) for name in files(dialect).protocol.names() for dead in ("", DEAD)]
    for what, how in strange:
        for number in range(times):
            yield Cell(what, how, BEGIN + PAUSE_FROM + span * number / times, number + 1, dialect)
    for what, how in product(("core", "drive", BUS), PAUSES):
        for number in range(times):
            yield Cell(what, how, BEGIN + PAUSE_FROM + span * number / times, number + 1, dialect)


# The table


def table(results: Iterable[Result]) -> Iterator[str]:
    """Write the results as two tables: a row for each message, and a row for each loss of a node or the bus."""
    rows: dict[str, dict[str, list[Result]]] = {}
    for each in results:
        rows.setdefault(each.cell.what, {}).setdefault(each.cell.how, []).append(each)
    spoiled = {what: fates for what, fates in rows.items() if fates.keys() & {*MESSAGE_FATES}}
    yield f"| message | {' | '.join(MESSAGE_FATES)} |"
    yield "|---" * (1 + len(MESSAGE_FATES)) + "|"
    for what, fates in spoiled.items():
        yield f"| {what} | {' | '.join(_figures(fates.get(how, ())) for how in MESSAGE_FATES)} |"
    yield ""
    yield "| lost | matches | worst | matches that went on |"
    yield "|---|---|---|---|"
    for what, fates in rows.items():
        for how, found in ((how, found) for how, found in fates.items() if how not in MESSAGE_FATES):
            yield f"| {what} {how} | {len(found)} | {_figures(found)} | {sum(each.went_on for each in found)} |"


def _figures(results: Sequence[Result]) -> str:
    """Write the worst of some results; a star marks that no match went on."""
    if not results:
        return ""
    seconds, distance = max(each.seconds for each in results), max(each.distance for each in results)
    return f"{seconds:.2f} s, {distance:.0f} mm" + "*" * (not any(each.went_on for each in results))


def in_one_line(results: Sequence[Result]) -> str:
    """Say in one line what the worst was."""
    worst, farthest = max(results, key=lambda r: r.seconds), max(results, key=lambda r: r.distance)
    return (
        f"{len(results)} cells, {sum(bool(r.wrong) for r in results)} wrong; uncommanded for {worst.seconds:.2f} s at "
        f"most ({worst.cell.what} {worst.cell.how}), {farthest.distance:.0f} mm at most "
        f"({farthest.cell.what} {farthest.cell.how})"
    )


def run_all(
    *,
    dialect: Annotated[str, f"EDS files (default: {dialects.DEFAULT})"] = dialects.DEFAULT,
    times: Annotated[int, Option(metavar="N"), f"times of a match (default: {TIMES})"] = TIMES,
    only: Annotated[str, Option(metavar="TEXT"), "only cells whose name has this in it"] = "",
    live: Annotated[bool, "the pauses without the navigation, in real time"] = False,
    campaign: Annotated[Campaign, HelpGroup("many at once, with all of it")],
) -> int:
    """Lose messages and nodes in matches, see that the robot stands; print table, what is wrong, and figures."""
    chosen = [each for each in cells(dialect, times) if only in f"{each.what} {each.how}"]
    if live:
        chosen = [each._replace(live=True) for each in chosen if each.how in PAUSES]
    kept = campaign.kept(Result, lambda: {"campaign": "losses", "dialect": dialect})
    with campaign.workers(len(chosen)) as workers:
        results = list(counted(in_blocks(attempt, chosen, workers, kept), len(chosen), "cells", workers))
    print(*table(results), sep="\n")
    print()
    wrong = [each for each in results if each.wrong]
    print(*(f"{each.cell.what} {each.cell.how} at {each.cell.time:.2f} s: {each.wrong}" for each in wrong), sep="\n")
    print(in_one_line(results))
    return WRONG if wrong else FINE


def main(words: Sequence[str] | None = None) -> int:
    """Run what the words of a command line say, those of this process if None."""
    parser = Parser("loss_matrix", description=summary(run_all))
    status: int = describe(parser, run_all)(parser.parse_args(words))
    return status


if __name__ == "__main__":
    sys.exit(import_module("loss_matrix").main())  # other processes find it by this name
