"""A match around a strategy: the referee starts up the nodes, lets the strategy play, and brings it to its end.

The referee has neither bus nor clock, so that the same coroutine runs in simulated and in real time. A team's strategy
is a Python file with a coroutine function `play(core)`; whatever is wrong with it before a match begins is one line
with the place in its file.
"""

from __future__ import annotations

import asyncio
import os
import re
import threading
import traceback
from collections.abc import Callable, Coroutine, Generator
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from functools import partial
from inspect import iscoroutinefunction, signature
from math import ceil, inf
from pathlib import Path
from threading import get_ident
from typing import Any, NamedTuple, TypeAlias, cast

from eurobot_od.bus.live.event_loop import Hang, Terminated, caller, exited
from eurobot_od.device.timers import Call
from eurobot_od.errors import LocalError, NoAnswer, ProgramFailed, RemoteError, StateError
from eurobot_od.pdo.kinds import plain
from eurobot_od.robot.match import strategy as shipped
from eurobot_od.robot.model.messages import DIAMETERS, GotoXY, KalmanPositionResponse
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose, turn
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.world.world import REACH, REACH_ANGLE, EventKind, Timeline
from eurobot_od.support import extras
from eurobot_od.support.texts import amount, parameters

AHEAD = " ahead"
"""How the core ends the reason of a stop for something that its distance sensor saw."""


class Observer:
    """Watches a core's gotos and tasks, and changes nothing; `truth` gives the true pose of its robot.

    `errors` are the distances between the believed and the true position at each arrival, mm.
    """

    def __init__(self, core: Core, timeline: Timeline, truth: Callable[[], Pose]) -> None:
        self.errors: list[float] = []
        self._core = core
        self._timeline = timeline
        self._truth = truth
        core.observe = self._began
        core.told.append(partial(timeline.tell, EventKind.SAID))

    def _began(self, what: GotoXY | str, call: Call[Any]) -> None:
        begin = self._timeline.clock()
        # `caller` is looked up now: when the call ends, the strategy's line is no longer on the stack.
        call.add_done_callback(partial(self._ask_for, "act" if isinstance(what, str) else "goto", caller()))
        if isinstance(what, str):
            call.add_done_callback(partial(self._did, what))
            return
        place = f"({what.x}, {what.y}) {what.angle} deg, {what.speed} %"
        goto = plain(what) | {"barriers": self._core.facts.words(what.barriers)}
        self._timeline.tell(EventKind.GOTO, place, goto=goto)
        call.add_done_callback(partial(self._ended, begin))

    def _ask_for(self, name: str, where: str, call: Call[Any]) -> None:
        """Warn of a call that has ended without anybody awaiting it."""
        if not call.is_wanted:
            self._timeline.tell(
                EventKind.WARNING, f"{where}: nobody awaits this {name}; write `await core.{name}(...)`"
            )

    def _did(self, task: str, call: Future[int]) -> None:
        if not call.cancelled() and call.exception() is None:
            gain = call.result()
            text = str(gain) if gain else f"nothing{self._away_from(task)}"
            self._timeline.tell(EventKind.TASK, f"{task}: {text}", task=task, gain=gain)

    def _away_from(self, task: str) -> str:
        """Return a phrase with a task's place if the robot is too far from it to do it; empty if it is there."""
        start = self._core.configuration
        here = self._truth()
        there = self._core.facts.tasks(start.team_colour)[task].pose if start else here
        # Of an unknown place, which has NaN, nothing is said.
        if here.distance(there.point) > REACH or abs(turn(here.angle, there.angle)) > REACH_ANGLE:
            return "; its place is ({}, {}) {} deg, the robot is at ({:.0f}, {:.0f}) {:.0f} deg".format(*there, *here)
        return ""

    def _ended(self, begin: float, call: Future[GotoReport]) -> None:
        try:
            report = call.result()
        except CancelledError:
            self._tell_end("cancelled", "", self._timeline.clock() - begin)
        except Exception as error:  # the strategy gets it, too: it may know what to do
            self._tell_end("failed", str(error), self._timeline.clock() - begin)
        else:
            if report.outcome is Outcome.ARRIVED:
                self._tell_arrival(report)
                return
            # The core stopped by itself: the strategy made no call that could be observed.
            if report.why.endswith(AHEAD):
                self._timeline.tell(EventKind.STOP, f"emergency stop: {report.why}", obstacle=report.why[: -len(AHEAD)])
            self._tell_end(report.outcome.value, report.why, report.ended)

    def _tell_end(self, outcome: str, why: str, seconds: float) -> None:
        text = f"{outcome} after {seconds:.2f} s" + (f": {why}" if why else "")
        self._timeline.tell(EventKind.GIVEN_UP, text, outcome=outcome, why=why or None, seconds=seconds)

    def _tell_arrival(self, report: GotoReport) -> None:
        # Where it believes it is, not where it was sent: the distance from the truth is then the filter's error alone.
        place = self._core.positions[KalmanPositionResponse].position
        truth = self._truth()
        goto = report.goto
        seconds = report.ended
        error = truth.distance(Point(place.x or 0, place.y or 0))
        self.errors.append(error)
        off = {"error": round(error, 1), "distance": round(truth.distance(Point(goto.x, goto.y)), 1)}
        details = f"confirmed after {(report.confirmed or 0) * 1000:.1f} ms, position error {error:.0f} mm"
        if report.deviation is not None and report.deviation > self._core.arrival_distance:
            details += f", place known to {report.deviation} mm only"
        text = f"after {seconds:.2f} s ({details})"
        told = off | {"confirmed": report.confirmed, "deviation": report.deviation}
        self._timeline.tell(EventKind.ARRIVED, text, seconds=seconds, **told)


