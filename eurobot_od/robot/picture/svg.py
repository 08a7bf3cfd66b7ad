"""SVG elements as text.

Rule of this file: nothing of the field; text is escaped here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

Point = tuple[float, float]


def element(tag: str, *content: str, **attributes: object) -> str:
    """Return an element; `stroke_width=3` becomes `stroke-width="3"`, `class_` is `class`; None leaves one out."""
    written = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(number(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    return f"<{tag}{written}>{''.join(content)}</{tag}>" if content else f"<{tag}{written}/>"


def number(value: object) -> str:
    """Write a value; numbers with at most two decimals."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)


def text(place: Point, words: str, **attributes: object) -> str:
    """Return a text at a place."""
    return element("text", escape(words), x=place[0], y=place[1], **attributes)


def title(words: str) -> str:
    """Return what a browser shows when the pointer is on the element that this is put into."""
    return element("title", escape(words))


def circle(centre: Point, radius: float, *content: str, **attributes: object) -> str:
    """Return a circle."""
    return element("circle", *content, cx=centre[0], cy=centre[1], r=radius, **attributes)


def line(start: Point, end: Point, **attributes: object) -> str:
    """Return a straight line."""
    return element("line", x1=start[0], y1=start[1], x2=end[0], y2=end[1], **attributes)


def rectangle(corner: Point, width: float, height: float, *content: str, **attributes: object) -> str:
    """Return a rectangle by its upper left corner."""
    return element("rect", *content, x=corner[0], y=corner[1], width=width, height=height, **attributes)


def polyline(points: Iterable[Point], **attributes: object) -> str:
    """Return lines from point to point."""
    return element("polyline", points=_points(points), **attributes)


def polygon(points: Iterable[Point], *content: str, **attributes: object) -> str:
    """Return a closed figure."""
    return element("polygon", *content, points=_points(points), **attributes)


def group(*content: str, **attributes: object) -> str:
    """Return elements as one."""
    return element("g", "\n".join(content), **attributes)


def _points(points: Iterable[Point]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)
