"""Suites run on a live bus as they do in simulation, survive its failure, and end in good order when interrupted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from itertools import count

import can
import pytest

from eurobot_od.bus import live as runtime
from eurobot_od.check.on_bus import run_live, run_simulated
from eurobot_od.check.report import Status, StepResult, SuiteResult
from eurobot_od.check.runner import Interrupt, RunOptions
from eurobot_od.od.standard import HEARTBEAT_TIME
from tests.check.suites import HEAD, document, results, suite
from tests.kit import plant

CHANNELS = count()
TALK = """
- send: Check Lift Request
- expect: Check Lift Response
- send: {Order Set: {colour: blue, boxes: 12, rows: 0}}
- expect: Order Confirm
- send: Place Request
- expect: {Place Response: {x: 0..400, y: 1600..2000}}
- sdo: {read: 0x1017, expect: 1000}
- sdo: {read: Manufacturer device name, expect: Packaging line lift}
- nmt: reset
- heartbeat: boot-up
- send: {raw: "202#D274"}
- emcy: 0x8210
- expect: {Move Confirm: {}}
  within: 20 ms
"""
WAITING = document(
    "- {name: begun, send: Halt Lift}\n- {name: long, wait: 10 min}\n- wait: 10 min",
    HEAD + "teardown:\n  - {name: tidy, send: Halt Lift}\n",
)


@pytest.fixture
def open_bus() -> Callable[[], can.BusABC]:
    """Opens buses on a channel of this test's own."""
    channel = f"check {next(CHANNELS)}"
    return lambda: runtime.open_bus("virtual", channel)


@pytest.fixture
def lift(open_bus: Callable[[], can.BusABC]) -> Iterator[runtime.Live]:
    with runtime.Live.node(open_bus(), plant.NODES["lift"](plant.load("lift"))) as live:
        yield live


def run(text: str, open_bus: Callable[[], can.BusABC], interrupt: Interrupt | None = None) -> SuiteResult:
    return run_live(suite(text), RunOptions(keep_going=True, interrupt=interrupt or Interrupt()), open_bus)


@pytest.mark.usefixtures("lift")
def test_a_live_node_and_a_simulated_one_get_the_same_verdicts(open_bus: Callable[[], can.BusABC]) -> None:
    text = document(TALK)
    simulated = results(text)
    live = run(text, open_bus)
    verdicts = [step.status for step in simulated.steps]
    assert verdicts == 12 * [Status.PASSED] + [Status.FAILED]
    assert [step.status for step in live.steps] == verdicts


@pytest.mark.usefixtures("lift")
def test_a_node_that_the_tester_plays_is_named_if_it_is_on_the_bus(open_bus: Callable[[], can.BusABC]) -> None:
    text = document("- send: Check Lift Request\n- wait: 100 ms")
    assert run(text, open_bus).remarks == ()
    panel = plant.NODES["panel"](plant.load("panel"))
    panel.device.objects.values[HEARTBEAT_TIME] = 10
    with runtime.Live.node(open_bus(), panel):
        (said,) = run(text, open_bus).remarks
    assert said == "panel (node 1) is on this bus, and the tester sends its messages: switch it off"


def test_a_missing_node_is_red_and_no_bus_error(open_bus: Callable[[], can.BusABC]) -> None:
    result = run(document("- send: Check Lift Request\n- {expect: Check Lift Response, within: 50 ms}"), open_bus)
    assert [step.status for step in result.steps] == [Status.PASSED, Status.FAILED]
    assert result.error == ""


class Unplugged(can.BusABC):
    """A bus whose adapter is gone: `receiving` and `sending` say whether it still does."""

    channel_info = "unplugged"

    def __init__(self, *, receiving: bool, sending: Exception | None) -> None:
        super().__init__("unplugged")
        self._receiving = receiving
        self._sending = sending
        self._down = threading.Event()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self._sending is not None:
            raise self._sending

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._receiving:
            raise OSError("no such device")
        self._down.wait(timeout)
        return None, False

    def shutdown(self) -> None:
        self._down.set()
        super().shutdown()


BROKEN = {
    "reading fails": ({"receiving": False, "sending": None}, "the bus unplugged failed: no such device"),
    "sending fails": ({"receiving": True, "sending": OSError("gone")}, "the bus unplugged failed: gone"),
    "the driver takes nothing": (
        {"receiving": True, "sending": can.CanOperationError("buffer full")},
        "the bus unplugged did not take 381#",
    ),
}


