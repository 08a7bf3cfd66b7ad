"""`send`: what goes out, what comes back, and that a wrong command line sends nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.cli.send import exchange
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import Drive
from tests.cli.console import Said, run
from tests.rows import rows

CHANNEL = "test-send"
GOTO = ["Goto XY", "x=1234", "y=567", "angle=89", "speed=75"]
DIAMETERS = ["enemy_1_diameter=45", "enemy_2_diameter=33"]


@contextmanager
def hearing(bus: can.BusABC, heard: Callable[[can.Message], None]) -> Iterator[None]:
    """Have a function called with what comes on a bus; python-can's notifier is not a context manager before 4.6."""
    notifier = can.Notifier(bus, [heard])
    try:
        yield
    finally:
        notifier.stop()


@pytest.fixture
def wire() -> Iterator[can.BusABC]:
    """Another participant on the bus that the commands of this file use."""
    with can.Bus(CHANNEL, interface="virtual") as bus:
        yield bus


def send(capsys: pytest.CaptureFixture[str], *words: str) -> Said:
    return run(capsys, "send", *words, "-i", "virtual", "-c", CHANNEL)


def heard(wire: can.BusABC) -> str | None:
    """Return the next frame on the bus as candump writes it, None if there is none."""
    message = wire.recv(0)
    return None if message is None else f"{message.arbitration_id:03X}#{message.data.hex().upper()}"


# What goes out


@rows(
    "words, frame, said",
    [
        (["Stop Drive"], "004#", "Stop Drive"),
        (["stop-drive"], "004#", "Stop Drive"),
        (["Emergency Stop", "obstacle=enemy"], "002#01", "Emergency Stop  obstacle=enemy"),
        (["Emergency Stop", "obstacle=1"], "002#01", "Emergency Stop  obstacle=enemy"),
        (
            [*GOTO, "barriers=0xA5C3"],
            "008#D27423592C01C3A5",
            "Goto XY  x=1234 mm, y=567 mm, angle=89 deg, speed=75 %, barriers=fire 1:forced, fire 4:forced, "
            "fire 5:normal, fire 6:normal, pool 1:forced, pool 2:forced",
        ),
        (
            [*GOTO, "barriers=fire-1:forced"],
            "008#D27423592C010200",
            "Goto XY  x=1234 mm, y=567 mm, angle=89 deg, speed=75 %, barriers=fire 1:forced",
        ),
        (
            ["Start Configuration Set", "team_colour=red", "enemies=2", "confederates=1", *DIAMETERS],
            "2C0#DD86",
            "Start Configuration Set  team_colour=red, enemies=2, confederates=1, enemy_1_diameter=45 cm, "
            "enemy_2_diameter=33 cm",
        ),
        (
            ["Navi Position Response", "x=unknown", "y=unknown", "angle=unknown", "source=internal"],
            "080#FFF00FFF03",
            "Navi Position Response  x=unknown, y=unknown, angle=unknown, source=internal",
        ),
        (["Goto State Response", "time=blocked"], "014#FEFFFF", "Goto State Response  time=blocked"),
    ],
)
def test_a_message_is_sent_and_shown(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, words: list[str], frame: str, said: str
) -> None:
    assert send(capsys, *words) == (0, f"sent      {frame}  {said}\n", "")
    assert heard(wire) == frame
    assert heard(wire) is None


