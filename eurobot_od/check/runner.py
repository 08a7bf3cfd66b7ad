"""Runs a suite on a bench: does each step, judges what comes, and tells why a step fails.

Rule of this file: no clock and no bus but the bench's. `expect` looks at what has come since the last question, each
frame counting once; `never` at what comes from the end of the step before. A question is a `send` (several in a row
count as one), an `sdo` or an `nmt`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from eurobot_od.check import sdo
from eurobot_od.check.bench import Bench
from eurobot_od.check.patterns import Difference, Pattern
from eurobot_od.check.results import Finding, Line, Section, Status, StepResult, SuiteResult
from eurobot_od.check.suite import (
    Expect,
    Group,
    Never,
    Nmt,
    NodeServices,
    Order,
    Period,
    Poll,
    Save,
    SdoRead,
    SdoWrite,
    Send,
    Step,
    Suite,
    Wait,
)
from eurobot_od.check.trace import Seen, Trace
from eurobot_od.device.nmt import NMT_COB_ID
from eurobot_od.errors import BusError, LocalError, NoAnswer, RemoteError
from eurobot_od.frame import Frame

FRAMES_SHOWN = 8
"""How many frames a failed step shows, the last ones on the bus."""


@dataclass(frozen=True)
class Options:
    """How suites are run: `keep_going` does the next steps after a failed one, `chosen` says which steps are done."""

    keep_going: bool = False
    chosen: Callable[[str], bool] = lambda _: True


class Failed(Exception):
    """A step is red; `finding` says why."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.what)
        self.finding = finding


class Interrupt:
    """Ends a running suite from outside, such as from a signal handler: the step under way is given up."""

    def __init__(self) -> None:
        self.requested = False
        self._running: tuple[asyncio.AbstractEventLoop, asyncio.Task[None]] | None = None

    def request(self) -> None:
        """End the running suite, and let no other begin."""
        self.requested = True
        if self._running is not None:
            loop, task = self._running
            loop.call_soon_threadsafe(task.cancel)

    async def guard(self, work: Awaitable[None]) -> bool:
        """Do some work that may be interrupted; return whether it was done to its end."""
        task: asyncio.Task[None] = asyncio.ensure_future(work)
        self._running = asyncio.get_running_loop(), task
        if self.requested:
            task.cancel()
        try:
            await asyncio.wait([task])
        finally:
            self._running = None
        return not task.cancelled() and task.result() is None


