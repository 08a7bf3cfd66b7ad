"""The live bus as the page gets it: what has changed, and what is kept."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.library.library import Library, LibraryDevices
from eurobot_od.pdo.kinds import Message
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web import session as module
from eurobot_od.web.events import PageEvent
from eurobot_od.web.page import Panel
from eurobot_od.web.session import Session
from tests.kit import plant
from tests.kit.library import PRODUCT, REVISION, VENDOR, device_text, library_of
from tests.kit.plant import messages as m
from tests.web.scene import channel
from tests.web.test_drives import NETWORK, bench
from tests.web.test_events import REMAPPED

BEAT, NMT = Frame(0x702, b"\x05"), Frame(0x000, b"\1\2")


class Restarting(VirtualBus):
    """A bus whose time stamps count from its opening."""

    latest: ClassVar[Restarting]

    def __init__(self, channel: str) -> None:
        super().__init__(channel)
        self.broken, self._opened_at = False, time.time()
        Restarting.latest = self

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.broken:
            raise OSError("pulled out")
        message, filtered = super()._recv_internal(timeout)
        if message is not None:
            message.timestamp -= self._opened_at
        return message, filtered


class Marking(Panel):
    """Makes an event of each message that moves something or stops it."""

    def take(self, time: float, message: Message) -> Iterator[PageEvent]:
        kinds = {m.HaltLift: "halt", m.MoveTo: "move"}
        if type(message) in kinds:
            yield PageEvent(f"{kinds[type(message)]} {time}", kinds[type(message)], time, "")


STOP = plant.decoder().protocol.encode(m.HaltLift())


@pytest.fixture
def bus() -> Iterator[tuple[Session, Callable[[Frame], None]]]:
    """A session on a bus; the function sends a frame and waits until the session has it."""
    name = channel()
    with open_bus("virtual", name) as other:
        session = Session(partial(open_bus, "virtual", name), plant.decoder(), 500_000, lambda _: [Marking])

        def send(frame: Frame) -> None:
            before = session.frames
            Driver(other).send(frame)
            while session.frames == before:
                session.poll()

        yield session, send
        session.close()


def snapshot(session: Session, since: int = -1) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(session.snapshot(since))
    return found


def send_own(session: Session, frame: Frame) -> None:
    """Send a frame from the page, and wait until the session has it."""
    before = session.frames
    session.tap.send_frame(frame)
    while session.frames == before:
        session.poll()


def test_a_snapshot_has_what_changed_since_a_turn(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, send = bus
    send(BEAT)
    first = snapshot(session)
    send(STOP)
    second = snapshot(session, first["turn"])
    assert [each["name"] for each in first["rows"]] == ["Heartbeat lift"]
    assert [each["name"] for each in second["rows"]] == ["Halt Lift"]
    assert [each["kind"] for each in second["events"]] == ["halt"]
    assert len(snapshot(session)["rows"]) == 2
    assert snapshot(session, second["turn"])["rows"] == []


def test_the_diagnosis_fills_while_traffic_comes(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, send = bus
    send(BEAT)
    before = [each.rule for each in session.diagnosis.so_far(session.now)]
    send(Frame(0x082, bytes.fromhex("1082110000000000")))
    open_, again = (session.diagnosis.so_far(session.now) for _ in range(2))
    assert before == []
    assert [each.title for each in open_] == ["lift: EMCY 0x8210 pdo too short, register 0x11"]
    assert [each.seen.number for each in again] == [1]
    send(Frame(0x082, bytes(8)))
    assert [each.rule for each in session.diagnosis.so_far(session.now)] == [BusRule.EMCY_CLEARED]


def test_the_state_of_each_node_is_in_the_snapshot(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, send = bus
    send(BEAT)
    lift = next(each for each in snapshot(session)["nodes"] if each["name"] == "lift")
    assert (lift["state"], lift["life"]) == ("operational", "alive")
    assert 0 <= lift["age"] < 10


def test_frames_sent_by_the_page_are_shown_too(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, _ = bus
    send_own(session, STOP)
    assert [each["name"] for each in snapshot(session)["rows"]] == ["Halt Lift"]


def test_events_make_room_for_newer_ones(
    bus: tuple[Session, Callable[[Frame], None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    session, send = bus
    monkeypatch.setattr(module, "MOST_EVENTS", 3)
    for _ in range(5):
        send(NMT)
    assert [each["key"] for each in snapshot(session)["events"]] == ["NMT 3", "NMT 4", "NMT 5"]


class Lasting(Panel):
    """Has one event, which changes with each message."""

    def take(self, time: float, message: Message) -> Iterator[PageEvent]:
        yield PageEvent("lasting", "stop", 0.0, type(message).__name__, end=time)


def test_a_changed_event_is_kept_as_a_new_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_EVENTS", 2)
    session = Session(partial(open_bus, "virtual", channel()), plant.decoder(), 500_000, lambda _: [Lasting])
    for frame in (STOP, NMT, STOP, NMT):
        send_own(session, frame)
    assert [each["key"] for each in snapshot(session)["events"]] == ["lasting", "NMT 4"]
    session.close()


def test_the_page_hears_answers_after_a_job_has_left_its_bus(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, send = bus
    session.open_for_job(lambda _: None).shutdown()
    send(Frame(0x582, bytes(8)))
    assert session.tap.recv(0) is not None


def test_a_bus_has_no_load_before_its_first_frame() -> None:
    session = Session(partial(open_bus, "virtual", channel()), plant.decoder(), 500_000)
    shown = snapshot(session)
    session.close()
    assert (shown["load"], shown["rate"]) == (0, 0)


def test_a_message_has_a_period_after_two_intervals(bus: tuple[Session, Callable[[Frame], None]]) -> None:
    session, send = bus
    periods = []
    for _ in range(3):
        send(BEAT)
        [row] = snapshot(session)["rows"]
        periods.append(row["period"] is None)
    assert periods == [True, True, False]


def test_a_recording_ends_by_itself_when_it_is_long(
    bus: tuple[Session, Callable[[Frame], None]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    session, send = bus
    monkeypatch.setattr(module, "MOST_RECORDED", 2)
    session.recording.start(tmp_path)
    for _ in range(3):
        send(BEAT)
    state = snapshot(session)["recording"]
    assert (state["on"], state["frames"]) == (False, 2)
    assert len((tmp_path / state["file"]).read_text().splitlines()) == 2


def test_what_is_told_of_a_recording_is_shown(
    bus: tuple[Session, Callable[[Frame], None]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    @contextmanager
    def full(_: Path, tell: Callable[[str], object]) -> Iterator[Callable[[float, Frame], None]]:
        tell("nothing is logged until there is room")
        yield lambda *_: None

    session, _ = bus
    monkeypatch.setattr(module, "recording", full)
    session.recording.start(tmp_path)
    assert snapshot(session)["recording"]["trouble"] == "nothing is logged until there is room"


def test_a_full_disk_ends_a_recording_and_nothing_else(
    bus: tuple[Session, Callable[[Frame], None]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    @contextmanager
    def full(_: Path, **_options: object) -> Iterator[Callable[[float, Frame], None]]:
        with Path("/dev/full").open("w", buffering=1) as disk:
            yield lambda _time, frame: print(frame, file=disk)

    session, send = bus
    monkeypatch.setattr(module, "recording", full)
    session.recording.start(tmp_path)
    send(BEAT)
    send(BEAT)
    found = snapshot(session)
    assert found["frames"] == 2
    assert not found["recording"]["on"]
    assert "No space left on device" in found["recording"]["trouble"]


def test_a_recording_that_cannot_be_ended_lets_the_bus_go_all_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    @contextmanager
    def full(_: Path, **_options: object) -> Iterator[Callable[[float, Frame], None]]:
        with Path("/dev/full").open("w") as disk:  # noticed only when what is buffered is written
            yield lambda _time, frame: print(frame, file=disk)

    name = channel()
    bus = open_bus("virtual", name)
    session = Session(lambda: bus, plant.decoder(), 500_000)
    monkeypatch.setattr(module, "recording", full)
    session.recording.start(tmp_path)
    send_own(session, BEAT)
    with pytest.raises(OSError, match="No space left on device"):
        session.close()
    assert bus._is_shutdown


def test_a_bus_that_fails_is_reported_and_opened_again() -> None:
    name = channel()
    opened = [open_bus("virtual", name)]
    may_open = threading.Event()

    def opening() -> Any:
        if not may_open.is_set():
            raise BusError("not yet")
        opened.append(open_bus("virtual", name))
        return opened[-1]

    session = Session(lambda: opening() if opened[0]._is_shutdown else opened[0], plant.decoder(), 500_000)
    opened[0].shutdown()
    while not session.trouble:
        session.poll()
    assert "failed" in session.trouble
    with pytest.raises(BusError, match="failed"):
        session.tap.send_frame(BEAT)
    may_open.set()
    while session.trouble:
        session.poll()
    session.tap.send_frame(BEAT)
    session.close()


def test_times_continue_when_the_driver_restarts_at_zero() -> None:
    name = channel()
    session = Session(partial(Restarting, name), plant.decoder(), 500_000)
    with open_bus("virtual", name) as other:
        for lost in (True, False):
            before = session.frames
            Driver(other).send(BEAT)
            while session.frames == before:
                session.poll()
            if lost:
                Restarting.latest.broken = True
                while not session.trouble:
                    session.poll()
                while session.trouble:
                    session.poll()
    [row] = snapshot(session)["rows"]
    assert 0.0 < row["time"] <= session.now
    session.close()


def test_a_frame_of_ours_stands_before_its_answer(tmp_path: Path) -> None:
    """A master that saw an answer before its request would take each transfer of a healthy lift for incomplete."""
    with bench(tmp_path) as scene:
        for _ in range(20):
            scene.ask(do="read", node="servo", object="0x1008")
        assert scene.served.session is not None
        frames = [json.loads(each) for each in scene.served.session.history.since(0).frames]
    transfers = [each for each in frames if each[0] in (0x585, 0x605)]
    assert len(transfers) >= 80  # by segments
    assert [each[0] for each in transfers] == [0x605, 0x585] * (len(transfers) // 2)
    assert {each[5] for each in transfers} == {""}
    assert [each[1] for each in transfers] == sorted(each[1] for each in transfers)


def test_a_frame_that_the_driver_refuses_was_not_on_the_bus() -> None:
    class Full(VirtualBus):
        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            raise can.CanTimeoutError

    session = Session(lambda: Full(channel()), plant.decoder(), 500_000)
    with pytest.raises(BusError, match="did not take the frame"):
        session.tap.send_frame(BEAT)
    session.poll()
    assert session.frames == 0
    session.close()


def test_times_begin_with_what_the_page_sends_first() -> None:
    name = channel()
    session = Session(partial(open_bus, "virtual", name), plant.decoder(), 500_000)
    send_own(session, BEAT)
    with open_bus("virtual", name) as other:
        Driver(other).send(NMT)
        while session.frames < 2:
            session.poll()
    one, two = (json.loads(each)[1] for each in session.history.since(0).frames)
    assert 0.0 <= one <= two <= session.now
    session.close()


def test_the_history_is_bounded_and_says_where_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, number in (("MOST_KEPT", 20), ("DROPPED", 5), ("AT_ONCE", 10)):
        monkeypatch.setattr(module, name, number)
    history = module.FrameHistory()
    for number in range(53):
        history.add(str(number))
    late = history.since(0)
    assert (late.first, late.frames[0], len(late.frames)) == (30, "30", 10)
    assert history.since(late.next).frames[0] == "40"
    assert history.since(53) == (53, [])


def test_a_message_that_is_mapped_otherwise_now_has_a_text_in_place_of_values() -> None:
    name = channel()
    session = Session(partial(open_bus, "virtual", name), NETWORK, 500_000)
    with open_bus("virtual", name) as other:
        for text in ("285#370600000000", *REMAPPED, "285#40E20100"):
            before = session.frames
            Driver(other).send(Frame.parse(text))
            while session.frames == before:
                session.poll()
    (shown,) = (each for each in snapshot(session)["rows"] if each["id"] == 0x285)
    first, *_, last = map(json.loads, session.history.since(0).frames)
    session.close()
    assert (shown["values"], shown["text"]) == (None, "position_actual_value=123456")
    assert first[3] is not None
    assert last[3:5] == [None, "position_actual_value=123456"]


class View(Marking):
    name, title, script, style = "own", "Own", "", ""


def test_a_page_lists_a_node_once_it_has_shown_what_it_is(tmp_path: Path) -> None:
    library, name = Library([library_of(tmp_path / "makers", axis=device_text())]), channel()
    decoder = Decoder((), describe=LibraryDevices(library, print))
    session = Session(
        partial(open_bus, "virtual", name), decoder, 500_000, lambda found: [View] if found.dictionaries else []
    )
    with open_bus("virtual", name) as other:

        def send(cob_id: int, data: bytes) -> None:
            before = session.frames
            Driver(other).send(Frame(cob_id, data))
            while session.frames == before:
                session.poll()

        send(0x705, b"\x05")
        (heard,) = json.loads(session.snapshot(-1))["nodes"]
        assert (session.learned, heard["name"]) == (0, "node 5")
        for sub, number in enumerate((VENDOR, PRODUCT, REVISION), 1):
            send(0x605, bytes([0x40, 0x18, 0x10, sub, 0, 0, 0, 0]))
            send(0x585, bytes([0x43, 0x18, 0x10, sub]) + number.to_bytes(4, "little"))
        send(0x185, b"\x07\x00")
    said = json.loads(session.snapshot(-1))
    assert said["learned"] == session.learned > 0
    assert [(each["name"], each["state"]) for each in said["nodes"]] == [("axis_5", "operational")]
    assert [type(each) for each in session.panels] == [View]
    assert '"axis_5.TPDO1"' in session.page("the bus")
    assert '"messages":[]' not in session.page("the bus")
    session.close()
