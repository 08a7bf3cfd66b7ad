"""`match` plays a match of core, drive and navigation over a CAN bus, everything loaded from the EDS files."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from eurobot_od import loading
from eurobot_od.bus import live
from eurobot_od.cli import ExitStatus, RobotName, complain, fall_silent
from eurobot_od.cli.devices import Dialect
from eurobot_od.cli.options import LONG_RUN, BusOptions, Campaign, Faults, Json, assigned, counted, span_below
from eurobot_od.cli.signature import HelpGroup, Option
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.plugin import Plugin
from eurobot_od.robot.commands import Sides, WorldErrors, status_of
from eurobot_od.robot.match import MatchEvent, stage
from eurobot_od.robot.match.referee import StrategyFiles
from eurobot_od.robot.model.options import UNITS, Errors, MatchOptions
from eurobot_od.support.files import check_writable, write_whole
from eurobot_od.support.progress import folded, in_colour
from eurobot_od.traffic.recorder import END, GO_ON, recording

if TYPE_CHECKING:
    import can

    from eurobot_od.robot.scene.files import SeenMatch

SEEDS = re.compile(r"(?:([0-9]{1,9})-)?([0-9]{1,9})")
"""N or FIRST-LAST."""


def _seeds(text: str) -> range:
    """Parse the seeds of many matches; raises LocalError."""
    match = SEEDS.fullmatch(text)
    seeds = range(int(match[1] or 1), int(match[2]) + 1) if match else range(0)
    if match and match[1] and not seeds:
        raise LocalError(f"{text}: the first seed is above the last; FIRST-LAST is {match[2]}-{match[1]}")
    if not seeds:
        raise LocalError(f"{text} is neither a number of seeds nor FIRST-LAST")
    return seeds


def _match_time(text: str) -> float:
    """Parse a time in a match; raises LocalError."""
    seconds = span_below(LONG_RUN)(text)
    if not seconds:
        raise LocalError(f"a time of {text} is not above 0")
    return seconds


MatchTime: TypeAlias = Annotated[float, Option(metavar="TIME", read=_match_time)]
File: TypeAlias = Annotated[Path, Option(metavar="FILE")]
Written: TypeAlias = Annotated[File, Option(is_output=True)]
ERRORS = ", ".join(f"{name}={value:g} {UNITS.get(name, '')}".rstrip() for name, value in vars(Errors()).items())


@dataclass(frozen=True, kw_only=True)
class NodesAndWorld:
    """Settings and faults of our nodes, and errors of the world.

    fault: give a node a fault; `faults` lists them
    values: value in place of the EDS file's, such as 'drive.Motion.Maximum speed=600', or of robot.yaml's, such as
        body.radius=250
    """

    GROUP = HelpGroup("our nodes and the world, each option repeatable")

    fault: Faults = ()
    values: Annotated[Sequence[tuple[str, str]], Option("--set"), assigned("NAME=VALUE")] = ()
    errors: Annotated[
        WorldErrors,
        f"error of the simulated world; these are there, without a unit as shares or rates of 0..1: {ERRORS}",
    ] = ()


@dataclass(frozen=True, kw_only=True)
class AskedMatch:
    """A match, or many, as the command line describes it.

    seed: seed of all chance: same seed, same frames (default: 1)
    seeds: play each seed, simulated, and compare
    duration: match time, such as 45 or 1min (default: robot.yaml's)
    speed: simulated or real time
    emergency_at: hit the mushroom at this match time
    strategy: Python file with a coroutine play(core); left out: the robot's
    compare: play the same --seeds with each of these strategies
    against: strategy of a second robot, instead of enemy 1
    log: write all frames there, in the format of its suffix; with --seeds {seed} stands for each seed
    log_failure: what to do when the log cannot be written (default: go-on); the exit status is 3 in any case
    field: draw the match: .svg, .html or .png; with --compare .html, the matches side by side
    as_json: print as JSON: timeline and summary, or a line for each seed
    """

    sides: Sides
    seed: int | None = None
    seeds: Annotated[range | None, Option(metavar="N|FIRST-LAST", read=_seeds)] = None
    duration: Annotated[MatchTime | None, Option("--for")] = None
    speed: Literal["fast", "real"] = "fast"
    emergency_at: MatchTime | None = None
    strategy: File | None = None
    compare: Annotated[Sequence[File], Option(nargs="+")] = ()
    against: File | None = None
    log: Written | None = None
    log_failure: Annotated[str, Option(choices=(GO_ON, END))] = GO_ON
    field: Written | None = None
    as_json: Json = False
    campaign: Annotated[Campaign, HelpGroup("many at once, with --seeds")]
    dialect: Dialect = None
    robot_name: RobotName = None
    nodes: NodesAndWorld
    bus: Annotated[
        BusOptions,
        HelpGroup("bus", "default: python-can's configuration; without one, --speed real takes a bus in this process"),
    ]

    @property
    def robot(self) -> Plugin:
        """The robot that plays; raises as `loading.find`."""
        return loading.find(self.robot_name)

    @property
    def options(self) -> MatchOptions:
        """The options for one seed; raises UnknownName, LocalError."""
        return MatchOptions(
            **vars(self.sides),
            seed=1 if self.seed is None else self.seed,
            duration=self.duration,
            emergency_at=self.emergency_at,
            dialect=self.dialect,
            errors=Errors().changed_by(self.nodes.errors),
            faults=tuple(self.nodes.fault),
            settings=tuple(self.nodes.values),
            robot=self.robot_name,
        )

    @property
    def strategies(self) -> StrategyFiles:
        """The files of the strategies; raises LocalError."""
        if self.against is not None and self.speed == "real":
            raise LocalError("--against is for simulated time, and does not go with --speed real")
        ours = self.strategy
        folder = self.robot.folder
        if ours is None and folder and (folder / "strategy.py").is_file():
            ours = folder / "strategy.py"  # that of a team's own robot; None is the shipped one
        return StrategyFiles(ours, self.against)

    def refuse(self, names: Iterable[str], why: str) -> None:
        """Refuse options that are given, including those of the bus; raises LocalError."""
        usual = {"speed": "fast"}
        for name in names:
            value = getattr(self.bus if name in OF_A_BUS else self, name)
            if value != usual.get(name):
                raise LocalError(f"--{name} {value} {why}")


LONG = 10
"""Multiple of a match's usual duration above which a mistake in the unit is likely."""

OF_A_BUS = ("interface", "channel", "bitrate")
"""Options without a meaning in simulated time."""


def match(asked: AskedMatch) -> ExitStatus:
    """Play a match of core, drive and navigation over a CAN bus, everything on it loaded from the EDS files.

    $ match --field match.html
    $ match --seeds 20
    $ match --strategy mine.py --fault stop-ignored
    """
    options = asked.options
    usual = options.facts().duration
    if asked.duration and asked.duration > LONG * usual:
        complain(f"--for: a match of {asked.duration:g} s; robot.yaml says {usual} s")
    if _is_changed(asked.robot):
        from eurobot_od.cli.lint import differs_from_table  # its rules take time to import

        differs_from_table(asked.robot)
    if asked.compare:
        return _compare(asked, options)
    return _run_one(asked, options) if asked.seeds is None else _run_many(asked, asked.seeds, options)


def _is_changed(robot: Plugin) -> bool:
    """Return whether a team's own table was written after its EDS files."""
    table, folder = robot.table, robot.dialects.root
    if not (robot.folder and folder and table and table.is_file()):
        return False
    return any(each.stat().st_mtime < table.stat().st_mtime for each in folder.glob("*/*.eds"))


# One match


def _run_one(asked: AskedMatch, options: MatchOptions) -> ExitStatus:
    """Play, print the timeline as it happens and the summary at the end; return 1 if the strategy raised."""
    _check_options(asked)
    # Loaded before the log is opened, so that a mistake in the strategy leaves no empty log.
    players = asked.strategies.load()
    events: list[MatchEvent] = []
    frames: list[tuple[float, Frame]] = []
    with recording(asked.log, asked.log_failure, complain) as write_frame:

        def watch(time: float, frame: Frame) -> None:
            write_frame(time, frame)
            if asked.field is not None or not frames:  # the first frame is the start of the truth
                frames.append((time, frame))

        show = events.append if asked.as_json else partial(_show, in_colour(sys.stdout))
        # A strategy's output must not get into the JSON.
        with redirect_stdout(sys.stderr) if asked.as_json else nullcontext():
            if asked.speed == "fast":
                found, world = stage.play_simulated(options, show, watch, None, *players, complain)
            else:
                bit_rate = asked.bus.bitrate or live.BITRATE
                found, world = stage.play_live(options, show, watch, _bus(asked), players.ours, complain, bit_rate)
        if asked.field is not None:
            from eurobot_od.robot.scene.files import draw

            draw(asked.field, frames, options, world)
        if asked.as_json:
            timeline = [each.as_data() for each in events]
            print(json.dumps({"timeline": timeline, "summary": found.as_data()}, indent=2))
        else:
            print(f"\n{found}")
    if asked.log is not None and frames:
        from eurobot_od.robot.scene.files import keep_truth

        keep_truth(asked.log, world, frames[0][0], complain)  # after the log, which is complete only now
    return status_of(found)


def _bus(asked: AskedMatch) -> Callable[[], can.BusABC]:
    """Return a function that opens the bus of a live match.

    Warn if its bit rate is too low for the robot's messages.
    """
    slow = too_slow(asked.robot, asked.dialect, asked.bus.bitrate) if asked.bus.bitrate else ""
    # Not refused, as a team may have no faster bus, and most messages are in time.
    if slow:
        complain(slow)
    return partial(live.open_bus, asked.bus.interface, asked.bus.channel, asked.bus.bitrate)


def too_slow(robot: Plugin, dialect: str | None, bit_rate: int) -> str:
    """Return why a bit rate, in bit/s, is too low, as a stop or another message can be late; empty if it is not."""
    from eurobot_od.cli.load import of_robot
    from eurobot_od.traffic.load import load_report, summary

    found = load_report(of_robot(robot, dialect), bit_rate)
    return "" if found.holds else f"this bus is too slow: {summary(found)}; see `load -b {bit_rate}`"


def _check_options(asked: AskedMatch) -> None:
    """Check the options of one match before it is played; raises LocalError, and OSError for a picture's file."""
    asked.campaign.refuse("--seeds")
    # Not ignored, as a user who names a bus expects the robot on it to move.
    if asked.speed == "fast":
        asked.refuse(OF_A_BUS, "goes with --speed real only: in simulated time there is no such bus")
    if asked.field is not None:
        from eurobot_od.robot.scene.files import form

        form(asked.field)
        check_writable(asked.field)


EVENT_COLOURS = {"arrived": 32, "stop": 33, "given up": 33, "emergency": 31, "match": 36, "end": 36}
"""Terminal colours of the lines of a timeline, by the kind of event."""

INDENT = len("    0.000 s  configure  ")
"""Column of an event's text in its line."""


def _show(coloured: bool, event: MatchEvent) -> None:
    """Print an event; if standard output is closed, the match goes on for its log."""
    colour = EVENT_COLOURS.get(event.kind.value) if coloured else None
    try:
        line = folded(str(event), sys.stdout, INDENT)
        print(f"\x1b[{colour}m{line}\x1b[0m" if colour else line, flush=sys.stdout.isatty())
    except BrokenPipeError:
        fall_silent()


# Many seeds


def _run_many(asked: AskedMatch, seeds: range, options: MatchOptions) -> ExitStatus:
    """Play all seeds and print a summary; return 1 if something went wrong in a match."""
    # here, as one match does not need it
    from eurobot_od.robot.match.seeds import SEED, PlayedMatch, play_many, report, settings

    asked.refuse(("speed", "seed", "field", *OF_A_BUS), "is for one match, and does not go with --seeds")
    log = None if asked.log is None else str(asked.log)
    # Otherwise each match would overwrite the log before.
    if log is not None and SEED not in log:
        raise LocalError(f"--log {log}: write {SEED} where each match's seed is to stand")
    strategies = asked.strategies
    played = []
    results = asked.campaign.kept(PlayedMatch, lambda: settings(options, strategies))
    status = ExitStatus.INTERRUPTED
    with suppress(KeyboardInterrupt), asked.campaign.workers(len(seeds)) as workers:
        matches = play_many(options, seeds, workers, strategies, results, log)
        hidden = asked.as_json and sys.stdout.isatty()  # the lines show the progress
        for match in counted(matches, len(seeds), "matches", workers, hidden):
            played.append(match)
            if asked.as_json:
                print(json.dumps(match.as_data()))
        status = ExitStatus.FOUND if any(match.wrong for match in played) else ExitStatus.FINE
    if played and not asked.as_json:
        print(*report(played), sep="\n")
    return status


# Many seeds, several strategies


def _compare(asked: AskedMatch, options: MatchOptions) -> ExitStatus:
    """Play all seeds with each strategy and print them side by side; return 1 if something went wrong in a match."""
    from eurobot_od.robot.match.seeds import compared, farthest_apart, play_many

    asked.refuse(("speed", "seed", "strategy", "log", *OF_A_BUS), "does not go with --compare")
    if asked.campaign.results is not None:
        raise LocalError(f"--results {asked.campaign.results} does not go with --compare")
    if asked.seeds is None or len({file.stem for file in asked.compare}) < max(len(asked.compare), 2):
        raise LocalError("--compare needs two strategies or more, with different names, and --seeds")
    if asked.field is not None:
        if asked.field.suffix.lower() != ".html":
            raise LocalError(f"--field {asked.field}: with --compare it is an .html")
        check_writable(asked.field)
    played = {}
    for file in asked.compare:
        with asked.campaign.workers(len(asked.seeds)) as workers:
            matches = play_many(options, asked.seeds, workers, StrategyFiles(file, asked.against))
            played[file.stem] = list(counted(matches, len(asked.seeds), "matches", workers))
    if asked.as_json:
        print(json.dumps({name: [match.as_data() for match in matches] for name, matches in played.items()}))
    else:
        print(*compared(played), sep="\n")
    if asked.field is not None:
        seed = farthest_apart(played)
        _draw_side_by_side(asked, replace(options, seed=seed))
        if not asked.as_json:
            print(f"{asked.field}: seed {seed}, at which the points differ most")
    return ExitStatus.FOUND if any(match.wrong for matches in played.values() for match in matches) else ExitStatus.FINE


def _seen(options: MatchOptions, strategies: StrategyFiles) -> SeenMatch:
    from eurobot_od.robot.scene.files import seen_match

    frames: list[tuple[float, Frame]] = []
    with redirect_stdout(sys.stderr):
        _, world = stage.play_simulated(
            options, lambda _: None, lambda *frame: frames.append(frame), None, *strategies.load()
        )
    return seen_match(frames, options, world)


def _draw_side_by_side(asked: AskedMatch, options: MatchOptions) -> None:
    """Play a seed again with each strategy, which gives the same frames, and write the page with all of them."""
    from eurobot_od.robot.scene.files import side_by_side

    assert asked.field is not None
    matches = {file.stem: _seen(options, StrategyFiles(file, asked.against)) for file in asked.compare}
    write_whole(asked.field, side_by_side(matches, f"Match, seed {options.seed}"))
