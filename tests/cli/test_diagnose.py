"""The command `diagnose`: its verdict, its forms, its exit status, and a bus."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import pytest

from eurobot_od.cli.diagnose import WORDS
from eurobot_od.frame import Frame
from eurobot_od.traffic.entries import Timed
from eurobot_od.traffic.monitor import BusSource
from tests.cli.console import run
from tests.traffic.diagnosis.defects import beats, log
from tests.web.scene import channel

WORKBENCH = ("--robot", "none")

MOTOR = Path(__file__).parents[2] / "docs" / "motor.eds"

LOGS = {
    "error": log(beats(until=1.0), beats(node=6, until=3.0)),
    "note": [(1.0, "085#1081110000000000"), (1.1, "085#0000000000000000")],
    "fine": [(1.0, "705#05"), (1.1, "705#05")],
    "empty": [],
}


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    for name, frames in LOGS.items():
        text = "".join(f"({time:.6f}) can0 {frame}\n" for time, frame in frames)
        (tmp_path / f"{name}.log").write_text(text)
    return {name: str(tmp_path / f"{name}.log") for name in LOGS}


VERDICTS = [
    ("error", 1, "1 error in 42 frames, 3 s. It is node 5: is lost: no heartbeat for 2 periods of 100 ms"),
    ("note", 0, "1 note in 2 frames, 100 ms. It is node 5: EMCY 0x8110"),
    ("fine", 0, "Nothing is wrong in 2 frames, 100 ms"),
    ("empty", 1, "1 error in 0 frames, 0 ms. It is no frame in"),
]


@pytest.mark.parametrize(("name", "status", "verdict"), VERDICTS)
def test_the_first_line_is_the_verdict(
    files: dict[str, str], capsys: pytest.CaptureFixture[str], name: str, status: int, verdict: str
) -> None:
    said = run(capsys, "diagnose", files[name], *WORKBENCH)
    assert said.out.startswith(verdict)
    assert said.status == status


@pytest.mark.parametrize(("level", "status"), [("error", 0), ("warning", 0), ("note", 1), ("never", 0)])
def test_the_verdict_is_the_lowest_failing_level(
    files: dict[str, str], capsys: pytest.CaptureFixture[str], level: str, status: int
) -> None:
    assert run(capsys, "diagnose", files["note"], "--fail-on", level, *WORKBENCH).status == status


def test_each_level_can_fail_or_none() -> None:
    assert WORDS == ("error", "warning", "note", "never")


def test_an_incident_names_place_cause_remedy_and_clause(
    files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "diagnose", files["error"], *WORKBENCH).out.splitlines()
    assert said[2].startswith("ERROR    node 5: is lost")
    assert [line.split()[0] for line in said[3:]] == ["Seen", "Likely", "To", "Source"]
    assert f"at 1.300000 s ({files['error']}:25)" in said[3]


def test_json(files: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(run(capsys, "diagnose", files["error"], "--json", *WORKBENCH).out)
    (found,) = data["incidents"]
    assert (found["rule"], found["level"], found["who"], found["number"]) == ("heartbeat-lost", "error", "node 5", 1)
    assert found["places"] == [{"time": 1.3, "log": files["error"], "line": 25}]


@pytest.mark.parametrize("suffix", [".html", ".md"])
def test_a_report(files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str) -> None:
    report = tmp_path / f"report{suffix}"
    run(capsys, "diagnose", files["error"], files["note"], "--report", str(report), *WORKBENCH)
    text = report.read_text()
    assert "Diagnosis of error.log, note.log" in text
    assert text.count("node 5: is lost") == 3  # the verdict, the table, its heading


def test_a_report_has_what_somebody_else_needs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, report = tmp_path / "unix.log", tmp_path / "report.md"
    log.write_text("".join(f"({1_700_000_000 + each}.000000) can0 705#05\n" for each in range(5)))
    run(capsys, "diagnose", str(log), "--eds", f"5={MOTOR}", "--report", str(report), "--robot", "none")
    text = report.read_text()
    assert re.search(r"\| Begins \| 2023-11-1[45] \d\d:\d\d:20\.000", text), text
    assert "| 5 | motor | motor.eds | 0x00000000:0x00000005:0x00010000:0x00000001 |" in text
    assert re.search(r"\| Reported \| \d{4}-\d\d-\d\d .*\n\| Made by \| .*eurobot-od|canopen-workbench", text)
    assert re.search(r"TPDO1 is never sent.* \| 1 \| 4\.000 \| 2023-11-1[45] \d\d:\d\d:24\.000", text), text


def test_headings_of_facts_are_not_wrapped(
    files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(capsys, "diagnose", files["error"], "--report", str(report := tmp_path / "report.html"), *WORKBENCH)
    assert '<td class="word">Seen</td><td>once' in report.read_text()


WRONG = [
    (["--report", "x.pdf"], "unknown document format '.pdf'"),
    (["--fail-on", "info"], "unknown value 'info'; known: error, warning, note, never"),
    (["--eds", "5=missing.eds"], "missing.eds"),
    (["--ask"], "--ask is for a bus: leave it out, or "),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_wrong_input_is_a_line(
    files: dict[str, str], capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    said = run(capsys, "diagnose", files["fine"], *words, *WORKBENCH)
    assert complaint in said.complaint
    assert (said.status, said.out) == (2, "")


@contextmanager
def traffic(data: bytes, identifier: int, channel_name: str = "") -> Iterator[str]:
    """A bus on which a frame is sent again and again."""
    name = channel_name or channel()
    done = threading.Event()
    message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)

    def send() -> None:
        with can.Bus(interface="virtual", channel=name) as bus:
            while not done.wait(0.01):
                bus.send(message)

    thread = threading.Thread(target=send)
    thread.start()
    yield name
    done.set()
    thread.join()


def test_diagnose_listens_for_the_given_time(capsys: pytest.CaptureFixture[str]) -> None:
    with traffic(bytes.fromhex("1081110000000000"), 0x085) as name:
        said = run(capsys, "diagnose", "-i", "virtual", "-c", name, "--for", "500ms", *WORKBENCH)
    assert said.status == 1
    assert "node 5: EMCY 0x8110" in said.out.splitlines()[0]


class OldFrames(BusSource):
    """A bus of which each look takes in a frame of the first moment; a test's thread might send none in time."""

    def poll(self) -> Iterator[Timed]:
        yield 1.0, Frame(0x705, b"\5")


