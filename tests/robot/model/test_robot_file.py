"""Reading `robot.yaml`: what is wrong is said on one line with its place, and changes are judged like the file."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError, UnknownName, YamlError
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import RobotShape, Wheels
from eurobot_od.robot.model.values import Barriers, Passage, TeamColour

SHIPPED = (dialects.eds_folder() / robot_file.NAME).read_text(encoding="utf-8")

WRONG = [
    ("  radius: 140 ", "  radius: wide ", "radius = 'wide' is not allowed; allowed: 10..1000 mm"),
    ("  radius: 140 ", "  radius: 0140 ", "radius = '0140' is not allowed; allowed: 10..1000 mm"),  # octal to some
    ("  radius: 140 ", "  raduis: 140 ", "unknown key 'raduis'; did you mean radius?"),
    ("  radius: 140 ", "  wheels: {track: 180, diameter: 70} ", "key 'radius' is missing, or 'outline'"),
    ("  radius: 140 ", "  outline: [[100, 0], [0, 100]] ", "outline has 2 corners; allowed: 3 or more"),
    ("duration: 90", "duration: 0", "duration = '0' is not allowed; allowed: whole numbers 1..65535 s"),
    ("duration: 90", "duration: 1.5", "duration = '1.5' is not allowed; allowed: whole numbers 1..65535 s"),
    ("size: [3000, 2000]", "size: 3000", "expected a list, found '3000'"),
    ("size: [3000, 2000]", "size: [3000, 1000]", "the start of red, (200.0, 1800.0), is outside of the field"),
    ("at: [400, 900]", "at: [400, 2900]", "fire 3 at (400, 2900) is outside of the field of 3000 x 2000 mm"),
    ("shape: disc", "shape: disk", "unknown shape 'disk'; did you mean disc?"),
    ("number: 2, kind: fire", "number: 1, kind: fire", "fire 2: number 1 is taken by fire 1"),
    ("number: 2, kind: fire", "number: 9, kind: fire", "number = '9' is not allowed; allowed: whole numbers 1..8"),
    ("number: 2, kind: fire", "number: 2, kind: rock", "fire 2: unknown kind 'rock'; known: fire, pool"),
    ("worth: harvest", "worth: gold", "unknown worth 'gold'; known: points, fruit, harvest"),
    ("chance: 1, worth", "chance: 2, worth", "chance = '2' is not allowed; allowed: 0..1"),
    ("body:\n", "body: [\n", ""),
]


def line_of(text: str) -> int:
    return SHIPPED[: SHIPPED.index(text)].count("\n") + 1


@pytest.mark.parametrize(("text", "instead", "what"), WRONG)
def test_a_mistake_in_the_file_is_one_line_with_its_place(tmp_path: Path, text: str, instead: str, what: str) -> None:
    file = tmp_path / robot_file.NAME
    file.write_text(SHIPPED.replace(text, instead, 1), encoding="utf-8")
    with pytest.raises(YamlError, match=r"^[^\n]+$") as caught:
        robot_file.read(file)
    found = re.fullmatch(re.escape(str(file)) + r":(\d+):\d+: (.+)", str(caught.value))
    assert found, caught.value
    assert what in found[2]


@pytest.mark.parametrize(
    ("text", "instead"),
    [
        ("number: 2, kind: fire", "number: 9, kind: fire"),
        ("number: 2, kind: fire", "number: 1, kind: fire"),
        ("number: 2, kind: fire", "number: 2, kind: rock"),
        ("at: [400, 900]", "at: [400, 2900]"),
        ("mammoth: {at: [600", "mammoth: {at: [9600"),
    ],
    ids=["value", "number taken", "unknown kind", "barrier outside", "task outside"],
)
def test_the_line_is_that_of_the_entry(tmp_path: Path, text: str, instead: str) -> None:
    file = tmp_path / robot_file.NAME
    file.write_text(SHIPPED.replace(text, instead, 1), encoding="utf-8")
    with pytest.raises(YamlError, match=f":{line_of(text)}:"):
        robot_file.read(file)


def test_names_can_go_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(FACTS)) == FACTS


CHANGES = [
    ("body.radius", "5", "body.radius=5: radius = '5' is not allowed; allowed: 10..1000 mm"),
    ("body.raduis", "250", "body.raduis=250: unknown key 'raduis'; did you mean radius?"),
    ("tasks.mamoth.points", "3", "tasks.mamoth.points=3: unknown key 'mamoth'; did you mean mammoth?"),
    ("body.radius.x", "1", "body.radius.x=1: '140' is a single value, which is given as a whole"),
    ("body", "250", "body=250: expected a mapping (keys: radius, outline, wheels), found '250'"),
    ("body.radius", "", "body.radius=: the file is empty"),
    ("body.outline", "[[-100, -100], [100, -100], [0, 100]]", "is less than that of a corner of the outline, 141.4 mm"),
]


@pytest.mark.parametrize(("name", "value", "what"), CHANGES)
def test_a_change_that_cannot_be_is_told(name: str, value: str, what: str) -> None:
    with pytest.raises(LocalError, match=re.escape(what)):
        robot_file.read(changes=[(name, value)])


def test_a_change_is_in_place_of_the_files() -> None:
    changes = [("body.radius", "250"), ("tasks.frescos.points", "5"), ("field.start.red.pose", "[300, 1700, 90]")]
    facts = robot_file.read(changes=changes)
    assert (facts.body.radius, facts.red_tasks["frescos"].points) == (250, 5)
    assert facts.start(TeamColour.RED) == (300, 1700, 90)
    assert robot_file.read().body.radius == 140, "of the next one who reads the file, nothing has changed"


def test_an_outline_has_the_circle_around_it() -> None:
    text = SHIPPED.replace("  radius: 140 ", "  outline: [[-100, -100], [100, -100], [0, 120]] ", 1)
    body = robot_file.parse(text, "robot.yaml").body
    assert (body.radius, body.outline[2]) == (142, Point(0, 120))


def test_the_file_is_found_beside_the_eds_files_or_above_them(tmp_path: Path) -> None:
    folder = tmp_path / "robot" / "canopen"
    folder.mkdir(parents=True)
    shipped = dialects.eds_folder() / robot_file.NAME
    assert robot_file.file_for(folder / "drive.eds") == shipped
    above, beside = folder.parent / robot_file.NAME, folder / robot_file.NAME
    above.touch()
    assert robot_file.file_for(folder / "drive.eds") == robot_file.file_for(folder) == above
    beside.touch()
    assert robot_file.file_for(folder / "drive.eds") == robot_file.file_for(folder) == beside


def test_a_file_that_is_not_read_for_its_suffix_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "canopen"
    folder.mkdir()
    (tmp_path / "robot.yml").touch()
    with pytest.raises(LocalError, match=r"robot\.yml is not read: its name has to be robot\.yaml"):
        robot_file.file_for(folder)


@pytest.mark.parametrize("team", TeamColour)
def test_an_unknown_task_is_told_with_what_it_may_mean(team: TeamColour) -> None:
    with pytest.raises(UnknownName, match="unknown task 'mamoth'; did you mean mammoth"):
        FACTS.tasks(team)["mamoth"]


def test_the_settings_of_a_match_are_facts_or_of_nodes() -> None:
    options = MatchOptions(settings=(("body.radius", "250"), ("drive.Motion.Maximum speed", "600")))
    assert options.facts().body.radius == 250
    assert options.of_nodes == (("drive.Motion.Maximum speed", "600"),)


FACTS = robot_file.read()


def test_the_2014_robot_is_as_its_eds_files_say() -> None:
    defaults = {"drive": ("Body.Robot radius", FACTS.body.radius), "core": ("Match.Match duration", FACTS.duration)}
    for name in dialects.names():
        for node, (setting, fact) in defaults.items():
            dictionary = dialects.load(node, name)
            assert dictionary.default(dictionary.address(setting)) == fact


def test_barriers_have_the_numbers_and_names_of_the_flags() -> None:
    names = [*(f"fire {number}" for number in range(1, 7)), "pool 1", "pool 2"]
    assert [(each.number, each.name) for each in FACTS.barriers] == [*enumerate(names, 1)]


def test_barriers_have_the_sizes_of_the_document() -> None:
    radii = {each.kind.name: each.kind.radius for each in FACTS.barriers}
    assert radii == {"fire": pytest.approx(140 / math.sqrt(3)), "pool": 150}


@pytest.mark.parametrize(("text", "number"), [("fire 1", 1), ("Fire-6", 6), (" pool_1 ", 7), ("POOL 2", 8)])
def test_barrier_is_found_by_its_name(text: str, number: int) -> None:
    assert FACTS.barrier(text).number == number


@pytest.mark.parametrize("text", ["fire 7", "pool 0", "fire", "1", "", "fire  1"])
def test_unknown_barrier_is_told(text: str) -> None:
    with pytest.raises(UnknownName, match="unknown barrier"):
        FACTS.barrier(text)


def test_flags_are_written_by_names() -> None:
    barriers = Barriers.of({2: Passage.FORCED, 7: Passage.NORMAL, 1: Passage.FREE})
    assert FACTS.words(barriers) == "fire 2:forced, pool 1:normal"
    assert FACTS.words(Barriers(0)) == "none"


def test_barriers_are_mirrored_left_to_right() -> None:
    places = {(barrier.kind, barrier.x, barrier.y) for barrier in FACTS.barriers}
    assert {(kind, FACTS.field.width - x, y) for kind, x, y in places} == places


def test_red_starts_upper_left_and_yellow_upper_right_looking_at_each_other() -> None:
    red, yellow = FACTS.start(TeamColour.RED), FACTS.start(TeamColour.YELLOW)
    assert red.x < FACTS.field.width / 4
    assert red.y > FACTS.field.height * 3 / 4
    assert (yellow.x, yellow.y) == (FACTS.field.width - red.x, red.y)
    assert (red.bearing(yellow.point), yellow.bearing(red.point)) == (red.angle, yellow.angle)


def test_a_start_place_is_in_its_zone() -> None:
    for (left, lower, right, upper), pose in FACTS.field.starts.values():
        assert left < pose.x < right
        assert lower < pose.y < upper


def test_wheels_stand_left_and_right() -> None:
    body = RobotShape(150.0, wheels=Wheels(180, 70))
    (back, front), right = body.tracks(Pose(1000, 500, 0))
    assert (back, front) == ((965, 590), (1035, 590))
    assert right == ((965, 410), (1035, 410))


def test_an_outline_turns_with_the_robot() -> None:
    body = RobotShape(150.0, (Point(100, 50), Point(-100, 0), Point(100, -50)))
    assert body.corners(Pose(1000, 500, 90)) == [
        pytest.approx(Point(950, 600)),
        pytest.approx(Point(1000, 400)),
        pytest.approx(Point(1050, 600)),
    ]