# The referee


Strategy: TypeAlias = Callable[[Core], Coroutine[Any, Any, Any]]
"""A team's program: a coroutine that awaits the core's calls. It starts with the match, and is cancelled at its end."""

LOOKS = 0.05
"""Time between two checks whether the match is over, in s."""

MOMENT = 0.001
"""The shortest wait in seconds: without it, no time would pass for a core whose match is just about to end."""

FIRST_POSITION = 5.0
"""Seconds within which the first position should have come: the polling's start delay, and several periods."""

UNENDED = 0.5
"""Longest time by which a core may end the match late, in s."""

SETTLED = 1.0
"""Time after a stop within which the robot stands still, in s."""

SEEN_TO_STAND = 0.5
"""Time for which a robot that stands is watched, in s."""

LAST_LINES = 5
"""Lines of a strategy's traceback that are shown: what it raised, and the two lines that led there."""

PACKAGE = Path(__file__).resolve().parents[2]
"""The folder of this package: calls inside it mean nothing to the team."""

PYTHON = Path(os.__file__).resolve().parent
"""The folder of Python's own modules, and of those that are installed."""

CARETS = " ~^"
"""The characters with which Python 3.11 and later underline the place in a line."""

PLACE = re.compile(r'^  File "(.+)", line ([0-9]+)', re.MULTILINE)
"""File and line of a call in a traceback."""


UNEXPECTED = re.compile(r"^Core\.(\w+)\(\) got an unexpected keyword argument")
"""What Python says of a parameter that a method of Core does not have."""


def is_foreign(file: str) -> bool:
    """Return whether a file is a team's own."""
    return not file.startswith("<") and not {PACKAGE, PYTHON} & {*Path(file).resolve().parents}


def _last_lines(error: BaseException) -> str:
    """Return the end of a traceback, without calls in this package or generated code, unless there are no others."""
    told = traceback.TracebackException.from_exception(error)
    foreign = [frame for frame in told.stack if frame.line and is_foreign(frame.filename)]
    told.stack = traceback.StackSummary.from_list(foreign or told.stack)
    lines = "".join(told.format()).strip().splitlines()
    if isinstance(error, TypeError) and (wrong := UNEXPECTED.match(str(error))):
        lines[-1] += f"; write {wrong[1]}{parameters(getattr(Core, wrong[1]), 1)}"
    return "\n".join([line for line in lines if line.strip(CARETS)][-LAST_LINES:])


