"""SVG elements as text, and the colours, sizes and axes of our pictures.

Only this module escapes text for SVG, so that a title with `<` cannot break a picture.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from math import ceil, floor, log10
from typing import NamedTuple

from eurobot_od.support.texts import one_line

FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
INK, PALE, GRID, PAPER = "#22262b", "#6b7178", "#e6e3d8", "#ffffff"
COLOURS = BLUE, RED, GREEN, PURPLE, BROWN = "#2f8fd0", "#c62828", "#2e7d32", "#8e5bb5", "#b26a00"
TEXT, TITLE = 13, 17
"""Font sizes in charts, in px."""

NAMESPACE = "http://www.w3.org/2000/svg"

TICKS = 6
"""Approximate number of grid lines of an axis."""

PaperPoint = tuple[float, float]
"""x and y in the picture; y grows downwards."""


def element(tag: str, *content: str, **attributes: object) -> str:
    """Return an element; `stroke_width=3` becomes `stroke-width="3"`, `class_` becomes `class`, and None is omitted."""
    said = {name.rstrip("_").replace("_", "-"): value for name, value in attributes.items() if value is not None}
    written = "".join(f' {name}="{_escaped(number(value))}"' for name, value in said.items())
    return f"<{tag}{written}>{''.join(content)}</{tag}>" if content else f"<{tag}{written}/>"


def _escaped(words: str) -> str:
    return escape(one_line(words))


def number(value: object) -> str:
    """Format a value; floats with at most two decimals."""
    # Further digits than a hundredth of a pixel only make the file longer.
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)


def text(place: PaperPoint, words: str, **attributes: object) -> str:
    """Return a text at a place."""
    return element("text", _escaped(words), x=place[0], y=place[1], **attributes)


def title(words: str) -> str:
    """Return the tooltip of the element that contains it."""
    return element("title", _escaped(words))


def circle(centre: PaperPoint, radius: float, **attributes: object) -> str:
    """Return a circle."""
    return element("circle", cx=centre[0], cy=centre[1], r=radius, **attributes)


def line(start: PaperPoint, end: PaperPoint, **attributes: object) -> str:
    """Return a straight line."""
    return element("line", x1=start[0], y1=start[1], x2=end[0], y2=end[1], **attributes)


def rectangle(corner: PaperPoint, width: float, height: float, **attributes: object) -> str:
    """Return a rectangle by its upper left corner."""
    return element("rect", x=corner[0], y=corner[1], width=width, height=height, **attributes)


def polyline(points: Iterable[PaperPoint], **attributes: object) -> str:
    """Return lines from point to point."""
    return element("polyline", points=_points(points), **attributes)


def polygon(points: Iterable[PaperPoint], **attributes: object) -> str:
    """Return a closed figure."""
    return element("polygon", points=_points(points), **attributes)


def group(*content: str, **attributes: object) -> str:
    """Return a group of elements."""
    return element("g", "\n".join(content), **attributes)


def moved(corner: PaperPoint, *content: str, **attributes: object) -> str:
    """Return a group of elements whose origin is at `corner`."""
    return group(*content, transform=f"translate({number(corner[0])} {number(corner[1])})", **attributes)


def _points(points: Iterable[PaperPoint]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)


def document(heading: str, *content: str, width: float, height: float) -> str:
    """Return a picture as a file."""
    size = {"viewBox": f"0 0 {number(width)} {number(height)}", "width": width, "height": height}
    paper = rectangle((0, 0), width, height, fill=PAPER)
    return element("svg", title(heading), paper, *content, xmlns=NAMESPACE, **size, font_family=FONT)


def heading(words: str) -> str:
    """Return the heading of a chart."""
    return text((20, 29), words, font_size=TITLE, font_weight="bold", fill=INK)


# Axes


class Axis(NamedTuple):
    """A linear scale: value `low` is at `start`, `high` at `end`."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: float) -> float:
        """Return the place of a value."""
        return self.start + (self.end - self.start) * (value - self.low) / (self.high - self.low)

    def ticks(self) -> Iterator[float]:
        """Yield round values from `low` to `high`."""
        step = round_step((self.high - self.low) / TICKS)
        # 1e-9: an end of the axis stays a tick despite rounding
        return (number * step for number in range(ceil(self.low / step - 1e-9), floor(self.high / step + 1e-9) + 1))


def round_step(least: float) -> float:
    """Return the smallest number of the series 1, 2, 5, 10, 20, ... (also 0.5, 0.2, ...) that is at least `least`."""
    power = 10.0 ** floor(log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))


def axis_across(ticks: Iterable[tuple[float, str]], top: float, bottom: float) -> Iterator[str]:
    """Yield the grid line and the label of each tick, given as x and text."""
    for x, words in ticks:
        yield line((x, top - 6), (x, bottom + 4), stroke=GRID, stroke_width=1)
        yield text((x, bottom + 20), words, font_size=TEXT, fill=PALE, text_anchor="middle")


def axis_up(axis: Axis, left: float, right: float) -> Iterator[str]:
    """Yield the grid line and the label of each tick of a vertical axis."""
    for value in axis.ticks():
        y = axis.at(value)
        yield line((left, y), (right, y), stroke=GRID, stroke_width=1)
        yield text((left - 8, y + 4), f"{value:g}", font_size=TEXT, fill=PALE, text_anchor="end")
