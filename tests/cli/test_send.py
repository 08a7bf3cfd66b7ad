"""`send`: what goes out, what comes back, and that a wrong command line sends nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.cli.send import exchange
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from tests.cli.console import Said, run
from tests.kit import plant

CHANNEL = "test-send"
MOVE = ["Move To", "x=1234", "y=567", "angle=89", "speed=75"]
WEIGHED = "Weight Response  weight=12.5 kg, temperature=21.5 degC"


@contextmanager
def hearing(bus: can.BusABC, heard: Callable[[can.Message], None]) -> Iterator[None]:
    """Call a function with each frame on a bus; python-can's notifier is not a context manager before 4.6."""
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


@pytest.mark.parametrize(
    ("words", "frame", "said"),
    [
        (["Halt Lift"], "381#", "Halt Lift"),
        (["halt-lift"], "381#", "Halt Lift"),
        (["Halt Cause", "cause=curtain"], "281#01", "Halt Cause  cause=curtain"),
        (["Halt Cause", "cause=1"], "281#01", "Halt Cause  cause=curtain"),
        (
            [*MOVE, "gates=0xA5C3"],
            "202#D27423592C01C3A5",
            "Move To  x=1234 mm, y=567 mm, angle=89 deg, speed=75 %, gates=gate-1:locked,gate-4:locked",
        ),
        (
            [*MOVE, "gates=gate-1:locked"],
            "202#D27423592C010200",
            "Move To  x=1234 mm, y=567 mm, angle=89 deg, speed=75 %, gates=gate-1:locked",
        ),
        (
            ["Order Set", "colour=blue", "boxes=12", "rows=2"],
            "481#1901",
            "Order Set  colour=blue, boxes=12, rows=2",
        ),
        (
            ["Place Response", "x=unknown", "y=unknown", "angle=unknown", "source=encoder"],
            "382#FFF00FFF03",
            "Place Response  x=unknown, y=unknown, angle=unknown, source=encoder",
        ),
        (["Weight Response", "weight=12.5", "temperature=21.5"], "183#E2040000AC41", WEIGHED),
        (["Move State Response", "time=blocked"], "282#FEFFFF", "Move State Response  time=blocked"),
    ],
)
def test_a_message_is_sent_and_shown(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, words: list[str], frame: str, said: str
) -> None:
    assert send(capsys, *words) == (0, f"sent      {frame}  {said}\n", "")
    assert heard(wire) == frame
    assert heard(wire) is None


