"""Errors that used to hide: each is seen, and none takes the place of another."""

from __future__ import annotations

import errno
import gc
import os
import sys
from collections.abc import Callable, Iterator, Sequence

import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.controller import Controller, Event, Report
from eurobot_od.errors import BusError, EurobotError, StateError
from tests.bus.live.loose import LONG, Reports
from tests.kit import lift
from tests.kit.lift import Cabin, CheckCabinRequest, CheckCabinResponse, FloorRequest, Halt, MoveTo, Panel, Ride
from tests.processes import bus_server, free_port, motor, process, shared

PROTOCOL = lift.protocol()


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A bus of the test's own."""
    name: str = request.node.name
    return name


class StuckBus(VirtualBus):
    """A bus whose driver raises when it is shut down."""

    error = OSError("no answer")

    def shutdown(self) -> None:
        super().shutdown()
        raise self.error


class ClosedBus(StuckBus):
    """A bus whose server has gone first, by the same Ctrl-C."""

    error = OSError(errno.EBADF, "Bad file descriptor")


class StubbornCabin(Cabin):
    """Does not come to an end."""

    def leave(self) -> None:
        raise StateError("it does not stand")


def test_an_error_at_shutdown_does_not_replace_the_cause(channel: str) -> None:
    reports = Reports()
    live = Live.node(StuckBus(channel), Cabin(lift.dictionary("cabin")), report=reports)
    with pytest.raises(ZeroDivisionError), live:
        raise ZeroDivisionError
    assert reports.wait_for(Event.END_FAILED).text == str(live.failure) != "None"


def test_a_bus_that_its_server_has_closed_ends_without_a_word(channel: str) -> None:
    reports: list[Report] = []
    live = Live.node(ClosedBus(channel), Cabin(lift.dictionary("cabin")), report=reports.append)
    with pytest.raises(KeyboardInterrupt), live:
        raise KeyboardInterrupt
    assert (reports, live.failure) == ([], None)


def test_of_two_errors_at_the_end_the_first_is_raised(channel: str) -> None:
    live = Live.node(StuckBus(channel), StubbornCabin(lift.dictionary("cabin")))
    with pytest.raises(EurobotError, match="it does not stand"), live:
        pass
    assert isinstance(live.failure, BusError)


def test_a_report_that_cannot_be_written_is_kept_and_the_bus_read_on(channel: str) -> None:
    def closed(_: Report) -> None:
        raise BrokenPipeError(32, "Broken pipe")

    controller = Controller(PROTOCOL, report=closed)
    controller.add_function(CheckCabinResponse, lambda *_: 1 / 0, "lamp")
    queue = controller.add_queue(CheckCabinResponse)
    with Live.node(VirtualBus(channel), Cabin(lift.dictionary("cabin"))), Live(VirtualBus(channel), controller) as live:
        for _ in range(2):
            live.send(CheckCabinRequest())
            assert queue.get(LONG) is not None
    assert [report.event for report in controller.reports].count(Event.LISTENER_FAILED) == 2
    assert isinstance(controller.report_failure, BrokenPipeError)
    assert live.failure is None


@pytest.mark.long
@pytest.mark.live
def test_a_closed_report_pipe_ends_a_node_and_is_no_failed_bus() -> None:
    port = free_port()
    command = " ".join((sys.executable, "-m eurobot_od node", *motor(), *shared(port)))
    with bus_server(port) as server, process("bash", "-c", f"{command} > >(head -n 1)") as running:
        running.line("Ctrl-C ends it")
        server.kill()  # which is reported, to nobody
        assert running.wait() == 0
        assert running.told() == running.said[:1]


def test_send_after_the_end_says_so(channel: str) -> None:
    with Live(VirtualBus(channel), Controller(PROTOCOL)) as live:
        pass
    with pytest.raises(StateError, match="the bus is closed; nothing is sent any more"):
        live.send(Halt())


def test_system_exit_in_a_listener_silences_it_for_one_message() -> None:
    heard: list[float] = []

    def leaves(_: object, timestamp: float) -> None:
        heard.append(timestamp)
        sys.exit("gone")

    reports: list[Report] = []
    controller = Controller(PROTOCOL, report=reports.append)
    controller.add_function(Halt, leaves)
    controller.start()
    for now in (1.0, 2.0):
        controller.receive(PROTOCOL.encode(Halt()), now)
    assert heard == [1.0, 2.0]
    assert [report.text for report in reports] == ["SystemExit: gone"] * 2


@pytest.fixture
def panel(channel: str) -> Iterator[tuple[Live, Panel]]:
    node = Panel(lift.dictionary("panel"))
    with Live.node(VirtualBus(channel), node) as live:
        yield live, node


def child_says(calls: Sequence[Callable[[], object]], monkeypatch: pytest.MonkeyPatch) -> bytes:
    """Fork, and return what the child says of its calls: R for one that is refused, and ! for an error in the fork."""
    read, write = os.pipe()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "unraisablehook", lambda _: os.write(write, b"!"))
        child = os.fork()
    if child == 0:
        for call in calls:
            try:
                call()
                os.write(write, b"-")
            except StateError:
                os.write(write, b"R")
        os._exit(0)
    os.close(write)
    _, status = os.waitpid(child, 0)
    assert status == 0
    with os.fdopen(read, "rb") as answers:
        return answers.read()


FORKS = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing forks here"),
    pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning"),
]


class TestForkedChild:
    """A child has the objects of its parent, and none of the threads."""

    pytestmark = FORKS

    def test_a_node_is_refused(self, panel: tuple[Live, Panel], monkeypatch: pytest.MonkeyPatch) -> None:
        live, node = panel
        calls = (
            lambda: live.send(CheckCabinRequest()),
            node.check,
            lambda: node.move(MoveTo(1, Ride.NORMAL, 1)),
            lambda: node.send(FloorRequest()),
            live.stop,
        )
        assert child_says(calls, monkeypatch) == b"RRRR-"
        live.send(CheckCabinRequest())  # here it goes on

    def test_a_child_process_needs_a_node(self, channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
        with Live(VirtualBus(channel), Controller(PROTOCOL)) as live:
            assert child_says([lambda: live.send(CheckCabinRequest()), live.stop], monkeypatch) == b"R-"
            live.send(CheckCabinRequest())

    def test_a_collected_live_bus_is_no_error(self, channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
        with Live(VirtualBus(channel), Controller(PROTOCOL)):
            pass
        gc.collect()
        assert child_says([], monkeypatch) == b""