@pytest.mark.parametrize(("bus", "what"), BROKEN.values(), ids=BROKEN.keys())
def test_a_failing_bus_ends_the_suite(bus: dict[str, object], what: str) -> None:
    text = HEAD + "steps:\n  - wait: 20 ms\n  - send: Halt Lift\n  - wait: 1 s\n"
    result = run(text, lambda: Unplugged(**bus))  # type: ignore[arg-type]
    assert result.error == what
    broken = [step for step in result.steps if step.status is Status.BUS_FAILED]
    assert len(broken) == 1
    assert result.steps[-1].status is Status.SKIPPED


def test_the_teardown_is_done_when_a_lost_bus_is_back(open_bus: Callable[[], can.BusABC]) -> None:
    class Lost(Unplugged):
        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            if msg.arbitration_id == 0x202:
                raise OSError("gone")

    buses = iter([Lost(receiving=True, sending=None), Unplugged(receiving=False, sending=None), open_bus()])
    steps = '- send: Halt Lift\n- send: {raw: "202#"}\n- wait: 10 min'
    with open_bus() as witness:
        result = run(document(steps, HEAD + "teardown:\n  - send: Halt Lift\n"), lambda: next(buses))
        assert witness.recv(2.0) is not None
    assert str(result.error) == "the bus unplugged failed: gone"
    assert [step.status for step in result.steps] == [
        Status.PASSED,
        Status.BUS_FAILED,
        Status.SKIPPED,
        Status.PASSED,
    ]


def test_an_interrupt_cancels_the_step_and_does_the_teardown(open_bus: Callable[[], can.BusABC]) -> None:
    interrupt = Interrupt()
    options = RunOptions(interrupt=interrupt, show=lambda _: interrupt.request())
    result = run_live(suite(WAITING), options, open_bus)
    assert [(step.name, step.status) for step in result.steps] == [
        ("begun", Status.PASSED),
        ("long", Status.INTERRUPTED),
        ("tidy", Status.PASSED),
    ]


def test_an_interrupt_before_the_start_does_the_teardown_only(open_bus: Callable[[], can.BusABC]) -> None:
    interrupt = Interrupt()
    interrupt.request()
    assert [step.name for step in run(WAITING, open_bus, interrupt).steps] == ["tidy"]


def test_an_interrupt_ends_a_simulated_suite_too() -> None:
    interrupt = Interrupt()
    seen: list[StepResult] = []

    def show(step: StepResult) -> None:
        seen.append(step)
        if len(seen) == 5:
            interrupt.request()

    endless = HEAD + "steps:\n  - repeat: 100000\n    steps:\n      - wait: 1 ms\nteardown:\n  - send: Halt Lift\n"
    result = run_simulated(suite(endless), RunOptions(interrupt=interrupt, show=show), plant.PLUGINS.under_test)
    assert [step.status for step in result.steps[-2:]] == [Status.INTERRUPTED, Status.PASSED]
    assert result.count(Status.PASSED) < 10


SENT = document("- send: Halt Lift\n- never: Move Confirm\n  for: 10 ms", HEAD + "timeout: 100 ms\n")


def test_a_suite_that_only_sends_is_red_without_the_device(open_bus: Callable[[], can.BusABC]) -> None:
    *others, heard = run(SENT, open_bus).steps
    assert [each.status for each in others] == [Status.PASSED, Status.PASSED]
    assert (heard.name, heard.status) == ("the node under test is on the bus", Status.FAILED)
    assert heard.reason is not None
    assert heard.reason.what.startswith("no frame of lift since the suite began, and no answer to an SDO request")


@pytest.mark.usefixtures("lift")
def test_a_suite_that_only_sends_is_green_with_a_device_that_says_nothing(open_bus: Callable[[], can.BusABC]) -> None:
    assert [each.status for each in run(SENT, open_bus).steps] == [Status.PASSED, Status.PASSED]


@pytest.mark.usefixtures("lift")
def test_a_red_step_names_another_client_of_the_node(open_bus: Callable[[], can.BusABC]) -> None:
    wrong = document("- {name: begun, wait: 1 ms}\n- sdo: {read: 0x1017, expect: 7}")
    with open_bus() as other:

        def ask(step: StepResult) -> None:
            if step.name == "begun":
                data = bytes.fromhex("40 17 10 00 00 00 00 00")
                other.send(can.Message(arbitration_id=0x602, data=data, is_extended_id=False))

        alone = run(wrong, open_bus)
        disturbed = run_live(suite(wrong), RunOptions(show=ask), open_bus)
    said = "another client speaks to lift (1 frame since the suite began, the last one 602#4017100000000000)"
    assert alone.remarks == ()
    assert [each.partition(":")[0] for each in disturbed.remarks] == [said]
    reason = disturbed.steps[1].reason
    assert reason is not None
    assert reason.meanwhile.startswith(said)
