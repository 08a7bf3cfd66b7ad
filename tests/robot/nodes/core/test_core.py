"""The core's calls: what it sends and hears for a caller, from any thread, and what a reset makes of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack, suppress
from random import Random
from typing import Any

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import (
    Obstacle,
    Source,
)
from eurobot_od.robot.nodes import ROLES, Core, Drive
from tests.client.peers import new_channel, open_bus
from tests.robot.nodes.driving import (
    GOTO,
)
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench, as_if_started

# Calls from several threads


class Interleaved(AbstractContextManager[None]):
    """A guard that another thread gets just before a call takes it, or just after the call has let it go, once."""

    def __init__(self, core: Core, before: Callable[[Core], object], after: Callable[[Core], object]) -> None:
        self.core = core
        self.depth = 0
        self.before, self.after = before, after
        core.guard = self

    def __enter__(self) -> None:
        if self.depth == 0:
            before, self.before = self.before, no_call
            before(self.core)
        self.depth += 1

    def __exit__(self, *_: object) -> None:
        self.depth -= 1
        if self.depth == 0:
            after, self.after = self.after, no_call
            after(self.core)


def no_call(_: Core) -> None:
    """Do nothing."""


def stopped_by_a_master(core: Core) -> None:
    core.receive(Frame(NMT_COB_ID, bytes([NmtCommand.STOP, 0])), core.now)


@pytest.mark.parametrize(
    ("call", "meanwhile"),
    [
        (lambda core: core.goto(*GOTO), Core.emergency_shutdown),
        (lambda core: core.goto(*GOTO), stopped_by_a_master),
        (lambda core: core.configure_start(*RED), stopped_by_a_master),
    ],
)
def test_a_call_sees_what_another_thread_did_just_before_it(
    alone: Bench, call: Callable[[Core], object], meanwhile: Callable[[Core], object]
) -> None:
    alone.configure()
    before = len(alone.messages())
    Interleaved(alone.core, before=meanwhile, after=no_call)
    with pytest.raises(StateError):
        call(alone.core)
    alone.run(1.0)
    assert not {type(message) for message in alone.messages()[before:]} & {GotoXY, StartConfigurationSet}


def test_a_confirm_that_comes_right_after_a_shutdown_does_not_end_it(alone: Bench) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(0.1)
    confirm = PROTOCOL.encode(StartConfigurationConfirm())
    Interleaved(alone.core, before=no_call, after=lambda core: core.receive(confirm, core.now))
    alone.core.emergency_shutdown()
    assert alone.core.shut_down
    assert isinstance(call.exception(0), StateError)


@pytest.mark.parametrize(
    "call",
    [
        Core.check_nodes,
        lambda core: core.configure_start(*RED),
        lambda core: core.goto(*GOTO),
        Core.position,
    ],
)
@pytest.mark.parametrize("running", [0.0, 0.1])
def test_an_nmt_reset_ends_every_call(call: Callable[[Core], Future[Any]], running: float) -> None:
    bench = Bench("drive", "navigation")
    as_if_started(bench.core)
    future = call(bench.core)
    bench.run(running)
    bench.command("drive", NmtCommand.RESET_NODE, bench.core.device.node_id)
    assert isinstance(future.exception(0), StateError)
    asked = len(bench.log)
    bench.run(1.0)
    assert not {type(each) for each in bench.messages()[asked:]} & {CheckDriveRequest, GotoXY, StartConfigurationSet}


def test_an_nmt_reset_forgets_configuration_and_positions(alone: Bench) -> None:
    alone.configure()
    alone.say("drive", KalmanPositionResponse(1, 2, 3, Source.INTERNAL))
    alone.core.emergency_shutdown()
    alone.command("drive", NmtCommand.RESET_NODE)
    assert (alone.core.configuration, alone.core.positions, alone.core.shut_down) == (None, {}, False)


WATCHED = [GOTO, RED, StopDrive(), EmergencyStop(Obstacle.ENEMY), EmergencyShutdown()]


@pytest.mark.parametrize("message", WATCHED, ids=lambda message: type(message).__name__)
def test_a_message_whose_result_a_call_watches_cannot_be_sent_alone(alone: Bench, message: Message) -> None:
    with pytest.raises(StateError, match=r"is sent by core\.\w+\(\), which watches its result"):
        alone.core.send(message)
    with pytest.raises(StateError, match="is sent by core"):
        alone.core.ask(message, GotoConfirm)
    alone.run(0.1)
    assert alone.messages() == []


def test_any_other_message_is_sent_asked_for_and_told(alone: Bench) -> None:
    told: list[Message] = []
    end = alone.core.on(GotoStateResponse, told.append)
    call = alone.core.ask(GotoStateRequest(), GotoStateResponse)
    alone.run(0.01)
    alone.say("drive", GotoStateResponse(5))
    assert (call.result(0), told) == (GotoStateResponse(5), [GotoStateResponse(5)])
    end()
    alone.core.send(GotoStateRequest())
    alone.say("drive", GotoStateResponse(6))
    assert (alone.sent(GotoStateRequest), told) == ([GotoStateRequest()] * 2, [GotoStateResponse(5)])


def test_the_next_message_as_wanted_is_waited_for(alone: Bench) -> None:
    next_one = alone.core.hear(GotoStateResponse)
    wanted = alone.core.hear(GotoStateResponse, lambda each: each.time == 7, timeout=1.0)
    for remaining in (5, 6, 7):
        alone.run(0.3)
        alone.say("drive", GotoStateResponse(remaining))
    assert (next_one.result(0), wanted.result(0)) == (GotoStateResponse(5), GotoStateResponse(7))
    assert {type(each) for each in alone.messages()} == {GotoStateResponse}


@pytest.mark.parametrize(
    ("where", "error", "text"),
    [
        (None, NoAnswer, "no GotoStateResponse within 500 ms"),
        (lambda each: each.time == 7, NoAnswer, "no GotoStateResponse as wanted within 500 ms"),
        (lambda each: each.place, AttributeError, "'GotoStateResponse' object has no attribute 'place'"),
    ],
)
def test_a_message_that_does_not_come_as_wanted_is_an_error_of_the_call(
    alone: Bench, where: Callable[[GotoStateResponse], object] | None, error: type[Exception], text: str
) -> None:
    heard = alone.core.hear(GotoStateResponse, where)
    alone.run(0.4)
    if where is not None:
        alone.say("drive", GotoStateResponse(6))
    alone.run(0.2)
    with pytest.raises(error, match=f"^{text}$"):
        heard.result(0)
    assert alone.core.open_calls == 0


def test_waiting_for_a_message_that_the_core_never_receives_is_refused(alone: Bench) -> None:
    with pytest.raises(StateError):
        alone.core.hear(GotoXY)


def test_a_function_that_wants_one_message_takes_it_from_no_other(alone: Bench) -> None:
    told: list[str] = []

    def once(_: Message) -> None:
        told.append("once")
        end()

    end = alone.core.on(GotoStateResponse, once)
    alone.core.on(GotoStateResponse, lambda _: told.append("always"))
    for _ in range(2):
        alone.say("drive", GotoStateResponse(5))
    assert told == ["once", "always", "always"]


def test_an_answer_that_does_not_come_in_time_is_an_error(alone: Bench) -> None:
    call = alone.core.ask(GotoStateRequest(), GotoStateResponse, timeout=0.2)
    alone.run(0.19)
    assert not call.done()
    alone.run(0.02)
    with pytest.raises(NoAnswer, match="no GotoStateResponse within 200 ms after GotoStateRequest"):
        call.result(0)


def test_an_unmapped_message_is_an_error_that_names_the_cores_file(alone: Bench) -> None:
    with pytest.raises(StateError, match=r"core has no TPDO for GotoConfirm; .*core\.eds says what it can send"):
        alone.core.send(GotoConfirm())
    for receive in (lambda: alone.core.ask(GotoStateRequest(), GotoXY), lambda: alone.core.on(GotoXY, print)):
        with pytest.raises(StateError, match=r"core has no RPDO for GotoXY; .*core\.eds says what it can receive"):
            receive()
    alone.run(0.1)
    assert alone.messages() == []


def test_a_call_of_a_core_that_is_off_ends_at_once() -> None:
    """Nobody calls its `tick` any more: it would wait for ever."""
    core = Core(DICTIONARIES["core"])
    core.switched_off()
    for call in (core.position(), core.check_nodes()):
        with pytest.raises(StateError, match="the core is being switched off"):
            call.result(timeout=0)
    assert core.open_calls == 0


# Calls from several threads at once, in real time

ROUNDS = 300
"""How often the calls meet, a millisecond or less apart."""


@pytest.mark.long
def test_a_shutdown_that_races_gotos_always_wins_and_every_call_ends() -> None:
    channel = new_channel()
    calls = list[Future[Any]]()
    core, drive, navigation = (role(DICTIONARIES[name]) for name, role in ROLES.items())
    assert isinstance(core, Core)
    assert isinstance(drive, Drive)
    with ExitStack() as stack:
        for node in (navigation, drive, core):
            stack.enter_context(Live.node(open_bus(channel), node))
        core.device.objects.put(core.device.dictionary.address("Standstill.Stop period"), 5)
        core.configure_start(*RED).result(10)
        end = time.monotonic() + 8.0
        for round_ in range(ROUNDS):
            if time.monotonic() > end:
                break
            _race(core, calls, round_)
            assert core.shut_down
            assert calls[-1].result(5).seconds < 5.0
            assert drive.safe
            assert comes_to_rest(drive)
            core.configure_start(*RED).result(10)
        assert round_ > 20  # on a machine that has much else to do
        last = core.emergency_shutdown()
        last.result(5)
        assert comes_to_rest(drive)
    assert [call for call in calls if not call.done()] == []


def comes_to_rest(drive: Drive) -> bool:
    """Return whether the drive stands soon: in stop periods of 5 ms it may roll the last of its braking unseen."""
    end = time.monotonic() + 1.0
    pause = threading.Event()
    while drive.moving and time.monotonic() < end:
        pause.wait(0.01)
    return not drive.moving


def _race(core: Core, calls: list[Future[Any]], round_: int) -> None:
    """Send gotos from one thread while this one shuts down; the last of `calls` is the shutdown's."""
    begin = threading.Barrier(2)

    def drive_on() -> None:
        begin.wait()
        with suppress(StateError):
            for x in (500, 600, 700):
                calls.append(core.goto(x, 1700, 0, 100))

    thread = threading.Thread(target=drive_on)
    thread.start()
    begin.wait()
    for _ in range(round_ % 50 * 20):  # a moment that is a little longer each time
        pass
    shutdown = core.emergency_shutdown()
    thread.join()
    calls.append(shutdown)


def test_stops_gotos_and_cancels_of_many_threads_end_with_a_robot_that_stands() -> None:
    channel = new_channel()
    calls = list[Future[Any]]()
    core, drive, navigation = (role(DICTIONARIES[name]) for name, role in ROLES.items())
    assert isinstance(core, Core)
    assert isinstance(drive, Drive)
    end = time.monotonic() + 0.7

    def play(seed: int) -> None:
        chance = Random(seed)
        while time.monotonic() < end:
            begin: list[Callable[[], Future[Any]]] = [
                lambda: core.goto(chance.randrange(300, 2700), 1700, 0, 100),
                core.stop,
                core.position,
                lambda: core.emergency_stop(Obstacle.ENEMY),
            ]
            call = chance.choice(begin)()
            calls.append(call)
            if chance.random() < 0.3:
                call.cancel()

    with ExitStack() as stack:
        for node in (navigation, drive, core):
            stack.enter_context(Live.node(open_bus(channel), node))
        core.configure_start(*RED).result(10)
        threads = [threading.Thread(target=play, args=(seed,)) for seed in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not drive.moving
    assert len(calls) > 100
    assert [call for call in calls if not call.done()] == []
