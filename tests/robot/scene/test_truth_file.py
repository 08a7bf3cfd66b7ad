"""What the world knows of a match, kept beside its log."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.scene.recording import NOTHING, PathPoint, ScoredTask, TouchMark, Truth
from eurobot_od.robot.scene.truth_file import read_truth, truth_file, write_truth

TRUTH = Truth(
    [PathPoint(10.0, 1.0, 2.0, 3.0), PathPoint(10.5, 4.0, 5.0, 6.0)],
    [TouchMark(11.0, Point(7.0, 8.0), "ours and enemy 1", True)],
    [ScoredTask(12.5, "ours", "fruit", 4)],
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "match.log"
    file.write_text("(10.0) can0 00C#\n")
    return file


def test_what_is_written_is_read_again_by_the_logs_clock(log: Path) -> None:
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
def test_what_is_damaged_is_one_line(log: Path, content: str) -> None:
    write_truth(log, TRUTH, 0.0)
    digest = json.loads(truth_file(log).read_text())["log"]
    truth_file(log).write_text(content.replace("LOG", json.dumps(digest)))
    with pytest.raises(LocalError, match=r"match\.log\.truth\.json: .+") as raised:
        read_truth(log)
    assert "\n" not in str(raised.value)


def test_what_is_of_another_log_is_refused(log: Path) -> None:
    write_truth(log, TRUTH, 0.0)
    log.write_text("(10.0) can0 008#\n")
    with pytest.raises(LocalError, match=r"of another log than match\.log"):
        read_truth(log)