def test_a_dialect_gives_the_bits(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    send(capsys, *MOVE, "direction=backward", "--dialect", "packed")
    assert heard(wire) == "202#4D22371652C00030"


# What comes back


@pytest.fixture
def lift(wire: can.BusABC) -> Iterator[can.BusABC]:
    """A lift that runs on the bus and has booted."""
    bus = open_bus("virtual", CHANNEL)
    with Live.node(bus, plant.NODES["lift"](plant.load("lift"))):
        assert wire.recv(5.0) is not None
        yield wire


@pytest.mark.usefixtures("lift")
def test_an_expected_answer_is_shown_with_the_time_it_took(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Check Lift Request", "--expect", "Check Lift Response", "--within", "10")
    sent, received = said.out.splitlines()
    assert said.status == 0
    assert sent == "sent      502#  Check Lift Request"
    assert received.startswith("received  482#  Check Lift Response  after ")
    assert received.endswith(" ms")


@pytest.mark.usefixtures("lift")
def test_an_answer_is_shown_with_its_values(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Move State Request", "--expect", "move state response", "--within", "10s")
    assert said.out.splitlines()[1].startswith("received  282#FDFFFF  Move State Response  time=unknown  after ")


@pytest.mark.usefixtures("lift")
def test_another_message_is_no_answer(capsys: pytest.CaptureFixture[str]) -> None:
    said = send(capsys, "Check Lift Request", "--expect", "Check Scale Response", "--within", "100 ms")
    assert said.status == 1
    assert said.out.splitlines()[1] == "expected  Check Scale Response: nothing came within 100 ms"


def test_an_answer_that_is_too_short_is_one_line(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    short = can.Message(arbitration_id=0x282, data=b"\x01", is_extended_id=False)
    with hearing(wire, lambda _: wire.send(short)):
        said = send(capsys, "Move State Request", "--expect", "Move State Response", "--within", "10 s")
    assert said.status == 1
    assert said.err == "eurobot-od: Move State Response (0x282): 1 bytes of data, expected 3\n"


def test_on_an_empty_bus_no_answer_comes(capsys: pytest.CaptureFixture[str], wire: can.BusABC) -> None:
    said = send(capsys, "Check Lift Request", "--expect", "Check Lift Response", "--within", "0.05s")
    assert said.status == 1
    assert said.out.splitlines()[1] == "expected  Check Lift Response: nothing came within 50 ms"
    assert heard(wire) == "502#"


def test_an_exchange_gives_the_answer_and_the_time_it_took(wire: can.BusABC) -> None:
    answer = can.Message(arbitration_id=0x482, data=b"\x05", is_extended_id=False)
    with hearing(wire, lambda _: wire.send(answer)):
        found = exchange(open_bus("virtual", CHANNEL), Frame(0x502, b""), Frame(0x482), 10.0)
    assert found is not None
    frame, took = found
    assert frame == Frame(0x482, b"\x05")
    assert took > 0


def test_a_bus_that_fails_while_the_answer_is_awaited_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: float) -> None:
        raise OSError("the adapter is gone")

    bus = open_bus("virtual", CHANNEL)
    monkeypatch.setattr(bus, "recv", fail)
    with pytest.raises(BusError, match="the adapter is gone"):
        exchange(bus, Frame(0x502, b""), Frame(0x482), 10.0)


# Frames in candump's notation


@pytest.mark.parametrize(
    ("text", "frame", "words"),
    [
        ("185#0102", "185#0102", ""),
        ("185#", "185#", ""),
        (
            "481#19.01",
            "481#1901",
            "  Order Set  colour=blue, boxes=12, rows=2",
        ),
        ("202#01", "202#01", ""),  # too short for a Move To: sent as it is
    ],
)
def test_a_frame_is_sent_unchanged(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, text: str, frame: str, words: str
) -> None:
    assert send(capsys, text) == (0, f"sent      {frame}{words}\n", "")
    assert heard(wire) == frame


@pytest.mark.parametrize(
    ("expect", "status"),
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
    (["Halt Lift", "--expect", "1855#"], "'1855#' is not a frame"),
    (["Gotto"], "unknown message 'Gotto'; known: Halt All, "),
    (["Move Confrm"], "unknown message 'Move Confrm'; did you mean Move Confirm or Order Confirm?"),
    (["Move", "To", *MOVE[1:]], "a name with spaces needs quotes: send 'Move To'"),
    ([*MOVE, "z=1"], "unknown field of Move To 'z'; known: x, y, angle, speed, gates, direction, route"),
    (["Halt Lift", "x=1"], "unknown field of Halt Lift 'x'"),
    (MOVE[:2], "Move To: y, angle, speed missing"),
    ([*MOVE, "x=1"], "Move To: x given twice"),
    (["Move To", "x=3001", *MOVE[2:]], "Move To: x = 3001 is not allowed; allowed: 0..3000 mm"),
    (["Move To", "x=-1", *MOVE[2:]], "Move To: x = -1 is not allowed; allowed: 0..3000 mm"),
    (["Move To", "x=12.5", *MOVE[2:]], "Move To: x = '12.5' is not allowed; allowed: 0..3000 mm"),
    (["Move To", "x", *MOVE[2:]], "Move To: x = 'x' is not allowed; allowed: 0..3000 mm"),
    (["Move To", "x=", *MOVE[2:]], "Move To: x = '' is not allowed; allowed: 0..3000 mm"),
    ([*MOVE[:4], "speed=101"], "Move To: speed = 101 is not allowed; allowed: 0..100 %"),
    ([*MOVE, "gates=gate-9"], "unknown gate 'gate 9'; did you mean gate "),
    ([*MOVE, "gates=gate-1:maybe"], "Move To: gates = 'gate-1:maybe' is not allowed; allowed: 0..65535, or "),
    ([*MOVE, "direction=backward"], "Move To: direction = backward is not allowed; allowed: forward, as the loaded"),
    (["Halt Cause", "cause=wall"], "Halt Cause: cause = 'wall' is not allowed; allowed: operator (0), "),
    (["Halt Lift", "--expect", "Nothing"], "unknown message 'Nothing'; known: Halt All, "),
    (["Halt Lift", "--expect", "185#R"], "--expect 185#R: a remote frame is no answer"),
    (["nothing.yaml"], "nothing.yaml: No such file"),
    (["nothing.yaml", "x=1"], "nothing.yaml is a list: it takes no fields, and no --expect"),
    (["Halt Lift", "--dialect", "nonsense"], "unknown dialect 'nonsense'; known: packed, plain"),
]


def test_a_list_is_sent_with_its_bursts_and_ends_with_its_last_frame(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, tmp_path: Path
) -> None:
    file = tmp_path / "wake-up.yaml"
    file.write_text("- {send: Halt Lift, burst: 2, gap: 5 ms}\n- {send: 705#R1}\n- {send: 100#01}\n")
    assert send(capsys, str(file)).out == "4 frames sent\n"
    sent = [wire.recv(0) for _ in range(4)]
    assert [(each.arbitration_id, each.is_remote_frame) for each in sent if each] == [
        (0x381, False),
        (0x705, True),
        (0x100, False),
        (0x381, False),
    ]


def test_a_list_waits_for_its_trigger_until_ctrl_c(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, sent = tmp_path / "answer.yaml", list[Frame]()

    def ended(_: object, frame: Frame) -> None:
        sent.append(frame)
        if len(sent) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("eurobot_od.cli.send_list.transmit", ended)
    file.write_text("- {send: 185#01}\n- {send: 100#, trigger: 185}\n")
    assert send(capsys, str(file)).out == "2 frames sent\n"
    assert sent == [Frame(0x185, b"\1"), Frame(0x100)]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_a_wrong_command_line_is_one_line_and_sends_nothing(
    capsys: pytest.CaptureFixture[str], wire: can.BusABC, words: list[str], complaint: str
) -> None:
    said = send(capsys, *words)
    assert (said.status, said.out) == (2, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1
    assert heard(wire) is None


@pytest.mark.parametrize(
    ("words", "complaint"),
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
    said = run(capsys, "send", "Halt Lift", *words)
    assert (said.status, said.out) == (3, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1
