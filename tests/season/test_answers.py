"""Pictures of any rows: the scales, what is drawn, and what cannot be."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")

import polars as pl

from eurobot_od.errors import LocalError
from eurobot_od.season.answers import chart_of, draw
from eurobot_od.season.reports import ChartKind


@pytest.mark.parametrize(
    ("rows", "kind", "shapes"),
    [
        ({"name": ["a", "<b>"], "n": [1.0, 2.5]}, ChartKind.BARS, 2),
        ({"t": [1, 2, 4], "n": [1, 0, 3], "m": [2, 2, 2]}, ChartKind.LINES, 2),
        ({"n": [1, 1, 5, None]}, ChartKind.HISTOGRAM, 2),
        ({"n": [7, 7]}, ChartKind.HISTOGRAM, 1),
        ({"name": ["a"], "n": [0]}, ChartKind.BARS, 1),
        ({"t": [3], "n": [-2]}, ChartKind.LINES, 1),
    ],
)
def test_the_columns_choose_the_kind_of_picture(rows: dict[str, list[object]], kind: ChartKind, shapes: int) -> None:
    frame = pl.DataFrame(rows)
    chart = chart_of(frame)
    assert chart.kind is kind
    picture = draw(frame, chart, "a < b")
    ElementTree.fromstring(picture)
    drawn = re.findall(r"<polyline" if kind is ChartKind.LINES else r"<rect", picture)
    assert len(drawn) == shapes + (kind is not ChartKind.LINES)  # the paper is a rectangle, too


def test_a_picture_of_no_rows_says_so() -> None:
    frame = pl.DataFrame({"name": [], "n": []}, {"name": pl.String, "n": pl.Int64})
    assert "no rows" in draw(frame, chart_of(frame), "empty")


def test_texts_alone_cannot_be_drawn() -> None:
    frame = pl.DataFrame({"name": ["a"], "other": ["b"]})
    with pytest.raises(LocalError, match="none of the columns name, other has numbers"):
        draw(frame, chart_of(frame), "texts")
