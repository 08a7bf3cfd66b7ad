"""The picture: to scale, on the page, with everything that happened, and good XML whatever the title."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import (
    EmergencyStop,
    Enemy1PositionResponse,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import OURS, Barriers, Obstacle, Passage, Score, Source, TeamColour
from eurobot_od.robot.protocol import decoder
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.files import SeenMatch, form, save
from eurobot_od.robot.scene.recording import PathPoint, TouchMark, Truth, record
from eurobot_od.robot.scene.scene import PAGE, SPACING, sheet
from eurobot_od.support import svg

FACTS = robot_file.read()

SVG = "{http://www.w3.org/2000/svg}"
BARRIER_FLAGS = Barriers.of({1: Passage.NORMAL, 8: Passage.FORCED})
EVENTS: list[tuple[float, Message]] = [
    (0.0, StartConfigurationSet(TeamColour.RED, 1, 0, 40, 0)),
    (1.0, KalmanPositionResponse(200, 1800, 0, Source.INTERNAL)),
    (2.0, GotoXY(1000, 500, 90, 80, BARRIER_FLAGS)),
    (4.0, Enemy1PositionResponse(2000, 1500, None, Source.ENEMY_1)),
    (5.0, KalmanPositionResponse(600, 1100, 300, Source.INTERNAL)),
    (6.0, EmergencyStop(Obstacle.ENEMY)),
    (12.0, GotoXY(1000, 500, 90, 80)),
    (15.0, KalmanPositionResponse(1000, 500, 90, Source.INTERNAL)),
    (16.0, GotoStateResponse(0)),
]


TOUCHES = [
    TouchMark(4.0, Point(620, 1400), "ours at 300 mm/s touched fire 1", True),
    TouchMark(5.0, Point(700, 500), "enemy 1 at 200 mm/s touched ours", False),
]
SCORES = [
    Score(5.0, OURS, "frescos", 6),
    Score(8.0, "enemy 1", "mammoth", 10),
    Score(15.0, OURS, "tree 1", 3),
]
KNOWN = Truth([PathPoint(1.0, 200, 1800, 0), PathPoint(15.0, 1000, 500, 0)], TOUCHES, SCORES)
"""What the world knows of the events."""


def drawn(
    events: list[tuple[float, Message]] = EVENTS, title: str = "Match", truth: Truth | None = None
) -> ElementTree.Element:
    return ElementTree.fromstring(sheet(record(events, truth or Truth()), FACTS, title))


def light(colour: str) -> str:
    return style.COLOURS[colour].light


def field_of(picture: ElementTree.Element) -> ElementTree.Element:
    found = picture.find(f".//{SVG}g[@id='field']")
    assert found is not None
    return found


def words(picture: ElementTree.Element) -> list[str]:
    return [each.text or "" for each in picture.iter(f"{SVG}text")]


def titles(picture: ElementTree.Element) -> list[str]:
    return [each.text or "" for each in picture.iter(f"{SVG}title")]


def placed(
    picture: ElementTree.Element, x: float = 0, y: float = 0
) -> Iterator[tuple[ElementTree.Element, float, float]]:
    """Yield all elements, each with the place of its origin."""
    for each in picture:
        moved = re.match(r"translate\((\S+) (\S+)\)", each.get("transform", ""))
        here = (x + float(moved[1]), y + float(moved[2])) if moved else (x, y)
        yield each, *here
        yield from placed(each, *here)


def circles(picture: ElementTree.Element, **attributes: str) -> list[tuple[float, float, float]]:
    return [
        (x + float(each.get("cx", 0)), y + float(each.get("cy", 0)), float(each.attrib["r"]))
        for each, x, y in placed(picture)
        if each.tag == f"{SVG}circle" and attributes.items() <= each.attrib.items()
    ]


def numbers(picture: ElementTree.Element) -> Iterator[tuple[float, float]]:
    """Yield all places of a drawing, by the coordinates of its elements."""
    for each, x, y in placed(picture):
        for one, other in (("x", "y"), ("cx", "cy"), ("x1", "y1"), ("x2", "y2")):
            if one in each.attrib:
                yield x + float(each.attrib[one]), y + float(each.attrib[other])
        for pair in each.attrib.get("points", "").split():
            x_text, y_text = pair.split(",")
            yield x + float(x_text), y + float(y_text)


def test_the_field_is_to_scale() -> None:
    borders = (each for each in field_of(drawn()).iter(f"{SVG}rect") if each.get("stroke") == svg.INK)
    (border,) = (each for each in borders if each.get("x") == "0")
    assert (float(border.attrib["width"]), float(border.attrib["height"])) == (FACTS.field.width, FACTS.field.height)


@pytest.mark.parametrize(("share", "scaled"), [(0.5, "scale(2.0000)"), (1.0, ""), (2.0, "scale(0.5000)")])
def test_another_field_is_drawn_as_large_as_the_room(share: float, scaled: str) -> None:
    field = replace(FACTS.field, width=round(3000 * share), height=round(2000 * share))
    text = sheet(record(EVENTS, Truth()), replace(FACTS, field=field), "Match")
    assert "".join(re.findall(r"scale\([\d.]+\)", text)) == scaled


def test_pools_stand_where_they_stand() -> None:
    pools = [each for each in FACTS.barriers if each.kind.name == "pool"]
    expected = [(pool.x, FACTS.field.height - pool.y, pool.kind.radius) for pool in pools]
    assert circles(field_of(drawn()), fill=style.FIXED) == expected


def test_tasks_stand_at_their_places_with_what_they_are_worth() -> None:
    found = {}
    for each, x, y in placed(field_of(drawn())):
        if each.get("class") == "sign task":
            (title,), (worth,) = titles(each), words(each)
            found[title.partition(":")[0]] = (x, FACTS.field.height - y, worth, title)
    tasks = FACTS.tasks(TeamColour.RED)
    assert {name: place[:2] for name, place in found.items()} == {each.name: each.at[:2] for each in tasks.values()}
    assert {name: found[name][2] for name in ("fire 1", "tree 1", "mammoth", "frescos", "basket")} == {
        "fire 1": "1", "tree 1": "3f", "mammoth": "12", "frescos": "6", "basket": "1/f",
    }  # fmt: skip
    assert found["mammoth"][3] == "mammoth: 6 x 2 points, each by 60%; 4 s"
    assert "task: points at most, or f: fruit" in words(drawn())


def test_asked_barriers_are_ringed_by_their_passage() -> None:
    rings = [
        (x, y, each.get("stroke-dasharray"))
        for each, x, y in placed(field_of(drawn()))
        if each.tag == f"{SVG}circle" and each.get("stroke") == light(style.STOP) and each.get("fill") == "none"
    ]
    first, last = FACTS.barriers[0], FACTS.barriers[7]
    assert rings == [(first.x, FACTS.field.height - first.y, "18 14"), (last.x, FACTS.field.height - last.y, None)]


def test_gotos_to_one_place_share_its_mark_and_have_their_own_discs() -> None:
    field = field_of(drawn())
    assert [(x, FACTS.field.height - y, r) for x, y, r in circles(field, r="26")] == [(1000, 500, 26)]
    (stopped,), (reached,) = (circles(field, r=str(style.MARK), fill=light(each)) for each in (style.PAPER, style.GOTO))
    assert (stopped[0], reached[0] - stopped[0], stopped[1]) == (1000, SPACING, reached[1])


def test_stops_and_gotos_say_everything_under_the_pointer() -> None:
    assert titles(drawn())[len(FACTS.red_tasks) :] == [
        "fire 1",
        "pool 2",
        "enemy 1",
        "goto 1 to 1000, 500 mm, 90 deg, 80 %, barriers fire 1:normal, pool 2:forced, at 2.0 s: stopped",
        "goto 2 to 1000, 500 mm, 90 deg, 80 %, barriers none, at 12.0 s: arrived",
        "A: Emergency Stop: enemy, at 6.0 s",
    ]


def test_an_enemy_has_the_size_of_the_start_configuration() -> None:
    enemies = circles(field_of(drawn()), fill=light(style.colour_of("enemy 1")))
    assert enemies == [(2000, FACTS.field.height - 1500, 200)]


def test_summary() -> None:
    assert "red team, 1 enemy, 0 confederates, 1 of 2 gotos reached, 1 stop, 16 s" in words(drawn())


def test_the_own_start_place_is_the_one_that_is_marked() -> None:
    squares = [each for each in field_of(drawn()).iter(f"{SVG}rect") if each.get("fill-opacity")]
    marked = {each.attrib["fill"]: each.get("stroke-dasharray") is None for each in squares}
    assert marked == {light(style.team_colour(team)): team is TeamColour.RED for team in TeamColour}


def test_the_path_is_marked_every_ten_seconds() -> None:
    moved = [(float(time), KalmanPositionResponse(100 + 50 * time, 1000, 0, Source.INTERNAL)) for time in range(31)]
    assert circles(field_of(drawn([EVENTS[0], *moved])), r="15") == [(x, 1000, 15) for x in (600, 1100, 1600)]


def test_a_stop_before_any_place_is_known_is_counted_and_not_on_the_field() -> None:
    found = drawn([(0.0, EmergencyStop(Obstacle.ENEMY)), *EVENTS[1:3]])
    assert any("1 stop" in each for each in words(found))
    assert not any("Emergency Stop" in each for each in titles(field_of(found)))


def test_bodies_are_to_scale() -> None:
    field = field_of(drawn())
    assert circles(field, fill=style.TREE) == [
        (x, FACTS.field.height - y, FACTS.field.trees.radius) for x, y in FACTS.field.trees.places
    ]
    ours = circles(field, fill=light(style.team_colour(TeamColour.RED)))
    assert ours == [(1000, FACTS.field.height - 500, FACTS.body.radius)]


def bursts(picture: ElementTree.Element) -> list[tuple[float, float, bool]]:
    """Return the middle of each burst, and whether it is filled."""
    return [
        (round(x), round(y), each.get("fill") == style.TOUCH)
        for each, x, y in placed(picture)
        if each.tag == f"{SVG}polygon" and style.TOUCH in each.attrib.values()
    ]


def test_touches_are_marked_where_they_happened() -> None:
    drawing = drawn(truth=KNOWN)
    assert bursts(field_of(drawing)) == [(620, FACTS.field.height - 1400, True), (700, FACTS.field.height - 500, False)]
    assert {each.words for each in TOUCHES} <= set(titles(drawing))


def test_our_points_are_in_the_summary() -> None:
    summary = "red team, 1 enemy, 0 confederates, 1 of 2 gotos reached, 1 stop, 2 touches, 9 points, 16 s"
    assert summary in words(drawn(truth=KNOWN))


def test_a_log_alone_knows_neither_touches_nor_points() -> None:
    drawing = drawn()
    assert bursts(drawing) == []
    assert not [each for each in words(drawing) if "touch" in each or each.endswith(" points")]


@pytest.mark.parametrize("title", ["<b>&\"' Größe", "]]>", "-->"])
def test_any_title_is_good_xml(title: str) -> None:
    assert title in words(drawn(title=title))


EMPTY: list[tuple[float, Message]] = []
MANY: list[tuple[float, Message]] = [
    each
    for n in range(300)
    for each in (
        (n * 1.0, GotoXY(n * 10, n % 20 * 100, n, 50)),
        (n + 0.4, KalmanPositionResponse(n * 10, n % 20 * 100, n, Source.INTERNAL)),
        (n + 0.5, StopDrive()),
    )
]


@pytest.mark.parametrize("truth", [Truth(), KNOWN], ids=["a log", "a match played here"])
@pytest.mark.parametrize("events", [EMPTY, EVENTS, MANY], ids=["nothing", "little", "a lot"])
def test_everything_is_on_the_page(events: list[tuple[float, Message]], truth: Truth) -> None:
    picture = drawn(events, truth=truth)
    width, height = PAGE
    for part in picture.findall(f"{SVG}g"):
        match = re.fullmatch(r"translate\((\S+) (\S+)\)", part.attrib["transform"])
        assert match
        left, top = float(match[1]), float(match[2])
        rows = [*part.findall(f"{SVG}g/{SVG}g[@transform]")]
        assert all(-100 <= x + left <= width and -100 <= y + top <= height for x, y in numbers(part))
        for row in rows:
            down = float(row.attrib["transform"].removesuffix(")").split()[1])
            assert all(y + top + down <= height for _, y in numbers(row))


def test_the_true_path_is_drawn() -> None:
    (line,) = (each for each in drawn(truth=KNOWN).iter(f"{SVG}polyline") if each.get("stroke") == style.TRUTH)
    assert line.attrib["points"] == "200,200 1000,1500"


def test_time_has_ever_darker_colours() -> None:
    def brightness(colour: str) -> int:
        return sum(bytes.fromhex(colour[1:]))

    shades = [brightness(style.colour_at(share / 20)) for share in range(21)]
    assert shades == sorted(shades, reverse=True)
    assert (style.colour_at(-1), style.colour_at(2)) == (style.colour_at(0), style.colour_at(1))


def test_a_file_has_colours_that_every_program_knows() -> None:
    title = "var(--field-ink)"
    drawing = sheet(record(MANY, KNOWN), FACTS, title)
    assert re.findall(r"var\(.*?\)", drawing) == [title], "a title stays as it is"


# Files


DECODER = decoder()
SEEN = SeenMatch([(time, DECODER(DECODER.protocol.encode(message))) for time, message in EVENTS], DECODER, FACTS, KNOWN)


@pytest.mark.parametrize(
    ("suffix", "start"), [("svg", b"<svg "), ("html", b"<!DOCTYPE html>"), ("png", b"\x89PNG"), ("SVG", b"<svg ")]
)
def test_the_suffix_says_the_format(tmp_path: Path, suffix: str, start: bytes) -> None:
    file = tmp_path / f"match.{suffix}"
    save(SEEN, file, "Match")
    assert file.read_bytes().startswith(start)


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match=r"unknown picture format '.gif'; known: .svg, .html, .png"):
        save(SEEN, tmp_path / "match.gif", "Match")


def test_png_without_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resvg_py", None)
    with pytest.raises(LocalError, match=r"the extra `png` brings it"):
        form(tmp_path / "match.png")  # asked before a match is played
    with pytest.raises(LocalError, match=r"the extra `png` brings it"):
        save(SEEN, tmp_path / "match.png", "Match")
    assert not (tmp_path / "match.png").exists()


def test_one_far_timestamp_does_not_draw_for_ever() -> None:
    far: list[tuple[float, Message]] = [*EVENTS, (9e10, KalmanPositionResponse(700, 1100, 300, Source.INTERNAL))]
    assert len(sheet(record(far), FACTS, "far")) < 100_000


def test_a_path_that_took_no_time_is_drawn() -> None:
    """A damaged log, all of whose time stamps are 0, ended in a division by zero."""
    at_once: list[tuple[float, Message]] = [
        (0.0, KalmanPositionResponse(x, 1100, 300, Source.INTERNAL)) for x in (700, 800, 900)
    ]
    assert field_of(drawn(at_once)) is not None
