"""Opening a bus; what a driver does with a frame: takes it, has no room for it now, or has failed."""

from __future__ import annotations

import errno
import json
import logging
import socket
import struct
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.socketcan import SocketcanBus
from can.interfaces.virtual import VirtualBus, channels

from eurobot_od.bus.live import Driver, open_bus, share
from eurobot_od.bus.live.buses import Connection, Gaps
from eurobot_od.errors import BusError, LocalError
from eurobot_od.frame import Frame
from eurobot_od.support import connections
from eurobot_od.support.connections import STEADY
from tests.bus.live.loose import until
from tests.processes import free_port

FRAME = Frame(0x123, b"\1\2")


class Bus(can.BusABC):
    """A bus whose `send` raises `error`, if there is one, and keeps what it was given."""

    channel_info = "test"

    def __init__(self, error: Exception | None = None) -> None:
        self.error, self.sent = error, list[tuple[can.Message, float | None]]()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append((msg, timeout))
        if self.error:
            raise self.error

    def shutdown(self) -> None:
        self._is_shutdown = True


def refused(number: int | None) -> can.CanError:
    """What python-can raises because of an operating system's error, or of its own accord."""
    error = can.CanError("Transmit buffer\nfull")
    error.__cause__ = None if number is None else OSError(number, "said so")
    return error


def test_a_frame_is_handed_over_as_it_is() -> None:
    bus = Bus()
    assert Driver(bus).send(FRAME, timeout=0.25)
    ((message, timeout),) = bus.sent
    assert (message.arbitration_id, bytes(message.data), message.is_extended_id, timeout) == (
        0x123,
        b"\1\2",
        False,
        0.25,
    )
    assert not message.is_remote_frame
    assert not message.is_error_frame


class Nameless(Bus):
    """A bus that does not say where it is, as python-can's slcan."""

    channel_info = can.BusABC.channel_info

    def __init__(self, *_: object, **__: object) -> None:
        super().__init__()


def test_a_bus_without_a_name_has_that_of_its_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BACKENDS, "slcan", (__name__, "Nameless"))
    bus = open_bus("slcan", "/dev/ttyACM0")
    assert bus.channel_info == "slcan /dev/ttyACM0"


