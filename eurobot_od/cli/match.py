"""Play a match of core, drive and navigation over a CAN bus, everything on it loaded from the EDS files.

Rule of this file: parse, call `match.stage` or, for many seeds, `match.many`, print.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options as shared
from eurobot_od.cli.recorder import recording
from eurobot_od.errors import LocalError, RemoteError
from eurobot_od.robot.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.frame import Frame
    from eurobot_od.pdo.message import Message
    from eurobot_od.robot.match import Event, Options, Summary
    from eurobot_od.robot.match.played import Played
    from eurobot_od.robot.world import World

    Show = Callable[[Event], None]
    Watch = Callable[[float, Frame], None]

SEEDS = re.compile(r"(?:([0-9]{1,9})-)?([0-9]{1,9})")
"""N or FIRST-LAST."""

MOST_JOBS = 60
"""More processes than these cannot be waited for on Windows."""

OF_ONE_MATCH = {"speed": "fast"} | dict.fromkeys(("seed", "log", "field", "interface", "channel", "bitrate"))
"""Options that mean nothing to the matches of many seeds, and what they are when they are left out."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    colours = [colour.name.lower() for colour in TeamColour]
    parser.add_argument("--team", choices=colours, default="red", help="our colour (default: red)")
    parser.add_argument("--enemies", type=int, choices=range(3), default=2, help="how many enemies (default: 2)")
    parser.add_argument("--confederates", type=int, choices=range(2), default=1, help="confederates (default: 1)")
    parser.add_argument("--seed", type=int, help="seed of all chance: same seed, same frames (default: 1)")
    parser.add_argument("--seeds", type=_seeds, metavar="N|FIRST-LAST", help="play each seed, simulated, and compare")
    parser.add_argument("--jobs", type=_jobs, metavar="N", help="processes for --seeds (default: one a core)")
    parser.add_argument("--duration", type=_positive, metavar="SECONDS", help="match time (default: the core's, 90)")
    parser.add_argument("--speed", choices=("fast", "real"), default="fast", help="simulated or real time")
    parser.add_argument("--emergency-at", type=_positive, metavar="SECONDS", help="hit the mushroom at this match time")
    parser.add_argument("--log", type=Path, metavar="FILE", help="write all frames; the suffix says the format")
    parser.add_argument("--field", type=Path, metavar="FILE", help="draw the match: .svg, .html or .png")
    parser.add_argument(
        "--json", action="store_true", help="print as JSON: timeline and summary, or a line for each seed"
    )
    shared.add_dialect(parser)
    shared.add_bus(parser)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number of seconds")
    return value


def _seeds(text: str) -> range:
    match = SEEDS.fullmatch(text)
    seeds = range(int(match[1] or 1), int(match[2]) + 1) if match else range(0)
    if not seeds:
        raise argparse.ArgumentTypeError(f"{text} is neither a number of seeds nor FIRST-LAST")
    return seeds


def _jobs(text: str) -> int:
    jobs = int(text) if re.fullmatch("[0-9]{1,9}", text) else 0
    if not 1 <= jobs <= MOST_JOBS:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 to {MOST_JOBS}")
    return jobs


def run(arguments: argparse.Namespace) -> int:
    """Play one match, or one for each of many seeds."""
    from eurobot_od.robot.match import Options

    options = Options(
        team=TeamColour[arguments.team.upper()],
        enemies=arguments.enemies,
        confederates=arguments.confederates,
        seed=1 if arguments.seed is None else arguments.seed,
        duration=arguments.duration,
        emergency_at=arguments.emergency_at,
        dialect=arguments.dialect,
    )
    return _run_one(arguments, options) if arguments.seeds is None else _run_many(arguments, options)


# One match


def _run_one(arguments: argparse.Namespace, options: Options) -> int:
    """Play, print the timeline as it happens and the summary at the end."""
    if arguments.jobs is not None:
        raise LocalError("--jobs goes with --seeds only")
    events: list[Event] = []
    show = events.append if arguments.json else partial(_show, sys.stdout.isatty())
    picture = Picture(arguments.field, arguments.dialect)
    with recording(arguments.log) as write:
        summary, world = _play(arguments, options, show, _both(write, picture.add))
    picture.draw(world, f"Match, seed {options.seed}")
    if arguments.json:
        print(_as_json(events, summary))
    else:
        print(_as_text(summary))
    return 0


def _both(one: Watch, other: Watch) -> Watch:
    def watch(time: float, frame: Frame) -> None:
        one(time, frame)
        other(time, frame)

    return watch


def _play(arguments: argparse.Namespace, options: Options, show: Show, watch: Watch) -> tuple[Summary, World]:
    from eurobot_od.robot.match import stage

    if arguments.speed == "fast":
        return stage.play_simulated(options, show, watch)
    return stage.play_live(options, show, watch, partial(shared.open_bus, arguments))


