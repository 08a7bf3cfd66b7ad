"""Play a match of core, drive and navigation over a CAN bus, everything on it loaded from the EDS files."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od import plugin
from eurobot_od.cli import ExitStatus, campaign, complain, fall_silent
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.robot.commands.common import add_sides, options_of, status_of
from eurobot_od.robot.model.options import UNITS, Errors
from eurobot_od.support.terminal import folded, in_colour

if TYPE_CHECKING:
    import can

    from eurobot_od.frame import Frame
    from eurobot_od.plugin import Plugin
    from eurobot_od.robot.match import MatchEvent, MatchOptions
    from eurobot_od.robot.match.referee import StrategyFiles
    from eurobot_od.robot.world import World

SEEDS = re.compile(r"(?:([0-9]{1,9})-)?([0-9]{1,9})")
"""N or FIRST-LAST."""

OF_A_BUS = ("interface", "channel", "bitrate")
"""Options that mean nothing in simulated time."""

OF_ONE_MATCH = {"speed": "fast"} | dict.fromkeys(("seed", "field", *OF_A_BUS))
"""Options that mean nothing to the matches of many seeds, and what they are when they are left out."""


REPEATABLE = {
    "--fault": ("NAME", "give a node a fault; `faults` lists them"),
    "--set": (
        "NAME=VALUE",
        "value in place of the EDS file's, such as 'drive.Motion.Maximum speed=600', or of robot.yaml's, such as "
        "body.radius=250",
    ),
    "--world": ("NAME=VALUE", "error of the simulated world, see below"),
}
"""What our nodes and the world are to be like: the form of each option's value, and its help."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    file: dict[str, Any] = {"type": Path, "metavar": "FILE"}
    time = partial(shared.positive, of=" of seconds")
    add_sides(parser)
    parser.add_argument("--seed", type=int, help="seed of all chance: same seed, same frames (default: 1)")
    parser.add_argument("--seeds", type=_seeds, metavar="N|FIRST-LAST", help="play each seed, simulated, and compare")
    parser.add_argument("--duration", type=time, metavar="SECONDS", help="match time (default: robot.yaml's)")
    parser.add_argument("--speed", choices=("fast", "real"), default="fast", help="simulated or real time")
    parser.add_argument("--emergency-at", type=time, metavar="SECONDS", help="hit the mushroom at this match time")
    parser.add_argument("--strategy", **file, help="Python file with a coroutine play(core); left out: the robot's")
    parser.add_argument("--compare", **file, nargs="+", help="play the same --seeds with each of these strategies")
    parser.add_argument("--against", **file, help="strategy of a second robot, instead of enemy 1")
    shared.add_log(parser)
    parser.add_argument("--field", **file, help="draw the match: .svg, .html or .png; with --compare the points: .svg")
    parser.add_argument(
        "--json", action="store_true", help="print as JSON: timeline and summary, or a line for each seed"
    )
    campaign.add_campaign(parser, "--seeds")
    shared.add_dialect(parser)
    nodes = parser.add_argument_group("our nodes and the world, each option repeatable")
    for name, (form, words) in REPEATABLE.items():
        nodes.add_argument(name, action="append", default=[], metavar=form, help=words)
    errors = (f"{name}={value:g} {UNITS.get(name, '')}".rstrip() for name, value in vars(Errors()).items())
    parser.epilog = f"Errors of the world; without a unit they are shares or rates of 0..1: {', '.join(errors)}."
    shared.add_bus(parser, "; without one, --speed real takes a bus in this process")


