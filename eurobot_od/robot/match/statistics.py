"""What many matches came to: how their gotos ended, the spread of their figures, and the seeds that need a look.

Counts and order statistics only, nothing smoothed: every extreme names its seed, which can be played again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from operator import itemgetter
from statistics import median
from typing import NamedTuple

from eurobot_od.robot.match.played import ARRIVED, UNMEANT, PlayedMatch
from eurobot_od.robot.match.summary import Summary

ALL_ARRIVED = "all arrived but the last"


class EndingCount(NamedTuple):
    """A way for gotos to end: in how many matches, and how many gotos."""

    name: str
    matches: int
    gotos: int


class Figure(NamedTuple):
    """A figure of which a team wants to know the spread: one of each match, or of each of its arrivals."""

    name: str
    decimals: int
    of: Callable[[PlayedMatch], Iterable[float | None]]


def _once(figure: Callable[[PlayedMatch, Summary], float]) -> Callable[[PlayedMatch], Iterable[float]]:
    """Make a figure that a match has once, if it was played to its end."""
    return lambda match: [figure(match, match.summary)] if match.summary else []


FIGURES = (
    Figure("places reached", 0, _once(lambda match, _: len(match.arrivals))),
    Figure("distance to place, mm", 1, lambda match: [goto.distance for goto in match.arrivals]),
    Figure("position error, mm", 1, lambda match: [goto.error for goto in match.arrivals]),
    Figure("time to place, s", 2, lambda match: [goto.seconds for goto in match.arrivals]),
    Figure("messages seen", 0, _once(lambda _, summary: summary.messages_sent)),
    Figure("bus load, %", 2, _once(lambda _, summary: summary.load * 100)),
    Figure("end, s", 1, _once(lambda _, summary: summary.seconds)),
)


class Spread(NamedTuple):
    """The least, the middle and the greatest of a figure, and the first seeds that have the extremes."""

    least: float
    least_seed: int
    median: float
    most: float
    most_seed: int


def endings(matches: Sequence[PlayedMatch]) -> list[EndingCount]:
    """Count how gotos ended: in which matches all but the last arrived, then every way to end."""
    ends = [[goto.end for goto in match.gotos] for match in matches]
    fine = [each for each, match in zip(ends, matches) if not match.wrong and set(each[:-1]) <= {ARRIVED}]
    gotos, in_matches = Counter(chain(*ends)), Counter(chain(*map(set, ends)))
    names = [ARRIVED, *UNMEANT, *sorted(gotos.keys() - {ARRIVED, *UNMEANT})]
    rest = [EndingCount(name, in_matches[name], gotos[name]) for name in names]
    return [EndingCount(ALL_ARRIVED, len(fine), sum(map(len, fine))), *rest]


def spread(figure: Figure, matches: Sequence[PlayedMatch]) -> Spread | None:
    """Return the spread of a figure, None if no match has it."""
    values = [(value, match.seed) for match in matches for value in figure.of(match) if value is not None]
    if not values:
        return None
    least, most = min(values, key=itemgetter(0)), max(values, key=itemgetter(0))
    return Spread(*least, median(value for value, _ in values), *most)


# In words


def report(matches: Sequence[PlayedMatch]) -> Iterator[str]:
    """Say in lines what the matches came to; there is at least one."""
    yield f"{'gotos':<30} {'matches':>8} {'gotos':>8}"
    for ending in endings(matches):
        yield f"{ending.name:<30} {ending.matches:>8} {ending.gotos:>8}"
    yield ""
    yield f"{'':<22} {'least':>8} {'seed':>6} {'median':>8} {'most':>8} {'seed':>6}"
    for figure in FIGURES:
        yield _line(figure, spread(figure, matches))
    yield ""
    bad = [match for match in matches if match.wrong]
    yield from (f"seed {match.seed}: {text}" for match in bad for text in match.wrong)
    played = f"{len(matches)} match{'es' * (len(matches) != 1)}, seeds {matches[0].seed} to {matches[-1].seed}"
    yield f"{played}: something went wrong in {len(bad)}" if bad else f"{played}: nothing went wrong"


def _line(figure: Figure, spread: Spread | None) -> str:
    if spread is None:
        return f"{figure.name:<22} {'none':>8}"
    least, middle, most = (f"{each:8.{figure.decimals}f}" for each in (spread.least, spread.median, spread.most))
    return f"{figure.name:<22} {least} {spread.least_seed:>6} {middle} {most} {spread.most_seed:>6}"
