"""The command monitor: plain lines and a table, and a terminal with keys."""

from __future__ import annotations

import os
import select
import sys
import time
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.traffic.formats import read

MOTOR = Path(__file__).parents[2] / "docs" / "motor.eds"

LOG = """\
(10.000000) can0 182#
(10.500000) can0 702#05
(11.000000) can0 123#01
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    file = tmp_path / "bus.log"
    file.write_text(LOG)
    return file


def test_a_log_as_lines_and_a_table(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--speed", "max"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].split() == ["10.000000", "Move", "Confirm"]
    assert [line.split()[0] for line in lines[3:]] == ["ID", "123", "182", "702"]
    assert "1 x unknown identifier" in err


def test_filter_and_sort(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--speed", "max", "--filter", "lift", "--sort", "age"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["10.000000", "10.500000", "ID", "702", "182"]


def test_monitor_records_the_watched_bus(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--speed", "max", "--filter", "none", "--log", str(tmp_path / "b.asc")]) == 0
    capsys.readouterr()
    with log.open("rb") as before, (tmp_path / "b.asc").open("rb") as after:
        assert [raw for *_, raw in read(after)] == [raw for *_, raw in read(before)]


def test_other_nodes_than_those_of_the_files_are_named_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "other.log"
    log.write_text("(1.0) can0 702#05\n(8.0) can0 705#05\n")
    absent = "node 5 is on this bus, nodes 1, 3 are not"
    assert cli.main(["monitor", str(log), "--speed", "max"]) == 0
    assert capsys.readouterr().err.startswith(f"eurobot-od: {absent}\n")


def test_damage_is_named_by_its_log_and_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = [tmp_path / name for name in ("a.log", "b.log")]
    logs[0].write_text("(1.0) can0 080#\n")
    logs[1].write_text("(2.0) can0 080#\n(2.1) can0 nothing\n")
    assert cli.main(["monitor", *map(str, logs), "--speed", "max"]) == 0
    assert f"first at {logs[1]}:2: " in capsys.readouterr().err


def test_statistics_at_the_end(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--speed", "max", "--statistics"]) == 0
    *_, load = capsys.readouterr().out.splitlines()
    assert load.startswith("load of 500 kbit/s: ? 0.01%, lift 0.02%")


def test_keys_that_ask_a_node_need_a_bus(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--ask"]) == 2
    assert capsys.readouterr().err == f"eurobot-od: --ask is for a bus: leave it out, or {log}\n"


@pytest.mark.parametrize("speed", ["0", "-1", "fast"])
def test_no_speed(speed: str) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["monitor", "--speed", speed])
    assert ended.value.code == cli.ExitStatus.WRONG_INPUT


# On a terminal


@pytest.mark.posix
def test_keys_on_a_terminal(log: Path) -> None:
    import pty

    child, terminal = pty.fork()
    if child == 0:
        arguments = ["-m", "eurobot_od", "monitor", str(log), "--speed", "0.01"]
        os.execve(sys.executable, [sys.executable, *arguments], os.environ | {"TERM": "xterm", "COLUMNS": "120"})
    seen = _until(terminal, b"sort: identifier")
    for keys, expected in ((b"s", b"sort: name"), (b"/move\r", b"filter: move"), (b"p", b"PAUSED")):
        os.write(terminal, keys)
        seen = _until(terminal, expected)
    os.write(terminal, b"q")
    seen = _until(terminal, b"Move Confirm")
    assert b"\x1b[?1049l" in seen
    assert os.waitpid(child, 0)[1] == 0
    os.close(terminal)


@pytest.mark.posix
def test_a_dumb_terminal_gets_plain_lines(log: Path) -> None:
    import pty

    child, terminal = pty.fork()
    if child == 0:
        arguments = ["-m", "eurobot_od", "monitor", str(log), "--speed", "max"]
        os.execve(sys.executable, [sys.executable, *arguments], os.environ | {"TERM": "dumb"})
    seen = _until(terminal, b"1 x unknown identifier")
    assert b"\x1b" not in seen
    assert os.waitpid(child, 0)[1] == 0
    os.close(terminal)


@pytest.mark.posix
def test_a_device_that_is_exchanged_is_named_after_the_table(tmp_path: Path) -> None:
    import pty

    log = tmp_path / "exchanged.log"
    product = "(1.{0}) can0 605#4018100200000000\n(1.{0}1) can0 585#43181002{1:02d}000000\n"
    log.write_text(product.format(1, 5) + product.format(2, 7))
    child, terminal = pty.fork()
    if child == 0:
        arguments = ["-m", "eurobot_od", "--robot", "none", "monitor", str(log), "--eds", f"5={MOTOR}"]
        os.execve(sys.executable, [sys.executable, *arguments], os.environ | {"TERM": "xterm", "COLUMNS": "120"})
    seen = _until(terminal, b"\x1b[?1049l")
    assert os.waitpid(child, 0)[1] == 0
    after = (seen + _rest(terminal)).rpartition(b"\x1b[?1049l")[2]
    assert b"motor.eds is for another device: node 5 has product code 0x7, not 0x5" in after
    os.close(terminal)


def _rest(terminal: int) -> bytes:
    seen = b""
    while select.select([terminal], [], [], 0.1)[0]:
        try:
            seen += os.read(terminal, 1 << 16)
        except OSError:  # the program has ended
            break
    return seen


def _until(terminal: int, expected: bytes) -> bytes:
    """Read from a terminal until something was shown."""
    seen = b""
    until = time.monotonic() + 10
    while expected not in seen and time.monotonic() < until:
        if select.select([terminal], [], [], 0.1)[0]:
            seen += os.read(terminal, 1 << 16)
    assert expected in seen
    return seen
