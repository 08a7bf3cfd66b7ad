"""Plays a match for each of many seeds, with any workers: what came of them, in figures; strategies side by side.

Matches come in the order of their seeds, and are the same whoever plays them; each process reads the EDS files and the
strategies once.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from itertools import chain, pairwise
from math import ceil, sqrt
from operator import attrgetter, itemgetter
from pathlib import Path
from statistics import fmean, quantiles, stdev
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od import loading
from eurobot_od.errors import LocalError, ProgramFailed, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.robot.match.referee import Players, StrategyFiles, in_one_line
from eurobot_od.robot.match.stage import EdsFiles, Performance, Prefixed, play_simulated
from eurobot_od.robot.match.summary import RobotTouch, Summary, Touched, touches_of
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.robot_file import file_for
from eurobot_od.robot.model.values import OURS, Outcome, Passage
from eurobot_od.robot.scene.files import keep_truth
from eurobot_od.robot.world import World
from eurobot_od.robot.world.bodies import Touch
from eurobot_od.robot.world.world import EventKind, MatchEvent
from eurobot_od.season import campaign
from eurobot_od.season.campaign import HERE, Workers
from eurobot_od.support.files import digest_of
from eurobot_od.traffic.recorder import recording

if TYPE_CHECKING:  # only kept results need the extra `season`
    from eurobot_od.season.results import Results

ARRIVED = Outcome.ARRIVED.value
UNMEANT = tuple(outcome.value for outcome in (Outcome.NOT_POSSIBLE, Outcome.REPLACED, Outcome.LOST))
"""Ways for a goto to end that nobody wanted; if it was blocked, the robot drove into something, which counts as a
touch."""

BOTH_SHIPPED = Players()


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
            texts.append(in_one_line(self.summary.failure))
        texts += [f"goto ({goto.x}, {goto.y}): {goto.end}" for goto in self.gotos if goto.end in UNMEANT]
        texts += [f"touched {touch.thing} at {touch.time:.1f} s" for touch in self.touches if touch.is_wrong]
        pushed = any(touch.driven_into for touch in self.touches)  # even if it stood
        texts += [f"moved {self.moved:g} mm after it had stopped"] if self.moved and not pushed else []
        texts += self.warnings
        if self.summary:
            texts += [f"gatekeeper: {report}" for report in self.summary.reports]
        return texts

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        rows = {name: [row._asdict() for row in getattr(self, name)] for name in ("gotos", "tasks", "touches")}
        figures = {"points": self.points, "stops": self.stops, "moved": self.moved}
        summary = self.summary and self.summary.as_data()
        return {"seed": self.seed, "wrong": self.wrong, **figures, **rows, "summary": summary}


def play(
    options: MatchOptions, files: EdsFiles, players: Players = BOTH_SHIPPED, log: Path | None = None
) -> PlayedMatch:
    """Play a match in simulated time; a node that does not answer is a result of the match, not an error.

    What a strategy prints goes to standard error, with the seed. All frames are written to `log`; raises the errors of
    `traffic.recorder.recording`.
    """
    events: list[MatchEvent] = []
    summary = None
    failure = None
    driven = 0.0
    printed = Prefixed(sys.stderr, f"seed {options.seed}: ")
    told: list[str] = []

    def tell(line: str) -> None:
        told.append(line)
        printed.write(f"{line}\n")

    world: World | None = None
    times: list[float] = []
    with recording(log, tell=tell) as write, redirect_stdout(printed):

        def watch(time: float, frame: Frame) -> None:
            write(time, frame)
            if not times:
                times.append(time)

        try:
            summary, world = play_simulated(options, events.append, watch, files, *players, tell)
            driven = sum(after.distance(before.point) for (_, before), (_, after) in pairwise(world.path)) / 1000
        except (RemoteError, ProgramFailed) as error:
            failure = "; ".join([*told, str(error)])  # first the cause: a node that has raised gives no answer
    if log and world and times:
        keep_truth(log, world, times[0], tell)
    printed.end()
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


SHIPPED = StrategyFiles()

SEED = "{seed}"
"""The placeholder for the seed in the name of a log."""


def play_many(
    options: MatchOptions,
    seeds: range,
    workers: Workers = HERE,
    strategies: StrategyFiles = SHIPPED,
    results: Results[PlayedMatch] | None = None,
    log: str | None = None,
) -> Generator[PlayedMatch, None, None]:
    """Play a match for each seed; `results` keeps them, and those that it already has are not played again.

    `log` is the name of a file for the frames of each match, with `{seed}` in it.

    Raises UnknownName, FileError, LocalError before anything is played, ChildProcessError if a process dies.
    """
    player = SeedPlayer(options, strategies, _digest(options, strategies), log)
    Performance(options, stage(player)[0], World(options, lambda: 0.0))  # raises here, once
    return campaign.run(player, seeds, workers, results)


@dataclass(frozen=True)
class SeedPlayer:
    """Plays the match of a seed; `digest` is that of the files that are read for it.

    `log` is the name of a file for the frames, with `{seed}` in it.
    """

    options: MatchOptions
    strategies: StrategyFiles
    digest: str
    log: str | None = None

    def __call__(self, seed: int) -> PlayedMatch:
        """Play."""
        log = None if self.log is None else Path(self.log.replace(SEED, str(seed)))
        return play(replace(self.options, seed=seed), *stage(self), log)


# One is enough: a process plays one campaign, and a changed file has another digest and so another key.
@lru_cache(1)
def stage(player: SeedPlayer) -> tuple[EdsFiles, Players]:
    """Read the EDS files and the strategies: once in each process, unless they change."""
    return EdsFiles.read(player.options), player.strategies.load()


def settings(options: MatchOptions, strategies: StrategyFiles) -> dict[str, str]:
    """Return everything that the matches of any seeds depend on: the options, and the contents of the files.

    Raises UnknownName, LocalError.
    """
    given = {name: str(value) for name, value in asdict(options).items() if name != "seed"}
    return {"campaign": "matches", **given, "files": _digest(options, strategies)}


def _digest(options: MatchOptions, strategies: StrategyFiles) -> str:
    """Return a digest of the EDS files, the robot's file and the strategies."""
    folder = loading.find(options.robot).dialects.folder(options.dialect)
    return digest_of([*sorted(folder.glob("*.eds")), file_for(folder), *strategies])


