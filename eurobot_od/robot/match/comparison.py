"""Strategies side by side: the same seeds played by each, in numbers and as a picture.

The same seed has the same opponents, wheels and beacons, so what counts is the difference at each seed. Its interval is
much narrower than the spread of one strategy's matches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import sqrt
from statistics import fmean, stdev
from typing import NamedTuple

from eurobot_od.robot.match.played import PlayedMatch
from eurobot_od.support import svg
from eurobot_od.support.svg import Axis

Played = Mapping[str, Sequence[PlayedMatch]]
"""The matches of each strategy, by its name, with the same seeds in the same order."""

NORMAL = 1.96
"""The mean is within this many standard errors of the true mean in 95 % of all samples."""


class Measure(NamedTuple):
    """A measure that is compared: its name with the unit, and its value in a match."""

    name: str
    of: Callable[[PlayedMatch], float]


MEASURES = (
    Measure("points", lambda match: match.points),
    Measure("touches", lambda match: len(match.touches)),
    Measure("our fault", lambda match: sum(touch.is_wrong for touch in match.touches)),
    Measure("driven, m", lambda match: match.driven),
)
POINTS = MEASURES[0]


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return a mean, and the half-width of its 95 % interval."""
    return fmean(values), NORMAL * stdev(values) / sqrt(len(values)) if len(values) > 1 else 0.0


def report(played: Played) -> Iterator[str]:
    """Yield a line for each seed and the means; then how each strategy differs from the first at the same seeds."""
    names = list(played)
    width = max(12, *(len(name) + 2 for name in names))
    yield f"{'':<6}" + "".join(f"{measure.name:>{width * len(names)}}" for measure in MEASURES)
    yield f"{'seed':<6}" + "".join(f"{name:>{width}}" for _ in MEASURES for name in names)
    for row in zip(*played.values()):
        cells = (measure.of(match) for measure in MEASURES for match in row)
        yield f"{row[0].seed:<6}" + "".join(f"{cell:>{width}.4g}" for cell in cells)
    means = (interval([measure.of(each) for each in played[name]]) for measure in MEASURES for name in names)
    yield f"{'mean':<6}" + "".join(f"{f'{mean:.1f} ± {half:.1f}':>{width}}" for mean, half in means)
    yield ""
    first, *others = names
    for name in others:
        for measure in MEASURES:
            # Seed by seed: opponents and beacons are the same in both matches, so luck cancels out.
            differences = [measure.of(after) - measure.of(before) for before, after in zip(played[first], played[name])]
            mean, half = interval(differences)
            # If the interval contains 0, it does not even tell which of the two is better.
            verdict = "" if abs(mean) > half else ", which may be chance"
            more, fewer = sum(each > 0 for each in differences), sum(each < 0 for each in differences)
            what = f"{measure.name} {mean:+.2f} ± {half:.2f}{verdict}"
            yield f"{name} against {first}: {what}; more at {more} seeds, fewer at {fewer}"


# The picture

LEFT, TOP, PLOT, HEIGHT, RIGHT, BOTTOM = 56, 64, 880, 320, 24, 40
"""Margins, and the size of the plot; one unit is a pixel."""


def picture(played: Played) -> str:
    """Return an SVG document with the points at each seed, a dot for each strategy, and a line at each mean."""
    points = {name: [POINTS.of(match) for match in matches] for name, matches in played.items()}
    seeds = [match.seed for match in next(iter(played.values()))]
    across = Axis(-0.5, len(seeds) - 0.5, LEFT, LEFT + PLOT)
    up = Axis(0.0, max(1.0, *(max(values) for values in points.values())), TOP + HEIGHT, TOP)
    drawn = [*svg.axis_up(up, LEFT, LEFT + PLOT)]
    for place, (name, values) in enumerate(points.items()):
        colour, (mean, half) = svg.COLOURS[place % len(svg.COLOURS)], interval(values)
        top, bottom = up.at(mean + half), up.at(mean - half)
        drawn.append(svg.rectangle((LEFT, top), PLOT, bottom - top, fill=colour, opacity=0.15))
        drawn.append(svg.line((LEFT, up.at(mean)), (LEFT + PLOT, up.at(mean)), stroke=colour))
        drawn += (
            svg.group(
                svg.title(f"{name}, seed {seed}: {value:g}"),
                svg.circle((across.at(number), up.at(value)), 3, fill=colour),
            )
            for number, (seed, value) in enumerate(zip(seeds, values))
        )
        legend = f"{name}: {mean:.1f} ± {half:.1f} points"
        drawn.append(svg.text((LEFT + 290 * place, TOP - 18), legend, font_size=svg.TEXT, fill=colour))
    title, dots = f"Points, seeds {seeds[0]} to {seeds[-1]}", "a dot for each match; lines: means, with 95 % intervals"
    drawn.append(svg.text((LEFT, TOP + HEIGHT + 24), dots, font_size=svg.TEXT, fill=svg.PALE))
    width, height = LEFT + PLOT + RIGHT, TOP + HEIGHT + BOTTOM
    return svg.document(title, svg.heading(title), *drawn, width=width, height=height)
