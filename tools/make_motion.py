"""Makes the pictures and the table of docs/profiles.md.

They show the motion of the simulated drive in each mode, and its state machine. All of it is measured on the device,
which is commanded by SDO as by a master.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import TRANSITIONS, DriveCommand, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import encode
from eurobot_od.od.standard import SYNC_PERIOD
from eurobot_od.sdo.wire import ClientCommand, carrying
from eurobot_od.support import svg

DOCS = Path(__file__).parents[1] / "docs"
EDS, PAGE, PICTURE = "servo.eds", "profiles.md", "motion.svg"
NODE_ID, STEP = 5, 0.001


class Sample(NamedTuple):
    """The drive at a time in seconds: turns, revolutions a minute, thousandths of its torque."""

    time: float
    wanted: float
    turns: float
    speed: float
    torque: float


class Watched(DriveAxis):
    """An axis that records the states it enters."""

    def __init__(self, *arguments: Any) -> None:
        self.entered: list[State] = []
        super().__init__(*arguments)

    def _enter(self, state: State) -> None:
        self.entered.append(state)
        super()._enter(state)


class WatchedDrive(SimulatedDrive):
    """A drive of such axes."""

    AXIS: ClassVar[type[DriveAxis]] = Watched


class Bench:
    """The drive of the documentation, from power-on: objects are written, time passes, samples are taken."""

    def __init__(self, folder: Path, **options: Any) -> None:
        self.drive = WatchedDrive(Dictionary.load(folder / EDS, NODE_ID), **options)
        self.now = 0.0
        self.samples: list[Sample] = []
        self.drive.start(0.0)

    @property
    def axis(self) -> Watched:
        """The drive's axis."""
        axis = self.drive.axes[0]
        assert isinstance(axis, Watched)
        return axis

    def write(self, index: int, value: int, sub: int = 0) -> None:
        """Write an object over SDO."""
        variable = self.drive.dictionary.variable((index, sub))
        assert variable is not None
        request = carrying(ClientCommand.DOWNLOAD, (index, sub), encode(variable, value))
        self.drive.receive(Frame(0x600 + NODE_ID, request), self.now)

    def command(self, *words: int) -> None:
        """Write controlwords."""
        for word in words:
            self.write(cia402.CONTROLWORD, word)

    def enable(self, mode: Mode) -> None:
        """Enable the drive in a mode."""
        self.write(cia402.MODE, mode)
        self.command(DriveCommand.SHUTDOWN.bits, DriveCommand.SWITCH_ON.bits, DriveCommand.ENABLE.bits)

    def run(self, seconds: float) -> None:
        """Advance the time, and take a sample at each step."""
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            self.drive.tick(self.now)
            self.axis.advance(self.now)
            self.samples.append(self._sample())

    def _sample(self) -> Sample:
        turn = self.axis.units.turn
        value = self.drive.value
        torque = float(value((cia402.TORQUE, 0)) or 0)
        wanted = self.axis.demand.position
        turns, speed = self.axis.motor.position / turn, self.axis.motor.velocity / turn * 60
        return Sample(self.now, wanted / turn, turns, speed, torque)


# Each mode's way over time

TURN = 4096
"""Position units of a turn of the drive in docs/servo.eds, which has no object for it."""

ON = DriveCommand.ENABLE.bits


def _ramps(bench: Bench) -> None:
    """Set ramps of 40 turns/s² up and 80 down."""
    bench.write(cia402.PROFILE_ACCELERATION, 40 * 60)
    bench.write(cia402.PROFILE_DECELERATION, 80 * 60)


def _positions(bench: Bench) -> None:
    """Move by ten turns, and back in two set-points of which the second waits for the first."""
    _ramps(bench)
    bench.write(cia402.PROFILE_VELOCITY, 1200)
    bench.enable(Mode.PROFILE_POSITION)
    for target, wait in ((10, 1.2), (4, 0.2), (0, 1.6)):
        bench.write(cia402.TARGET_POSITION, target * TURN)
        bench.command(ON | cia402.NEW_SET_POINT, ON)
        bench.run(wait)


def _velocities(bench: Bench) -> None:
    """Turn at one velocity, then in reverse, then stop."""
    _ramps(bench)
    bench.enable(Mode.PROFILE_VELOCITY)
    for velocity in (1200, -600, 0):
        bench.write(cia402.TARGET_VELOCITY, velocity)
        bench.run(1.0)


def _home(bench: Bench) -> None:
    """Find the negative limit switch fast, leave it slowly, and find the index pulse (method 1)."""
    bench.write(cia402.HOMING_METHOD, 1)
    bench.write(cia402.HOMING_SPEEDS, 600, 1)
    bench.write(cia402.HOMING_SPEEDS, 120, 2)
    bench.write(cia402.HOMING_ACCELERATION, 3000)
    bench.enable(Mode.HOMING)
    bench.run(0.05)
    bench.command(ON | cia402.HOMING_START)
    bench.run(2.5)


