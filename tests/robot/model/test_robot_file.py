"""Reading `robot.yaml`: what is wrong is said on one line with its place, and changes are judged like the file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError, YamlError
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import TeamColour

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
def test_what_is_wrong_is_one_line_with_its_place(tmp_path: Path, text: str, instead: str, what: str) -> None:
    file = tmp_path / robot_file.NAME
    file.write_text(SHIPPED.replace(text, instead, 1), encoding="utf-8")
    with pytest.raises(YamlError, match=r"^[^\n]+$") as caught:
        robot_file.read(file)
    found = re.fullmatch(re.escape(str(file)) + r":(\d+):\d+: (.+)", str(caught.value))
    assert found, caught.value
    assert what in found[2]


def test_the_line_is_that_of_the_value(tmp_path: Path) -> None:
    file = tmp_path / robot_file.NAME
    file.write_text(SHIPPED.replace("number: 2, kind: fire", "number: 9, kind: fire", 1), encoding="utf-8")
    with pytest.raises(YamlError, match=f":{line_of('number: 2, kind: fire')}:"):
        robot_file.read(file)


CHANGES = [
    ("body.radius", "5", "body.radius=5: radius = '5' is not allowed; allowed: 10..1000 mm"),
    ("body.raduis", "250", "body.raduis=250: unknown key 'raduis'; did you mean radius?"),
    ("tasks.mamoth.points", "3", "tasks.mamoth.points=3: unknown key 'mamoth'; did you mean mammoth?"),
    ("body.radius.x", "1", "body.radius.x=1: '140' is a single value, which is given as a whole"),
    ("body", "250", "body=250: expected a mapping, `key: value`, found '250'"),
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


def test_the_settings_of_a_match_are_facts_or_of_nodes() -> None:
    options = MatchOptions(settings=(("body.radius", "250"), ("drive.Motion.Maximum speed", "600")))
    assert options.facts().body.radius == 250
    assert options.of_nodes == (("drive.Motion.Maximum speed", "600"),)