class Picture:
    """The match on the playing field, drawn into `file` at the end; without a file nothing is kept.

    Raises UnknownName for a suffix of no format, before anything is played.
    """

    def __init__(self, file: Path | None, dialect: str | None) -> None:
        self._file, self._dialect = file, dialect
        self._frames: list[tuple[float, Frame]] = []
        if file is not None:
            from eurobot_od.robot.picture.files import form

            form(file)

    def add(self, time: float, frame: Frame) -> None:
        """Keep a frame."""
        if self._file is not None:
            self._frames.append((time, frame))

    def draw(self, world: World, title: str) -> None:
        """Draw what the frames say, and where the robot truly was."""
        if self._file is None:
            return
        from eurobot_od.robot.picture.files import save
        from eurobot_od.robot.picture.recording import record

        save(record(self._messages(), world.path), self._file, title)

    def _messages(self) -> Iterator[tuple[float, Message]]:
        from eurobot_od.robot.protocol import EurobotProtocol

        protocol = EurobotProtocol.load(self._dialect)
        for time, frame in self._frames:
            with suppress(RemoteError):  # the services of CANopen are none of the picture's business
                yield time, protocol.decode(*frame)


COLOURS = {"arrived": 32, "stop": 33, "given up": 33, "emergency": 31, "match": 36, "end": 36}
"""Terminal colours of timeline lines by their kind."""


def _show(in_colour: bool, event: Event) -> None:
    colour = COLOURS.get(event.kind.value) if in_colour else None
    print(f"\x1b[{colour}m{event}\x1b[0m" if colour else event, flush=in_colour)


def _as_json(events: list[Event], summary: Summary) -> str:
    timeline = [{"time": round(e.time, 6), "kind": e.kind.value, "text": e.text} | e.data for e in events]
    return json.dumps({"timeline": timeline, "summary": summary.as_data()}, indent=2)


def _as_text(summary: Summary) -> str:
    lines = ["", f"{'message':<32} {'frames':>7}"]
    lines += [f"{name:<32} {count:>7}" for name, count in (summary.frames | summary.others).items()]
    total = sum(summary.frames.values()) + sum(summary.others.values())
    lines.append(f"{'total':<32} {total:>7}")
    lines.append("")
    sent, known = summary.messages_sent, len(summary.frames)
    lines.append(f"{sent} of {known} messages in {summary.seconds:.1f} s, bus load {summary.load:.2%}")
    if summary.errors:
        reached, mean, worst = len(summary.errors), sum(summary.errors) / len(summary.errors), max(summary.errors)
        places = f"{reached} place{'s' * (reached != 1)} reached"
        lines.append(f"{places}, position error {mean:.1f} mm on average, {worst:.0f} mm at most")
    lines += [f"gatekeeper: {report}" for report in summary.reports]
    return "\n".join(lines)


# Many seeds


def _run_many(arguments: argparse.Namespace, options: Options) -> int:
    """Play all seeds and print what they came to; status 1 if something went wrong in a match."""
    from eurobot_od.robot.match.seeds import cores, play_many

    _check_options(arguments)
    jobs = arguments.jobs or min(cores(), MOST_JOBS)
    with closing(play_many(options, arguments.seeds, jobs)) as matches:
        return 1 if (_print_objects if arguments.json else _print_tally)(matches, len(arguments.seeds)) else 0


def _check_options(arguments: argparse.Namespace) -> None:
    for name, left_out in OF_ONE_MATCH.items():
        if (value := getattr(arguments, name)) != left_out:
            raise LocalError(f"--{name} {value} is for one match, and does not go with --seeds")


def _print_objects(matches: Iterable[Played], number: int) -> bool:
    """Print each match when it is its turn; tell whether something went wrong in one."""
    bad = False
    for match in matches if sys.stdout.isatty() else _watched(matches, number):
        print(json.dumps(match.as_data()))
        bad |= bool(match.wrong)
    return bad


def _print_tally(matches: Iterable[Played], number: int) -> bool:
    """Print what all matches came to; tell whether something went wrong in one."""
    from eurobot_od.robot.match.statistics import report

    played = list(_watched(matches, number))
    print(*report(played), sep="\n")
    return any(match.wrong for match in played)


def _watched(matches: Iterable[Played], number: int) -> Iterable[Played]:
    return _with_progress(matches, number) if sys.stderr.isatty() else matches


def _with_progress(matches: Iterable[Played], number: int) -> Iterator[Played]:
    """Show how many matches are played."""
    from eurobot_od.cli.decode import bar

    try:
        for count, match in enumerate(matches):
            sys.stderr.write(f"\r{bar(count / number)}")
            yield match
    finally:
        sys.stderr.write("\r" + " " * len(bar(1.0)) + "\r")
