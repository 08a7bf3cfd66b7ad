"""The side channel without a socket: what a line is answered with, whatever it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import Errors, MatchOptions
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import OURS, Source, TeamColour
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.world import World
from eurobot_od.robot.world.server import LINE_LIMIT, REQUESTS, VERSION, WHOM, Channel
from eurobot_od.robot.world.world import RIVAL, LocalVehicle

FACTS = robot_file.read()

OPTIONS = MatchOptions(TeamColour.YELLOW, enemies=1, confederates=1, seed=7, errors=Errors(beacon_dropouts=0.5))


def make_world() -> World:
    """A world that stands at 3 s, our robot before an enemy and at a task."""
    world = World(OPTIONS, lambda: 3.0)
    world.pose(OURS, 0.0)
    world.robots[OURS].place(FACTS.tasks(TeamColour.YELLOW)["mammoth"].pose)
    world.robots[RIVAL].place(Pose(2400, 1300, 0.0))
    return world


def make_channel(world: World) -> Channel:
    return Channel(world, OPTIONS)


def ask(channel: Channel, line: str | bytes) -> Any:
    answer = channel.answer(line if isinstance(line, bytes) else line.encode())
    assert answer.endswith(b"\n")
    assert answer.count(b"\n") == 1
    return json.loads(answer)


def pose_data(pose: Pose | None) -> dict[str, float] | None:
    return None if pose is None else pose._asdict()


REFERENCE = Path(__file__).parents[3] / "docs" / "world.md"


# What is right is answered as a vehicle in this process answers it

SAME: list[tuple[str, Callable[[LocalVehicle], Any]]] = [
    ('{"request": "move", "distance": 40, "turn": 1.5, "seconds": 0.1}', lambda it: it.move(Odometry(40, 1.5), 0.1)),
    ('{"request": "move", "distance": -5e2, "turn": 0, "seconds": 1}', lambda it: it.move(Odometry(-500, 0), 1)),
    *(
        (f'{{"request": "pose", "whom": "{name}"}}', lambda it, whom=whom: pose_data(it.pose(whom)))
        for name, whom in WHOM.items()
    ),
    ('{"request": "pose", "whom": "enemy_1", "age": 2}', lambda it: pose_data(it.pose(Source.ENEMY_1, 2.0))),
    ('{"request": "begin", "task": "mammoth"}', lambda it: it.begin("mammoth")),
    ('{"request": "finish", "task": "mammoth"}', lambda it: it.finish("mammoth")),
    (' {"task": "mammoth", "request": "finish"}\r', lambda it: it.finish("mammoth")),
]


@pytest.mark.parametrize(("line", "locally"), SAME)
def test_a_request_is_answered_as_by_a_vehicle_in_this_process(
    line: str, locally: Callable[[LocalVehicle], Any]
) -> None:
    assert ask(make_channel(make_world()), line) == {"answer": locally(make_world().vehicle())}


def test_a_body_ahead_is_named() -> None:
    world = make_world()
    world.robots[OURS].place(Pose(2400, 800, 90.0))
    seen = world.vehicle().ahead(700.0, 35.0)
    assert seen is not None
    answer = {"obstacle": "enemy", "distance": seen.distance, "bearing": seen.bearing}
    assert ask(make_channel(world), '{"request": "ahead", "distance": 700, "angle": 35}') == {"answer": answer}
    assert ask(make_channel(world), '{"request": "ahead", "distance": 10, "angle": 35}') == {"answer": None}


def test_hello_says_which_match_it_is() -> None:
    answer = ask(make_channel(make_world()), '{"request": "hello"}')["answer"]
    assert answer.pop("errors")["beacon_dropouts"] == 0.5
    start = {"team": "yellow", "enemies": 1, "confederates": 1, "seed": 7}
    assert answer == {"version": VERSION, **start}


def test_truth_has_the_robot_s_place_and_points() -> None:
    world = make_world()
    channel = make_channel(world)
    points = ask(channel, '{"request": "finish", "task": "mammoth"}')["answer"]
    assert points > 0
    assert ask(channel, '{"request": "move", "distance": 3000, "turn": 0, "seconds": 10}')["answer"] < 3000
    place = world.robot._asdict()
    truth = {"time": 3.0, **place, "points": points, "touches": 1}
    assert ask(channel, '{"request": "truth"}') == {"answer": truth}


# What is wrong is answered with what is wrong, and changes nothing

MOVE = '{"request": "move", "distance": 1, "turn": 0, "seconds": 0.01}'
REFUSED: list[tuple[str | bytes, str]] = [
    ("", "not JSON"),
    ("hello", "not JSON"),
    ('{"request": "hello"', "not JSON"),
    (b'{"request": "\xff"}', "not JSON"),
    ("[" * LINE_LIMIT, "not JSON"),
    ('{"request": "hello"}' + " " * LINE_LIMIT, "a line of more than 4096 bytes"),
    ("[]", "not a JSON object"),
    ("1", "not a JSON object"),
    ("null", "not a JSON object"),
    ("{}", "unknown request None; known: hello, truth"),
    ('{"request": "mov"}', "unknown request 'mov'; did you mean move?"),
    ('{"request": ["move"]}', "unknown request ['move']"),
    ('{"request": "hello", "version": 1}', "unknown field of hello 'version'"),
    ('{"request": "pose", "who": "internal"}', "unknown field of pose 'who'; did you mean whom?"),
    ('{"request": "pose"}', "pose: whom = None is not allowed; allowed: internal, confederate, enemy_1, enemy_2"),
    ('{"request": "pose", "whom": ["internal"]}', "pose: whom = ['internal'] is not allowed"),
    ('{"request": "pose", "whom": "internal", "age": -1}', "pose: age = -1.0 is not allowed; allowed: 0..3600 s"),
    (MOVE.replace("0.01", "-0.01"), "move: seconds = -0.01 is not allowed; allowed: 0..10 s"),
    (MOVE.replace("1,", "NaN,"), "move: distance = nan is not allowed; allowed: -10000..10000 mm"),
    (MOVE.replace("1,", "-Infinity,"), "move: distance = -inf is not allowed"),
    (MOVE.replace("1,", "1e999,"), "move: distance = inf is not allowed"),
    (MOVE.replace("1,", "9" * 3000 + ","), "move: distance = inf is not allowed"),
    (MOVE.replace("1,", "true,"), "move: distance = True is not allowed"),
    (MOVE.replace("1,", '"1",'), "move: distance = '1' is not allowed"),
    (MOVE.replace(', "turn": 0', ""), "move: turn = None is not allowed; allowed: -3600..3600 degrees"),
    ('{"request": "begin", "task": 5}', "begin: task = 5.0 is not allowed; allowed: the name of a task"),
    ('{"request": "begin", "task": "mamoth"}', "unknown task 'mamoth'; did you mean mammoth?"),
    ('{"request": "finish", "task": ""}', "unknown task ''"),
]


@pytest.mark.parametrize(("line", "error"), REFUSED)
def test_a_wrong_line_is_answered_with_one_error_and_counted(line: str | bytes, error: str) -> None:
    world = make_world()
    channel = make_channel(world)
    before = world.robot
    said = ask(channel, line)
    assert list(said) == ["error"]
    assert said["error"].startswith(error)
    assert (channel.requests, channel.refused, world.robot) == (1, 1, before)
    assert "answer" in ask(channel, MOVE)
    assert (channel.requests, channel.refused) == (2, 1)


@pytest.mark.parametrize("name", REQUESTS)
def test_every_request_is_in_the_reference(name: str) -> None:
    reference = REFERENCE.read_text(encoding="utf-8")
    assert f'| `{{"request": "{name}"' in reference
    for field, rule in REQUESTS[name].fields.items():
        assert f"| `{name}` | `{field}` | {rule.allowed}" in reference