class Runner:
    """One run of a suite; `show` is called with each step's result as it comes."""

    def __init__(
        self,
        suite: Suite,
        bench: Bench,
        options: Options,
        interrupt: Interrupt,
        show: Callable[[StepResult], None],
    ) -> None:
        self.suite, self.bench, self.options, self.interrupt = suite, bench, options, interrupt
        self._show = show
        self._results: list[StepResult] = []
        self._variables: dict[str, Any] = {}
        self._used: set[int] = set()
        self._mark = self._edge = 0
        self._asking = False
        self._stopped = False
        self._error: BusError | None = None

    async def run(self, how: str) -> SuiteResult:
        """Run the suite, its teardown in any case; `how` names the bench for reports."""
        self._trace = Trace()
        await self.bench.begin(self._trace)
        self._start = self._trace.now
        await self.interrupt.guard(self._until_teardown())
        self._stopped = self._error is not None
        await self._section(Section.TEARDOWN, self.suite.teardown, keep_going=True)
        suite, seconds = self.suite, self._trace.now - self._start
        return SuiteResult(suite.file, suite.name, how, tuple(self._results), seconds, error=self._error)

    async def _until_teardown(self) -> None:
        chosen = [step for step in self.suite.steps if self.options.chosen(step.name)]
        await self._section(Section.SETUP, self.suite.setup, keep_going=False)
        await self._section(Section.STEPS, chosen, self.options.keep_going)

    async def _section(self, section: Section, steps: Sequence[Step], keep_going: bool) -> None:
        for step in steps:
            if self._stopped:
                self._tell(StepResult(section, step.name, step.place, Status.SKIPPED, self._since_start, 0.0))
            else:
                await self._step(section, step, keep_going, step.name)

    # Steps

    async def _step(self, section: Section, step: Step, keep_going: bool, name: str) -> None:
        if isinstance(step.action, Group):
            await self._group(section, step, step.action, keep_going, name)
            return
        started = self._since_start
        status, finding = Status.INTERRUPTED, None
        try:
            status, finding = await self._judge(step)
        finally:
            self._stopped = (
                self._stopped or status is Status.BUS_FAILED or (status is not Status.PASSED and not keep_going)
            )
            took = self._since_start - started
            self._tell(StepResult(section, name, step.place, status, started, took, finding))

    async def _group(self, section: Section, step: Step, group: Group, keep_going: bool, name: str) -> None:
        for turn in range(1, step.repeat + 1):
            heading = f"{name} {turn}/{step.repeat}" if step.repeat > 1 else name
            for each in group.steps:
                if not self._stopped:
                    await self._step(section, each, keep_going, f"{heading}: {each.name}")

    async def _judge(self, step: Step) -> tuple[Status, Finding | None]:
        """Do a step as often as it says, and return how it ended."""
        try:
            for _ in range(step.repeat):
                await self.DO[type(step.action)](self, step.action)
                self._asking = isinstance(step.action, Send) or (self._asking and isinstance(step.action, Save))
        except Failed as failed:
            return Status.FAILED, replace(failed.finding, frames=self._last_frames())
        except (LocalError, RemoteError) as error:
            return Status.FAILED, Finding(str(error), frames=self._last_frames())
        except BusError as error:
            self._error = error
            return Status.BUS_FAILED, Finding(str(error), frames=self._last_frames())
        return Status.PASSED, None

    def _tell(self, result: StepResult) -> None:
        self._results.append(result)
        self._show(result)

    @property
    def _since_start(self) -> float:
        return self._trace.now - self._start

    def _last_frames(self) -> tuple[Line, ...]:
        return tuple(map(self._line, self._trace.frames[-FRAMES_SHOWN:]))

    def _line(self, seen: Seen) -> Line:
        return Line(seen.time - self._start, seen.own, seen.frame, self._words(seen.frame))

    def _words(self, frame: Frame) -> str:
        meaning = self.suite.decoder(frame)
        return f"{meaning.name}  {meaning.text}".rstrip() if meaning.name else ""

    # Asking

    def _ask(self) -> None:
        """Begin a question: what came before it answers nothing."""
        self._mark = self._edge = len(self._trace)

    async def _put(self, frame: Frame) -> None:
        self._trace.add(Seen(await self.bench.send(frame), frame, own=True))

    async def _send(self, action: Send) -> None:
        if not self._asking:
            self._ask()
        await self._put(action.sent.frame(self._variables))

    async def _nmt(self, action: Nmt) -> None:
        self._ask()
        await self._put(Frame(NMT_COB_ID, bytes([action.command, action.node_id])))

    async def _wait(self, action: Wait) -> None:
        await self._trace.sleep(action.seconds)
        self._edge = len(self._trace)

    # Expecting

    def _deadline(self, within: float | None) -> float:
        return self._trace.now + (self.suite.timeout if within is None else within)

    async def _next(self, patterns: Sequence[Pattern], start: int, deadline: float) -> tuple[int, Seen] | None:
        """Return the next frame, with its number, that no step has used yet and that one of the patterns may be."""
        cob_ids = frozenset(pattern.cob_id for pattern in patterns)
        number = await self._trace.first(cob_ids, start, deadline)
        while number in self._used:
            number = await self._trace.first(cob_ids, number + 1, deadline)
        return None if number is None else (number, self._trace.frames[number])

    def _use(self, number: int) -> None:
        self._used.add(number)
        self._edge = number + 1

    async def _expect(self, action: Expect) -> None:
        order, left = action.expected.order, list(action.expected.patterns)
        deadline, start, other = self._deadline(action.within), self._mark, None
        while left:
            found = await self._next(left, start, deadline)
            if found is None:
                raise self._nothing(action, left, other)
            number, seen = found
            start = number + 1
            tried = left[:1] if order is Order.IN_ORDER else left
            hit = next((each for each in tried if not self._differences(each, seen)), None)
            if hit is not None:
                self._use(number)
                left = [] if order is Order.ANY else [each for each in left if each is not hit]
                start = self._mark
            elif any(each.decisive for each in left if each.cob_id == seen.frame.cob_id):
                raise self._other(tried, seen)
            else:
                other = seen

    def _differences(self, pattern: Pattern, seen: Seen) -> list[Difference]:
        if pattern.cob_id != seen.frame.cob_id:
            return [Difference("message", str(pattern), self._meaning(seen))]
        return pattern.differences(seen.frame, self._variables)

    def _meaning(self, seen: Seen) -> str:
        return self._words(seen.frame) or str(seen.frame)

    def _other(self, tried: Sequence[Pattern], seen: Seen) -> Failed:
        """Say that something else came than expected: as the pattern that comes nearest to it sees it."""
        nearest = min(tried, key=lambda each: (each.cob_id != seen.frame.cob_id, len(self._differences(each, seen))))
        differences = tuple(self._differences(nearest, seen))
        text = nearest.text(self._variables)
        return Failed(Finding(f"{nearest} is not as expected", text, self._meaning(seen), differences))

    def _nothing(self, action: Expect, left: Sequence[Pattern], other: Seen | None) -> Failed:
        within = self.suite.timeout if action.within is None else action.within
        what = f"no {' or '.join(map(str, left))} within {_time(within)}"
        if other is not None:
            return self._with_last(what, left[0], other)
        return Failed(Finding(what, "; ".join(each.text(self._variables) for each in left), "nothing"))

    def _with_last(self, what: str, pattern: Pattern, last: Seen | None) -> Failed:
        """Say that what was wanted did not come, and what came last instead."""
        wanted = pattern.text(self._variables)
        if last is None:
            return Failed(Finding(what, wanted, "nothing"))
        return Failed(Finding(what, wanted, self._meaning(last), tuple(self._differences(pattern, last))))

    async def _never(self, action: Never) -> None:
        start, deadline = self._edge, self._deadline(action.span)
        while (found := await self._next([action.pattern], start, deadline)) is not None:
            number, seen = found
            if not self._differences(action.pattern, seen):
                what = f"{action.pattern} came, though it should not"
                raise Failed(Finding(what, f"never {action.pattern.text(self._variables)}", self._meaning(seen)))
            start = number + 1
        self._edge = len(self._trace)

    async def _poll(self, action: Poll) -> None:
        self._ask()
        started, start, last = self._trace.now, self._mark, None
        deadline, count = self._deadline(action.within), 0
        while self._trace.now < deadline:
            await self._put(action.sent.frame(self._variables))
            count += 1
            pause = min(started + count * action.every, deadline)
            while (found := await self._next([action.until], start, pause)) is not None:
                number, last = found
                start = number + 1
                if not self._differences(action.until, last):
                    self._use(number)
                    return
        raise self._with_last(f"{action.until} not as wanted after {count} x {action.sent}", action.until, last)

    async def _period(self, action: Period) -> None:
        latest = action.every + action.tolerance
        start, last = self._edge, None
        for number_of in range(action.count + 1):
            deadline = (self._trace.now if last is None else last.time) + latest
            found = await self._next([action.pattern], start, deadline)
            if found is None:
                what = f"no {action.pattern} within {_time(latest)}, after {number_of} of them"
                raise self._with_last(what, action.pattern, None)
            self._check_period(action, number_of, last, found[1])
            self._use(found[0])
            start, last = self._edge, found[1]

    def _check_period(self, action: Period, number: int, last: Seen | None, seen: Seen) -> None:
        differences = self._differences(action.pattern, seen)
        if last is not None and abs(seen.time - last.time - action.every) > action.tolerance:
            wanted = f"{_time(action.every)} +- {_time(action.tolerance)}"
            differences.append(Difference(f"period {number}", wanted, _time(seen.time - last.time)))
        if differences:
            what = f"{action.pattern} is not as expected"
            text = action.pattern.text(self._variables)
            raise Failed(Finding(what, text, self._meaning(seen), tuple(differences)))

    # SDO

    def _exchange(self, node: NodeServices, within: float | None) -> sdo.Exchange:
        async def exchange(request: bytes) -> bytes:
            start = len(self._trace)
            await self._put(Frame(node.sdo_request, request))
            number = await self._trace.first(frozenset([node.sdo_answer]), start, self._deadline(within))
            if number is None:
                raise NoAnswer("SDO request", f"answer of {node.name}", 1, within or self.suite.timeout)
            self._use(number)
            return self._trace.frames[number].frame.data

        return exchange

    async def _sdo_read(self, action: SdoRead) -> None:
        self._ask()
        data = await self._transfer(action, sdo.upload(self._exchange(action.node, action.within), action.address))
        if data is None:
            return
        value = action.decode(data)
        if action.expected is not None and not action.expected.fits(value, self._variables):
            wanted, came = action.expected.text(self._variables), action.expected.kind.text(value)
            difference = Difference(action.label, wanted, came)
            raise Failed(Finding(f"{action.label} is not as expected", wanted, came, (difference,)))
        if action.save is not None:
            self._variables[action.save] = value

    async def _sdo_write(self, action: SdoWrite) -> None:
        self._ask()
        content = action.encode(self._variables)
        exchange = self._exchange(action.node, action.within)
        await self._transfer(action, sdo.download(exchange, action.address, content))

    async def _transfer(self, action: SdoRead | SdoWrite, transfer: Awaitable[bytes | None]) -> bytes | None:
        """Do a transfer that may have to be refused; None if it was as it had to be, or if there is nothing to read."""
        wanted = None if action.abort is None else f"abort 0x{action.abort:08X}"
        try:
            data = await transfer
        except sdo.SdoAborted as error:
            if error.code == action.abort:
                return None
            came = f"abort 0x{error.code:08X}"
            raise Failed(Finding(f"{action}: {error}", wanted or "no abort", came)) from None
        if wanted is not None:
            raise Failed(Finding(f"{action}: the node does not refuse", wanted, "no abort"))
        return data

    # Variables

    async def _save(self, action: Save) -> None:
        for name, (binding, field) in ((name, (each.binding, each.field)) for name, each in action.variables.items()):
            frames = (each.frame for each in reversed(self._trace.frames) if not each.own)
            last = next((frame for frame in frames if frame.cob_id == binding.cob_id), None)
            if last is None:
                raise Failed(Finding(f"no {binding.name} has come yet"))
            self._variables[name] = getattr(self.suite.decoder.protocol.decode(*last), field)

    DO: ClassVar[Mapping[type, Callable[[Any, Any], Awaitable[None]]]] = {
        Send: _send,
        Expect: _expect,
        Never: _never,
        Poll: _poll,
        Period: _period,
        SdoRead: _sdo_read,
        SdoWrite: _sdo_write,
        Nmt: _nmt,
        Save: _save,
        Wait: _wait,
    }


def _time(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 1 else f"{seconds * 1000:g} ms"
