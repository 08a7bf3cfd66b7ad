"""`with Robot` on an in-process bus, in real time: however the block is left, the robot stands."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

from eurobot_od.bus.live import FrameReader, Live
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.facade import Robot
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    EmergencyStop,
    GotoXY,
    StopDrive,
)
from eurobot_od.robot.model.values import Obstacle, Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.nodes.core.flows import GotoReport, NotStanding
from eurobot_od.robot.nodes.node import Detection
from tests.bus.live.loose import LONG, until
from tests.client.peers import new_channel, open_bus
from tests.kit.bench import put
from tests.robot.nodes.harness import PROTOCOL, as_if_started

FAR = GotoXY(2700, 1700, 0, 50)


class Partners:
    """A drive and a navigation on a bus of their own, and every goto and stop that was on it."""

    def __init__(self, *, present: bool = True) -> None:
        self.channel = new_channel()
        self.drive = Drive(dialects.load("drive"))
        self.navigation = Navigation(dialects.load("navigation"))
        self.present = present
        self.commands: list[Message] = []
        self._cob_ids = {PROTOCOL.cob_id(each) for each in (GotoXY, StopDrive, EmergencyStop, EmergencyShutdown)}

    def _seen(self, _: float, frame: Frame) -> None:
        if frame.cob_id in self._cob_ids:
            self.commands.append(PROTOCOL.decode(*frame))

    @contextmanager
    def running(self) -> Iterator[Partners]:
        with ExitStack() as stack:
            stack.enter_context(FrameReader(open_bus(self.channel), self._seen, time.monotonic))
            nodes = (self.drive, self.navigation) if self.present else ()
            for node in nodes:
                stack.enter_context(Live.node(open_bus(self.channel), node))
            yield self


@pytest.fixture
def partners() -> Iterator[Partners]:
    with Partners().running() as running:
        yield running


@pytest.fixture
def nobody() -> Iterator[Partners]:
    """A bus on which nobody answers."""
    with Partners(present=False).running() as running:
        yield running


def robot_on(partners: Partners) -> Robot:
    return Robot("virtual", partners.channel)


def impatient(partners: Partners) -> Robot:
    """Return a robot that soon gives up an answer and a stop, on whose bus nobody answers."""
    robot = robot_on(partners)
    put(robot.core, "Goto handshake.Confirm wait", 20)
    put(robot.core, "Standstill.Standstill wait", 200)
    return robot


def drive_off(robot: Robot, partners: Partners) -> None:
    """Begin with a goto, and go on when the drive carries it out."""
    robot.configure_start(TeamColour.RED)
    robot.core.goto(*FAR)
    until(lambda: partners.drive.goto is not None)  # a drive that is configured brakes, and so moves as well


def by_its_end(_: Robot) -> None:
    pass


def by_an_exception(_: Robot) -> None:
    raise ZeroDivisionError


def by_ctrl_c(_: Robot) -> None:
    raise KeyboardInterrupt


def by_sys_exit(_: Robot) -> None:
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("leave", "error"),
    [
        (by_its_end, None),
        (by_an_exception, ZeroDivisionError),
        (by_ctrl_c, KeyboardInterrupt),
        (by_sys_exit, SystemExit),
    ],
)
def test_the_robot_stands_however_the_block_ends(
    partners: Partners, leave: Callable[[Robot], None], error: type[BaseException] | None
) -> None:
    def play() -> None:
        with robot_on(partners) as robot:
            drive_off(robot, partners)
            leave(robot)

    if error is None:
        play()
    else:
        with pytest.raises(error):
            play()
    assert not partners.drive.moving
    assert partners.commands[0] == FAR
    assert set(partners.commands[1:]) == {StopDrive()}


def press_ctrl_c() -> None:
    ident = threading.main_thread().ident
    assert ident is not None
    signal.pthread_kill(ident, signal.SIGINT)


@pytest.mark.posix
def test_ctrl_c_while_a_goto_is_waited_for(partners: Partners) -> None:
    reports: list[GotoReport] = []

    def play() -> None:
        with robot_on(partners) as robot:
            robot.configure_start(TeamColour.RED)
            threading.Timer(0.2, press_ctrl_c).start()
            reports.append(robot.goto(*FAR))

    with pytest.raises(KeyboardInterrupt):
        play()
    assert not reports
    assert not partners.drive.moving
    assert partners.commands[-1] == StopDrive()


def test_a_robot_that_never_drove_is_not_stopped(partners: Partners) -> None:
    with robot_on(partners) as robot:
        robot.check_nodes()
        robot.configure_start(TeamColour.RED)
        robot.position()
    assert partners.commands == []


def test_a_drive_that_does_not_answer_is_an_error(nobody: Partners) -> None:
    robot = impatient(nobody)

    def play() -> None:
        with robot:
            as_if_started(robot.core)
            robot.core.goto(*FAR)
            until(lambda: FAR in nobody.commands)

    with pytest.raises(NotStanding, match=r"was not seen to stand within 0\.2 s"):
        play()
    until(lambda: nobody.commands[-1] == EmergencyShutdown())
    ours = str(robot.live.bus.channel_info)
    left = {thread.name.removeprefix(ours) for thread in threading.enumerate() if thread.name.startswith(ours)}
    assert left == {" watch"}  # the test's own


def test_the_error_that_has_ended_the_block_is_in_the_context_of_a_robot_that_does_not_stand(nobody: Partners) -> None:
    def play() -> None:
        with impatient(nobody) as robot:
            as_if_started(robot.core)
            robot.core.goto(*FAR)
            raise ZeroDivisionError

    with pytest.raises(NotStanding) as not_standing:
        play()
    assert isinstance(not_standing.value.__context__, ZeroDivisionError)


def test_a_thread_that_goes_on_driving_cannot_move_a_robot_that_is_left(partners: Partners) -> None:
    refused: list[StateError] = []

    def drive_on(robot: Robot) -> None:
        try:
            while True:
                robot.goto(*FAR)
        except StateError as error:
            refused.append(error)

    with robot_on(partners) as robot:
        robot.configure_start(TeamColour.RED)
        thread = threading.Thread(target=drive_on, args=(robot,))
        thread.start()
        until(lambda: partners.drive.goto is not None)
    thread.join(LONG)
    assert [str(each) for each in refused] == ["the core is being switched off"]
    assert not partners.drive.moving
    assert partners.commands[-1] == StopDrive()


def test_calls_that_are_pending_when_the_robot_is_left_end(nobody: Partners) -> None:
    with robot_on(nobody) as robot:
        pending: list[Future[Any]] = [
            robot.core.check_nodes(),
            robot.core.position(),
            robot.core.configure_start(TeamColour.RED),
        ]
    pending += [robot.core.position(), robot.core.stop(), robot.core.check_nodes()]  # too late
    for call in pending:
        assert isinstance(call.exception(LONG), StateError)
    with pytest.raises(StateError):
        robot.core.goto(*FAR)


def test_a_core_that_was_left_may_be_switched_on_again(partners: Partners) -> None:
    core = Core(dialects.load("core"))
    for _ in range(2):
        with Live.node(open_bus(partners.channel), core):
            assert set(core.check_nodes().result(LONG)) == {"drive", "navigation"}


def test_the_robot_stands_after_a_goto_s_timeout(partners: Partners) -> None:
    with robot_on(partners) as robot:
        robot.configure_start(TeamColour.RED)
        report = robot.goto(*FAR, timeout=0.2)
        assert report.outcome is Outcome.TIMED_OUT
        until(lambda: not partners.drive.moving)


def test_the_end_of_the_match_ends_the_strategy_and_the_robot_stands(partners: Partners) -> None:
    ends: list[Outcome] = []

    async def play(core: Core) -> None:
        while True:
            ends.append((await core.goto(*FAR[:4])).outcome)

    with robot_on(partners) as robot:
        robot.check_nodes()
        robot.configure_start(TeamColour.RED)
        robot.start_match(0.3)
        robot.play(play)
        assert robot.core.match_over
    # The bus's thread ends the goto and cancels the strategy, which may see the first before the second.
    assert ends in ([], [Outcome.STOPPED])
    assert partners.commands[-1] == StopDrive()


def test_an_error_of_a_strategy_has_no_other_error_before_it(partners: Partners) -> None:
    async def play(core: Core) -> None:
        assert core.configuration is not None, "not configured"

    with robot_on(partners) as robot, pytest.raises(AssertionError) as caught:
        robot.play(play)
    assert caught.value.__context__ is None


def test_a_strategy_that_fails_leaves_a_robot_that_stands(partners: Partners) -> None:
    async def strategy(core: Core) -> None:
        await core.configure_start(TeamColour.RED)
        core.goto(*FAR)
        await core.position()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), robot_on(partners) as robot:
        robot.play(strategy)
    assert not partners.drive.moving
    assert partners.commands[-1] == StopDrive()


def test_a_goto_without_confirm_has_no_answer(nobody: Partners) -> None:
    def play() -> None:
        with impatient(nobody) as robot:
            as_if_started(robot.core)
            robot.goto(*FAR)

    with pytest.raises(NotStanding) as not_standing:
        play()
    assert isinstance(not_standing.value.__context__, NoAnswer)


class Equipment:
    """A distance sensor that sees an enemy, and an arm that turns over two fires at once."""

    def look(self, _now: float) -> Detection:
        return Detection(Obstacle.ENEMY, 321.0, -4.0)

    def begin(self, _task: str) -> float:
        return 0.01

    def finish(self, _task: str) -> int:
        return 2


def test_sensor_and_actuators_are_reached_by_calls() -> None:
    equipment = Equipment()
    with Robot("virtual", new_channel(), sensor=equipment, actuators=equipment) as robot:
        assert robot.obstacle() == Detection(Obstacle.ENEMY, 321.0, -4.0)
        assert robot.act("fire 1") == 2


def test_a_robot_without_a_sensor_sees_nothing() -> None:
    with Robot("virtual", new_channel()) as robot:
        assert robot.obstacle() is None
