"""A robot of another year: a field and a body of its own, in files only."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import pytest

from eurobot_od import Core, Drive, rehearse
from eurobot_od.cli import main
from eurobot_od.device.objects import MemoryStore
from eurobot_od.errors import DictionaryError, FieldError
from eurobot_od.robot import dialects
from eurobot_od.robot.match.stage import DEFAULTS, play_simulated
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.robot_file import NAME
from eurobot_od.robot.model.values import OURS, Barriers, Outcome, Passage, TeamColour
from eurobot_od.robot.nodes.node import RobotNode

CORNER = (3350, 150, 315)
"""The far corner, seen from the start of red."""


SMALL = """
field:
  size: [2000, 1500]
  border: 10
  start:
    red: {zone: [0, 0, 400, 400], pose: [200, 200, 90]}
    yellow: {zone: [1600, 0, 2000, 400], pose: [1800, 200, 90]}
barriers:
  kinds: {crate: {shape: disc, size: 200}}
  places: {crate: {number: 1, kind: crate, at: [1000, 750]}}
tasks:
  shelf: {at: [1700, 1300, 90], seconds: 1, tries: 1, points: 5, chance: 1}
robots:
  enemy 1: {radius: 120, rounds: [[1500, 500], [1700, 700]]}
  enemy 2: {radius: 120, rounds: [[700, 300], [1200, 300]]}
  confederate: {radius: 120, rounds: [[300, 700], [300, 500]]}
"""
"""What a robot's file says of a smaller field than that of 2014."""


def write_robot(folder: Path, field: str, size: tuple[int, int] = (3500, 2500), facts: str = "") -> str:
    """Make the EDS files of a table with a field of that size; return the folder that --dialect takes."""
    shipped, table = dialects.eds_folder(), folder / "protocol.yaml"
    text = (shipped / "protocol.yaml").read_text(encoding="utf-8")
    for axis, old, new in zip("XY", (3000, 2000), size):
        text = text.replace(
            f"{axis} position: {{bits: 12, range: [0, {old}]", f"{axis} position: {{bits: 12, range: [0, {new}]"
        )
    table.write_text(text, encoding="utf-8")
    assert main(["make-eds", str(table), "-o", str(folder)]) == 0
    facts = facts or (shipped / NAME).read_text(encoding="utf-8").replace("size: [3000, 2000]", f"size: {field}")
    (folder / NAME).write_text(facts, encoding="utf-8")
    return str(folder / "canopen")


async def to_the_corner(core: Core, place: tuple[int, int, int] = CORNER) -> Outcome:
    await core.check_nodes()
    await core.configure_start(TeamColour.RED)
    return (await core.goto(*place, speed=80)).outcome


def test_the_robot_drives_to_the_far_corner_of_a_larger_field(tmp_path: Path) -> None:
    options = MatchOptions(dialect=write_robot(tmp_path, "[3500, 2500]"), enemies=0, confederates=0, falling=False)
    truth: list[tuple[float, float]] = []

    async def play(core: Core) -> Outcome:
        outcome = await to_the_corner(core)
        seen = await core.position()
        truth.append((seen.x or 0, seen.y or 0))
        return outcome

    drawing = tmp_path / "field.svg"
    assert rehearse(play, options, picture=drawing) is Outcome.ARRIVED
    assert truth == [pytest.approx(CORNER[:2], abs=20)]
    assert "scale(0.8" in drawing.read_text(encoding="utf-8"), "a larger field is drawn smaller"


def test_a_smaller_field_is_played_and_drawn(tmp_path: Path) -> None:
    facts = "body: {radius: 120}\nmatch: {duration: 60}" + SMALL
    options = MatchOptions(
        dialect=write_robot(tmp_path, "", (2000, 1500), facts), enemies=0, confederates=0, falling=False
    )
    drawing, points = tmp_path / "field.svg", []

    async def play(core: Core) -> None:
        assert await to_the_corner(core, (1700, 1300, 90)) is Outcome.ARRIVED
        points.append(await core.act("shelf"))
        await core.goto(1900, 1700, 0, speed=80)

    with pytest.raises(FieldError, match=r"y = 1700 is not allowed; allowed: 0\.\.1500 mm"):
        rehearse(play, options, picture=drawing)
    assert points
    assert "scale(1.3" in drawing.read_text(encoding="utf-8"), "a smaller field is drawn larger"


