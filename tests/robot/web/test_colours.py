"""The page's colours: read from its styles, and judged by figures."""

from __future__ import annotations

import re
from itertools import combinations

import pytest

from eurobot_od.robot.model.messages import StartConfigurationSet
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.scene.panel import FieldPanel
from eurobot_od.robot.scene.scene import looks
from eurobot_od.web.page import FILES
from tests.web.colours import SEEN, contrast, distance

TEXT, SHAPE = 4.5, 3.0
"""Least contrast of text, and of lines and shapes (WCAG 2.1 AA, 1.4.3 and 1.4.11)."""

APART = 20.0
"""Least distance of two robots' colours for any eyes, ten times what can just be told apart."""

TEXTS = [
    *((ink, ground) for ink in ("ink", "pale", "bad", "accent", "good") for ground in ("paper", "surface")),
    ("on-accent", "accent"),
    ("paper", "bad"),
    *((ink, ground) for ink in ("field-ink", "field-pale") for ground in ("field-paper", "field-surface")),
    *(("field-paper", ground) for ground in ("field-goto", "field-stop")),
]


def themes() -> dict[str, dict[str, str]]:
    """Return the variables of the light style, and of the dark one."""
    found: dict[str, dict[str, str]] = {"light": {}, "dark": {}}
    for text in ((FILES / "page.css").read_text(), FieldPanel.style):
        light, dark = re.findall(r":root \{(.*?)\}", text, re.DOTALL)
        for name, block in (("light", light), ("dark", dark)):
            found[name] |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block))
    return found


THEMES = themes()


def test_figures_that_are_known() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # the grey that just fails
    assert distance("#ff0000", "#00ff00", "all cones") == pytest.approx(170.6, abs=0.5)
    assert distance("#d32f2f", "#ad5a00", "deuteranopia") < 12  # red and brown, which the page once had


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize(("ink", "ground"), TEXTS)
def test_text_can_be_read(theme: str, ink: str, ground: str) -> None:
    assert contrast(THEMES[theme][ink], THEMES[theme][ground]) >= TEXT


@pytest.mark.parametrize("theme", THEMES)
def test_lines_and_robots_can_be_seen(theme: str) -> None:
    seen = {name: colour for name, colour in THEMES[theme].items() if name.startswith(("line-", "robot-"))}
    assert len(seen) == 13
    faint = {name: contrast(colour, THEMES[theme]["paper"]) for name, colour in seen.items()}
    assert {name: figure for name, figure in faint.items() if figure < SHAPE} == {}


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("eyes", SEEN)
def test_robots_are_told_apart_by_all_eyes(theme: str, eyes: str) -> None:
    robots = {name: colour for name, colour in THEMES[theme].items() if name.startswith("robot-")}
    pairs = [
        each for each in combinations(robots, 2) if set(each) != {"robot-red", "robot-yellow"}
    ]  # ours is one of them
    near = {(one, two): distance(robots[one], robots[two], eyes) for one, two in pairs}
    assert {pair: round(figure) for pair, figure in near.items() if figure < APART} == {}


def test_each_robot_has_a_colour_of_its_own() -> None:
    starts = [StartConfigurationSet(team, 2, 1, 30, 30) for team in TeamColour]
    colours = {each.colour for start in starts for each in looks(FieldPanel.facts(), start)}
    for theme in THEMES.values():
        assert colours == {f"var(--{name})" for name in theme if name.startswith("robot-")}