def _cyclic_positions(bench: Bench) -> None:
    """Follow a target position that comes every 10 ms."""
    bench.write(SYNC_PERIOD[0], 10_000)
    bench.enable(Mode.CYCLIC_POSITION)
    for step in range(200):
        share = min(step / 150, 1.0)
        bench.write(cia402.TARGET_POSITION, round(8 * TURN * share * share * (3 - 2 * share)))
        bench.run(0.01)


def _cyclic_velocities(bench: Bench) -> None:
    """Turn at a target velocity that comes every 10 ms, up and down again."""
    bench.enable(Mode.CYCLIC_VELOCITY)
    for step in range(250):
        share = min(step / 200, 1.0)
        bench.write(cia402.TARGET_VELOCITY, round(4 * 1000 * share * (1 - share)))
        bench.run(0.01)


def _torques(bench: Bench) -> None:
    """Push along a slope, with less torque than the friction, and against the motion."""
    bench.write(cia402.TORQUE_SLOPE, 200)
    bench.enable(Mode.PROFILE_TORQUE)
    for torque, wait in ((40, 1.0), (10, 0.5), (-30, 0.6), (0, 0.9)):
        bench.write(cia402.TARGET_TORQUE, torque)
        bench.run(wait)


def _turning(bench: Bench) -> None:
    _ramps(bench)
    bench.write(cia402.QUICK_STOP_DECELERATION, 50 * 60 * 10)
    bench.enable(Mode.PROFILE_VELOCITY)
    bench.write(cia402.TARGET_VELOCITY, 1200)
    bench.run(0.8)


def _quick_stop(bench: Bench) -> None:
    """Stop on the quick stop ramp, which leads to Switch on disabled."""
    _turning(bench)
    bench.command(DriveCommand.QUICK_STOP.bits)
    bench.run(0.7)


def _halt(bench: Bench) -> None:
    """Stop on the ramp of profile velocity, and go on."""
    _turning(bench)
    bench.command(ON | cia402.HALT)
    bench.run(0.8)
    bench.command(ON)
    bench.run(0.8)


class Curve(NamedTuple):
    """A curve of a panel: its label, its colour, and its value of a sample."""

    words: str
    colour: str
    of: Callable[[Sample], float]


WANTED = Curve("demand", svg.RED, lambda sample: sample.wanted)
TURNS = Curve("position, turns", svg.BLUE, lambda sample: sample.turns)
SPEED = Curve("velocity, rpm", svg.GREEN, lambda sample: sample.speed)
TORQUE = Curve("torque, ‰", svg.PURPLE, lambda sample: sample.torque)


class Panel(NamedTuple):
    """A motion: its title, the function that makes it, its curves above and below, and the options of the drive."""

    title: str
    motion: Callable[[Bench], None]
    above: Sequence[Curve] = (WANTED, TURNS)
    options: Mapping[str, Any] = {}


PANELS = (
    Panel("Profile position: 10 turns, then 4 and 0 in a row", _positions),
    Panel("Profile velocity: 1200, -600, 0 rpm", _velocities, (TORQUE,)),
    Panel("Homing, method 1: limit switch, back, index pulse", _home, options={"travel": (-5, 5)}),
    Panel("Cyclic synchronous position: a target each 10 ms", _cyclic_positions),
    Panel("Cyclic synchronous velocity: one each 10 ms", _cyclic_velocities, (TURNS,)),
    Panel("Profile torque: 40, 10, -30, 0 ‰; friction takes 25 ‰", _torques, (TORQUE,)),
    Panel("Quick stop at 0.8 s: ramp 0x6085", _quick_stop, (TORQUE,)),
    Panel("Halt at 0.8 s, on at 1.6 s: ramp 0x6084", _halt, (TORQUE,)),
)

WIDTH, HEIGHT, COLUMNS = 560, 300, 2
LEFT, RIGHT, TOP, MIDDLE, BOTTOM = 64, 24, 54, 24, 34
"""Of a panel and its margins; one unit is a pixel of a screen."""

WIDTHS = ((1.8,), (4.5, 1.5))
"""Widths of the lines: of one curve, and of two that lie upon each other."""

WORDS = 60
"""Room for the label of the curve that is named at the right."""