# A histogram of whole numbers, as lines of text


WIDTH = 40
"""Characters of the longest bar."""

MOST_ROWS = 15
"""Most rows of a histogram; each row covers as many values as that takes."""

STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


def histogram(values: Sequence[int]) -> Iterator[str]:
    """Yield how often values from 0 up occur, with a row for each step from the least to the greatest."""
    step = next((each for each in STEPS if max(values) // each - min(values) // each < MOST_ROWS), STEPS[-1])
    counts = Counter(value // step for value in values)
    most, width = max(counts.values()), len(str(max(counts) * step + step - 1))
    # Empty rows are drawn as well: a gap in the middle is worth seeing.
    for number in range(min(counts), max(counts) + 1):
        first, last = number * step, number * step + step - 1
        name = f"{first:>{width}}" if step == 1 else f"{first:>{width}} to {last:>{width}}"
        length = round(counts[number] / most * WIDTH) or (counts[number] > 0)  # a single match is visible, too
        yield f"{name}  {'#' * length} {counts[number]}"


# The figures


MOST_LISTED = 20
"""Most seeds to look at that are listed; all of them are in the JSON."""

LOWEST = 3
"""Number of seeds with the fewest points that are worth a look as well."""


class Figure(NamedTuple):
    """A figure whose spread a team wants to know: one for each match, or for each of its arrivals."""

    name: str
    decimals: int
    of: Callable[[PlayedMatch], Iterable[float | None]]

    def line(self, spread: Spread | None) -> str:
        """Return a line of the table; None is for a figure that no match has."""
        if spread is None:
            return f"{self.name:<22} {'none':>8}"
        (least, at_least), (most, at_most) = spread.least, spread.most
        low, *middle, high = (f"{each:8.{self.decimals}f}" for each in (least, *spread.quartiles, most))
        mean = f"{spread.mean:8.{max(self.decimals, 1)}f}"
        return f"{self.name:<22} {mean} {low} {at_least:>6} {' '.join(middle)} {high} {at_most:>6}"


def _once(figure: Callable[[PlayedMatch, Summary], float]) -> Callable[[PlayedMatch], Iterable[float]]:
    """Make a figure that a match has once, if it was played to its end."""
    return lambda match: [figure(match, match.summary)] if match.summary else []


FIGURES = (
    Figure("points", 0, _once(lambda match, _: match.points)),
    Figure("tasks done", 0, _once(lambda match, _: sum(task.gain > 0 for task in match.tasks))),
    Figure("stopped by sensor", 0, _once(lambda match, _: match.stops)),
    Figure("touches", 0, _once(lambda match, _: len(match.touches))),
    Figure("places reached", 0, _once(lambda match, _: len(match.arrivals))),
    Figure("distance to place, mm", 1, lambda match: [goto.distance for goto in match.arrivals]),
    Figure("position error, mm", 1, lambda match: [goto.error for goto in match.arrivals]),
    Figure("time to place, s", 2, lambda match: [goto.seconds for goto in match.arrivals]),
    Figure("messages seen", 0, _once(lambda _, summary: summary.messages_sent)),
    Figure("bus load, %", 2, _once(lambda _, summary: summary.load * 100)),
    Figure("end, s", 1, _once(lambda _, summary: summary.seconds)),
)


class Spread(NamedTuple):
    """Mean, quartiles, least and greatest of a figure, and the first seeds with the extremes."""

    mean: float
    least: tuple[float, int]
    quartiles: list[float]
    most: tuple[float, int]


def endings(matches: Sequence[PlayedMatch]) -> list[tuple[str, int, int]]:
    """Count how gotos ended: those that arrived, those whose end nobody wanted, then every other way to end.

    Each way has its name, in how many matches it came, and for how many gotos.
    """
    ends = [[goto.end for goto in match.gotos] for match in matches]
    gotos, in_matches = Counter(chain(*ends)), Counter(chain(*map(set, ends)))
    names = [ARRIVED, *UNMEANT, *sorted(gotos.keys() - {ARRIVED, *UNMEANT})]
    return [(name, in_matches[name], gotos[name]) for name in names]


FORCED = "forced barrier"


def touch_counts(matches: Iterable[PlayedMatch]) -> Iterator[tuple[str, int, int, int, int]]:
    """Count what was touched, and by whose fault; a barrier flagged as forced counts only as that.

    Each kind of thing has its name, in how many matches it was touched, how often, how often we drove into it, and how
    often it drove into us.
    """
    found = [(match.seed, touch) for match in matches for touch in match.touches]
    for name in (FORCED, *(kind.value for kind in Touched)):
        own = [(seed, each) for seed, each in found if name == (FORCED if each.forced else each.kind.value)]
        at_fault, driven_into = (sum(getattr(each, whose) for _, each in own) for whose in ("at_fault", "driven_into"))
        yield name, len({seed for seed, _ in own}), len(own), at_fault, driven_into


def spread(figure: Figure, matches: Iterable[PlayedMatch]) -> Spread | None:
    """Return the spread of a figure, None if no match has it."""
    pairs = [(value, match.seed) for match in matches for value in figure.of(match) if value is not None]
    if not pairs:
        return None
    values = [value for value, _ in pairs]
    # Inclusive: the seeds are everything that was played, and the extremes are among them.
    quartiles = quantiles(values, n=4, method="inclusive") if len(values) > 1 else values * 3
    return Spread(fmean(values), min(pairs, key=itemgetter(0)), quartiles, max(pairs, key=itemgetter(0)))


# In words

NO_TASKS = "no task was done in any match: `await core.act(task)` does one of those in robot.yaml"


def report(matches: Sequence[PlayedMatch]) -> Iterator[str]:
    """Yield lines that sum up the matches, at least one."""
    yield f"{'gotos':<30} {'matches':>8} {'gotos':>8}"
    for end, in_matches, gotos in endings(matches):
        yield f"{end:<30} {in_matches:>8} {gotos:>8}"
    yield ""
    yield f"{'touched':<21} {'matches':>8} {'touches':>8} {'our fault':>10} {'driven into':>12}"
    for thing, in_matches, touches, at_fault, driven_into in touch_counts(matches):
        yield f"{thing:<21} {in_matches:>8} {touches:>8} {at_fault:>10} {driven_into:>12}"
    yield ""
    headings = f"{'mean':>8} {'least':>8} {'seed':>6} {'25 %':>8} {'median':>8} {'75 %':>8} {'most':>8} {'seed':>6}"
    yield f"{'':<22} {headings}"
    for figure in FIGURES:
        yield figure.line(spread(figure, matches))
    if errors := sorted(goto.error for match in matches for goto in match.arrivals if goto.error is not None):
        # A value that some match really had, not one interpolated between two.
        rms, most = sqrt(fmean(error**2 for error in errors)), errors[ceil(0.95 * len(errors)) - 1]
        where = f"position error at {len(errors)} arrivals"
        yield f"{where}: mean {fmean(errors):.1f} mm, RMS {rms:.1f} mm, 95 % up to {most:.1f} mm"
    if points := [match.points for match in matches if match.summary]:
        yield from ("", "matches by points", *histogram(points))
    yield ""
    yield from _to_look_at(matches)


def _to_look_at(matches: Sequence[PlayedMatch]) -> Iterator[str]:
    """Name the seeds in which something went wrong, and those with the fewest points."""
    if not any(match.tasks for match in matches):
        yield NO_TASKS
    bad = [match for match in matches if match.wrong]
    for match in bad[:MOST_LISTED]:
        first, *others = match.wrong
        yield f"seed {match.seed}: {first}" + (f", and {len(others)} more" if others else "")
    if len(bad) > MOST_LISTED:
        yield f"and {len(bad) - MOST_LISTED} more seeds"
    if len(matches) > LOWEST and any(match.summary for match in matches):
        # Worth a look even if nothing went wrong: this is where a strategy can gain most.
        low = sorted((match for match in matches if match.summary), key=attrgetter("points"))[:LOWEST]
        yield "fewest points: " + ", ".join(f"seed {match.seed} with {match.points}" for match in low)
    played = f"{len(matches)} match{'' if len(matches) == 1 else 'es'}, seeds {matches[0].seed} to {matches[-1].seed}"
    yield f"{played}: something went wrong in {len(bad)}" if bad else f"{played}: nothing went wrong"


# Strategies side by side: the same seed has the same opponents, wheels and beacons, so what counts is the difference at
# each seed. Its interval is much narrower than the spread of one strategy's matches.


Played = Mapping[str, Sequence[PlayedMatch]]
"""The matches of each strategy, by its name, with the same seeds in the same order."""

NORMAL = 1.96
"""The mean is within this many standard errors of the true mean in 95 % of all samples."""


class Measure(NamedTuple):
    """A measure that is compared: its name with the unit, its value in a match, and its digits after the point."""

    name: str
    of: Callable[[PlayedMatch], float]
    digits: int = 0


MEASURES = (
    Measure("points", lambda match: match.points),
    Measure("touches", lambda match: len(match.touches)),
    Measure("our fault", lambda match: sum(touch.at_fault for touch in match.touches)),
    Measure("driven, m", lambda match: match.driven, 2),
)
POINTS = MEASURES[0]


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return a mean, and the half-width of its 95 % interval."""
    return fmean(values), NORMAL * stdev(values) / sqrt(len(values)) if len(values) > 1 else 0.0


def _doubt(mean: float, half: float) -> str:
    """Return how sure a mean difference is: an interval with 0 in it does not even tell which of the two is better."""
    if abs(mean) > half:
        return ""
    return ", which may be chance" if half else ", the same at each seed"


def compared(played: Played) -> Iterator[str]:
    """Yield a line for each seed and the means; then how each strategy differs from the first at the same seeds."""
    names = list(played)
    width = max(12, *(len(name) + 2 for name in names))
    yield f"{'':<6}" + "".join(f"{measure.name:>{width * len(names)}}" for measure in MEASURES)
    yield f"{'seed':<6}" + "".join(f"{name:>{width}}" for _ in MEASURES for name in names)
    for row in zip(*played.values()):
        cells = (f"{measure.of(match):.{measure.digits}f}" for measure in MEASURES for match in row)
        yield f"{row[0].seed:<6}" + "".join(f"{cell:>{width}}" for cell in cells)
    means = (interval([measure.of(each) for each in played[name]]) for measure in MEASURES for name in names)
    yield f"{'mean':<6}" + "".join(f"{f'{mean:.1f} ± {half:.1f}':>{width}}" for mean, half in means)
    yield ""
    first, *others = names
    for name in others:
        for measure in MEASURES:
            # Seed by seed: opponents and beacons are the same in both matches, so luck cancels out.
            differences = [measure.of(after) - measure.of(before) for before, after in zip(played[first], played[name])]
            mean, half = interval(differences)
            more, fewer = sum(each > 0 for each in differences), sum(each < 0 for each in differences)
            what = f"{measure.name} {mean:+.2f} ± {half:.2f}{_doubt(mean, half)}"
            yield f"{name} against {first}: {what}; more at {more} seeds, fewer at {fewer}"


def farthest_apart(played: Played) -> int:
    """Return the first seed at which the points differ most; raises LocalError if all strategies have finished none."""
    rows = [row for row in zip(*played.values()) if all(match.summary for match in row)]
    if not rows:
        raise LocalError("no seed was played to its end with each strategy, so there is nothing to be drawn")
    farthest: Sequence[PlayedMatch] = max(rows, key=_difference)
    return farthest[0].seed


def _difference(row: Sequence[PlayedMatch]) -> float:
    """Return the largest difference of the points of matches."""
    points = list(map(POINTS.of, row))
    return max(points) - min(points)
