"""What there is to draw: in its layer, in its time, at its place, and marks of one place side by side."""

from __future__ import annotations

import re

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.scene.recording import PathPoint, RecordedGoto, RecordedStop
from eurobot_od.robot.scene.scene import CLEAR, DISC, MARKS, SIGN, SPACING, Item, MatchScene, ground, looks
from eurobot_od.robot.scene.style import MARK

FACTS = robot_file.read()
WIDTH, HEIGHT = FACTS.field.width, FACTS.field.height


def goto(number: int, x: int, y: int, **ended: object) -> RecordedGoto:
    return RecordedGoto(number, float(number), GotoXY(x, y, 90, 80), **ended)  # type: ignore[arg-type]


def place_of(item: Item) -> tuple[float, float]:
    """Return where a mark's sign is drawn, on paper."""
    moved = [tuple(map(float, pair)) for pair in re.findall(r"translate\((\S+) (\S+)\)", item.drawing)]
    return sum(x for x, _ in moved), sum(y for _, y in moved)


def discs(scene: MatchScene, *gotos: RecordedGoto) -> list[tuple[float, float]]:
    return [place_of(item) for each in gotos for item in scene.goto(each) if item.layer == MARKS]


# Where gotos lead, and how far from it their discs stand, to the right and downwards.
ROWS = [
    ("one", [(1000, 500)], [(0, DISC)]),
    ("three, to both sides", [(1000, 500)] * 3, [(0, DISC), (SPACING, DISC), (-SPACING, DISC)]),
    ("near each other", [(1000, 500), (1050, 530)], [(0, DISC), (SPACING, DISC)]),
    ("far apart", [(1000, 500), (2000, 500)], [(0, DISC), (0, DISC)]),
    ("at the left border", [(10, 500)] * 2, [(SPACING - 10, DISC), (2 * SPACING - 10, DISC)]),
    ("at the right border", [(2990, 500)] * 2, [(10 - SPACING, DISC), (10 - 2 * SPACING, DISC)]),
    ("at the lower border", [(1000, CLEAR // 2)], [(0, -DISC)]),
]


@pytest.mark.parametrize(("why", "places", "beside"), ROWS)
def test_discs_stand_side_by_side_and_on_the_field(
    why: str, places: list[tuple[int, int]], beside: list[tuple[float, float]]
) -> None:
    found = discs(MatchScene(FACTS), *(goto(number, *place) for number, place in enumerate(places, 1)))
    expected = [(x + right, HEIGHT - y + down) for (x, y), (right, down) in zip(places, beside, strict=True)]
    assert found == expected, why


def test_a_row_that_is_full_begins_anew() -> None:
    many = discs(MatchScene(FACTS), *(goto(number, 1500, 500) for number in range(200)))
    assert all(SPACING <= x <= WIDTH - SPACING for x, _ in many)
    assert len(set(many)) > 40


def test_a_disc_keeps_its_place_when_the_goto_ends() -> None:
    scene = MatchScene(FACTS)
    one = goto(1, 1000, 500)
    two = goto(2, 1000, 500)
    before = discs(scene, one, two)
    assert discs(scene, goto(1, 1000, 500, ended=3.0, outcome=Outcome.ARRIVED)) == [before[0]] * 2


def test_a_stop_stands_where_the_robot_was_or_nowhere() -> None:
    scene = MatchScene(FACTS)
    stop = RecordedStop("A", 6.0, "Emergency Stop: enemy", PathPoint(6, 700, 1950, None))
    (item,) = scene.stop(stop)
    assert (place_of(item), item.begin, item.end) == ((700, 50 + SIGN), 6.0, None), (
        "below: above it there is the border"
    )
    assert list(scene.stop(RecordedStop("B", 7.0, "Stop Drive: commanded", None))) == []


@pytest.mark.parametrize("scale", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("kind", ["goto", "stop"])
def test_no_sign_covers_the_name_of_a_start_zone(kind: str, scale: float) -> None:
    """Signs are drawn larger around their place, and words from their corner on."""
    names = [
        (float(x), float(y), anchor == "end", len(words) * 0.5 * 38 * scale)
        for x, y, anchor, words in re.findall(
            r'x="(\S+)" y="(\S+)"[^>]*anchor="(\w+)"[^>]*>(start \w+)<', ground(FACTS)
        )
    ]
    assert len(names) == 2
    covered = []
    for x, y in [(x, y) for x in range(0, int(WIDTH) + 1, 60) for y in range(int(HEIGHT) - 700, int(HEIGHT) - 40, 20)]:
        stop = RecordedStop("A", 6.0, "Emergency Stop: enemy", PathPoint(6, x, y, None))
        scene = MatchScene(FACTS)
        place = (x, HEIGHT - y)
        items = scene.goto(goto(1, x, y)) if kind == "goto" else scene.stop(stop)
        (item,) = (each for each in items if each.layer == MARKS)
        sign = [here + scale * (there - here) for here, there in zip(place, place_of(item))]
        for left, top, leftwards, width in names:
            begin = left - width if leftwards else left
            beside = max(begin - sign[0], sign[0] - begin - width, top - sign[1], sign[1] - top - 38 * scale)
            covered += [(place, sign)] if beside < MARK * scale else []
    assert covered == []


def test_robots_look_as_the_start_configuration_says() -> None:
    start = StartConfigurationSet(TeamColour.YELLOW, 1, 0, 40, 0)
    ours, raw, enemy, *_ = looks(FACTS, start)
    assert ours.colour == raw.colour == "var(--robot-yellow)"
    assert (enemy.radius, next(looks(FACTS, None)).colour) == (200, "var(--field-ink)")


def test_a_robot_is_turned_or_round_where_nobody_knows_its_heading() -> None:
    body = robot_file.read(changes=[("body.outline", "[[120, 60], [-120, 60], [-120, -60], [120, -60]]")])
    ours = next(looks(body, None))
    assert "rotate(-90)" in ours.at((500, 500), 90)
    assert "polygon" in ours.turned
    assert ours.at((500, 500), None) == f'<g transform="translate(500 500)">{ours.round}</g>'
    assert "polygon" not in ours.round
