"""`node` with devices that have no node-ID, and `lss` that finds them and gives them one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import run
from tests.cli.processes import line, node
from tests.processes import free_port

MOTOR = Path(__file__).parents[2] / "docs" / "motor.eds"


@pytest.mark.posix
def test_a_device_without_a_node_id_is_given_one_which_it_has_at_its_next_start(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    port, store = str(free_port()), str(tmp_path / "motor.dcf")
    bus = ["-i", "remote", "-c", f"ws://127.0.0.1:{port}"]
    own = ["--eds", f"255={MOTOR}", "--serial", "1234", "--store", store, "--share", port]
    with node(*own) as device:
        line(device, "motor (no node-ID) on ")
        given = run(capsys, "lss", "set", "--node-id", "5", "--store", *bus)
        assert given.out == "0x00000000:0x00000005:0x00010000:0x000004D2  node-ID 5, stored\n"
        assert run(capsys, "read", "5", "0x1018:4", *bus).out.endswith("0x4D2\n")
    with node(*own) as device:
        line(device, "motor (node-ID 5) on ")


@pytest.mark.posix
def test_serial_numbers_count_up(capsys: pytest.CaptureFixture[str]) -> None:
    port = str(free_port())
    eds = ["--eds", f"255={MOTOR}", "--eds", f"255={MOTOR}", "--eds", f"7={MOTOR}"]
    with node(*eds, "--serial", "10", "--share", port) as devices:
        line(devices, "3 devices on")
        found = run(capsys, "lss", "find", "-i", "remote", "-c", f"ws://127.0.0.1:{port}", "--timeout", "20 ms")
    kind = "0x00000000:0x00000005:0x00010000"
    assert found.out == f"{kind}:0x0000000B  no node-ID\n{kind}:0x0000000C  no node-ID\n"


def test_only_a_simulated_device_is_without_a_node_id(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    log.write_text("(0.0) can0 705#00\n", encoding="utf-8")
    said = run(capsys, "decode", str(log), "--eds", f"255={MOTOR}")
    assert (said.status, said.err) == (2, f"eurobot-od: {MOTOR}: node-ID 255 is not in 1..127\n")
