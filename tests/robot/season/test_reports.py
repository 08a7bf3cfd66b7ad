"""The robot's reports beside figures that are worked out by hand, and their pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("duckdb", reason="the extra `season` is not installed")

from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.messages import CATALOGUE, KalmanPositionResponse, NaviPositionResponse
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import OURS, Caption, GotoFault, Obstacle, RobotError, Score, Source
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.scene.recording import PathPoint, TouchMark, Truth, truth_file, write_truth
from eurobot_od.season.answers import draw
from eurobot_od.season.archive import Archiver, DecodedNetwork
from eurobot_od.season.season import Season
from tests.season.seasons import Timed, write_log

PROTOCOL = EurobotProtocol.load()
NETWORK = DecodedNetwork(dialects.load_all(), CATALOGUE, beside=ROBOT.beside)
BITRATE = 1000


def sent(time: float, message: Any) -> Timed:
    return time, PROTOCOL.encode(message)


GOTO = messages.GotoXY(x=1000, y=1000, angle=0, speed=50)
BLOCKED = messages.GotoStateResponse(GotoFault.BLOCKED)
FIRST: list[Timed] = [
    sent(0.0, GOTO),
    sent(0.002, messages.GotoConfirm()),
    sent(1.0, GOTO),
    sent(1.5, GOTO),  # a repetition: the confirm is for this one
    sent(1.504, messages.GotoConfirm()),
    sent(1.6, messages.GotoConfirm()),  # another one, which counts for nothing
    sent(2.0, messages.GotoStateResponse(500)),
    sent(2.5, messages.GotoStateResponse(0)),
    sent(2.6, KalmanPositionResponse(1003, 1004, 0, Source.INTERNAL)),
    sent(2.7, NaviPositionResponse(1000, 1010, 0, Source.INTERNAL)),
    sent(2.8, messages.GotoStateResponse(0)),
    sent(2.9, KalmanPositionResponse(2000, 2000, 0, Source.INTERNAL)),
    (3.0, Frame(0x7E6, b"12")),
]
SECOND: list[Timed] = [
    sent(0.0, messages.EmergencyStop(Obstacle.ENEMY)),
    sent(0.2, messages.EmergencyStop(Obstacle.ENEMY)),  # repeated
    sent(0.3, messages.StopDrive()),  # of the same stop
    sent(0.8, GOTO),
    sent(0.9, messages.EmergencyStop(Obstacle.ENEMY)),
    sent(6.0, BLOCKED),
    (7.0, Frame(0x081, RobotError.DRIVE_BLOCKED.to_bytes(2, "little") + bytes(6))),
    (8.0, Frame(0x081, bytes(8))),  # the error is gone
]


KNOWN = Truth(
    [PathPoint(0.0, 200, 900, 0.0)],
    [TouchMark(1.0, Point(1, 2), "enemy 1 touched ours", False), TouchMark(2.5, Point(1, 2), "ours touched it", True)],
    [Score(0.5, OURS, "fire 1", 1), Score(2.0, OURS, "mammoth", 8), Score(2.25, "enemy 1", "fresco", 3)],
    [Caption(1.5, OURS, "on my way"), Caption(1.5, OURS, "on my way")],
)
"""The truth about the first log; the second one has none."""


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Season:
    folder = tmp_path_factory.mktemp("reports")
    for name, frames in (("first", FIRST), ("second", SECOND)):
        log = write_log(folder / f"{name}.log", frames)
        if name == "first":
            write_truth(log, KNOWN, 0.0)
        Archiver(folder / "season", NETWORK)(log)
    return Season.open(folder / "season")


def rows(season: Season, report: str, *columns: str) -> list[tuple[Any, ...]]:
    found = season.sql(ROBOT.reports()[report].sql, {"bitrate": BITRATE}).select(columns).rows()
    return [tuple(Path(cell).stem if str(cell).endswith(".log") else cell for cell in row) for row in found]


def test_latency_is_from_the_goto_that_was_confirmed(season: Season) -> None:
    assert rows(season, "latency", "confirmed", "least_ms", "most_ms", "median_ms") == [(2, 2.0, 4.0, 3.0)]


def test_an_arrival_is_the_first_state_that_says_so_and_its_error_that_of_the_position_after(season: Season) -> None:
    columns = ("log", "arrivals", "mean_s", "mean_mm", "most_mm", "beacons_mm")
    assert rows(season, "arrivals", *columns) == [("first", 1, 1.0, 5.0, 5.0, 10.0)]


def test_stops_are_counted_once_however_often_they_are_sent(season: Season) -> None:
    assert rows(season, "stops", "reason", "stops", "frames", "logs", "first_log", "first_line") == [
        ("Emergency Stop: enemy", 2, 3, 1, "second", 1),
        ("EMCY drive blocked", 1, 1, 1, "second", 7),
        ("goto blocked", 1, 1, 1, "second", 6),
        ("Stop Drive", 0, 1, 1, "second", 3),
    ]


def test_points_and_touches_are_those_of_each_match_with_a_truth(season: Season) -> None:
    assert rows(season, "points", "log", "points", "tasks", "others", "last_s") == [("first", 9, 2, 3, 2.0)]
    wanted = [("first", 2, 1, 1.0, "enemy 1 touched ours")]
    assert rows(season, "touches", "log", "touches", "our_fault", "first_s", "first") == wanted


def test_a_truth_changes_the_run_and_a_damaged_one_is_noted(tmp_path: Path) -> None:
    log = write_log(tmp_path / "match.log", FIRST)
    archive = Archiver(tmp_path / "season", NETWORK)
    plain = archive(log)
    write_truth(log, KNOWN, 0.0)
    known = archive(log)
    truth_file(log).write_text("{")
    (damaged,) = archive.put([log])
    assert known.run != plain.run == damaged.run
    assert "match.log.truth.json: not what `match --log` writes" in damaged.notes[0]


def test_two_channels_are_two_buses(tmp_path: Path) -> None:
    """A log may hold several: a goto is confirmed, and a stop repeated, on its own."""
    log = tmp_path / "two.log"
    lines = (
        (0.0, "can0", GOTO),
        (0.1, "can1", GOTO),
        (0.15, "can0", messages.GotoConfirm()),
        (0.3, "can1", messages.GotoConfirm()),
        (1.0, "can0", GOTO),
        (1.1, "can1", GOTO),
        (1.4, "can0", messages.GotoStateResponse(0)),
        (1.5, "can1", KalmanPositionResponse(2000, 2000, 0, Source.INTERNAL)),
        (1.6, "can0", KalmanPositionResponse(1003, 1004, 0, Source.INTERNAL)),
        (1.7, "can1", NaviPositionResponse(2000, 2000, 0, Source.INTERNAL)),
        (1.8, "can0", NaviPositionResponse(1000, 1010, 0, Source.INTERNAL)),
        (2.0, "can0", messages.EmergencyStop(Obstacle.ENEMY)),
        (2.2, "can1", messages.EmergencyStop(Obstacle.ENEMY)),
    )
    log.write_text("".join(f"({time:.6f}) {channel} {PROTOCOL.encode(message)}\n" for time, channel, message in lines))
    Archiver(tmp_path / "season", NETWORK)(log)
    season = Season.open(tmp_path / "season")
    assert rows(season, "latency", "confirmed", "least_ms", "most_ms") == [(2, 150.0, 200.0)]
    assert rows(season, "arrivals", "arrivals", "mean_s", "mean_mm", "beacons_mm") == [(1, 0.4, 5.0, 10.0)]
    assert rows(season, "stops", "reason", "stops", "frames") == [("Emergency Stop: enemy", 2, 2)]


@pytest.mark.parametrize("name", ROBOT.reports())
def test_every_report_has_a_picture(season: Season, name: str) -> None:
    report = ROBOT.reports()[name]
    shown = season.sql(report.chart.sql or report.sql, {"bitrate": BITRATE})
    picture = draw(shown, report.chart, report.title)
    assert picture.startswith("<svg")
    assert report.title in picture
    assert "no rows" not in picture
