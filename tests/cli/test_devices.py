"""--eds, --network and the network file of a folder: every command that decodes or talks takes any device."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions
from eurobot_od.frame import Frame
from tests.cli.console import run
from tests.client.peers import stock_lift
from tests.eds_text import DEVICE_TYPE, pdo, variable

SERVO = Path(__file__).parents[2] / "docs" / "servo.eds"
MOTOR = DEVICE_TYPE + variable("2000", "Speed", "INTEGER16") + pdo(0x1800, "0x20000010") + pdo(0x1804, "0x20000010")
PANEL = DEVICE_TYPE + variable("2000", "Wanted", "INTEGER16") + pdo(0x1400, "0x20000010", cob_id="0x185")


NETWORK = """nodes:
  motor: {file: motor.eds, node_id: 5}
  panel: {file: panel.eds, node_id: 1}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with two EDS files, a log and a suite."""
    (tmp_path / "motor.eds").write_text(MOTOR)
    (tmp_path / "panel.eds").write_text(PANEL)
    (tmp_path / "net.yaml").write_text(
        "nodes:\n  motor: {file: motor.eds, node_id: 5}\n  panel: {file: panel.eds, node_id: 1}\n"
    )
    (tmp_path / "run.log").write_text("(1.0) can0 185#FEFF\n")
    (tmp_path / "suite.yaml").write_text(
        "name: a motor\nspec: 1\nnode: motor\nsteps:\n  - expect: {motor.TPDO1: {speed: -2}}\n"
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


BOTH = ["--eds", "5=motor.eds", "--eds", "1=panel.eds"]
WAYS = [BOTH, ["--network", "net.yaml"], ["--network", "net.yaml", "--eds", "7=motor.eds"]]

# A command, and what it prints of the motor's message.
COMMANDS = [
    (["show"], "0x185   motor.TPDO1                    motor              panel                  2  speed 16"),
    (["show", "motor.TPDO1"], "-32768..32767"),
    (["decode", "run.log"], "speed=-2"),
    (["decode", "--where", "motor.TPDO1.speed<0", "run.log"], "speed=-2"),
    (["decode", "--node", "panel", "--json", "run.log"], '"fields": {"speed": -2}'),
    (["monitor", "--plain", "--speed", "max", "run.log"], "speed=-2"),
    (["send", "-i", "virtual", "motor.TPDO1", "speed=-2"], "185#FEFF"),
    (["check", "--list", "suite.yaml"], "a motor (motor; any dialect)"),
    (["export", "dbc"], "SG_ speed"),
]


@pytest.mark.parametrize(("words", "expected"), COMMANDS)
def test_commands_know_the_devices_that_are_named(
    capsys: pytest.CaptureFixture[str], words: list[str], expected: str
) -> None:
    said = run(capsys, *words, *BOTH)
    assert expected in said.out
    assert said.err.count("PDO left out: motor.eds: 0x1804: sub 1 is missing or has no number as its value\n") == 1


@pytest.mark.parametrize("words", WAYS[1:])
def test_a_network_file_names_them_as_well(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    assert "motor" in run(capsys, "show", *words).out


def test_two_devices_of_one_file_are_told_apart(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", "--eds", "5=motor.eds", "--eds", "6=motor.eds").out
    assert [line.split()[:2] for line in said.splitlines()[1:]] == [
        ["0x185", "motor_5.TPDO1"],
        ["0x186", "motor_6.TPDO1"],
    ]


def test_the_folder_s_network_file_is_the_default(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "net.yaml").rename(folder / "eurobot-od.yaml")
    assert "motor.TPDO1" in run(capsys, "show").out
    assert "motor.TPDO1" not in run(capsys, "show", "--dialect", "canopen").out
    assert "panel" not in run(capsys, "show", "--eds", "5=motor.eds").out


# What is wrong on a command line, and the line that says so.
WRONG = [
    (
        ["--eds", "motor.eds"],
        "motor.eds: the file names no node-ID; give one, as in 5=motor.eds, or in Python node_id=5",
    ),
    (["--eds", "128=motor.eds"], "motor.eds: node-ID 128 is not in 1..127"),
    (["--eds", "5=motor.eds", "--eds", "5=panel.eds"], "panel.eds: node-ID 5 is taken by motor.eds"),
    (["--eds", "5=gone.eds"], "gone.eds: No such file or directory; in this folder: motor.eds, panel.eds"),
    (["--network", "gone.yaml"], "gone.yaml: No such file or directory; in this folder: net.yaml, suite.yaml"),
    (
        ["--dialect", "canopen", "--network", "net.yaml"],
        "--dialect is a network of its own: leave out --eds and --network, or leave it out",
    ),
]


@pytest.mark.parametrize(("words", "line"), WRONG)
def test_an_error_is_one_line(capsys: pytest.CaptureFixture[str], words: list[str], line: str) -> None:
    assert run(capsys, "show", *words) == (ExitStatus.WRONG_INPUT, "", f"eurobot-od: {line}\n")


# Ways to lay a patch over a device's file, and the speed that it then has by default.
PATCHED = [
    (["--eds", "5=motor.eds", "--patch", "fast.yaml"], "300"),
    ([*BOTH, "--patch", "5=fast.yaml"], "300"),
    ([*BOTH, "--patch", "motor=fast.yaml"], "300"),
    ([*BOTH, "--patch", "motor=fast.yaml", "--patch", "5=own.dcf"], "7"),
    (["--network", "patched.yaml"], "300"),
    (["--network", "patched.yaml", "--patch", "motor=own.dcf"], "7"),
    (["--eds", "motor.eds", "--patch", "own.dcf"], "7"),  # it says which node that is
    (["--eds", "5=motor.eds", "--patch", "a=b.yaml"], "300"),
]


@pytest.mark.parametrize(("words", "speed"), PATCHED)
def test_a_patch_lies_over_a_devices_file(
    capsys: pytest.CaptureFixture[str], folder: Path, words: list[str], speed: str
) -> None:
    for name in ("fast.yaml", "a=b.yaml"):
        (folder / name).write_text("Speed: {DefaultValue: 300}\n")
    configured = MOTOR.replace("PDOMapping=1\n", "PDOMapping=1\nParameterValue=7\n", 1)
    (folder / "own.dcf").write_text(f"{configured}[DeviceComissioning]\nNodeID=5\n")
    (folder / "patched.yaml").write_text(NETWORK.replace("node_id: 5", "node_id: 5, patch: fast.yaml"))
    said = run(capsys, "show", "--objects", "Speed", *words).out
    assert [line.split()[-1] for line in said.splitlines() if "Speed" in line] == [speed]


def test_a_patch_is_for_one_device_and_a_wrong_line_of_it_is_named(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "my.yaml").write_text("0x2000:\n  DefaultValue: 99999\n")
    question = "eurobot-od: --patch my.yaml: say of which device: 5=, 1=\n"
    assert run(capsys, "show", *BOTH, "--patch", "my.yaml") == (ExitStatus.WRONG_INPUT, "", question)
    wrong = "eurobot-od: my.yaml:2: DefaultValue '99999': expected INTEGER16, -32768..32767\n"
    assert run(capsys, "show", *BOTH, "--patch", "5=my.yaml") == (ExitStatus.WRONG_INPUT, "", wrong)


def test_parts_left_out_of_a_file_are_one_line(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    flawed = "[2100]\nParameterName=Flawed\nDataType=5\n\n[2200sub1]\nParameterName=Lost\nDataType=5\n"
    (folder / "motor.eds").write_text(f"{MOTOR}see the manual\n{flawed}")
    said = run(capsys, "show", *BOTH)
    line = MOTOR.count("\n") + 1
    assert said.status == ExitStatus.FOUND
    checked = run(capsys, "check", "--simulate", "--conformance", "--step", "device type", *BOTH)
    assert (checked.status, "fail" in checked.out) == (ExitStatus.FOUND, False)
    assert [each for each in said.err.splitlines() if "motor.eds" in each][:2] == [
        "eurobot-od: motor.eds: repaired to be read: line 1: lists of objects added, and 4 more "
        "(`lint --fix` lists them)",
        f"eurobot-od: motor.eds: 2 objects left out: line {line + 1}: 0x2100: sub 0 has no AccessType, and 1 more "
        "(`lint` lists them)",
    ]


COUPLER = Path(__file__).parents[1] / "od" / "samples" / "coupler.eds"
MODULES = [
    ["--eds", f"5={COUPLER}", "--module", "1,1"],
    ["--eds", f"5={COUPLER}", "--module", "DI8", "--module", "5=1"],
    ["--eds", f"5={COUPLER}", "--eds", "6=motor.eds", "--module", "coupler=1,1"],
    ["--network", "modules.yaml"],
]


@pytest.mark.parametrize("words", MODULES)
def test_modules_are_plugged_in_by_the_command_line_or_the_network_file(
    capsys: pytest.CaptureFixture[str], folder: Path, words: list[str]
) -> None:
    nodes = f"nodes: {{coupler: {{file: {COUPLER}, node_id: 5, modules: [1, DI8]}}}}\n"
    (folder / "modules.yaml").write_text(nodes)
    said = run(capsys, "show", *words)
    assert said.status == ExitStatus.FINE
    assert "inputs_1 8, inputs_2 8" in said.out
    assert "coupler.eds" not in said.err


def test_modules_without_a_device_are_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", *BOTH, "--module", "1")
    assert (said.status, said.complaint) == (
        ExitStatus.WRONG_INPUT,
        "eurobot-od: --module 1: say into which device: 5=, 1=",
    )


def test_a_coupler_without_modules_says_how_to_plug_them_in(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "show", "--eds", f"5={COUPLER}")
    assert "none of its modules is connected; --module takes 1 (8 inputs), 2 (4 inputs)," in said.err


def test_a_guess_is_listed_before_other_repairs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "compact.eds"
    file.write_text(
        "[1000]\nParameterName=Type\nDataType=7\nAccessType=ro\nDefaultValue=zero\n"
        "[2200]\nParameterName=Compact\nObjectType=8\nCompactSubObj=3\nAccessType=rw\nDefaultValue=1\n"
    )
    said = run(capsys, "show", "--eds", f"5={file}", "--objects").err
    assert "repaired to be read: line 6: [2200sub1]: no DataType, read as DOMAIN, and " in said


def test_devices_without_files_are_asked_for_their_pdos() -> None:
    with stock_lift(SERVO) as (channel, _):
        decoder = Devices(robot_name="none").asking_decoder(BusOptions(interface="virtual", channel=channel))
    meaning = decoder(Frame(0x182, bytes.fromhex("3702E8030000")))
    assert (meaning.name, meaning.text[:14]) == ("node 2.TPDO1", "statusword=567")
    assert meaning.text.endswith("velocity_actual_value=1000")