def _seeds(text: str) -> range:
    match = SEEDS.fullmatch(text)
    seeds = range(int(match[1] or 1), int(match[2]) + 1) if match else range(0)
    if not seeds:
        raise argparse.ArgumentTypeError(f"{text} is neither a number of seeds nor FIRST-LAST")
    return seeds


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Play one match, or one for each of many seeds."""
    options = replace(
        options_of(arguments, shared.assignments("--set", "NODE.OBJECT=VALUE", arguments.set)),
        duration=arguments.duration,
        emergency_at=arguments.emergency_at,
        faults=tuple(arguments.fault),
    )
    if arguments.compare is not None:
        return _compare(arguments, options)
    play = _run_one if arguments.seeds is None else _run_many
    return play(arguments, options)


def _strategies(arguments: argparse.Namespace) -> StrategyFiles:
    from eurobot_od.robot.match.referee import StrategyFiles

    if arguments.against is not None and arguments.speed == "real":
        raise LocalError("--against is for simulated time, and does not go with --speed real")
    ours, folder = arguments.strategy, plugin.find(arguments.robot).folder
    if ours is None and folder and (folder / "strategy.py").is_file():
        ours = folder / "strategy.py"  # a team's own robot brings one; None is the shipped one
    return StrategyFiles(ours, arguments.against)


# One match


def _run_one(arguments: argparse.Namespace, options: MatchOptions) -> ExitStatus:
    """Play, print the timeline as it happens and the summary at the end; status 1 if the strategy raised."""
    from eurobot_od.bus import live
    from eurobot_od.robot.match import stage
    from eurobot_od.traffic.recorder import recording

    _refuse_what_does_not_go_with_one_match(arguments)
    # Loaded before the log is opened: a mistake in the strategy must not leave an empty log behind.
    players = _strategies(arguments).load()
    events: list[MatchEvent] = []
    frames: list[tuple[float, Frame]] = []
    began: list[float] = []
    with recording(arguments.log, arguments.log_failure, complain) as write:

        def watch(time: float, frame: Frame) -> None:
            write(time, frame)
            if not began:
                began.append(time)
            if arguments.field is not None:
                frames.append((time, frame))

        show = events.append if arguments.json else partial(_show, in_colour(sys.stdout))
        # What a strategy prints is not to get into the JSON.
        with redirect_stdout(sys.stderr) if arguments.json else nullcontext():
            if arguments.speed == "fast":
                summary, world = stage.play_simulated(options, show, watch, None, *players, complain)
            else:
                bus, bit_rate = _bus(arguments), arguments.bitrate or live.BITRATE
                summary, world = stage.play_live(options, show, watch, bus, players.ours, complain, bit_rate)
        if arguments.field is not None:
            from eurobot_od.robot.match.drawing import draw

            draw(arguments.field, frames, options, world)
        if arguments.json:
            timeline = [each.as_data() for each in events]
            print(json.dumps({"timeline": timeline, "summary": summary.as_data()}, indent=2))
        else:
            print(f"\n{summary}")
    if arguments.log is not None and began:
        # After the log, which is whole only now.
        _keep_truth(arguments.log, world, began[0])
    return status_of(summary)


def _keep_truth(log: Path, world: World, began: float) -> None:
    """Write what only the world knows beside the log; without it the match is a match all the same."""
    from eurobot_od.robot.match.drawing import truth_of
    from eurobot_od.robot.scene.truth_file import write_truth

    try:
        write_truth(log, truth_of(world), began)
    except OSError as error:
        complain(f"{error.filename}: {error.strerror}: points and touches are not kept")


def _bus(arguments: argparse.Namespace) -> Callable[[], can.BusABC]:
    """Return what opens the bus of a live match; complain of a bit rate that is too slow for the robot's messages."""
    from eurobot_od.bus.live import open_bus

    slow = too_slow(plugin.find(arguments.robot), arguments.dialect, arguments.bitrate) if arguments.bitrate else ""
    # Said and not refused: a team may have no faster bus, and most messages are in time on it.
    if slow:
        complain(slow)
    return partial(open_bus, arguments.interface, arguments.channel, arguments.bitrate)


def too_slow(robot: Plugin, dialect: str | None, bit_rate: int) -> str:
    """Say of a bit rate, bit/s, at which a stop or another message can be late that it is too slow; '' of others."""
    from eurobot_od.cli.load import of_robot
    from eurobot_od.traffic.load.report import load_report, summary

    report = load_report(of_robot(robot, dialect), bit_rate)
    return "" if report.holds else f"this bus is too slow: {summary(report)}; see `load -b {bit_rate}`"


def _refuse_what_does_not_go_with_one_match(arguments: argparse.Namespace) -> None:
    """Raise LocalError, and OSError for a picture that could not be written: before the match, not after it."""
    campaign.refuse(arguments, "--seeds")
    # Refused rather than ignored: whoever names a bus expects the robot on it to move.
    for name in OF_A_BUS if arguments.speed == "fast" else ():
        if (value := getattr(arguments, name)) is not None:
            raise LocalError(f"--{name} {value} goes with --speed real only: in simulated time there is no such bus")
    if arguments.field is not None:
        from eurobot_od.robot.scene.files import form
        from eurobot_od.support.files import check_writable

        form(arguments.field)
        check_writable(arguments.field)