def test_the_shipped_field_refuses_a_place_of_a_larger_one(tmp_path: Path) -> None:
    options = MatchOptions(dialect=write_robot(tmp_path, "[3000, 2000]"), enemies=0, confederates=0, falling=False)
    assert rehearse(to_the_corner, options) is Outcome.NOT_POSSIBLE


def test_a_field_larger_than_the_range_of_positions_is_reported() -> None:
    options = MatchOptions(settings=(("field.size", "[3500, 2500]"),))
    with pytest.raises(
        DictionaryError, match=r"drive\.eds: the robot's file has a field of 3500 mm along X, .* at 3000"
    ):
        rehearse(to_the_corner, options)


# A larger body


async def round_the_pool(core: Core) -> None:
    around = Barriers.of({core.facts.barrier("pool 1").number: Passage.FORCED})
    for x in (300, 1500):
        await core.goto(x, 900, 0, speed=60, barriers=around)


@pytest.mark.parametrize("radius", [140, 250])
def test_the_planner_keeps_away_by_the_radius(radius: int) -> None:
    body = ("body.radius", str(radius))
    options = MatchOptions(duration=20, enemies=0, confederates=0, falling=False, settings=(body,))
    _, world = play_simulated(options, lambda _: None, lambda *_: None, None, round_the_pool)
    pool = world.facts.barrier("pool 1")
    nearest = min(pose.distance(pool.point) for _, pose in world.path)
    assert world.robot.x > 1400, "it came past"
    assert pool.kind.radius + radius <= nearest <= pool.kind.radius + radius + 60


@pytest.mark.parametrize("radius", [140, 250])
def test_the_drives_setting_is_the_radius(radius: int) -> None:
    facts = robot_file.read(changes=[("body.radius", str(radius))])
    assert Drive(dialects.load("drive"), facts=facts).setting("Body.Robot radius") == radius


class Arm(RobotNode):
    FACTS: ClassVar[Any] = {"Body.Robot radius": lambda facts: facts.body.radius + 0.5}


def test_a_fact_out_of_the_range_of_its_setting_is_reported() -> None:
    with pytest.raises(DictionaryError, match=r"Body.Robot radius = 140.5, as the robot's file says, is not a whole"):
        Arm(dialects.load("drive"))


def test_a_setting_that_was_stored_counts_more_than_the_fact() -> None:
    dictionary = dialects.load("drive")
    store = MemoryStore({dictionary.address("Body.Robot radius"): 200})
    assert Drive(dictionary, store=store, facts=robot_file.read()).setting("Body.Robot radius") == 200


def test_the_match_is_as_long_as_the_fact() -> None:
    facts = robot_file.read(changes=[("match.duration", "100")])
    assert Core(dialects.load("core"), facts=facts).setting("Match.Match duration") == 100


def test_the_picture_shows_the_body(tmp_path: Path) -> None:
    drawing = tmp_path / "match.svg"
    options = MatchOptions(enemies=0, confederates=0, falling=False, settings=(("body.radius", "250"),))
    rehearse(start, options, picture=drawing)
    assert 'r="250"' in drawing.read_text(encoding="utf-8")


async def start(core: Core) -> None:
    await core.check_nodes()
    await core.configure_start(TeamColour.RED)
    await core.position()


@pytest.mark.long
def test_radius_of_the_body_is_that_of_contact() -> None:
    touched = [touches(f"{radius}") for radius in (140, 250)]
    assert touched[0] != touched[1]


def touches(radius: str) -> list[tuple[float, str]]:
    options = MatchOptions(seed=3, duration=20, settings=(("body.radius", radius),))
    _, world = play_simulated(options, lambda _: None, lambda *_: None)
    return [(each.time, each.thing) for each in world.touches if OURS in (each.robot, each.thing)]


def test_defaults_are_the_shipped_robots() -> None:
    assert DEFAULTS.facts().body.radius == 140
