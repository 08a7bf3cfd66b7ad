"""A match that was played, as values: how each goto ended, what was on the bus, and what needs a look.

It depends only on the options and the EDS files: whoever plays a seed again gets the same result.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from eurobot_od.errors import ProgramFailed, RemoteError
from eurobot_od.robot.match.referee import Players
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.match.summary import RobotTouch, Summary, touches_of
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.values import OURS, Outcome, Passage
from eurobot_od.robot.world.bodies import Touch
from eurobot_od.robot.world.world import EventKind, MatchEvent
from eurobot_od.traffic.recorder import recording

ARRIVED = Outcome.ARRIVED.value
UNMEANT = tuple(outcome.value for outcome in (Outcome.NOT_POSSIBLE, Outcome.REPLACED, Outcome.LOST))
"""Ways for a goto to end that nobody wanted; if it was blocked, the robot drove into something, which counts as a
touch."""

SHIPPED = Players()


class PlayedGoto(NamedTuple):
    """How a goto to a place, mm and degrees, ended, and how many seconds after its first transmission.

    `end` is its outcome; for a stop, with the reason. At an arrival, in mm: the `distance` from the place to where the
    robot truly was, and the `error` of the position that it believed in.
    """

    x: int
    y: int
    angle: int
    end: str
    seconds: float
    distance: float | None = None
    error: float | None = None


class PlayedTask(NamedTuple):
    """A task that was done: when it ended, in seconds, and its result in points or fruit."""

    time: float
    task: str
    gain: int


@dataclass(frozen=True)
class PlayedMatch:
    """The result of the match of a seed.

    `failure` says why it could not be played to its end; then there is no `summary`, and the rest covers the time until
    then. `moved` is how far the robot moved after it had come to rest, mm; `stops` is how often it was stopped for
    something ahead; `driven` is how far it drove, m.
    """

    seed: int
    gotos: list[PlayedGoto] = field(default_factory=list)
    tasks: list[PlayedTask] = field(default_factory=list)
    touches: list[RobotTouch] = field(default_factory=list)
    stops: int = 0
    moved: float = 0.0
    summary: Summary | None = None
    failure: str | None = None
    warnings: list[str] = field(default_factory=list)
    driven: float = 0.0

    @property
    def points(self) -> int:
        """Our points; 0 if the match could not be played to its end."""
        return self.summary.points.get(OURS, 0) if self.summary else 0

    @property
    def arrivals(self) -> list[PlayedGoto]:
        """The gotos that arrived."""
        return [goto for goto in self.gotos if goto.end == ARRIVED]

    @property
    def wrong(self) -> list[str]:
        """What needs a look; empty if all is well."""
        texts = [] if self.failure is None else [self.failure]
        if self.summary and self.summary.failure:
            # The last line of a traceback is the exception; whoever plays the seed again sees the rest.
            end = self.summary.failure.splitlines()[-1]
            texts.append(end if end.startswith("the strategy ") else f"the strategy raised {end}")
        texts += [f"goto ({goto.x}, {goto.y}): {goto.end}" for goto in self.gotos if goto.end in UNMEANT]
        texts += [f"touched {touch.thing} at {touch.time:.1f} s" for touch in self.touches if touch.is_wrong]
        pushed = any(touch.driven_into for touch in self.touches)  # even if it stood
        texts += [f"moved {self.moved:g} mm after it had stopped"] if self.moved and not pushed else []
        texts += self.warnings
        return texts + [f"gatekeeper: {report}" for report in (self.summary.reports if self.summary else ())]

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        rows = {name: [row._asdict() for row in getattr(self, name)] for name in ("gotos", "tasks", "touches")}
        figures = {"points": self.points, "stops": self.stops, "moved": self.moved}
        summary = self.summary and self.summary.as_data()
        return {"seed": self.seed, "wrong": self.wrong, **figures, **rows, "summary": summary}


class Prefixed(io.TextIOBase):
    """Writes each line with something before it."""

    def __init__(self, stream: TextIO, prefix: str) -> None:
        self._stream, self._prefix, self._begins = stream, prefix, True

    def write(self, text: str) -> int:
        """Write a part of a text."""
        for line in text.splitlines(keepends=True):
            self._stream.write(self._prefix + line if self._begins else line)
            self._begins = line.endswith("\n")
        return len(text)

    def flush(self) -> None:
        """Have the stream write what it holds."""
        self._stream.flush()


def play(options: MatchOptions, files: EdsFiles, players: Players = SHIPPED, log: Path | None = None) -> PlayedMatch:
    """Play a match in simulated time; a node that does not answer is a result of the match, not an error.

    What a strategy prints goes to standard error, with the seed. All frames are written to `log`; raises the errors of
    `traffic.recorder.recording`.
    """
    events: list[MatchEvent] = []
    summary, failure, driven = None, None, 0.0
    printed = Prefixed(sys.stderr, f"seed {options.seed}: ")
    tell = partial(print, file=printed)
    with recording(log, tell=tell) as write, redirect_stdout(printed):
        try:
            summary, world = play_simulated(options, events.append, write, files, *players, tell)
            driven = sum(after.distance(before.point) for (_, before), (_, after) in pairwise(world.path)) / 1000
        except (RemoteError, ProgramFailed) as error:
            failure = str(error)
    return PlayedMatch(
        options.seed,
        gotos_in(events),
        [PlayedTask(event.time, **event.data) for event in events if event.kind is EventKind.TASK],
        touches_in(events),
        sum(event.kind is EventKind.STOP and "obstacle" in event.data for event in events),
        next((event.data["moved"] for event in events if event.kind is EventKind.END), 0.0),
        summary,
        failure,
        [event.text for event in events if event.kind is EventKind.WARNING],
        driven,
    )


def gotos_in(events: Iterable[MatchEvent]) -> list[PlayedGoto]:
    """Return how the gotos of a timeline ended, in order; one without an end is left out."""
    begun: list[dict[str, Any]] = []
    ended: list[PlayedGoto] = []
    for event in events:
        if event.kind is EventKind.GOTO:
            begun.append(event.data["goto"])
        elif event.kind in (EventKind.ARRIVED, EventKind.GIVEN_UP):
            # Gotos end in the order in which they began: a newer one ends the older before it begins.
            goto, end = begun[len(ended)], event.data
            outcome, why = end.get("outcome", ARRIVED), end.get("why")
            place = goto["x"], goto["y"], goto["angle"]
            text = f"{outcome}: {why}" if why else outcome
            ended.append(PlayedGoto(*place, text, end["seconds"], end.get("distance"), end.get("error")))
    return ended


def touches_in(events: Iterable[MatchEvent]) -> list[RobotTouch]:
    """Return what our robot touched in a timeline, and whether its goto at that time had flagged it as forced."""
    forced: set[str] = set()
    found: list[RobotTouch] = []
    for event in events:
        if event.kind is EventKind.GOTO:
            # In words, as the timeline has them: `fire 1:normal, pool 2:forced`.
            passages = (text.partition(":") for text in event.data["goto"]["barriers"].split(", "))
            forced = {name for name, _, passage in passages if passage == Passage.FORCED.name.lower()}
        elif event.kind is EventKind.TOUCH:
            (touch,) = touches_of(OURS, [Touch(**event.data)])
            found.append(touch._replace(forced=touch.thing in forced))
    return found
