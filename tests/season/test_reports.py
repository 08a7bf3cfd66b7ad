"""Reports beside figures that are worked out by hand, and their pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("duckdb", reason="the extra `season` is not installed")

from eurobot_od.frame import Frame
from eurobot_od.season.answers import draw
from eurobot_od.season.archive import Archiver, DecodedNetwork
from eurobot_od.season.reports import REPORTS
from eurobot_od.season.season import Season
from tests.kit import plant
from tests.kit.plant import messages as m
from tests.season.seasons import Timed, write_log

PROTOCOL = plant.protocol()
NETWORK = DecodedNetwork(
    plant.load_all(), plant.CATALOGUE, (("Move Confirm", "Move To"), ("Check Lift Response", "Check Lift Request"))
)
BITRATE = 1000


def sent(time: float, message: Any) -> Timed:
    return time, PROTOCOL.encode(message)


MOVE = m.MoveTo(x=1000, y=1000, angle=0, speed=50)
FIRST: list[Timed] = [
    sent(0.0, MOVE),
    sent(0.002, m.MoveConfirm()),
    sent(1.0, MOVE),
    sent(1.5, MOVE),  # a repetition: the confirm is for this one
    sent(1.504, m.MoveConfirm()),
    sent(1.6, m.MoveConfirm()),  # another one, which counts for nothing
    sent(2.7, m.WeightResponse(12.5, 21.5)),
    (3.0, Frame(0x7E6, b"12")),
]
SECOND: list[Timed] = [
    sent(0.0, m.HaltCause(m.Cause.CURTAIN)),
    sent(0.2, m.HaltCause(m.Cause.CURTAIN)),  # repeated
    sent(5.0, m.HaltCause(m.Cause.CURTAIN)),
    sent(6.0, m.MoveStateResponse(m.Fault.BLOCKED)),
    (7.0, Frame(0x081, bytes.fromhex("02FF") + bytes(6))),
    (8.0, Frame(0x081, bytes(8))),  # the error is gone
]


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Season:
    folder = tmp_path_factory.mktemp("reports")
    for name, frames in (("first", FIRST), ("second", SECOND)):
        Archiver(folder / "season", NETWORK)(write_log(folder / f"{name}.log", frames))
    return Season.open(folder / "season")


def rows(season: Season, report: str, *columns: str) -> list[tuple[Any, ...]]:
    found = season.sql(REPORTS[report].sql, {"bitrate": BITRATE}).select(columns).rows()
    return [tuple(Path(cell).stem if str(cell).endswith(".log") else cell for cell in row) for row in found]


def test_an_answer_belongs_to_the_latest_request(season: Season) -> None:
    columns = ("request", "answer", "requests", "answered", "most_ms")
    assert rows(season, "answers", *columns) == [("Move To", "Move Confirm", 3, 2, 4.0)]


def test_periods_are_from_a_frame_to_the_next_of_its_message(season: Season) -> None:
    found = {
        row[0]: row[1:] for row in rows(season, "periods", "message", "frames", "least_ms", "most_ms", "jitter_ms")
    }
    assert found["Move To"] == (3, 500.0, 1000.0, 353.553)
    assert found["Weight Response"] == (1, None, None, None)


def test_two_channels_are_two_buses(tmp_path: Path) -> None:
    """A log may hold several: of each a message has its own period, and a request its own answer."""
    log = tmp_path / "two.log"
    lines = (
        (0.0, "can0", MOVE),
        (0.1, "can1", MOVE),
        (0.15, "can0", m.MoveConfirm()),
        (0.3, "can1", m.MoveConfirm()),
        (1.0, "can0", MOVE),
        (1.1, "can1", MOVE),
    )
    log.write_text("".join(f"({time:.6f}) {channel} {PROTOCOL.encode(message)}\n" for time, channel, message in lines))
    Archiver(tmp_path / "season", NETWORK)(log)
    season = Season.open(tmp_path / "season")
    periods = {row[0]: row[1:] for row in rows(season, "periods", "message", "frames", "least_ms", "most_ms")}
    assert periods["Move To"] == (4, 1000.0, 1000.0)
    columns = ("answer", "requests", "answered", "least_ms", "most_ms")
    assert rows(season, "answers", *columns) == [("Move Confirm", 4, 2, 150.0, 200.0)]


def test_load_counts_bits_without_and_with_all_stuff_bits(season: Season) -> None:
    found = {
        row[0]: row[1:] for row in rows(season, "load", "log", "frames", "seconds", "load_%", "most_%", "peak_second")
    }
    bits = [8 * len(frame.data) + 47 for _, frame in SECOND]
    most = [8 * len(frame.data) + 47 + (8 * len(frame.data) + 33) // 4 for _, frame in SECOND]
    assert found["second"] == (6, 8.0, *(round(sum(each) / BITRATE / 9 * 100, 2) for each in (bits, most)), 7)


def test_damage_names_its_first_place(season: Season) -> None:
    columns = ("log", "kind", "number", "first_line", "first")
    assert rows(season, "damage", *columns) == [("first", "unknown identifier", 1, 8, "7E6#3132")]


@pytest.mark.parametrize("name", REPORTS)
def test_every_report_has_a_picture(season: Season, name: str) -> None:
    report = REPORTS[name]
    shown = season.sql(report.chart.sql or report.sql, {"bitrate": BITRATE})
    picture = draw(shown, report.chart, report.title)
    assert picture.startswith("<svg")
    assert report.title in picture
    assert "no rows" not in picture