def test_a_diagnosis_that_is_behind_the_bus_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.cli.diagnose.BusSource", OldFrames)
    eds = f"5={MOTOR}"  # with a heartbeat of 500 ms
    said = run(capsys, "diagnose", "-i", "virtual", "-c", channel(), "--for", "1500ms", "--eds", eds, *WORKBENCH)
    assert "WARNING  the last " in said.out
    assert "is lost" not in said.out


def test_a_bus_without_a_frame(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "diagnose", "-i", "virtual", "-c", channel(), "--for", "50ms", *WORKBENCH)
    assert (said.status, said.out.splitlines()[0]) == (1, "1 error in 0 frames, 0 ms. It is no frame came")


def test_a_node_that_shows_trouble_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    name = channel()
    stock = canopen.Network()
    stock.connect(interface="virtual", channel=name)
    try:
        stock.create_node(5, str(MOTOR.with_name("servo.eds")))
        with traffic(bytes.fromhex("2032010000000000"), 0x085, channel_name=name):
            words = "diagnose", "-i", "virtual", "-c", name, "--for", "500ms", "--ask", "--json", *WORKBENCH
            found = json.loads(run(capsys, *words).out)["incidents"]
    finally:
        stock.disconnect()
    (asked,) = (each["asked"] for each in found if each["asked"])
    assert asked[0] == "0x1001:0 error register 0x00 (no error)"
    assert "0x1000:0 device type 0x00020192, profile 402" in asked
    assert asked[-2:] == ["0x6041:0 Statusword 576 (Switch on disabled)", "0x603F:0 Error code 0 (0x0000 no error)"]
