"""Interleaved rounds: each contender runs once, then each runs again, until all rounds are done.

This module does not know what is measured, nor how it is shown. Noise only makes times longer, so the minima are
compared; the comparison within each single round gives the spread.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple


class NotHere(Exception):
    """A measurement that this machine cannot make; the text says why."""


class Wrong(Exception):
    """A wrong result of a contender, whose time then means nothing; the text says what is wrong."""


class Quantity(Enum):
    """What a figure counts; the value is its name with its unit."""

    TIME = "time_s"
    MEAN = "mean_time_s"
    MEMORY = "memory_bytes"
    CPU = "cpu_share"
    CPU_TIME = "cpu_time_s"
    LOAD = "bus_load_share"
    COUNT = "count"


Figures = Mapping[Quantity, float]
Contender = Callable[[], Figures]
"""Measures once; raises NotHere or Wrong."""


class Scale(NamedTuple):
    """How much is measured: the number of rounds, and whether sizes are tiny."""

    rounds: int
    short: bool = False

    def of(self, full: int, short: int) -> int:
        """Return the full size, or the short one in a short run."""
        return short if self.short else full


class Way(Enum):
    """How ours is compared with the peer's: the value of both, and whether a large value is good."""

    TIMES_AS_FAST = "peer / ours"
    RATIO = "ours / peer"
    DIFFERENCE = "ours - peer"
    ALONE = "ours"

    def compare(self, ours: float, peer: float) -> float:
        """Return the value of the comparison; dividing by zero gives infinity."""
        return COMPARISONS[self](ours, peer)

    def reaches(self, value: float, wanted: float) -> bool:
        """Return whether a value is good enough."""
        return value >= wanted if self is Way.TIMES_AS_FAST else value <= wanted


def _ratio(one: float, other: float) -> float:
    return one / other if other else float("inf")


COMPARISONS: Mapping[Way, Callable[[float, float], float]] = {
    Way.TIMES_AS_FAST: lambda ours, peer: _ratio(peer, ours),
    Way.RATIO: _ratio,
    Way.DIFFERENCE: lambda ours, peer: ours - peer,
    Way.ALONE: lambda ours, _: ours,
}


class Claim(NamedTuple):
    """A row of the table: two contenders of a series, how they are compared, and the limit (None: only reported).

    `ours` and `peer` are names of contenders; without a peer `ours` stands alone.
    """

    name: str
    ours: str
    peer: str | None
    way: Way
    wanted: float | None = None
    quantity: Quantity = Quantity.TIME


@dataclass(frozen=True)
class Series:
    """Contenders that are measured in turns, and what is claimed of them.

    `open` prepares, yields the contenders by name, and cleans up; it may raise NotHere or Wrong. `often` multiplies the
    number of rounds: more for what takes next to no time and is easily disturbed, fewer (SELDOM) for what takes seconds
    and varies little, one (ONCE) for what is the same each time or far from its limit.
    """

    group: str
    name: str
    open: Callable[[Scale], AbstractContextManager[Mapping[str, Contender]]]
    claims: tuple[Claim, ...]
    often: float = 1

    def rounds(self, scale: Scale) -> int:
        """Return the number of rounds."""
        return scale.rounds if scale.short else max(1, round(scale.rounds * self.often))


SELDOM, ONCE = 0.4, 0


class Gap(NamedTuple):
    """Why there are no figures: nothing can be measured here, or the result was `wrong`."""

    why: str
    wrong: bool


WHOLE = ""
"""Stands for all contenders of a series."""


@dataclass
class Measured:
    """The figures of all rounds of a series by contender, and why a contender, or the WHOLE series, has none."""

    series: Series
    rounds: dict[str, list[Figures]] = field(default_factory=dict)
    gaps: dict[str, Gap] = field(default_factory=dict)

    @property
    def wrong(self) -> bool:
        """Whether any result was wrong."""
        return any(gap.wrong for gap in self.gaps.values())

    def gap(self, claim: Claim) -> Gap | None:
        """Return why a claim has no figures, None if it has them."""
        return next((self.gaps[name] for name in (WHOLE, claim.ours, claim.peer) if name in self.gaps), None)

    def column(self, contender: str | None, quantity: Quantity) -> list[float]:
        """Return the figures of all rounds of a contender; none without a contender."""
        return [each[quantity] for each in self.rounds[contender]] if contender else []


class Verdict(Enum):
    """What the figures say about a claim."""

    REACHED = "reached"
    MISSED = "missed"
    REPORTED = ""
    NOT_JUDGED = "not judged"


class Comparison(NamedTuple):
    """A claim with its figures: the minima of both, their comparison, the smallest and the largest of a round."""

    claim: Claim
    ours: float
    peer: float | None
    value: float
    least: float
    greatest: float
    verdict: Verdict


def measure(series: Series, scale: Scale) -> Measured:
    """Measure the contenders that a claim names.

    One that cannot be measured here, or is wrong, becomes a gap in the result.
    """
    measured = Measured(series)
    named = {name for claim in series.claims for name in (claim.ours, claim.peer)}
    with _noting(measured, WHOLE), series.open(scale) as contenders:
        for _ in range(series.rounds(scale)):
            for name in [each for each in contenders if each in named and each not in measured.gaps]:
                with _noting(measured, name):
                    measured.rounds.setdefault(name, []).append(contenders[name]())
    return measured


@contextmanager
def _noting(measured: Measured, contender: str) -> Iterator[None]:
    """Note a failure as a gap.

    Any error between another program and us makes its rows wrong, and does not end the bench.
    """
    try:
        yield
    except NotHere as reason:
        measured.gaps[contender] = Gap(str(reason), wrong=False)
    except Exception as fault:
        name = "" if isinstance(fault, Wrong) else f"{type(fault).__name__}: "
        measured.gaps[contender] = Gap(name + " ".join(str(fault).split()), wrong=True)


def compare(measured: Measured, claim: Claim, judged: bool) -> Comparison:
    """Compare the minima, and each round by itself."""
    ours = measured.column(claim.ours, claim.quantity)
    peer = measured.column(claim.peer, claim.quantity)
    value = claim.way.compare(min(ours), min(peer, default=0.0))
    each = [claim.way.compare(*pair) for pair in zip(ours, peer or [0.0] * len(ours))]
    verdict = _verdict(claim, value) if judged else Verdict.NOT_JUDGED
    return Comparison(claim, min(ours), min(peer, default=None), value, min(each), max(each), verdict)


def _verdict(claim: Claim, value: float) -> Verdict:
    if claim.wanted is None:
        return Verdict.REPORTED
    return Verdict.REACHED if claim.way.reaches(value, claim.wanted) else Verdict.MISSED