def picture(folder: Path) -> str:
    """Return the picture of all motions."""
    panels = []
    for number, panel in enumerate(PANELS):
        bench = Bench(folder, **panel.options)
        panel.motion(bench)
        row, column = divmod(number, COLUMNS)
        panels.append(svg.moved((column * WIDTH, row * HEIGHT), *_panel(panel, bench.samples)))
    rows = -(-len(PANELS) // COLUMNS)
    return svg.document("How the simulated drive moves", *panels, width=WIDTH * COLUMNS, height=HEIGHT * rows)


def _panel(panel: Panel, samples: Sequence[Sample]) -> Iterator[str]:
    height = (HEIGHT - TOP - MIDDLE - BOTTOM) / 2
    across = svg.Axis(0.0, samples[-1].time, LEFT, WIDTH - RIGHT)
    yield svg.heading(panel.title)
    for number, curves in enumerate((panel.above, (SPEED,))):
        top = TOP + number * (height + MIDDLE)
        labels = number == 1  # the times stand below the lower one alone
        ticks = [(across.at(each), f"{each:g} s" if labels else "") for each in across.ticks()]
        yield from svg.axis_across(ticks, top, top + height)
        yield from _curves(curves, samples, across, top, top + height)


def _curves(
    curves: Sequence[Curve], samples: Sequence[Sample], across: svg.Axis, top: float, foot: float
) -> Iterator[str]:
    values = [curve.of(sample) for curve in curves for sample in samples]
    low, high = min(*values, 0.0), max(*values, 0.0)
    room = max(high - low, 1.0) / 20
    up = svg.Axis(low - room, high + room, foot, top)
    yield from svg.axis_up(up, LEFT, WIDTH - RIGHT)
    for number, curve in enumerate(curves):
        points = [(across.at(each.time), up.at(curve.of(each))) for each in _thinned(curve, samples)]
        yield svg.polyline(points, fill="none", stroke=curve.colour, stroke_width=WIDTHS[len(curves) - 1][number])
    for number, curve in enumerate(curves):
        place = WIDTH - RIGHT - number * WORDS, top - 4
        yield svg.text(place, curve.words, font_size=svg.TEXT, fill=curve.colour, text_anchor="end")


def _thinned(curve: Curve, samples: Sequence[Sample]) -> list[Sample]:
    """Return every eighth sample, and each at which the curve jumps."""
    jumps = {n for n in range(1, len(samples)) if abs(curve.of(samples[n]) - curve.of(samples[n - 1])) > 5}
    kept = {*range(0, len(samples), 8), len(samples) - 1, *jumps, *(n - 1 for n in jumps)}
    return [samples[n] for n in sorted(kept)]


# The state machine

TABLE = re.compile(r"^\| \| Shutdown \|.*?\n(?=\n)", re.DOTALL | re.MULTILINE)
"""The table in its page."""

NUMBERS = {(each.before, each.after): each.number for each in TRANSITIONS}
WAYS: Mapping[State, tuple[DriveCommand, ...]] = {
    State.DISABLED: (),
    State.READY: (DriveCommand.SHUTDOWN,),
    State.SWITCHED_ON: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON),
    State.ENABLED: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE),
    State.QUICK_STOP: (DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE, DriveCommand.QUICK_STOP),
    State.FAULT_REACTION: (),
    State.FAULT: (),
}
"""The commands that bring the drive into each state; the last two need a fault, too."""

A_FAULT = "a fault"


def _in(folder: Path, state: State) -> Bench:
    """Return a drive that is in a state, and turns if that has torque."""
    bench = Bench(folder)
    bench.write(cia402.QUICK_STOP_OPTION, 6)  # it stays in Quick stop active
    if state is State.FAULT_REACTION:
        _turning(bench)
    bench.command(*(command.bits for command in WAYS[state]))
    if state in (State.FAULT, State.FAULT_REACTION):
        bench.axis.fault(0x1000)
    bench.run(2 * STEP)
    assert bench.axis.state is state
    bench.axis.entered.clear()
    return bench


def _cell(folder: Path, state: State, column: str) -> str:
    """Return the transitions that a command, or a fault, causes in a state, and the states they lead to."""
    bench = _in(folder, state)
    if column == A_FAULT:
        bench.axis.fault(0x1000)
        bench.run(0.5 if state is not State.FAULT_REACTION else STEP)
        is_new = bool(bench.axis.entered)
        return f"13, 14: {bench.axis.state.words}" if is_new else "-"
    command = next(each for each in DriveCommand if each.words == column)
    if command is DriveCommand.FAULT_RESET and state is State.FAULT:
        bench.command(0)  # the reset is a rising edge
        bench.axis.entered.clear()
    bench.command(command.bits)
    way = [state, *bench.axis.entered]
    numbers = [str(NUMBERS[pair]) for pair in pairwise(way)]
    return f"{', '.join(numbers)}: {way[-1].words}" if numbers else "-"


def table(folder: Path) -> str:
    """Return the state machine as a Markdown table: the transitions that each command causes in each state."""
    columns = [*(each.words for each in DriveCommand), A_FAULT]
    rows = [[state.words, *(_cell(folder, state, each) for each in columns)] for state in WAYS]
    lines = [["", *columns], ["---"] * (len(columns) + 1), *rows]
    return "".join(f"| {' | '.join(line)} |\n".replace("|  |", "| |") for line in lines)


def with_table(page: str, made: str) -> str:
    """Return a page with its table replaced."""
    return TABLE.sub(lambda _: made, page)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture, and the table into its page."""
    parser = argparse.ArgumentParser(description="Make what the documentation shows of the simulated drive.")
    parser.add_argument("--folder", type=Path, default=DOCS, help="where to (default: docs)")
    folder: Path = parser.parse_args(arguments).folder
    (folder / PICTURE).write_text(picture(folder), encoding="utf-8")
    page = folder / PAGE
    page.write_text(with_table(page.read_text(encoding="utf-8"), table(folder)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
