"""SVG elements as text.

Rule of this file: text is escaped here and nowhere else, so that a title with `<` in it cannot break a picture.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from eurobot_od.support.escaping import one_line

PaperPoint = tuple[float, float]
"""x and y on the paper, where y grows downwards."""


def element(tag: str, *content: str, **attributes: object) -> str:
    """Return an element; `stroke_width=3` becomes `stroke-width="3"`, `class_` is `class`; None leaves one out."""
    written = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{_escaped(number(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    return f"<{tag}{written}>{''.join(content)}</{tag}>" if content else f"<{tag}{written}/>"


def _escaped(words: str) -> str:
    return escape(one_line(words))


def number(value: object) -> str:
    """Write a value; numbers with at most two decimals."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)


def text(place: PaperPoint, words: str, **attributes: object) -> str:
    """Return a text at a place."""
    return element("text", _escaped(words), x=place[0], y=place[1], **attributes)


def title(words: str) -> str:
    """Return what a browser shows when the pointer is on the element that this is put into."""
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
    """Return elements as one."""
    return element("g", "\n".join(content), **attributes)


def moved(corner: PaperPoint, *content: str, **attributes: object) -> str:
    """Return elements as one, with their origin at `corner`."""
    return group(*content, transform=f"translate({corner[0]} {corner[1]})", **attributes)


def _points(points: Iterable[PaperPoint]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)
