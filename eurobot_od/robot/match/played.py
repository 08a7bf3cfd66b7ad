"""A match that was played, as values: how each goto ended, what was on the bus, and what needs a look.

Rule of this file: all of it depends on the options and the EDS files alone; whoever plays a seed again gets the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from eurobot_od.errors import RemoteError
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.match.summary import Summary
from eurobot_od.robot.match.timeline import EventKind, MatchEvent
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.values import Outcome

ARRIVED = Outcome.ARRIVED.value
UNMEANT = tuple(outcome.value for outcome in (Outcome.NOT_POSSIBLE, Outcome.BLOCKED, Outcome.REPLACED))
"""Ways for a goto to end that nobody meant."""


class PlayedGoto(NamedTuple):
    """How the goto of a task ended, and after how many seconds from its first transmission.

    `end` is its outcome; a stop says why. At an arrival, in mm: the `distance` from the place to where the robot truly
    was, and the `error` of the position that it believed in.
    """

    task: str
    end: str
    seconds: float
    distance: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class PlayedMatch:
    """What the match of a seed came to.

    `failure` says why it could not be played to its end; then there is no `summary`, and `gotos` are those until
    then. `moved` is how far the robot moved after it had come to rest, mm.
    """

    seed: int
    gotos: list[PlayedGoto]
    moved: float = 0.0
    summary: Summary | None = None
    failure: str | None = None

    @property
    def arrivals(self) -> list[PlayedGoto]:
        """The gotos that arrived."""
        return [goto for goto in self.gotos if goto.end == ARRIVED]

    @property
    def wrong(self) -> list[str]:
        """What needs a look, nothing if all is well."""
        texts = [] if self.failure is None else [self.failure]
        texts += [f"goto {goto.task}: {goto.end}" for goto in self.gotos if goto.end in UNMEANT]
        texts += [f"moved {self.moved:g} mm after it had stopped"] if self.moved else []
        return texts + [f"gatekeeper: {report}" for report in (self.summary.reports if self.summary else ())]

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        summary, gotos = self.summary and self.summary.as_data(), [goto._asdict() for goto in self.gotos]
        return {"seed": self.seed, "wrong": self.wrong, "moved": self.moved, "gotos": gotos, "summary": summary}


def play(options: MatchOptions, files: EdsFiles) -> PlayedMatch:
    """Play a match in simulated time; a node that does not answer is a result of the match, not an error."""
    events: list[MatchEvent] = []
    try:
        summary, _ = play_simulated(options, events.append, lambda _time, _frame: None, files)
    except RemoteError as error:
        return PlayedMatch(options.seed, gotos_in(events), failure=str(error))
    return PlayedMatch(options.seed, gotos_in(events), events[-1].data["moved"], summary)


def gotos_in(events: Sequence[MatchEvent]) -> list[PlayedGoto]:
    """Return how the gotos of a timeline ended, in their order; one without an end is left out."""
    gotos = (event for event in events if event.kind is EventKind.GOTO)
    ends = (event for event in events if event.kind in (EventKind.ARRIVED, EventKind.GIVEN_UP))
    return [_goto(goto.data["goto"]["name"], end.data) for end, goto in zip(ends, gotos)]


def _goto(task: str, end: dict[str, Any]) -> PlayedGoto:
    outcome, why = end.get("outcome", ARRIVED), end.get("why")
    end_text = f"{outcome}: {why}" if why else outcome
    return PlayedGoto(task, end_text, end["seconds"], end.get("distance"), end.get("error"))
