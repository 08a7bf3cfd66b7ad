"""What a match's messages tell: paths, gotos and how they ended, stops and why."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message, OutOfRange
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionResponse,
    GotoConfirm,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    NaviPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import OURS, Caption, GotoFault, Obstacle, Outcome, Score, Source, TeamColour
from eurobot_od.robot.protocol import EurobotProtocol, decoder
from eurobot_od.robot.scene.files import SeenMatch
from eurobot_od.robot.scene.recording import (
    NOTHING,
    PathPoint,
    Recording,
    TouchMark,
    Truth,
    at,
    read_truth,
    record,
    truth_file,
    write_truth,
)

PROTOCOL = EurobotProtocol.load()
ONE, TWO = GotoXY(1000, 500, 0, 50), GotoXY(2000, 500, 90, 50)


def here(x: int | None, y: int | None, angle: int | None = 0) -> KalmanPositionResponse:
    return KalmanPositionResponse(x, y, angle, Source.INTERNAL)


def recorded(*messages: Message) -> Recording:
    """Record messages, one second apart."""
    return record((100.0 + second, message) for second, message in enumerate(messages))


def endings(recording: Recording) -> list[tuple[Outcome | None, float, float | None]]:
    return [(goto.outcome, goto.sent, goto.ended) for goto in recording.gotos]


GOTOS: list[tuple[str, list[Message], list[tuple[Outcome | None, float, float | None]]]] = [
    ("arrived", [ONE, GotoStateResponse(500), GotoStateResponse(0)], [(Outcome.ARRIVED, 0, 2)]),
    ("not possible", [ONE, GotoStateResponse(GotoFault.NOT_POSSIBLE)], [(Outcome.NOT_POSSIBLE, 0, 1)]),
    ("blocked", [ONE, GotoStateResponse(GotoFault.BLOCKED)], [(Outcome.BLOCKED, 0, 1)]),
    ("stopped", [ONE, StopDrive()], [(Outcome.STOPPED, 0, 1)]),
    ("replaced", [ONE, TWO, GotoStateResponse(0)], [(Outcome.REPLACED, 0, 1), (Outcome.ARRIVED, 1, 2)]),
    ("under way at the end", [ONE, GotoStateResponse(None)], [(None, 0, None)]),
    ("sent again, as its confirm was lost", [ONE, ONE, GotoConfirm(), GotoStateResponse(0)], [(Outcome.ARRIVED, 0, 3)]),
    (
        "driven again after it was reached",
        [ONE, GotoStateResponse(0), ONE, GotoStateResponse(0), GotoStateResponse(0)],
        [(Outcome.ARRIVED, 0, 1), (Outcome.ARRIVED, 2, 3)],
    ),
    ("not acted on", [ONE._replace(speed=OutOfRange(101))], []),
]


@pytest.mark.parametrize(("messages", "expected"), [row[1:] for row in GOTOS], ids=[row[0] for row in GOTOS])
def test_gotos(messages: list[Message], expected: list[tuple[Outcome | None, float, float | None]]) -> None:
    assert endings(recorded(*messages)) == expected


STOPS: list[tuple[str, list[Message], list[tuple[str, float, str]]]] = [
    ("an enemy", [EmergencyStop(Obstacle.ENEMY)], [("A", 0, "Emergency Stop: enemy")]),
    ("an object", [EmergencyStop(Obstacle.OBJECT)], [("A", 0, "Emergency Stop: object")]),
    ("no known obstacle", [EmergencyStop(OutOfRange(7))], [("A", 0, "Emergency Stop: 7 (out of range)")]),
    ("shutdown", [EmergencyShutdown()], [("A", 0, "Emergency Shutdown: mushroom")]),
    (
        "again after a late confirm",
        [ONE, StopDrive(), GotoConfirm(), StopDrive()],
        [("A", 1, "Stop Drive: commanded")],
    ),
    (
        "an emergency stop, and the stop drive that follows",
        [ONE, EmergencyStop(Obstacle.ENEMY), EmergencyStop(Obstacle.ENEMY), StopDrive()],
        [("A", 1, "Emergency Stop: enemy")],
    ),
    (
        "two in a row that differ",
        [EmergencyStop(Obstacle.ENEMY), EmergencyShutdown()],
        [("A", 0, "Emergency Stop: enemy"), ("B", 1, "Emergency Shutdown: mushroom")],
    ),
    (
        "the same for the next goto",
        [ONE, StopDrive(), TWO, StopDrive()],
        [("A", 1, "Stop Drive: commanded"), ("B", 3, "Stop Drive: commanded")],
    ),
]


@pytest.mark.parametrize(("messages", "expected"), [row[1:] for row in STOPS], ids=[row[0] for row in STOPS])
def test_stops(messages: list[Message], expected: list[tuple[str, float, str]]) -> None:
    assert [(s.letter, s.time, s.what) for s in recorded(*messages).stops] == expected


def test_letters_go_on_after_z() -> None:
    stops = recorded(*(each for _ in range(14) for each in (ONE, StopDrive(), TWO, EmergencyShutdown()))).stops
    assert [stop.letter for stop in stops][25:] == ["Z", "AA", "AB"]


def test_a_stop_is_where_the_robot_was_seen_last() -> None:
    assert recorded(here(100, 200), StopDrive()).stops[0].place == PathPoint(0, 100, 200, 0)
    assert recorded(StopDrive(), here(100, 200)).stops[0].place is None


def test_paths_hold_known_places_by_who_was_seen() -> None:
    enemy = Enemy1PositionResponse(1500, 1000, None, Source.ENEMY_1)
    raw = NaviPositionResponse(1, 2, 3, Source.INTERNAL)
    recording = recorded(here(100, 200, 90), here(None, None, None), enemy, raw, here(OutOfRange(4000), 5))
    assert recording.paths == {
        KalmanPositionResponse: [PathPoint(0, 100, 200, 90)],
        Enemy1PositionResponse: [PathPoint(2, 1500, 1000, None)],
    }
    assert recording.end == 4


def test_team() -> None:
    start = StartConfigurationSet(TeamColour.RED, 1, 0, 30, 0)
    assert recorded(start).team is TeamColour.RED
    assert recorded(start, start._replace(team_colour=TeamColour.YELLOW)).team is TeamColour.YELLOW
    assert recorded(ONE).team is None


def test_events_of_the_world_have_the_clock_of_the_messages() -> None:
    touch = TouchMark(101.0, Point(5, 6), "ours touched fire 1", True)
    score = Score(102.0, OURS, "tree 1", 3)
    said = Caption(103.0, OURS, "done")
    recording = record([(100.0, ONE)], Truth([PathPoint(100.5, 1, 2, 3)], [touch], [score], [said]))
    assert recording.truth.path == [(0.5, 1, 2, 3)]
    later = touch._replace(time=1.0), score._replace(time=2.0), said._replace(time=3.0)
    assert recording.truth[1:] == tuple([each] for each in later)


def test_frames_that_are_not_messages_are_left_out() -> None:
    frames = [
        (1.0, PROTOCOL.encode(ONE)),
        (2.0, Frame(0x701, b"\x05")),  # a heartbeat
        (3.0, Frame(PROTOCOL.cob_id(GotoStateResponse), b"\0")),  # too short
        (4.0, PROTOCOL.encode(GotoStateResponse(0))),
    ]
    decode = decoder()
    seen = SeenMatch([(time, decode(frame)) for time, frame in frames], decode, robot_file.read())
    assert endings(seen.recording) == [(Outcome.ARRIVED, 0, 3)]


PATH = [PathPoint(1, 0, 0, 0), PathPoint(2, 100, 200, 90)]


@pytest.mark.parametrize(
    ("time", "expected"), [(0, PATH[0]), (1, PATH[0]), (1.5, PathPoint(1.5, 50, 100, 0)), (2, PATH[1]), (9, PATH[1])]
)
def test_where_the_robot_was_at_a_time(time: float, expected: PathPoint) -> None:
    assert at(PATH, time) == expected
    assert at([], time) is None


TRUTH = Truth(
    [PathPoint(10.0, 1.0, 2.0, 3.0), PathPoint(10.5, 4.0, 5.0, 6.0)],
    [TouchMark(11.0, Point(7.0, 8.0), "ours and enemy 1", True)],
    [Score(12.5, "ours", "fruit", 4)],
    [Caption(10.25, "ours", "to the tree")],
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "match.log"
    file.write_text("(10.0) can0 00C#\n")
    return file


def test_a_written_truth_is_read_again_by_the_clock_of_the_log(log: Path) -> None:
    write_truth(log, TRUTH, 10.0)
    assert read_truth(log, 10.0) == TRUTH
    assert [each.time for each in read_truth(log).scores] == [2.5], "from the log's first frame on"


def test_a_log_with_nothing_beside_it(log: Path) -> None:
    assert read_truth(log) == NOTHING


def test_a_log_that_is_no_file_has_nothing_beside_it(tmp_path: Path) -> None:
    write_truth(tmp_path, TRUTH, 0.0)
    assert not truth_file(tmp_path).exists()


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        pytest.param("[" * 100_000, id="nested deeply"),
        "{}",
        '{"log": 5}',
        "\x00\xff",
        '{"log": LOG, "path": [], "touches": []}',
        '{"log": LOG, "path": [["x", 1, 2, 3]], "touches": [], "scores": []}',
        '{"log": LOG, "path": [[1, 2]], "touches": [], "scores": []}',
        '{"log": LOG, "path": [], "touches": [[1]], "scores": []}',
        '{"log": LOG, "path": [], "touches": [], "scores": [[1, "ours", "fruit", "many"]]}',
    ],
)
def test_a_damaged_truth_is_one_line(log: Path, content: str) -> None:
    write_truth(log, TRUTH, 0.0)
    digest = json.loads(truth_file(log).read_text())["log"]
    truth_file(log).write_text(content.replace("LOG", json.dumps(digest)))
    with pytest.raises(LocalError, match=r"match\.log\.truth\.json: .+") as raised:
        read_truth(log)
    assert "\n" not in str(raised.value)


def test_a_truth_of_another_log_is_refused(log: Path) -> None:
    write_truth(log, TRUTH, 0.0)
    log.write_text("(10.0) can0 008#\n")
    with pytest.raises(LocalError, match=r"of another log than match\.log"):
        read_truth(log)