EVENT_COLOURS = {"arrived": 32, "stop": 33, "given up": 33, "emergency": 31, "match": 36, "end": 36}
"""Terminal colours of timeline lines by their kind."""

INDENT = len("    0.000 s  configure  ")
"""Where an event's text begins in its line."""


def _show(coloured: bool, event: MatchEvent) -> None:
    """Print an event; a match that nobody reads any more is played to its end, for its log."""
    colour = EVENT_COLOURS.get(event.kind.value) if coloured else None
    try:
        line = folded(str(event), sys.stdout, INDENT)
        print(f"\x1b[{colour}m{line}\x1b[0m" if colour else line, flush=sys.stdout.isatty())
    except BrokenPipeError:
        fall_silent()


# Many seeds


def _run_many(arguments: argparse.Namespace, options: MatchOptions) -> ExitStatus:
    """Play all seeds and print what they came to; status 1 if something went wrong in a match."""
    from eurobot_od.robot.match.played import PlayedMatch
    from eurobot_od.robot.match.seeds import SEED, play_many, settings
    from eurobot_od.robot.match.statistics import bar_marks, report

    for name, left_out in OF_ONE_MATCH.items():
        if (value := getattr(arguments, name)) != left_out:
            raise LocalError(f"--{name} {value} is for one match, and does not go with --seeds")
    log = None if arguments.log is None else str(arguments.log)
    # Without it each match would overwrite the log of the one before.
    if log is not None and SEED not in log:
        raise LocalError(f"--log {log}: write {SEED} where each match's seed is to stand")
    strategies, played = _strategies(arguments), []
    results = campaign.results(arguments, PlayedMatch, lambda: settings(options, strategies))
    with campaign.workers(arguments, len(arguments.seeds)) as workers:
        matches = play_many(options, arguments.seeds, workers, strategies, results, log)
        hidden = arguments.json and sys.stdout.isatty()  # its lines tell how far it is
        for match in campaign.counted(matches, len(arguments.seeds), "matches", workers, hidden):
            played.append(match)
            if arguments.json:
                print(json.dumps(match.as_data()))
    if not arguments.json:
        print(*report(played, bar_marks(sys.stdout.encoding)), sep="\n")
    return ExitStatus.FOUND if any(match.wrong for match in played) else ExitStatus.FINE


# Many seeds, several strategies

OF_NO_COMPARISON = {"speed": "fast"} | dict.fromkeys(("seed", "strategy", "log", "results", *OF_A_BUS))
"""Options that mean nothing when strategies are compared, and what they are when they are left out."""


def _compare(arguments: argparse.Namespace, options: MatchOptions) -> ExitStatus:
    """Play all seeds with each strategy and print them side by side; status 1 if something went wrong in a match."""
    from eurobot_od.cli.output import write
    from eurobot_od.robot.match.comparison import picture, report
    from eurobot_od.robot.match.referee import StrategyFiles
    from eurobot_od.robot.match.seeds import play_many
    from eurobot_od.support.files import check_writable

    for name, left_out in OF_NO_COMPARISON.items():
        if (value := getattr(arguments, name)) != left_out:
            raise LocalError(f"--{name} {value} does not go with --compare")
    if arguments.seeds is None or len({file.stem for file in arguments.compare}) < max(len(arguments.compare), 2):
        raise LocalError("--compare needs two strategies or more, with different names, and --seeds")
    if arguments.field is not None:
        if arguments.field.suffix.lower() != ".svg":
            raise LocalError(f"--field {arguments.field}: with --compare it is an .svg")
        check_writable(arguments.field)
    played = {}
    for file in arguments.compare:
        with campaign.workers(arguments, len(arguments.seeds)) as workers:
            matches = play_many(options, arguments.seeds, workers, StrategyFiles(file, arguments.against))
            played[file.stem] = list(campaign.counted(matches, len(arguments.seeds), "matches", workers))
    if arguments.json:
        print(json.dumps({name: [match.as_data() for match in matches] for name, matches in played.items()}))
    else:
        print(*report(played), sep="\n")
    if arguments.field is not None:
        write(arguments.field, picture(played) + "\n")
    return ExitStatus.FOUND if any(match.wrong for matches in played.values() for match in matches) else ExitStatus.FINE
