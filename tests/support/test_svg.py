"""SVG elements: every figure has its measures, numbers are short, and no text breaks out."""

from __future__ import annotations

import pytest

from eurobot_od.support import svg


@pytest.mark.parametrize(
    ("figure", "text"),
    [
        (svg.text((1, 2), "a < b", fill="red"), '<text x="1" y="2" fill="red">a &lt; b</text>'),
        (svg.title('"x"\n'), "<title>&quot;x&quot;\\n</title>"),
        (svg.circle((1, 2.5), 3), '<circle cx="1" cy="2.5" r="3"/>'),
        (svg.line((1, 2), (3, 4), stroke_width=0.5), '<line x1="1" y1="2" x2="3" y2="4" stroke-width="0.5"/>'),
        (svg.rectangle((1, 2), 3, 4, class_="bar"), '<rect x="1" y="2" width="3" height="4" class="bar"/>'),
        (svg.polyline([(1, 2), (3.0, 4.125)]), '<polyline points="1,2 3,4.12"/>'),
        (svg.polygon([(1, 2), (3, 4)], fill=None), '<polygon points="1,2 3,4"/>'),
        (svg.group("<a/>", "<b/>", id="both"), '<g id="both"><a/>\n<b/></g>'),
        (svg.moved((5, 6.5), "<a/>", opacity=1), '<g transform="translate(5 6.5)" opacity="1"><a/></g>'),
        (svg.element("a", title='"&'), '<a title="&quot;&amp;"/>'),
    ],
)
def test_every_figure_has_its_coordinates(figure: str, text: str) -> None:
    assert figure == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(1, "1"), (1.0, "1"), (100.0, "100"), (1.25, "1.25"), (1.999, "2"), (-0.5, "-0.5"), ("1.000", "1.000")],
)
def test_numbers_have_at_most_two_decimals(value: object, text: str) -> None:
    assert svg.number(value) == text


@pytest.mark.parametrize(
    ("least", "step"), [(1, 1), (1.01, 2), (0.3, 0.5), (6, 10), (10, 10), (0.00021, 0.0005), (4321, 5000)]
)
def test_tick_steps_are_1_2_or_5_times_a_power_of_ten(least: float, step: float) -> None:
    assert svg.round_step(least) == pytest.approx(step)


def test_a_scale_has_round_ticks_between_its_ends() -> None:
    assert list(svg.Axis(-3, 11, 0, 1).ticks()) == [0, 5, 10]
