"""`program`, of the commands on parameters: one line at the end, good or bad; the others are in `test_objects`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import Said, run
from tests.client.flash import FlashDevice, Trouble
from tests.client.wired import WiredBus
from tests.kit import plant


def program(capsys: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch, device: FlashDevice, *words: str) -> Said:
    """Run the command on a bus with the device."""
    patch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(device))
    return run(capsys, "program", *words)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    found = tmp_path / "new.bin"
    found.write_bytes(b"new" * 100)
    return found


@pytest.mark.parametrize(
    ("trouble", "words", "said"),
    [
        (Trouble(busy_for=0.0), [], (0, "node 9: program 1: 300 bytes written, verified by CRC-32, started\n", "")),
        (
            Trouble(busy_for=0.0, identification=1),
            ["--no-crc"],
            (0, "node 9: program 1: 300 bytes written, not verified by a CRC, started\n", ""),
        ),
        (
            Trouble(busy_for=0.0, starts=False),
            [],
            (
                1,
                "",
                "eurobot-od: 0x1F51:1 Program control says: stopped; node 9: the program is written and does not run; "
                "`write 9 0x1F51:1 1` starts it, or download it again\n",
            ),
        ),
    ],
)
def test_a_download(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    file: Path,
    trouble: Trouble,
    words: list[str],
    said: tuple[int, str, str],
) -> None:
    assert program(capsys, monkeypatch, FlashDevice(trouble), "9", str(file), *words) == said


def test_an_empty_file_is_no_program(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    device = FlashDevice()
    empty = tmp_path / "empty.bin"
    empty.touch()
    assert program(capsys, monkeypatch, device, "9", str(empty)).status == 2
    assert device.commands == []


def test_the_device_of_another_eds_is_left_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, file: Path
) -> None:
    device = FlashDevice()
    lift = plant.FILES.folder() / "lift.eds"
    done = program(capsys, monkeypatch, device, "9", str(file), "--eds", str(lift))
    assert done.status == 1
    assert "lift.eds is for another device" in done.err
    assert device.commands == []