def test_a_dialect_gives_the_bits(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    send(capsys, *GOTO, "direction=backward", "--dialect", "firmware2014")
    assert heard(wire) == "008#4D22371652C00030"


# What comes back


@pytest.fixture
def drive(wire: can.BusABC) -> Iterator[can.BusABC]:
    """A drive that runs on the bus; its boot-up has been heard."""
    bus = open_bus("virtual", CHANNEL)
    with Live.node(bus, Drive(dialects.load("drive"))):
        assert wire.recv(5.0) is not None
        yield wire


@pytest.mark.usefixtures("drive")
def test_an_expected_answer_is_shown_with_the_time_it_took(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Check Drive Request", "--expect", "Check Drive Response", "--within", "10")
    sent, received = said.out.splitlines()
    assert said.status == 0
    assert sent == "sent      3C0#  Check Drive Request"
    assert received.startswith("received  400#  Check Drive Response  after ")
    assert received.endswith(" ms")


@pytest.mark.usefixtures("drive")
def test_an_answer_is_shown_with_its_values(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Goto State Request", "--expect", "goto state response", "--within", "10s")
    assert said.out.splitlines()[1].startswith("received  014#FFFF0F  Goto State Response  time=unknown  after ")


@pytest.mark.usefixtures("drive")
def test_another_message_is_no_answer(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Check Drive Request", "--expect", "Check Navi Response", "--within", "100 ms")
    assert said.status == 1
    assert said.out.splitlines()[1] == "expected  Check Navi Response: nothing came within 100 ms"


def test_an_answer_that_is_too_short_is_one_line(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    short = can.Message(arbitration_id=0x014, data=b"\x01", is_extended_id=False)
    with hearing(wire, lambda _: wire.send(short)):
        said = send(capsys, "Goto State Request", "--expect", "Goto State Response", "--within", "10 s")
    assert said.status == 1
    assert said.err == "eurobot-od: Goto State Response (0x014): 1 bytes of data, expected 3\n"


def test_on_an_empty_bus_nothing_comes(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    said = send(capsys, "Check Drive Request", "--expect", "Check Drive Response", "--within", "0.05s")
    assert said.status == 1
    assert said.out.splitlines()[1] == "expected  Check Drive Response: nothing came within 50 ms"
    assert heard(wire) == "3C0#"


def test_an_exchange_gives_the_answer_and_the_time_it_took(wire: can.BusABC) -> None:
    answer = can.Message(arbitration_id=0x400, data=b"\x05", is_extended_id=False)
    with hearing(wire, lambda _: wire.send(answer)):
        found = exchange(open_bus("virtual", CHANNEL), Frame(0x3C0, b""), Frame(0x400), 10.0)
    assert found is not None
    frame, took = found
    assert frame == Frame(0x400, b"\x05")
    assert took > 0


def test_a_bus_that_fails_while_the_answer_is_awaited_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: float) -> None:
        raise OSError("the adapter is gone")

    bus = open_bus("virtual", CHANNEL)
    monkeypatch.setattr(bus, "recv", fail)
    with pytest.raises(BusError, match="the adapter is gone"):
        exchange(bus, Frame(0x3C0, b""), Frame(0x400), 10.0)


# Frames in candump's notation


@rows(
    "text, frame, words",
    [
        ("185#0102", "185#0102", ""),
        ("185#", "185#", ""),
        (
            "2c0#dd.86",
            "2C0#DD86",
            "  Start Configuration Set  team_colour=red, enemies=2, confederates=1, "
            "enemy_1_diameter=45 cm, enemy_2_diameter=33 cm",
        ),
        ("008#01", "008#01", ""),  # too short for a Goto XY: sent as it is
    ],
)
def test_a_frame_is_sent_as_it_is(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, text: str, frame: str, words: str
) -> None:
    assert send(capsys, text) == (0, f"sent      {frame}{words}\n", "")
    assert heard(wire) == frame


@rows(
    "expect, status",
    [
        ("185#", 0),  # any data
        ("185#01", 0),  # data that begin so
        ("185#0102", 0),
        ("185#02", 1),
        ("186#", 1),
    ],
)
def test_a_frame_is_waited_for(capsys: pytest.CaptureFixture[str], wire: can.BusABC, expect: str, status: int) -> None:
    answer = can.Message(arbitration_id=0x185, data=b"\1\2", is_extended_id=False)
    within = "20 ms" if status else "10 s"
    with hearing(wire, lambda message: wire.send(answer) if message.arbitration_id == 0x123 else None):
        said = send(capsys, "123#", "--expect", expect, "--within", within)
    assert said.status == status
    told = said.out.splitlines()[1]
    assert told.startswith("received  185#0102  after ") if not status else told.startswith(f"expected  {expect}: ")


# What is wrong

WRONG = [
    (["185#1"], "'185#1' is not a frame: write an 11-bit identifier, # and up to 8 bytes: 185#0102"),
    (["185#01", "x=1"], "the frame 185#01 has no fields: x=1"),
    (["Stop Drive", "--expect", "1855#"], "'1855#' is not a frame"),
    (["Gotto"], "unknown message 'Gotto'; known: Emergency Shutdown, "),
    (["Goto Confrm"], "unknown message 'Goto Confrm'; did you mean Goto Confirm?"),
    ([*GOTO, "z=1"], "unknown field of Goto XY 'z'; known: x, y, angle, speed, barriers, direction, route"),
    (["Stop Drive", "x=1"], "unknown field of Stop Drive 'x'"),
    (GOTO[:2], "Goto XY: y, angle, speed missing"),
    ([*GOTO, "x=1"], "Goto XY: x given twice"),
    (["Goto XY", "x=3001", *GOTO[2:]], "Goto XY: x = 3001 is not allowed; allowed: 0..3000 mm"),
    (["Goto XY", "x=-1", *GOTO[2:]], "Goto XY: x = -1 is not allowed; allowed: 0..3000 mm"),
    (["Goto XY", "x=12.5", *GOTO[2:]], "Goto XY: x = '12.5' is not allowed; allowed: 0..3000 mm"),
    (["Goto XY", "x", *GOTO[2:]], "Goto XY: x = 'x' is not allowed; allowed: 0..3000 mm"),
    (["Goto XY", "x=", *GOTO[2:]], "Goto XY: x = '' is not allowed; allowed: 0..3000 mm"),
    ([*GOTO[:4], "speed=101"], "Goto XY: speed = 101 is not allowed; allowed: 0..100 %"),
    ([*GOTO, "barriers=fire-9"], "unknown barrier 'fire-9'; known: fire 1, "),
    ([*GOTO, "barriers=fire-1:maybe"], "Goto XY: barriers = 'fire-1:maybe' is not allowed; allowed: 0..65535, or "),
    ([*GOTO, "direction=backward"], "Goto XY: direction = backward is not allowed; allowed: forward, as the loaded"),
    (["Emergency Stop", "obstacle=wall"], "Emergency Stop: obstacle = 'wall' is not allowed; allowed: object (0), "),
    (["Stop Drive", "--expect", "Nothing"], "unknown message 'Nothing'; known: Emergency Shutdown, "),
    (["Stop Drive", "--dialect", "nonsense"], "unknown dialect 'nonsense'; known: canopen, firmware2014"),
]


@rows("words, complaint", WRONG)
def test_a_wrong_command_line_is_one_line_and_sends_nothing(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, words: list[str], complaint: str
) -> None:
    said = send(capsys, *words)
    assert (said.status, said.out) == (2, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1
    assert heard(wire) is None


@rows(
    "words, complaint",
    [
        (["-i", "nosuch"], "cannot open the nosuch bus: unknown interface 'nosuch'; known: "),
        (["-i", "nosuch", "-c", "can7"], "cannot open the nosuch bus can7: unknown interface 'nosuch'; "),
        (["-i", "socketcan", "-c", "nosuch0"], "cannot open the socketcan bus nosuch0: "),
        (["-i", "remote", "-c", "ws://127.0.0.1:9/"], "cannot open the remote bus ws://127.0.0.1:9/: "),
    ],
)
def test_a_bus_that_does_not_exist_is_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    said = run(capsys, "send", "Stop Drive", *words)
    assert (said.status, said.out) == (3, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1
