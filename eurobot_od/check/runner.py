"""Runs a suite on a bench: setup, steps, teardown, and a result for each step.

`actions` say what a step does. This module decides which steps are done and what becomes of the others, and always runs
the teardown.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from eurobot_od.check.actions.frames import Never
from eurobot_od.check.actions.nodes import follows_from_own_error
from eurobot_od.check.actions.objects import SdoRead, SdoWrite
from eurobot_od.check.bench import Bench
from eurobot_od.check.report import GOES_ON, Line, Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.check.steps import StepRunner
from eurobot_od.check.suite import Group, NodeServices, Report, Step, StepAction, Suite
from eurobot_od.check.tester import BenchTester, Failed, Gone, Skipped
from eurobot_od.device.nmt import NmtState, command_in, error_control
from eurobot_od.errors import BusError, LocalError, RemoteError
from eurobot_od.od.standard import EMCY
from eurobot_od.od.values import ERROR_CONTROL_BASE, base_identifier
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_places import Place

AFTER_SKIPPED = StepReason("it belongs to a step that is skipped")
"""Why the rest of a group is skipped after a skipped step."""

OWN_ERROR = "the node has an error of its own (0x1001), which is red, and need not be OPERATIONAL with it"
"""Why a step that waits in vain for frames of a node in OPERATIONAL is skipped."""

EMCY_LENGTH = 8
"""Length of an EMCY in bytes (CiA 301, 7.2.7.4)."""

HEARD = "the node under test is on the bus"
"""Name of the step that is red if all others are green although no node under test is there."""

FRAMES_SHOWN = 8
"""Number of last frames on the bus that a failed step shows."""


def _changes_nothing(step: Step) -> bool:
    """Return whether the later steps of a group can go on when this one is red, as it only checks something."""
    action = step.action
    if isinstance(action, SdoRead):
        return action.save is None
    return isinstance(action, Never) or (isinstance(action, SdoWrite) and action.abort is not None)


class Interrupt:
    """Ends a running suite from outside, such as from a signal handler; its current step is cancelled."""

    def __init__(self) -> None:
        self.requested = False
        self._running: tuple[asyncio.AbstractEventLoop, asyncio.Task[None]] | None = None

    def request(self) -> None:
        """Cancel the current step of the running suite, and start no other suite."""
        self.requested = True
        if self._running is not None:
            loop, task = self._running
            # A signal handler or another thread calls this, so the sleeping loop has to be woken.
            loop.call_soon_threadsafe(task.cancel)

    @contextmanager
    def by_ctrl_c(self) -> Iterator[None]:
        """Make the first Ctrl-C or SIGTERM end the current suite with its teardown, a second one the program."""

        def handle(*_: object) -> None:
            # A second signal ends the program: a teardown may wait long for a lost node.
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            self.request()

        before = {each: signal.signal(each, handle) for each in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)

    async def guard(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine to its end or until the interrupt."""
        task = asyncio.ensure_future(work)
        self._running = asyncio.get_running_loop(), task
        if self.requested:  # between two suites, when there was no task to cancel
            task.cancel()
        try:
            await asyncio.wait([task])  # not `await task`: that would raise CancelledError, and skip the teardown
        finally:
            self._running = None
        if not task.cancelled():
            task.result()  # raises what the work raised


def not_run(suite: Suite, how: str, why: str) -> SuiteResult:
    """Return the result of a suite that is not run: each step is skipped with the reason."""
    steps = (
        StepResult(SuitePart.STEPS, name, step.place, Status.SKIPPED, 0.0, 0.0, StepReason(why))
        for each in suite.steps
        for name, step in single_steps(each, each.name)
    )
    return SuiteResult(suite.file, suite.name, how, tuple(steps), skipped=why)


def single_steps(step: Step, name: str) -> Iterator[tuple[str, Step]]:
    """Yield the steps of a group with their titles, or the step itself."""
    if not isinstance(step.action, Group):
        yield name, step
        return
    for each in step.action.steps:
        yield from single_steps(each, f"{name}: {each.name}")


@dataclass(frozen=True)
class RunOptions:
    """How a suite is run.

    `keep_going`: do the next steps after a failed one. `chosen`: which steps to do, by name; the steps before them are
    done, too, as they may be needed, unless all are `independent`. `interrupt` may end the suite. `show` is called with
    each result. `reported` holds the findings that are reported once per node, for all suites of a run. Steps above the
    `level` are skipped.
    """

    keep_going: bool = False
    chosen: Callable[[str], bool] = lambda _: True
    independent: bool = False
    interrupt: Interrupt = field(default_factory=Interrupt)
    show: Callable[[StepResult], None] = lambda _: None
    reported: set[Report] = field(default_factory=set)
    level: str = ""


