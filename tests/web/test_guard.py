"""What may move something, by frame and by object, and why; and that no way of the page sends it unasked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.web.guard import MotionGuard
from tests.client.servo import EDS, SERVO
from tests.web.test_drives import bench

MOTOR = Dictionary.load(Path(__file__).parents[2] / "docs" / "motor.eds", 6, "motor")
IO = Dictionary.load(Path(__file__).parents[2] / "docs" / "io.eds", 7, "io")
GUARD = MotionGuard([SERVO, MOTOR, IO])


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        ("605#2B4060000F000000", "0x6040:0 of servo commands a drive"),
        ("605#23FF6000E8030000", "0x60FF:0 of servo commands a drive"),
        ("605#2BFF680000000000", "0x68FF:0 of servo commands a drive"),  # the second axis
        ("605#C140600002000000", "0x6040:0 of servo commands a drive"),  # by blocks
        ("605#0D01020304050607", "it goes on with a write to servo"),  # a segment names no object
        ("609#2B4060000F000000", "0x6040:0 of node 9 commands a drive"),  # no file
        ("605#2F00200001000000", "0x2000:0 of servo is an object of the drive's maker"),
        ("605#2300140105020000", "0x1400:1 of servo has the drive obey other frames"),
        ("205#0F00", "it carries 0x6040:0 to servo"),
        ("305#1F0000000000", "it carries 0x6040:0 to servo"),
        ("209#00", "no file says what a node does with 209"),
        ("000#0105", "NMT start lets servo obey PDOs"),
        ("000#0100", "NMT start lets all nodes obey PDOs"),
        ("000#8105", "a reset of servo ends"),
        ("000#8209", "a reset of the communication of node 9"),
        ("000#010500", "NMT start lets servo obey PDOs"),  # some nodes take a command that is too long
        ("605#2B4060000F00", "0x6040:0 of servo commands a drive"),  # and some servers what is too short
        ("609#2F00200001000000", "0x2000:0 of node 9 is an object of a maker"),
        ("609#2300140105020000", "0x1400:1 of node 9 has it obey other frames"),
        ("609#2F00620101000000", "0x6200:1 of node 9 sets an output"),
        ("607#2F00620101000000", "0x6200:1 of io sets an output"),
        ("607#2B116401E8030000", "0x6411:1 of io sets an output"),
        ("607#2F20620101000000", "0x6220:1 of io sets an output"),  # a single bit
        ("607#2F006A0101000000", "0x6A00:1 of io sets an output"),  # the second module
        ("207#01", "it carries 0x6200:1 to io, which sets an output"),
    ],
)
def test_frames_and_writes_that_may_move_something_are_recognised(frame: str, reason: str) -> None:
    assert GUARD.of_frame(Frame.parse(frame)).startswith(reason)


@pytest.mark.parametrize(
    "frame",
    [
        "605#4041600000000000",  # a read
        "605#2F17100064000000",  # the heartbeat's period
        "606#2F00200001000000",  # a maker's object of what is no drive
        "185#3700",  # the drive sends that itself
        "000#0205",  # NMT stop
        "000#8005",
        "000#01",  # no command
        "705#05",
        "607#2F06620101000000",  # what an output does on an error
        "607#2F00120101000000",
        "080#",  # no RPDO of these files is synchronous
    ],
)
def test_frames_and_writes_that_move_nothing_are_recognised(frame: str) -> None:
    assert GUARD.of_frame(Frame.parse(frame)) == ""


def test_sync_moves_a_drive_whose_targets_wait_for_it(tmp_path: Path) -> None:
    file = tmp_path / "synchronous.eds"
    text = EDS.read_text()
    head, tail = text.split("[1400sub2]", 1)
    file.write_text(f"{head}[1400sub2]{tail.replace('DefaultValue=255', 'DefaultValue=1', 1)}")
    assert MotionGuard([Dictionary.load(file, 5)]).of_frame(Frame(0x080)).startswith("SYNC has synchronous obey")


def test_a_makers_rpdo_counts_unless_a_robot_knows_what_its_messages_move() -> None:
    cob_ids = [pdo.cob_id for pdo in MOTOR.pdos if pdo.valid and pdo.direction.name == "RPDO"]
    assert cob_ids
    assert all("of the maker of motor" in GUARD.of_cob_id(each) for each in cob_ids)
    assert not any(MotionGuard([MOTOR], makers=False).of_cob_id(each) for each in cob_ids)


@pytest.mark.parametrize(
    "words",
    [
        {"do": "send frame", "frame": "605#2B4060000F000000"},
        {"do": "send frame", "frame": "000#0105"},
        {"do": "begin list", "key": "a", "title": "it", "rows": [{"send": "123#"}, {"send": "205#0F00"}]},
        {"do": "begin list", "key": "a", "title": "it", "rows": [{"send": "205#0F00", "trigger": "123"}]},
        {"do": "nmt", "command": "start", "node": "servo"},
        {"do": "nmt", "command": "reset", "node": "all"},
        {"do": "write", "node": "servo", "object": "0x60FF", "value": "100"},
        {"do": "write", "node": "servo", "object": "0x6040", "value": "15", "sure": "yes"},
    ],
)
def test_no_request_of_the_page_moves_something_without_confirmation(tmp_path: Path, words: dict[str, Any]) -> None:
    with bench(tmp_path) as scene:
        said = scene.ask(**words)
        assert said["error"] == f"not sent: {said['asks']}"
        assert scene.drive.device.objects.kept((0x60FF, 0)) == scene.drive.device.objects.kept((0x6040, 0)) == 0
        assert "error" not in scene.ask(**{**words, "sure": True})


@pytest.mark.parametrize("makers", [True, False])
def test_a_frame_to_a_node_without_a_file_may_move_something(makers: bool) -> None:
    assert MotionGuard([], makers).of_frame(Frame(0x205, b"\x0f\0")) == "no file says what a node does with 205"
