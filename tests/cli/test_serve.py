"""The command serve: what it refuses, what it prints, how it ends."""

from __future__ import annotations

import json
import shutil
import signal
import sys
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

from eurobot_od.cli.serve import ServedPage, bus_name, told_apart
from eurobot_od.errors import LocalError
from eurobot_od.support import extras
from eurobot_od.web.start import FilesChoice
from tests.cli.console import run
from tests.cli.processes import PATIENCE, command, in_background, line


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "friday.log"
    file.write_text("(1.0) can0 182#\n(2.5) can0 123#\n")
    return file


@pytest.mark.parametrize(
    ("logs", "names"),
    [
        (["/a/one.log", "/b/two.log"], ["one.log", "two.log"]),
        (["/runs/monday/bus.log", "/runs/friday/bus.log"], ["monday/bus.log", "friday/bus.log"]),
        (["bus.log", "old/bus.log"], ["bus.log", "old/bus.log"]),
        (["x/bus.log", "x/bus.log"], ["bus.log (1)", "bus.log (2)"]),
    ],
)
def test_logs_are_named_by_the_part_that_differs(logs: list[str], names: list[str]) -> None:
    assert told_apart(logs) == names


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        ([*"abcde"], 2, "a page shows up to 4 logs side by side, not 5"),
        (["a.log", "--control"], 2, "--control is for a bus: a log cannot be changed"),
        (["nothing.log"], 2, "nothing.log: No such file or directory"),
        (["x.txt", "--format", "log"], 2, "x.txt: No such file or directory"),
        (["--listen", "8014"], 2, "8014 is not HOST:PORT, such as 127.0.0.1:2014"),
        (["--listen", "127.0.0.1:99999"], 2, "127.0.0.1:99999 is not HOST:PORT"),
        (["-i", "nothing"], 3, "cannot open the nothing bus"),
        (["--eds", "no.eds"], 2, "no.eds"),
        (["--origin", "bench.example"], 2, "bench.example is not an origin, such as https://bench.example"),
        (["--origin", "https://bench.example/page"], 2, "is not an origin"),
        (["--origin", "ftp://bench.example", "-i", "nothing"], 2, "is not an origin"),
        (["--origin", "https://", "-i", "nothing"], 2, "is not an origin"),
        (["--token-file", "no.token"], 2, "no.token"),
        (["no.eds"], 2, "no.eds: No such file or directory"),
        (["empty.log", "no.dcf"], 2, "no.dcf: No such file or directory"),
    ],
)
def test_wrong_command_lines_are_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    words: list[str], status: int, complaint: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    said = run(capsys, "serve", *words)
    assert (said.status, complaint in said.complaint) == (status, True), said


def test_serve_without_its_extra(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    said = run(capsys, "serve")
    assert said.complaint == f"eurobot-od: {extras.missing('aiohttp', 'web')}"


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_a_log_is_served_until_sigterm(log: Path, end: signal.Signals) -> None:
    with command("serve", str(log), "--listen", "127.0.0.1:0") as process:
        address = line(process, "http://127.0.0.1:").split()[0]
        with urlopen(address, timeout=PATIENCE) as answer:
            assert "<title>friday.log</title>" in answer.read().decode()
        process.send_signal(end)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert "1 x unknown identifier" in err
    assert "Traceback" not in err


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
def test_in_the_background_of_a_script_sigterm_ends_it(log: Path) -> None:
    with in_background("serve", str(log), "--listen", "127.0.0.1:0") as process:
        line(process, "http://127.0.0.1:")
        process.terminate()
        process.communicate(timeout=PATIENCE / 2)
    assert process.returncode == 0


@pytest.mark.long
@pytest.mark.posix
def test_a_bus_is_served_until_sigterm() -> None:
    with command("serve", "-i", "virtual", "-c", "test-serve", "--listen", "127.0.0.1:0") as process:
        address = line(process, "http://127.0.0.1:").split()[0]
        with urlopen(address, timeout=PATIENCE) as answer:
            assert "<title>Bus test-serve (virtual)</title>" in answer.read().decode()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    assert "Traceback" not in err


@pytest.mark.long
@pytest.mark.posix
def test_files_are_served_without_a_bus_and_without_a_log(log: Path) -> None:
    file = shutil.copy(Path(__file__).parents[2] / "docs" / "motor.eds", log.parent)
    for words, title in (([], "motor.eds"), ([str(log)], "friday.log")):
        with command("serve", str(file), *words, "--listen", "127.0.0.1:0") as process:
            address = line(process, "http://127.0.0.1:").split()[0]
            with urlopen(address, timeout=PATIENCE) as answer:
                assert f"<title>{title}</title>" in answer.read().decode()
            asked = Request(f"{address}files", b'{"do": "list"}', {"Origin": address.rstrip("/")})
            with urlopen(asked, timeout=PATIENCE) as answer:
                listed = json.load(answer)["ok"]
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)
        assert [each["file"] for each in listed["files"] if each["origin"] == "named"] == [str(file)]
        assert not any(each["saves"] for each in listed["files"])


@pytest.mark.long
@pytest.mark.posix
def test_other_machines_need_a_token_that_is_printed_once(log: Path) -> None:
    with command("serve", str(log), "--listen", "0.0.0.0:0") as process:
        address = line(process, "http://").split()[0]
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    _, _, token = address.partition("/?token=")
    assert len(token) >= 32
    assert token not in out + err


@pytest.mark.parametrize(
    ("interface", "channel", "name"),
    [
        ("socketcan", "can0", "Bus can0 (socketcan)"),
        ("remote", "ws://192.168.1.7:54701/", "Bus at 192.168.1.7:54701"),
        ("remote", "ws://me:secret@host:1/", "Bus at host:1"),  # a password is nobody's heading
        ("pcan", None, "Bus (pcan)"),
        (None, None, "Bus"),
    ],
)
def test_the_title_of_the_page_names_its_bus(interface: str | None, channel: str | None, name: str) -> None:
    assert bus_name(interface, channel) == name


def test_a_choice_that_cannot_be_shown_leads_back_to_the_first_page(capsys: pytest.CaptureFixture[str]) -> None:
    class Chosen(ServedPage):
        def __init__(self) -> None:
            self.left = [FilesChoice(), FilesChoice()]

        async def _chosen(self) -> FilesChoice | None:
            return self.left.pop() if self.left else None

        async def _show(self, choice: object) -> bool:
            raise LocalError("it cannot be opened")

    Chosen().begin()
    assert capsys.readouterr().err.count("it cannot be opened\n") == 2