class Runner:
    """One run of a suite; made and run inside the event loop."""

    def __init__(self, suite: Suite, bench: Bench, options: RunOptions) -> None:
        self._suite = suite
        self._nodes = [suite.dictionaries[name] for name in suite.nodes]
        self._emcys = {found for each in self._nodes if (found := base_identifier(each.default(EMCY))) is not None}
        self._bench = bench
        self._options = options
        self._trace = bench.trace
        self._results: list[StepResult] = []
        self._stopped = False
        self._error = self._ended_by = ""
        self._undo: dict[tuple[str, Place], Step] = {}
        self._gone = False

    async def run(self, how: str) -> SuiteResult:
        """Run the suite with its teardown; `how` names the bench in reports."""
        suite = self._suite
        await self._bench.begin()
        self._start = self._trace.now
        self._tester = BenchTester(suite.timeout, suite.decoder, self._bench, self._options.reported)
        self._step_runner = StepRunner(self._tester)
        await self._options.interrupt.guard(self._until_teardown())
        # Wait for a lost bus only if there is a teardown and the bus has worked before. A bus that never worked (wrong
        # channel, no other node) would cost `RECOVERY` seconds per suite.
        has_worked = any(result.status is Status.PASSED for result in self._results)
        recovers = bool(suite.teardown) and has_worked
        self._stopped = bool(self._error) and not (recovers and await self._bench.recover())
        # After a lost node, the suite goes on only if other nodes may need their values back.
        self._stopped = self._stopped or (self._gone and len(suite.nodes) == 1)
        # First the `undo` steps of an interrupted group, as the teardown may check that all values are as before.
        for (name, _), step in [*self._undo.items()]:
            if not self._stopped:
                await self._step(SuitePart.TEARDOWN, step, True, name)
        # The teardown goes on after a red step: a later step may be the one that stops the node.
        await self._section(SuitePart.TEARDOWN, suite.teardown, keep_going=True)
        await self._check_heard()
        return SuiteResult(
            suite.file,
            suite.name,
            how,
            tuple(self._results),
            self._since_start,
            error=self._error,
            ended=self._ended_by,
            asked_again=self._tester.asked_again,
            slowest=self._tester.slowest,
            remarks=tuple(self._remarks()),
        )

    def _remarks(self) -> Iterator[str]:
        if any(each.reason and each.reason.meanwhile for each in self._results):
            yield self._other_client()
        if (said := self._reported()) and all(each.status in GOES_ON for each in self._results):
            yield f"all is green, and yet the last error is not reset: {said}"

    async def _check_heard(self) -> None:
        """Add a red step if all that was done is green, and yet no node under test is there."""
        statuses = {result.status for result in self._results}
        is_green = Status.PASSED in statuses and statuses <= {*GOES_ON}
        if not is_green or self._options.interrupt.requested:
            return
        sent = {each.cob_id for each in self._suite.decoder.protocol.bindings if {*each.senders} & {*self._suite.nodes}}
        sent |= {ERROR_CONTROL_BASE + each.node_id for each in self._nodes} | self._emcys
        sent |= {NodeServices.of(each).sdo_answer for each in self._nodes}
        if any(not own and frame.cob_id in sent for _, frame, own in self._trace.frames):
            return
        started = self._since_start
        with suppress(BusError):
            for each in map(NodeServices.of, self._nodes):
                if await self._tester.is_there(each, self._suite.timeout):
                    return
        names = " or ".join(self._suite.nodes)
        reason = StepReason(f"no frame of {names} since the suite began, and no answer to an SDO request: is it on?")
        took = self._since_start - started
        self._add(StepResult(SuitePart.STEPS, HEARD, self._results[0].place, Status.FAILED, started, took, reason))

    def _other_client(self) -> str:
        """Return that another client speaks to the only node under test; empty if none does."""
        if len(self._nodes) != 1:  # they may be each other's clients
            return ""
        node = NodeServices.of(self._nodes[0])
        others = (frame for _, frame, own in self._trace.frames if not own)
        asked = [each for each in others if each.cob_id == node.sdo_request or command_in(each, node.node_id)]
        if not asked:
            return ""
        since = f"{amount(len(asked), 'frame')} since the suite began, the last one {asked[-1]}"
        return f"another client speaks to {node.name} ({since}): end it, and run this again"

    async def _until_teardown(self) -> None:
        """Do the setup, the chosen steps, and the steps that they may need."""
        steps = self._suite.steps
        chosen = self._options.chosen
        numbers = [number for number, step in enumerate(steps) if chosen(step.name)]
        # No suite says which steps a step needs, so all before the last chosen one are done.
        if not self._options.independent:
            numbers = [*range(max(numbers, default=-1) + 1)]
        await self._section(SuitePart.SETUP, self._suite.setup, keep_going=False)
        await self._section(SuitePart.STEPS, [steps[number] for number in numbers], self._options.keep_going)

    async def _section(self, section: SuitePart, steps: Sequence[Step], keep_going: bool) -> None:
        for step in steps:
            is_above = bool(step.above) and step.above == self._options.level
            if self._stopped or is_above:
                why = StepReason(f"'{self._ended_by}' is red, and ends the suite") if self._ended_by else None
                why = StepReason(f"it is above the level {step.above}") if is_above else why
                now = self._since_start
                self._add(StepResult(section, step.name, step.place, Status.SKIPPED, now, 0.0, why))
            else:
                await self._step(section, step, keep_going, step.name)

    async def _step(self, section: SuitePart, step: Step, keep_going: bool, name: str) -> StepReason | None:
        """Do a step and add its result; return why the steps that build on it are skipped, None if they are not."""
        if isinstance(step.action, Group):
            goes_on = keep_going if step.needed is None else not step.needed
            return await self._group(section, step, step.action, goes_on, name)
        started = self._since_start
        status, reason = Status.INTERRUPTED, None
        try:
            status, reason = await self._judge(step, step.action)
        finally:  # also when an interrupt cancels the step, which then stays INTERRUPTED
            goes_on = keep_going if step.needed is None else not step.needed
            ends_all = bool(self._error) or not (status in GOES_ON or goes_on)
            self._stopped = self._stopped or ends_all
            if self._stopped and not self._error and status is Status.FAILED:
                self._ended_by = self._ended_by or name
            took = self._since_start - started
            self._add(StepResult(section, name, step.place, status, started, took, reason))
        if status is Status.SKIPPED:
            return AFTER_SKIPPED
        return (
            None if status is Status.PASSED or _changes_nothing(step) else StepReason(f"'{step.name}' before it is red")
        )

    async def _group(
        self, section: SuitePart, step: Step, group: Group, keep_going: bool, name: str
    ) -> StepReason | None:
        """Do the steps of a group; return why the rest of an outer group is skipped, None if it is not."""
        why: StepReason | None = None
        for turn in range(1, step.repeat + 1):
            heading = f"{name} {turn}/{step.repeat}" if step.repeat > 1 else name
            why = None if why is AFTER_SKIPPED else why
            titled = [(f"{heading}: {each.name}", each) for each in group.steps]
            self._undo |= {(title, each.place): each for title, each in titled if each.undo}
            for title, each in titled:
                if why is not None and not each.undo:
                    now = self._since_start
                    self._add(StepResult(section, title, each.place, Status.SKIPPED, now, 0.0, why))
                elif not self._stopped:
                    found = await self._step(section, each, keep_going, title)
                    self._undo.pop(
                        (title, each.place), None
                    )  # after the step, as an interrupt may come in the middle of it
                    why = why if each.undo else found
        return None if why is AFTER_SKIPPED else why

    async def _judge(self, step: Step, action: StepAction) -> tuple[Status, StepReason | None]:
        """Do a step as often as it says; return how it ended."""
        try:
            self._tester.remark = ""
            for _ in range(step.repeat):
                await self._step_runner.do(action)
            return Status.PASSED, StepReason(self._tester.remark) if self._tester.remark else None
        except Skipped as skipped:
            return Status.SKIPPED, skipped.reason
        except Failed as failed:
            status, reason = Status.FAILED, failed.reason
            if await follows_from_own_error(self._tester, action):
                return Status.SKIPPED, StepReason(f"{reason.what}: {OWN_ERROR}")
            self._gone = self._gone or isinstance(failed, Gone)
            self._stopped = self._stopped or self._gone
        except (LocalError, RemoteError) as error:
            status, reason = Status.FAILED, StepReason(str(error))
        except BusError as error:
            self._error = str(error)
            status, reason = Status.BUS_FAILED, StepReason(str(error))
        # Frames are decoded only here, as those of a passed step are not shown.
        frames = (
            Line(time - self._start, own, frame, words)
            for (time, frame, own), words in self._tester.last_frames(FRAMES_SHOWN)
        )
        return status, reason._replace(frames=tuple(frames), cause=self._reported(), meanwhile=self._other_client())

    def _reported(self) -> str:
        """Return the last error that a node under test has reported since it booted, empty if it is reset."""
        boots = {error_control(each.node_id, NmtState.INITIALISING) for each in self._nodes}
        for _, frame, own in reversed(self._trace.frames):
            if not own and frame in boots:
                break
            if not own and frame.cob_id in self._emcys and len(frame.data) == EMCY_LENGTH:
                return self._tester.words(frame) if any(frame.data[:2]) else ""
        return ""

    def _add(self, result: StepResult) -> None:
        self._results.append(result)
        self._options.show(result)

    @property
    def _since_start(self) -> float:
        return self._trace.now - self._start