def in_one_line(failure: str) -> str:
    """Return how a match failed: the given words, or the exception and the last place of its traceback."""
    places = PLACE.findall(failure)
    after = failure.rpartition("\n    ")[2].splitlines()
    end = " ".join(after[bool(places) :])  # without the line of the program that stands there
    told = end if end.startswith("the ") else f"the strategy raised {end}"
    return told + (" ({}:{})".format(*places[-1]) if places else "")


async def _played(strategy: Strategy, core: Core) -> None:
    """Run a strategy; raises ProgramFailed if it tries to end the whole program."""
    try:
        await strategy(core)
    except Terminated:
        raise
    except SystemExit as end:
        raise ProgramFailed(exited(end)).with_traceback(end.__traceback__) from None


class StrategyTask(asyncio.Task[Any]):
    """A task of a strategy, which knows whether anybody has asked how it ended."""

    is_asked = False

    def __await__(self) -> Generator[Any, None, Any]:
        self.is_asked = True
        return super().__await__()

    def result(self) -> Any:
        """Return the result; raises what the task raised."""
        self.is_asked = True
        return super().result()

    def exception(self) -> BaseException | None:
        """Return what the task raised."""
        self.is_asked = True
        return super().exception()


class Elsewhere:
    """Where a strategy fails besides its coroutine: in a task that nobody awaits, in a thread, by `os._exit`.

    A context manager; `errors` are what was raised in the block while `counts` said so. Of a task that may still be
    awaited the error is among them from `end` on.
    """

    def __init__(self, counts: Callable[[], bool]) -> None:
        self.errors: list[BaseException] = []
        self._counts = counts
        self._failed: list[StrategyTask] = []
        self._process = os.getpid()

    def __enter__(self) -> Elsewhere:
        self._loop = asyncio.get_running_loop()
        self._before = self._loop.get_exception_handler(), threading.excepthook, os._exit
        self._loop.set_exception_handler(self._in_task)
        self._loop.set_task_factory(self._task)
        threading.excepthook = self._in_thread
        os._exit = self._at_exit  # type: ignore[assignment]
        return self

    def __exit__(self, *_: object) -> None:
        handler, threading.excepthook, os._exit = self._before
        self._loop.set_exception_handler(handler)
        self._loop.set_task_factory(None)

    def end(self) -> None:
        """Take it that nobody will await a task any more."""
        self.errors += [error for each in self._failed if not each.is_asked and (error := each.exception())]

    def _task(self, loop: asyncio.AbstractEventLoop, coroutine: Any, **options: Any) -> StrategyTask:
        task = StrategyTask(coroutine, loop=loop, **options)
        task.add_done_callback(self._task_ended)
        return task

    def _task_ended(self, task: Any) -> None:
        if self._counts() and not task.cancelled():
            self._failed.append(task)

    def _in_task(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if isinstance(context.get("future"), asyncio.Task) and error is not None and self._counts():
            self.errors.append(error)
        else:
            loop.default_exception_handler(context)

    def _in_thread(self, raised: threading.ExceptHookArgs) -> None:
        if raised.exc_value is not None and self._counts():
            self.errors.append(raised.exc_value)
        else:
            self._before[1](raised)

    def _at_exit(self, status: int) -> None:
        if os.getpid() != self._process:  # a process that it has forked has to end so
            self._before[2](status)
        raise ProgramFailed(f"os._exit({status}) ends the whole program: write `return`")


class Referee:
    """A match that a strategy plays with `core`; what happens goes into `timeline`.

    `truth` gives the true pose of the robot. `failure` has the last lines of the traceback if the strategy raised.
    Raises LocalError for an emergency outside the match.
    """

    def __init__(self, core: Core, options: MatchOptions, timeline: Timeline, truth: Callable[[], Pose]) -> None:
        self.core = core
        self.options = options
        self.timeline = timeline
        self.clock = timeline.clock
        self._truth = truth
        self.failure: str | None = None
        self._duration = options.duration or float(core.match_duration)
        if options.emergency_at is not None and options.emergency_at >= self._duration:
            text = f"an emergency at {options.emergency_at:g} s is not within the match of {self._duration:g} s"
            raise LocalError(text)
        self._end = inf
        self._over = False
        self._elsewhere = Elsewhere(lambda: not self.core.match_over)  # afterwards every call of the core's is refused

    async def play(self, strategy: Strategy) -> None:
        """Play the match from the node checks to its end; raises NoAnswer if a node does not answer."""
        await self._start_up()
        with self._elsewhere:
            await self._let_play(strategy)
        await self._stand_still()

    async def _start_up(self) -> None:
        """Bring the nodes to the start of a match (document 5.1), or go on with one that is under way.

        Raises NoAnswer, StateError.
        """
        memory = None
        with suppress(NoAnswer):  # a drive that is not there yet remembers nothing
            memory = await self.core.recall()
        if memory is not None and memory.time_left:
            await self._go_on()
        else:
            await self._begin()

    async def _go_on(self) -> None:
        """Go on with a match that a core has begun which has ended since; the drive remembers it."""
        seen = await self.core.recover()
        self._duration = self.core.time_left
        what = f"a match is under way, {self._duration:.1f} s are left: configuration and place are the drive's"
        self.timeline.tell(EventKind.CONFIGURE, what, left=self._duration)
        self.timeline.tell(EventKind.POSITION, f"({seen.x}, {seen.y}) {seen.angle} deg", position=seen[:3])

    async def _begin(self) -> None:
        """Check the nodes, configure the start, and wait for the robot's place (document 5.1); raises NoAnswer."""
        answered = await self.core.check_nodes()
        answers = ", ".join(f"{node} answered after {seconds * 1000:.1f} ms" for node, seconds in answered.items())
        self.timeline.tell(EventKind.CHECK, answers, seconds=answered)
        options = self.options
        enemies = (self.core.facts.others[each] for each in DIAMETERS)
        # The diameter in cm for a radius in mm, rounded up: strategies keep clear of it.
        diameters = [ceil(each.radius / 5) * (number < options.enemies) for number, each in enumerate(enemies)]  # cm
        took = await self.core.configure_start(options.team, options.enemies, options.confederates, *diameters)
        others = f"{amount(options.enemies, 'enemy', 'enemies')}, {amount(options.confederates, 'confederate')}"
        what = f"{options.team.name.lower()}, {others}"
        self.timeline.tell(EventKind.CONFIGURE, f"{what}: confirmed after {took * 1000:.1f} ms", seconds=took)
        patience = self.clock() + FIRST_POSITION
        while KalmanPositionResponse not in self.core.positions:
            await asyncio.sleep(LOOKS)
            # The first answers of the polling may have been lost, and a strategy needs a place to start from.
            if self.clock() > patience:
                await self.core.position()
        seen = self.core.positions[KalmanPositionResponse].position
        self.timeline.tell(EventKind.POSITION, f"({seen.x}, {seen.y}) {seen.angle} deg", position=seen[:3])

    # Match (document 5.2)

    async def _let_play(self, strategy: Strategy) -> None:
        """Start the match, and let the strategy play until it is over."""
        start = self.clock()
        self._end = start + self._duration
        mushroom = inf if self.options.emergency_at is None else start + self.options.emergency_at
        self.timeline.tell(EventKind.MATCH, f"begins, {self._duration:g} s long", duration=self._duration)
        self.core.start_match(self._duration)
        loop = asyncio.get_running_loop()
        playing = asyncio.ensure_future(_played(strategy, self.core))
        here = get_ident()

        def end() -> None:
            if get_ident() == here:  # at once: the goto has just ended, and a strategy must not go on with its report
                playing.cancel()
            else:  # a live bus's thread, and only its loop's own thread may cancel a task
                loop.call_soon_threadsafe(playing.cancel)

        self.core.at_match_end = end
        try:
            while not (self._over or self.core.match_over):
                left = min(mushroom, self._end) - self.clock()
                await asyncio.sleep(min(max(left, MOMENT), LOOKS))
                if self.clock() >= mushroom:
                    mushroom = inf
                    self._over = True
                    self.core.emergency_shutdown()
                    self.timeline.tell(EventKind.EMERGENCY, "emergency shutdown: the mushroom was hit")
                await self._look_at(playing)
                if self.clock() >= self._end + UNENDED:
                    await self._give_up("the core does not end the match")
        finally:
            self.core.at_match_end = lambda: None
            await self._end_strategy(playing)

    async def _look_at(self, playing: asyncio.Future[Any]) -> None:
        """If the strategy has raised, stop the robot and keep what a team needs to find the cause."""
        has_ended = playing.done() and not playing.cancelled()
        error = next(iter(self._elsewhere.errors), None) or (playing.exception() if has_ended else None)
        if error is None or self.failure:
            return
        await self._give_up(f"the strategy hangs: {error}" if isinstance(error, Hang) else _last_lines(error))

    async def _give_up(self, failure: str) -> None:
        """End the match because of a failure, told in words or as the end of a traceback."""
        self._over = True
        self.failure = failure
        self.timeline.tell(EventKind.FAILED, in_one_line(failure))
        try:
            await self.core.stop()
        except (RemoteError, StateError) as unseen:
            self.timeline.tell(EventKind.FAILED, str(unseen))

    async def _end_strategy(self, playing: asyncio.Future[Any]) -> None:
        """Cancel a strategy that is still running, and let it clean up."""
        # It gets a moment for its `finally`; one that swallows the cancellation is reported, and not awaited.
        if playing.cancel():
            await asyncio.wait([playing], timeout=SETTLED)
        self._elsewhere.end()
        await self._look_at(playing)
        if not playing.done():
            self.failure = "the strategy goes on after the match: it swallows asyncio.CancelledError"
            self.timeline.tell(EventKind.FAILED, self.failure)
        if self.core.match_over:
            self.timeline.tell(EventKind.STOP, "stop drive: the match is over")

    async def _stand_still(self) -> None:
        """Stop the robot, wait for the end of the match, and report whether anything moved meanwhile."""
        # A strategy that failed was already stopped and seen to stand, and nothing else will follow.
        settled, left = (SEEN_TO_STAND, 0.0) if self.failure else (SETTLED, self._end + LOOKS - self.clock())
        await asyncio.sleep(settled)
        told = self.core.match_over or bool(self.failure)
        rest = self._truth()
        await asyncio.sleep(max(left - settled, 0.0))
        if not told:
            self.timeline.tell(EventKind.STOP, "stop drive: the match is over")
        now = self._truth()
        moved = now.distance(rest.point)
        text = f"the robot stands at ({now.x:.0f}, {now.y:.0f}); since it stopped it moved {moved:.0f} mm"
        self.timeline.tell(EventKind.END, text, x=round(now.x, 1), y=round(now.y, 1), moved=round(moved, 3))


# Strategies from a team's files


class Players(NamedTuple):
    """Who plays: our strategy, and that of the second robot, None if there is none."""

    ours: Strategy = shipped.play
    against: Strategy | None = None


class StrategyFiles(NamedTuple):
    """The files of strategies: ours, None for the shipped one; the second robot's, None if there is no such robot."""

    ours: Path | None = None
    against: Path | None = None

    def load(self) -> Players:
        """Load them; raises LocalError."""
        return Players(
            load_strategy(self.ours) if self.ours else shipped.play,
            load_strategy(self.against) if self.against else None,
        )


def load_strategy(file: Path) -> Strategy:
    """Return the `play` of a Python file, which may import modules beside it.

    What the file prints while it is loaded goes to standard error. Raises LocalError with the line of the file if it
    cannot be read, is not Python, raises, or has no coroutine function `play` that takes the core.
    """
    if file.is_dir():
        raise LocalError(f"{file} is a folder: name a Python file in it, such as {file / 'strategy.py'}")
    if file.suffix not in ("", ".py"):
        raise LocalError(f"{file}: a strategy is a Python file, such as {file.stem}.py")
    play = getattr(extras.load(file), "play", None)
    if play is None:
        raise LocalError(f"{file}: no `play` in it; write `async def play(core)`")
    code = getattr(play, "__code__", None)
    where = f"{code.co_filename}:{code.co_firstlineno}" if code else str(file)
    if not iscoroutinefunction(play):
        raise LocalError(f"{where}: `play` is not a coroutine function; write `async def play(core)`")
    try:
        # Tried here: in the match, the TypeError would name a line of ours.
        signature(play).bind(None)
    except TypeError as error:
        raise LocalError(f"{where}: `play` is called with the core and nothing else: {error}") from None
    return cast(Strategy, play)
