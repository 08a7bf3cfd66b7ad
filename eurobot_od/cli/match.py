"""Play a match of core, drive and navigation over a CAN bus, everything on it loaded from the EDS files.

Rule of this file: parse, call `match.stage`, print.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options as shared
from eurobot_od.cli.recorder import recording
from eurobot_od.errors import RemoteError
from eurobot_od.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.frame import Frame
    from eurobot_od.match import Event, Options, Summary
    from eurobot_od.messages import Message
    from eurobot_od.simulation.world import World

    Show = Callable[[Event], None]
    Watch = Callable[[float, Frame], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    colours = [colour.name.lower() for colour in TeamColour]
    parser.add_argument("--team", choices=colours, default="red", help="our colour (default: red)")
    parser.add_argument("--enemies", type=int, choices=range(3), default=2, help="how many enemies (default: 2)")
    parser.add_argument("--confederates", type=int, choices=range(2), default=1, help="confederates (default: 1)")
    parser.add_argument("--seed", type=int, default=1, help="seed of all chance: same seed, same frames (default: 1)")
    parser.add_argument("--duration", type=_positive, metavar="SECONDS", help="match time (default: the core's, 90)")
    parser.add_argument("--speed", choices=("fast", "real"), default="fast", help="simulated or real time")
    parser.add_argument("--emergency-at", type=_positive, metavar="SECONDS", help="hit the mushroom at this match time")
    parser.add_argument("--log", type=Path, metavar="FILE", help="write all frames; the suffix says the format")
    parser.add_argument("--field", type=Path, metavar="FILE", help="draw the match: .svg, .html or .png")
    parser.add_argument("--json", action="store_true", help="print timeline and summary as JSON")
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


def run(arguments: argparse.Namespace) -> int:
    """Play, print the timeline as it happens and the summary at the end."""
    from eurobot_od.match import Options

    options = Options(
        team=TeamColour[arguments.team.upper()],
        enemies=arguments.enemies,
        confederates=arguments.confederates,
        seed=arguments.seed,
        duration=arguments.duration,
        emergency_at=arguments.emergency_at,
        dialect=arguments.dialect,
    )
    events: list[Event] = []
    show = events.append if arguments.json else partial(_show, sys.stdout.isatty())
    picture = Picture(arguments.field, arguments.dialect)
    with recording(arguments.log) as write:
        summary, world = _play(arguments, options, show, _both(write, picture.add))
    picture.draw(world, f"Match, seed {arguments.seed}")
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
    from eurobot_od.match import stage

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
            from eurobot_od.view.files import form

            form(file)

    def add(self, time: float, frame: Frame) -> None:
        """Keep a frame."""
        if self._file is not None:
            self._frames.append((time, frame))

    def draw(self, world: World, title: str) -> None:
        """Draw what the frames say, and where the robot truly was."""
        if self._file is None:
            return
        from eurobot_od.view.files import save
        from eurobot_od.view.recording import record

        save(record(self._messages(), world.path), self._file, title)

    def _messages(self) -> Iterator[tuple[float, Message]]:
        from eurobot_od.protocol import Protocol

        protocol = Protocol.load(self._dialect)
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
