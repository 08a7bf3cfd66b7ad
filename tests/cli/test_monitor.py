"""The command monitor: logs at any speed, a bus, plain lines, and a terminal with keys."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Generator
from pathlib import Path

import can
import pytest

from eurobot_od import cli
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.logs.entries import Damage, Foreign
from eurobot_od.monitor.sources import BusSource, LogSource

LOG = """\
(10.000000) can0 00C#
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
    assert lines[0].split() == ["10.000000", "Goto", "Confirm"]
    assert [line.split()[0] for line in lines[3:]] == ["ID", "00C", "123", "702"]
    assert "1 x unknown identifier" in err


def test_filter_and_sort(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["monitor", str(log), "--speed", "max", "--filter", "drive", "--sort", "age"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["10.000000", "10.500000", "ID", "702", "00C"]


@pytest.mark.parametrize("speed", ["0", "-1", "fast"])
def test_no_speed(speed: str) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(["monitor", "--speed", speed])


# Sources


def entries() -> Generator[tuple[float, Frame], None, None]:
    yield from ((float(time), Frame(time)) for time in range(100, 110))


@pytest.mark.parametrize(
    ("speed", "polls"),
    [
        (1.0, [(0.0, 1, 100.0), (1.5, 1, 101.5), (4.0, 3, 104.0), (100.0, 5, 109.0)]),
        (2.0, [(0.0, 1, 100.0), (2.0, 4, 104.0), (100.0, 5, 109.0)]),
        (float("inf"), [(0.0, 10, 109.0)]),
    ],
)
def test_a_log_is_played_at_its_speed(speed: float, polls: list[tuple[float, int, float]]) -> None:
    now = [50.0]
    source = LogSource(entries(), speed, lambda: now[0])
    for after, count, shown in polls:
        now[0] = 50.0 + after
        assert len(list(source.poll())) == count
        assert source.now == shown
    assert source.ended


def test_an_empty_log_ends_at_once() -> None:
    nothing: list[tuple[float, Frame]] = []
    source = LogSource((each for each in nothing), 1.0)
    assert list(source.poll()) == []
    assert source.ended


def received(source: BusSource, count: int) -> list[Frame | Foreign]:
    found: list[Frame | Foreign] = []
    until = time.monotonic() + 5
    while len(found) < count and time.monotonic() < until:
        found += [raw for _, raw in source.poll()]
    return found


def test_a_bus_is_read_whatever_is_on_it() -> None:
    with can.Bus(interface="virtual", channel="monitor") as sender:
        source = BusSource(can.Bus(interface="virtual", channel="monitor"))
        sender.send(can.Message(arbitration_id=0x00C, is_extended_id=False))
        sender.send(can.Message(arbitration_id=0x18FF0001, is_extended_id=True, data=b"\1"))
        assert received(source, 2) == [Frame(0x00C), Foreign(Damage.EXTENDED, "18FF0001#01")]
        source.close()


def test_a_bus_that_fails_ends_the_watching() -> None:
    class Broken(can.BusABC):
        def __init__(self) -> None:
            super().__init__("broken")
            self.channel_info = "broken"

        def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
            raise can.CanOperationError("pulled out")

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            raise NotImplementedError

    source = BusSource(Broken())
    with pytest.raises(BusError, match="the bus broken failed: pulled out"):
        received(source, 1)
    source.close()


# On a terminal


@pytest.mark.skipif(os.name == "nt", reason="needs a pseudo-terminal")
def test_keys_on_a_terminal(log: Path) -> None:
    import pty

    child, terminal = pty.fork()
    if child == 0:
        arguments = ["-m", "eurobot_od", "monitor", str(log), "--speed", "0.01"]
        os.execve(sys.executable, [sys.executable, *arguments], os.environ | {"TERM": "xterm", "COLUMNS": "120"})
    seen = _until(terminal, b"sort: identifier")
    for keys, expected in ((b"s", b"sort: name"), (b"/goto\r", b"filter: goto"), (b"p", b"PAUSED")):
        os.write(terminal, keys)
        seen = _until(terminal, expected)
    os.write(terminal, b"q")
    seen = _until(terminal, b"Goto Confirm")
    assert b"\x1b[?1049l" in seen
    assert os.waitpid(child, 0)[1] == 0
    os.close(terminal)


def _until(terminal: int, expected: bytes) -> bytes:
    """Read from a terminal until something was shown."""
    seen, until = b"", time.monotonic() + 10
    while expected not in seen and time.monotonic() < until:
        if select.select([terminal], [], [], 0.1)[0]:
            seen += os.read(terminal, 1 << 16)
    assert expected in seen
    return seen