@pytest.fixture(autouse=True)
def _no_configuration(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Keep the user's own configuration of python-can away."""
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_BITRATE", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))


# What drivers raise when they do not open, by the channel.
FAILURES: dict[str, Exception] = {
    "unplugged": OSError(19, "No such device"),
    "missing": ImportError("no driver:\n  install one"),
    "mute": RuntimeError(),
}


class RecordingBus(VirtualBus):
    """A driver that keeps what it is opened with, and fails on some channels."""

    def __init__(self, channel: Any = None, **options: Any) -> None:
        self.options = {"channel": channel} | options
        if channel in FAILURES:
            self._is_shutdown = True
            raise FAILURES[channel]
        super().__init__(channel)


@pytest.fixture
def _recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the driver above with python-can as `recording`."""
    monkeypatch.setitem(BACKENDS, "recording", (__name__, RecordingBus.__name__))
    monkeypatch.setattr("can.util.VALID_INTERFACES", can.VALID_INTERFACES | {"recording"})


# Environment, configuration file (None: there is none), what the caller names, and what the driver is opened with.
CONFIGURED: list[tuple[dict[str, str], str | None, dict[str, Any], dict[str, Any]]] = [
    ({"CAN_INTERFACE": "recording", "CAN_CHANNEL": "a"}, None, {}, {"channel": "a", "bitrate": 500_000}),
    ({"CAN_INTERFACE": "recording", "CAN_BITRATE": "250000"}, None, {}, {"channel": None, "bitrate": 250_000}),
    ({"CAN_INTERFACE": "recording", "CAN_CHANNEL": "a"}, None, {"channel": "b"}, {"channel": "b", "bitrate": 500_000}),
    (
        {"CAN_BITRATE": "250000"},
        None,
        {"interface": "recording", "bitrate": 125_000},
        {"channel": None, "bitrate": 125_000},
    ),
    (
        {"CAN_INTERFACE": "virtual", "CAN_CHANNEL": "a"},
        None,
        {"interface": "recording"},
        {"channel": "a", "bitrate": 500_000},
    ),
    (
        {"CAN_CONFIG": '{"interface": "recording", "channel": "a", "extra": 1}'},
        None,
        {},
        {"channel": "a", "bitrate": 500_000, "extra": 1},
    ),
    ({}, "interface = recording\nchannel = a\nbitrate = 100000", {}, {"channel": "a", "bitrate": 100_000}),
    ({"CAN_CHANNEL": "b"}, "interface = recording\nchannel = a", {}, {"channel": "b", "bitrate": 500_000}),
]


@pytest.mark.usefixtures("_recording")
@pytest.mark.parametrize(("environment", "file", "given", "opened"), CONFIGURED)
def test_python_cans_configuration_is_honoured(
    environment: dict[str, str],
    file: str | None,
    given: dict[str, Any],
    opened: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    if file is not None:
        (tmp_path / "can.conf").write_text(f"[default]\n{file}\n")
    with open_bus(**given) as bus:
        assert isinstance(bus, RecordingBus)
        assert bus.options == opened


# What is left is the in-process bus: environment, what the caller names, and the channel.
BY_DEFAULT: list[tuple[dict[str, str], dict[str, Any], str]] = [
    ({}, {}, "eurobot"),
    ({}, {"channel": "a"}, "a"),
    ({}, {"bitrate": 125_000}, "eurobot"),
    ({"CAN_CHANNEL": "a"}, {}, "a"),
    ({"CAN_CHANNEL": "a"}, {"channel": "b"}, "b"),
    ({"CAN_INTERFACE": "virtual"}, {"channel": "b"}, "b"),
]


@pytest.mark.parametrize(("environment", "given", "channel"), BY_DEFAULT)
def test_default_is_the_in_process_bus(
    environment: dict[str, str], given: dict[str, Any], channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with open_bus(**given) as bus:
        assert bus.channel_info == f"Virtual bus channel {channel}"


NO_BUSES: list[tuple[dict[str, Any], str]] = [
    ({"interface": "nosuch"}, "cannot open the nosuch bus: unknown interface 'nosuch'; known: "),
    ({"interface": "nosuch", "channel": "x"}, "cannot open the nosuch bus x: unknown interface 'nosuch'; known: "),
    ({"interface": "socketcan", "channel": "nosuch0"}, "cannot open the socketcan bus nosuch0: "),
    ({"interface": "slcan", "channel": "/dev/nosuch"}, "cannot open the slcan bus /dev/nosuch: "),
    ({"interface": "recording", "channel": "unplugged"}, "cannot open the recording bus unplugged: [Errno 19] No such"),
    ({"interface": "recording", "channel": "missing"}, "cannot open the recording bus missing: no driver: install one"),
    ({"interface": "recording", "channel": "mute"}, "cannot open the recording bus mute: RuntimeError"),
]


@pytest.mark.usefixtures("_recording")
@pytest.mark.parametrize(("given", "told"), NO_BUSES)
def test_bus_that_does_not_open_is_told_in_one_line(given: dict[str, Any], told: str) -> None:
    with pytest.raises(BusError) as error:
        open_bus(**given)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(told)


def test_a_shared_bus_that_nobody_shares_says_what_shares_one() -> None:
    pytest.importorskip("can_remote", reason="the extra `remote` is not installed")
    with pytest.raises(BusError, match="nobody shares a bus there: `node NODE --share PORT` does"):
        open_bus("remote", f"ws://127.0.0.1:{free_port()}/")


def test_a_client_that_is_killed_leaves_neither_an_error_nor_its_bus() -> None:
    websocket = pytest.importorskip("can_remote.websocket", reason="the extra `remote` is not installed")
    channel = share(free_port())
    peer = websocket.WebSocket(channel, ["can.json.v1"])
    peer.send(json.dumps({"type": "bus_request", "payload": {"config": {}}}))
    peer.read()
    peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # as the kernel ends it
    peer.socket.close()
    with open_bus("virtual", channel) as bus:

        def is_alone() -> bool:
            bus.send(can.Message(arbitration_id=0x185))
            return len(channels[channel]) == 1

        until(is_alone)


def test_a_configured_bus_that_does_not_open_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("can_remote", reason="the extra `remote` is not installed")
    channel = f"ws://127.0.0.1:{free_port()}/"
    monkeypatch.setenv("CAN_INTERFACE", "remote")
    monkeypatch.setenv("CAN_CHANNEL", channel)
    with pytest.raises(BusError, match=f"cannot open the configured remote bus {channel}: .*; nobody shares a bus"):
        open_bus()


@pytest.mark.parametrize(("name", "value"), [("CAN_CONFIG", "{"), ("CAN_INTERFACE", "nosuch")])
def test_configuration_that_is_none_is_told_in_one_line(name: str, value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv(name, value)
    with pytest.raises(BusError, match=r"^cannot open the configured bus: .+$"):
        open_bus()


def test_an_interface_of_an_extra_says_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(BACKENDS, "remote", raising=False)  # as if python-can-remote were not installed
    with pytest.raises(BusError, match=r"cannot open the remote bus: interface remote is not installed; .*pip install"):
        open_bus("remote")


def test_sharing_without_its_extra_names_the_command_and_the_way_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "can_remote.server", None)
    with pytest.raises(
        LocalError, match=r"the extra `remote` brings it: .*pip install .*; without it: -i udp_multicast"
    ):
        share(free_port())


def test_multicast_without_its_package_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.interfaces.udp_multicast.utils.msgpack", None)
    with pytest.raises(BusError, match=r'it needs `pip install "python-can\[multicast\]"`'):
        open_bus("udp_multicast", "239.74.163.2")


@pytest.mark.parametrize("number", [None, errno.ENOBUFS, errno.EAGAIN, errno.ETIMEDOUT])
def test_a_full_driver_takes_no_frame_and_says_why(number: int | None) -> None:
    driver = Driver(Bus(refused(number)))
    assert not driver.send(FRAME)
    assert driver.refusal == "Transmit buffer full"
    assert str(driver.stuck(1.25)) == "the bus test has taken no frame for 1.2 s: Transmit buffer full"


@pytest.mark.parametrize("error", [refused(errno.ENETDOWN), refused(errno.ENODEV), OSError("gone"), ValueError("odd")])
def test_any_other_error_means_that_the_bus_has_failed(error: Exception) -> None:
    with pytest.raises(BusError, match=r"^the bus test failed: "):
        Driver(Bus(error)).send(FRAME)


def test_an_error_of_a_bus_that_was_replaced_meanwhile_is_only_a_frame_not_taken() -> None:
    class Replaced(Bus):
        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            driver.replace(Bus)
            raise OSError("closed")

    driver = Driver(Replaced())
    assert not driver.send(FRAME)


def test_only_a_driver_that_can_send_without_waiting_is_prompt() -> None:
    with VirtualBus("test-buses") as bus:
        assert (Driver(bus).prompt, Driver(bus).filters, Driver(bus).overflow) == (True, False, 0)
    slow = Bus()
    driver = Driver(slow)
    assert (driver.prompt, driver.filters) == (False, False)
    driver.send(FRAME)
    ((_, timeout),) = slow.sent
    assert timeout is not None
    assert 0 < timeout < 0.1


def test_log_messages_of_drivers_are_hidden_while_a_bus_is_opened(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Python writes warnings that nobody has asked for to the terminal; a driver's errors are raised, too."""
    for name in ("can", ""):
        monkeypatch.setattr(logging.getLogger(name), "handlers", [])
    open_bus("virtual", "quiet").shutdown()
    logging.getLogger("can").warning("the driver says so")
    assert capfd.readouterr() == ("", "")


FAILED = BusError("it failed")


class Scene:
    """A connection whose clock stands; `refusals` are how often its bus does not open."""

    def __init__(self, opens: bool = True, refusals: int = 0, bus: type[can.BusABC] = VirtualBus) -> None:
        self.now, self.refusals, self._bus = 0.0, refusals, bus
        self.on_open: Callable[[], object] = lambda: None
        self.told: list[object] = []
        opener = self._open if opens else None
        self.connection = Connection(
            Driver(bus("connection")),
            opener,
            lambda: self.now,
            lambda why, again: self.told.append((why, again)),
            lambda: self.told.append("opened"),
            self.told.append,
        )

    def close(self) -> None:
        self.connection.driver.bus.shutdown()

    def _open(self) -> can.BusABC:
        if self.refusals:
            self.refusals -= 1
            raise BusError("not yet")
        self.on_open()
        return self._bus("connection")


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(connections, "LONGEST_PAUSE", 0.002)


def test_only_the_first_who_notices_is_heard() -> None:
    with closing(Scene()) as scene:
        for _ in range(3):
            scene.connection.fail(FAILED)
        assert scene.told == [(FAILED, True)]
        assert not scene.connection.up


def test_a_gap_ends_when_the_bus_was_read_and_not_when_it_was_opened() -> None:
    with closing(Scene(refusals=3)) as scene:
        scene.now = 1.0
        scene.connection.fail(FAILED)
        assert scene.connection.reopen()
        scene.connection.fail(FAILED)  # opened, and still down
        assert scene.connection.reopen()
        assert scene.connection.failure is FAILED
        scene.now = 4.5
        scene.connection.works()
        scene.connection.works()
        assert scene.told == [(FAILED, True), "opened", "opened", 3.5]
        assert scene.connection.gaps == Gaps(1, 3.5)
        scene.now += STEADY
        scene.connection.fail(FAILED)
        assert scene.told[-1] == (FAILED, True)


def test_without_an_opener_it_is_not_opened_again_and_sending_may_go_on() -> None:
    with closing(Scene(opens=False)) as scene:
        scene.connection.fail(FAILED)
        assert scene.told == [(FAILED, False)]
        assert scene.connection.up
        assert not scene.connection.reopen()


def test_a_closed_connection_neither_fails_nor_reopens() -> None:
    with closing(Scene()) as scene:
        scene.connection.close()
        scene.connection.fail(FAILED)
        assert not scene.connection.reopen()
        assert scene.told == []


def test_a_bus_that_is_closed_while_it_opens_is_not_read() -> None:
    with closing(Scene()) as scene:
        scene.connection.fail(FAILED)
        scene.on_open = scene.connection.close
        assert not scene.connection.reopen()
        assert not scene.connection.up


class Receiving(SocketcanBus):
    """A socket of another kind that loses what it has no room for: its counters are those of any socket."""

    def __init__(self) -> None:
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self._is_shutdown = True  # nothing that is python-can's own


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts them")
def test_the_frames_for_which_the_kernel_had_no_room_are_counted() -> None:
    bus = Receiving()
    with bus.socket:
        bus.socket.setblocking(False)
        for _ in range(1000):
            bus.socket.sendto(bytes(4000), bus.socket.getsockname())
        read = 0
        with suppress(BlockingIOError):
            while bus.socket.recv(1):
                read += 1
        assert 0 < read < 1000
        assert Driver(bus).overflow == 1000 - read


class CountingBus(VirtualBus):
    """A bus whose driver has lost 5 frames."""

    lost = 5


def test_the_frames_that_each_bus_has_lost_are_added_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Driver, "overflow", property(lambda driver: getattr(driver.bus, "lost", 0)))
    with closing(Scene(bus=CountingBus)) as scene:
        scene.connection.count_overflow()
        scene.connection.fail(FAILED)
        assert scene.connection.reopen()
        scene.connection.count_overflow()  # the new one counts from 0, and has lost 5 again
        assert scene.connection.overflow == 10
        scene.connection.driver.bus.lost = 6  # type: ignore[attr-defined]
        scene.connection.count_overflow()
        assert scene.connection.overflow == 11


def test_a_bus_that_fails_while_it_is_said_to_work_is_still_lost() -> None:
    with closing(Scene()) as scene:
        scene.connection.fail(FAILED)
        assert scene.connection.reopen()
        scene.connection.fail(FAILED)  # a sender was quicker than the reader
        scene.connection.works()
        assert scene.connection.failure is FAILED
        assert scene.connection.gaps == Gaps()
