"""The command field: a log becomes a picture, or one line says why not."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import GotoXY, KalmanPositionResponse
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.protocol import EurobotProtocol

PROTOCOL = EurobotProtocol.load(dialects.DEFAULT)
HERE = PROTOCOL.encode(KalmanPositionResponse(500, 600, 0, Source.INTERNAL))
GOTO = PROTOCOL.encode(GotoXY(1000, 600, 0, 50))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "friday.log"
    file.write_text(f"(1.0) can0 {HERE}\n(2.0) can0 {GOTO}\n(2.5) can0 123#\n")
    return file


@pytest.mark.parametrize(("options", "title"), [([], "friday"), (["--title", "Final & last"], "Final &amp; last")])
def test_picture(log: Path, capsys: pytest.CaptureFixture[str], options: list[str], title: str) -> None:
    picture = log.with_suffix(".svg")
    assert cli.main(["field", str(log), "-o", str(picture), *options]) == 0
    assert f">{title}</text>" in picture.read_text()
    out, err = capsys.readouterr()
    assert out == ""
    assert "1 x unknown identifier" in err


@pytest.mark.parametrize(
    ("text", "suffix", "status", "message"),
    [
        ("(1.0) can0 00C#\n", ".svg", 1, "neither a Kalman Position Response nor a Goto XY to draw"),
        (f"(1.0) can0 {HERE}\n", ".gif", 2, "unknown picture format '.gif'"),
    ],
)
def test_no_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, suffix: str, status: int, message: str
) -> None:
    log = tmp_path / "bus.log"
    log.write_text(text)
    assert cli.main(["field", str(log), "-o", str(log.with_suffix(suffix))]) == status
    assert message in capsys.readouterr().err
    assert not log.with_suffix(suffix).exists()


@pytest.mark.long
def test_a_picture_from_a_log_has_the_points(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, page, picture = tmp_path / "match.log", tmp_path / "match.html", tmp_path / "match.svg"
    assert cli.main(["match", "--log", str(log)]) == 0
    told = re.search(r"points: ours (\d+)", capsys.readouterr().out)
    assert told is not None
    for file in (page, picture):
        assert cli.main(["field", str(log), "-o", str(file)]) == 0
    made = re.findall(r'"kind":"points","time":[0-9.]+,"text":"ours: [^"]* \+(\d+)"', page.read_text())
    assert sum(map(int, made)) == int(told[1]) > 0
    assert f"{told[1]} points" in picture.read_text()
    log.write_text(log.read_text()[20:])
    capsys.readouterr()
    assert cli.main(["field", str(log), "-o", str(page)]) == 0
    assert "match.log.truth.json: of another log than match.log; its points are left out" in capsys.readouterr().err
    assert '"kind":"points"' not in page.read_text()


def test_a_log_whose_name_is_not_utf_8(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log = Path(os.fsdecode(b"a\xff.log"))
    log.write_text("(1.000000) can0 008#D27423592C01C3A5\n")
    assert cli.main(["field", "-o", "match.html", str(log)]) == 0
    assert "\udcff" not in capsys.readouterr().err
