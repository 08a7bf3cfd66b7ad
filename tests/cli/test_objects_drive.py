"""`drive`: what a drive is told to do from a command line, and `node` with a drive's options."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from math import inf

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.cli import objects as command
from eurobot_od.client.drive402 import KNOWN_METHODS
from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from tests.cli.console import Said, run
from tests.cli.processes import PATIENCE, line, node, serve_bus
from tests.cli.processes import command as process
from tests.client.peers import new_channel, open_bus
from tests.client.servo import EDS, SERVO


@pytest.fixture
def channel() -> Iterator[str]:
    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDrive(SERVO)):
        yield channel


def said(capsys: pytest.CaptureFixture[str], channel: str, *words: str) -> Said:
    return run(capsys, "drive", "5", *words, "-i", "virtual", "-c", channel)


def test_a_drive_is_enabled_homed_and_moved(capsys: pytest.CaptureFixture[str], channel: str) -> None:
    assert said(capsys, channel, "status").out.startswith("node 5: Switch on disabled, profile position, position 0")
    assert said(capsys, channel, "enable").out.startswith("node 5: Operation enabled")
    assert "homing, position 0" in said(capsys, channel, "home", "--method", "35").out
    moved = said(capsys, channel, "move", "2000", "--velocity", "500")
    assert (moved.status, moved.err) == (0, "")
    back = said(capsys, channel, "move", "-500", "--relative", "--eds", f"5={EDS}", "--json")
    assert json.loads(back.out)["position"] == pytest.approx(1500, abs=50)
    assert said(capsys, channel, "disable").out.startswith("node 5: Switch on disabled")


def test_a_jog_ends_with_a_halt(capsys: pytest.CaptureFixture[str], channel: str) -> None:
    out = said(capsys, channel, "jog", "100", "--for", "300 ms").out.splitlines()
    assert "Operation enabled, profile velocity" in out[0]
    assert json.loads(said(capsys, channel, "status", "--json").out)["velocity"] < 100


def test_a_fault_is_shown_and_reset(capsys: pytest.CaptureFixture[str]) -> None:
    channel = new_channel()
    with Live.node(open_bus(channel), DRIVE_FAULTS["encoder-lost"].given_to(SimulatedDrive)(SERVO)):
        moved = said(capsys, channel, "move", "9000")
        assert moved.status == 1
        assert moved.err == "eurobot-od: the drive of node 5: move: it has a fault, error code 0x7305\n"
        assert "error code 0x7305" in said(capsys, channel, "status").out
        assert said(capsys, channel, "reset").out.startswith("node 5: Switch on disabled")


class TakenAway(SimulatedDrive):
    """Is disabled by another program at 0.3 s."""

    taken = inf

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        if frame.cob_id == 0x605 and frame.data[:3] == bytes.fromhex("23FF60"):
            self.taken = now + 0.3
        return super().receive(frame, now)

    def tick(self, now: float) -> list[Frame]:
        if now > self.taken:
            self.receive(Frame(0x605, bytes.fromhex("2B40600000000000")), now)
            self.taken = inf
        return super().tick(now)


def test_a_jog_that_another_program_ends_is_red(capsys: pytest.CaptureFixture[str]) -> None:
    channel = new_channel()
    with Live.node(open_bus(channel), TakenAway(SERVO)):
        jog = said(capsys, channel, "jog", "100")
    assert jog.status == 1
    assert "turn: it is in Switch on disabled (statusword 0x0" in jog.err


def test_a_jog_that_leaves_the_drive_disabled_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDrive(SERVO, given={(0x6084, 0): 1})):
        jog = said(capsys, channel, "jog", "1000", "--for", "500 ms")
    assert jog.out.splitlines()[-1].startswith("node 5: Switch on disabled")
    assert "the halt has left the drive in Switch on disabled: it did not stand within 0.5 s" in jog.err


def test_drive_says_that_a_node_is_no_drive(capsys: pytest.CaptureFixture[str]) -> None:
    channel = new_channel()
    with Live.node(open_bus(channel), SimulatedDevice.load(EDS.with_name("motor.eds"), 5)):
        told = said(capsys, channel, "status")
        kept = run(capsys, "store", "5", "-i", "virtual", "-c", channel)
    assert (told.status, kept.status) == (1, 1)
    assert told.err.startswith("eurobot-od: node 5 is no drive of CiA 402: read 0x6041")
    assert "node 5 cannot store parameters: it has no 0x1010" in kept.err


def test_drive_says_which_axes_a_drive_has(capsys: pytest.CaptureFixture[str], channel: str) -> None:
    told = said(capsys, channel, "status", "--axis", "2")
    assert told.status == 1
    assert told.err.endswith("node 5 has no axis 2, only axis 1 answers: read 0x6841:0 is refused\n")


def test_a_motion_says_that_it_has_enabled_the_drive(capsys: pytest.CaptureFixture[str], channel: str) -> None:
    stays = "eurobot-od: node 5 was not enabled: `move` has enabled it, and it stays so; `drive 5 disable` ends that\n"
    assert [said(capsys, channel, "move", "10").err for _ in range(2)] == [stays, ""]


WRONG = [
    (["move"], "drive move needs a position"),
    (["jog"], "drive jog needs a velocity"),
    (["enable", "5"], "enable takes no value"),
    (["home", "--velocity", "5"], "--velocity is for `drive move`"),
    (["move", "5", "--method", "35"], "--method is for `drive home`"),
    (["move", "5", "--for", "1 s"], "--for is for `drive jog`"),
    (["home", "--method", "16"], f"16 is not a homing method of CiA 402; known: {KNOWN_METHODS}"),
    (["move", "99999999999"], "99999999999 does not fit 0x607A: -2147483648..2147483647"),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_options_that_exclude_each_other_are_refused(
    capsys: pytest.CaptureFixture[str], channel: str, words: list[str], complaint: str
) -> None:
    wrong = said(capsys, channel, *words)
    assert (wrong.status, wrong.err) == (2, f"eurobot-od: {complaint}\n")


def test_every_action_of_a_drive_is_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "drive", "--help").out
    assert [each for each in command.ACTIONS if each not in out] == []


# The device's side


@pytest.mark.long
@pytest.mark.live
def test_ctrl_c_stops_a_jog(capsys: pytest.CaptureFixture[str]) -> None:
    with serve_bus("test-drive") as shared:
        bus = ["-i", "remote", "-c", shared]
        with node("--eds", f"5={EDS}", "--travel=-50..50", *bus) as device:
            line(device, "servo (node-ID 5) on ")
            with process("drive", "5", "jog", "100", *bus) as jog:
                line(jog, "Operation enabled, profile velocity")
                jog.send_signal(signal.SIGINT)
                assert jog.wait(PATIENCE) == 130
            data = json.loads(run(capsys, "drive", "5", "status", "--json", *bus).out)
            while data["velocity"]:
                data = json.loads(run(capsys, "drive", "5", "status", "--json", *bus).out)
            assert data["state"] == "Operation enabled"


NODE_WRONG = [
    (["--travel", "5"], "argument --travel: '5': LOW..HIGH in turns"),
    (["--travel", "5..-5"], "argument --travel: '5..-5': LOW..HIGH in turns"),
    (["--travel", "nan..1"], "argument --travel: 'nan..1': LOW..HIGH in turns"),
    (["--travel", "0..1", "--profile", "none"], "--travel is for drives (CiA 402)"),
    (["--fault", "overcurrent", "--profile", "none"], "the fault overcurrent is one of drives of CiA 402"),
]


@pytest.mark.parametrize(("words", "complaint"), NODE_WRONG)
def test_an_action_that_the_device_lacks_is_refused(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    wrong = run(capsys, "node", "--eds", f"5={EDS}", "-i", "virtual", "-c", new_channel(), *words)
    assert wrong.status == 2
    assert complaint in wrong.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--axis", "0"), "0 is not an axis; allowed: 1..8"),
        (("--own-id", "128"), "128 is not a node-ID; allowed: 1..127"),
    ],
    ids=["axis", "own node-ID"],
)
def test_a_number_out_of_its_range_is_told_with_the_range(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    told = run(capsys, "drive", "5", "status", *words, "-i", "virtual")
    assert (told.status, said in told.err) == (2, True), told.err
