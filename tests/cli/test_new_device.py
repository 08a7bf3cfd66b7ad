"""`new-device --package`: what it writes works at once, and what a package brings is used by every command."""

from __future__ import annotations

import os
import subprocess
import sys
from math import inf
from pathlib import Path

import pytest

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.loading import DEVICES
from eurobot_od.od.dictionary import Dictionary
from tests.cli.console import run
from tests.client.flash import IDENTITY, KeyedFlashDevice, eds
from tests.client.wired import WiredBus

SERVO = Path(__file__).parents[2] / "docs" / "servo.eds"
DOWNLOAD = """
from zlib import crc32

from eurobot_od.client.program import DownloadProcedure
from eurobot_od.plugin import Plugin


def program():
    ready, key = (0x1F57, 1), ((0x1F51, 1), b"\\x80")
    return DownloadProcedure([key], 1024, ready, crc=lambda content: crc32(content) ^ 0xFFFF_FFFF)


DEVICE = Plugin(name="flash", identity=(7,), program=program)
"""
LOG = """(0.0) can0 705#00
(0.5) can0 085#01FF010000000000
(1.0) can0 6E5#0C00000001
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("devices") / "gripper"
    made = subprocess.run(
        [sys.executable, "-m", "eurobot_od", "new-device", str(folder), "--package", "--eds", str(SERVO)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "pip install -e ." in made.stdout
    return folder


@pytest.fixture
def named(package: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setenv(DEVICES.variable, str(package / "gripper"))
    return ["--eds", f"5={SERVO}"]


def test_a_new_device_passes_all_that_its_readme_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "thermometer"
    assert run(capsys, "new-device", str(folder)).status == 0
    table, file, suite = (str(folder / f"thermometer.{each}") for each in ("yaml", "eds", "check.yaml"))
    assert run(capsys, "make-eds", table, "-o", str(folder), "--check").status == 0
    assert run(capsys, "lint", file, "--for", "canopennode", "--strict").status == 0
    for words in ([suite], ["--conformance"]):
        assert run(capsys, "check", *words, "--simulate", "--network", str(folder / "eurobot-od.yaml")).status == 0
    assert run(capsys, "export", "canopennode", file, "-o", str(folder / "firmware")).status == 0
    assert "new-device" not in (folder / "README.md").read_text()
    names = {each.name for each in folder.rglob("*") if each.is_file()}
    assert names >= {"README.md", "check.yml", "eurobot-od.yaml", "OD.h", "OD.c"}


def test_a_new_device_passes_its_own_test(package: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), *sys.path])}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"],
        cwd=package,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    assert "6 passed" in done.stdout


def test_a_log_is_decoded_with_the_maker_s_words_and_frames(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, named: list[str]
) -> None:
    log = tmp_path / "run.log"
    log.write_text(LOG)
    out = run(capsys, "decode", str(log), *named).out
    assert "0xFF01 gearbox jammed" in out
    assert "Beacon" in out
    assert "uptime=12 s, restarts=1" in out
    assert "servo: has restarted 1 times" in run(capsys, "diagnose", str(log), *named).out


@pytest.mark.usefixtures("named")
def test_another_device_has_nothing_of_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    log.write_text(LOG)
    out = run(capsys, "decode", str(log), "--eds", f"5={SERVO.with_name('motor.eds')}").out
    assert "gearbox" not in out
    assert "Beacon" not in out


def test_its_command_and_its_step_are_there(
    capsys: pytest.CaptureFixture[str], package: Path, named: list[str]
) -> None:
    assert run(capsys, "gripper-hello", "--times", "2").out == "gripper says hello\n" * 2
    suite = package / "own.check.yaml"
    assert run(capsys, "check", str(suite), "--simulate", *named).status == 0
    suite_text = suite.read_text()
    cold = suite.with_name("cold.check.yaml")
    cold.write_text(suite_text.replace("below: 100000", "below: -100000"))
    done = run(capsys, "check", str(cold), "--simulate", *named)
    assert (done.status, "too warm" in done.out) == (1, True)
    cold.write_text(suite_text.replace("below: 100000", "above: 1"))
    assert "cold.check.yaml:4:" in run(capsys, "check", str(cold), "--simulate", *named).err


class OwnAddressing:
    """A device without LSS: it boots once its serial number and a node-ID come under 0x7F0."""

    def __init__(self) -> None:
        self.device: SimulatedDevice | None = None

    @property
    def next_wakeup(self) -> float:
        return self.device.next_wakeup if self.device else inf

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == 0x7F0 and frame.data[:4] == (1).to_bytes(4, "little"):
            self.device = SimulatedDevice(Dictionary.load(SERVO, frame.data[4]))
            return self.device.start(now)
        return self.device.receive(frame, now) if self.device else []

    def tick(self, now: float) -> list[Frame]:
        return self.device.tick(now) if self.device else []


@pytest.mark.usefixtures("named")
@pytest.mark.parametrize(
    ("serial", "status", "said"),
    [
        (1, 0, "0x00000000:0x0005E401:0x00010002:0x00000001  node-ID 7, by its maker's procedure"),
        (2, 1, "no answer from node 7"),
    ],
)
def test_addressing_by_a_package_ends_with_a_device_that_answers(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, serial: int, status: int, said: str
) -> None:
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(OwnAddressing()))
    done = run(capsys, "lss", "set", "--identity", f"0:0x5E401:0x10002:{serial}", "--node-id", "7")
    assert said in done.out + done.err
    assert done.status == status


def test_a_program_goes_by_the_package_of_the_device(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "device.py").write_text(DOWNLOAD)
    (tmp_path / "flash.eds").write_text(eds() + IDENTITY.decode())
    (tmp_path / "firmware.bin").write_bytes(bytes(2500))
    device = KeyedFlashDevice()
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(device))
    words = "program", "9", str(tmp_path / "firmware.bin"), "--eds", f"9={tmp_path / 'flash.eds'}"
    assert "refused" in run(capsys, *words).err
    done = run(capsys, *words, "--package", str(tmp_path))
    assert done.out == "node 9: program 1: 2500 bytes written, verified by the maker's CRC, started\n"
    assert (device.parts, device.program) == ([1024, 1024, 452], bytes(2500))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("DEVICE = 1 / 0\n", "device.py:1: ZeroDivisionError"),
        ("DEVICE = 5\n", "no `DEVICE` in it that is an eurobot_od.plugin.Plugin"),
        ("import nothing_such\n", "device.py:1: ModuleNotFoundError"),
        ("def (\n", "device.py:1: SyntaxError"),
    ],
)
def test_a_broken_package_is_one_warning_with_its_place(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, said: str
) -> None:
    (tmp_path / "device.py").write_text(text)
    log = tmp_path / "run.log"
    log.write_text(LOG[: LOG.index("(1.0)")])
    done = run(capsys, "decode", str(log), "--eds", f"5={SERVO}", "--package", str(tmp_path))
    assert (done.status, done.err.count("\n")) == (0, 1)
    assert said in done.err
    assert "0xFF01" in done.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["x", "--package"], "a device package needs the device's EDS: write new-device NAME --package --eds FILE"),
        (["class", "--package", "--eds", str(SERVO)], "class: its name begins with a letter"),
        (["x", "--package", "--eds", "none.eds"], "none.eds"),
    ],
)
def test_a_wrong_call_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(capsys, "new-device", *words)
    assert (done.status != 0, done.err.count("\n")) == (True, 1)
    assert said in done.err
    assert list(tmp_path.iterdir()) == []
