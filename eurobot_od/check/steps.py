"""Does one step after the other on a bench: asks, looks at what comes, and raises Failed if it is not as expected.

`expect` looks at what has come since the last question, and each frame counts once; `never` and `period` look at what
comes from the end of the step before. A question is a `send` (several in a row count as one), an `nmt`, an `sdo` or a
`poll`.

The only clock and the only bus are those of the bench, on which the nodes under test are, with the trace of all frames
on it, each with its time. Frames are kept in the order in which they came and are never taken away: a reader says from
which number on it looks. Only one step runs at a time, so there is only one to wake.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial, singledispatchmethod
from typing import Any, NamedTuple, NoReturn, Protocol

from canopen.objectdictionary import ODVariable

from eurobot_od.check import suite
from eurobot_od.check.report import StepReason
from eurobot_od.check.suite import Mismatch, Pattern, Sent, ServicePattern, is_final
from eurobot_od.check.values import ObjectValues, Operand, ValueProblem
from eurobot_od.device.broadcasts import HISTORY, REGISTER_BITS
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError, LocalError, NoAnswer, RemoteError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import objects, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER, ERRORS, SYNC_COUNTER, SYNC_PERIOD
from eurobot_od.od.values import COB_ID, ERROR_CONTROL_BASE, MAPPINGS, NMT_COB_ID, Address, label
from eurobot_od.od.words import error_words
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import LENGTH, code_and_reason
from eurobot_od.support import texts
from eurobot_od.support.texts import amount
from eurobot_od.traffic.decoding import Following
from eurobot_od.traffic.meaning import Decoder, Meaning

BOOTED = bytes([NmtState.INITIALISING])
"""The data of a boot-up (CiA 301, 7.3.2.2.2)."""

ERROR_CONTROL = range(ERROR_CONTROL_BASE + 1, ERROR_CONTROL_BASE + 0x80)

QUESTIONS = (suite.Send, suite.SdoRead, suite.SdoWrite, suite.SdoRestore, suite.Dump, suite.SelfReported, suite.Poll)
"""Actions that an answer of before would be taken for an answer to."""

UNCONFIRMED = 0.02
"""Seconds that a server is given for a request that it does not answer."""

POLLED = 0.1
"""Seconds for an answer to the question whether a node is there."""

NOT_WHILE_VALID = (COB_ID, values.INHIBIT_TIME, values.SYNC_START)
"""Parameters of a PDO that must not be changed while it is valid (CiA 301, 7.5.2.35 and 7.5.2.37)."""

REGISTER = 2
"""Where the error register stands in an EMCY (CiA 301, 7.2.7.4)."""

MOST_BEFORE = 512
"""Frames that are looked at to understand the last ones; a block of SDO has at most 127."""


# The bench


class SeenFrame(NamedTuple):
    """A frame, its time in seconds by the loop's clock, and whether the tester sent it."""

    time: float
    frame: Frame
    own: bool = False


class Trace:
    """The frames of a run; made inside the event loop."""

    def __init__(self) -> None:
        self.frames: list[SeenFrame] = []
        self._loop = asyncio.get_running_loop()
        self.heard: Callable[[Frame], object] = lambda _: None
        """Called with each frame of the others as it comes."""
        self._waiting: asyncio.Future[None] | None = None
        self._failure: BusError | None = None

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def now(self) -> float:
        """The time in seconds."""
        return self._loop.time()

    def add(self, seen: SeenFrame) -> None:
        """Take in a frame."""
        self.frames.append(seen)
        self._wake()
        if not seen.own:
            self.heard(seen.frame)

    def fail(self, failure: BusError) -> None:
        """End all waiting: the bus is gone."""
        self._failure = failure
        self._wake()

    def recover(self) -> None:
        """Note that the bus is open again."""
        self._failure = None

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():  # two frames may come in one turn of the loop
            self._waiting.set_result(None)

    async def first(self, cob_ids: frozenset[int], start: int, deadline: float) -> int | None:
        """Return the number of the first foreign frame with one of these identifiers, from number `start` on.

        Waits for it until the time is `deadline`; None if none came by then. Raises BusError.
        """
        while True:
            for number in range(start, len(self.frames)):
                time, frame, own = self.frames[number]
                # By the frame's own time, not by that of looking: late is late, and in time is in time.
                if time > deadline:
                    return None
                if frame.cob_id in cob_ids and not own:
                    return number
            start = len(self.frames)
            if not await self._news(start, deadline):
                return None

    async def _news(self, known: int, deadline: float) -> bool:
        """Wait for more than the `known` frames until a time; raises BusError."""
        self._waiting = self._loop.create_future()
        timer = self._loop.call_at(deadline, self._wake)
        try:
            if self._failure is None and self._loop.time() < deadline:
                await self._waiting
        finally:  # also if the step is interrupted: a timer left behind would wake the next one too early
            timer.cancel()
            self._waiting = None
        if self._failure is not None:
            raise self._failure
        return len(self.frames) > known or self._loop.time() < deadline

    async def sleep(self, seconds: float) -> None:
        """Let time pass; raises BusError if the bus fails meanwhile."""
        await self.first(frozenset(), len(self.frames), self.now + seconds)


class Bench(Protocol):
    """A bus with the nodes under test; the tester is another participant, with no node of its own."""

    trace: Trace
    """Every frame of the others, once the bench has begun."""

    async def begin(self) -> None:
        """Return when the nodes are up; called once."""

    async def send(self, frame: Frame) -> float:
        """Send a frame and return, once it is on its way, its time by the loop's clock; raises BusError."""

    async def recover(self) -> bool:
        """Open a bus that has failed again; return whether it works before all patience is at an end."""


# Steps


class NotPassed(Exception):
    """A step that has not passed; `reason` says why."""

    def __init__(self, what: str, expected: str = "", came: str = "", mismatches: Sequence[Mismatch] = ()) -> None:
        super().__init__(what)
        self.reason = StepReason(what, expected, came, tuple(mismatches))


class Failed(NotPassed):
    """A step is red."""


class Gone(Failed):
    """A node does not come back from a reset: nothing else can be asked."""


class Skipped(NotPassed):
    """A step is not done."""


class StepRunner:
    """Does the steps of a suite; keeps what they know of each other: the last question, used frames, variables."""

    def __init__(self, timeout: float, decoder: Decoder, bench: Bench, reported: set[suite.Report]) -> None:
        self._timeout, self._decoder, self._bench, self._trace = timeout, decoder, bench, bench.trace
        self._reported = reported
        self._variables: dict[str, Any] = {}
        self._kept: dict[str, Address] = {}
        self._started: int | None = None
        self._used: set[int] = set()
        self._mark, self._edge = 0, len(bench.trace)
        self._dumped: dict[str, str] = {}
        self._asking = self._unsettled = False
        self._taken: set[Address] = set()
        self._answers: dict[int, Sent] = {}
        self._answering: set[asyncio.Task[None]] = set()
        self._trace.heard = self._heard

    async def do(self, action: suite.Action) -> None:
        """Do one action; raises Failed, LocalError or RemoteError if it is red, Skipped, BusError if the bus failed."""
        await asyncio.sleep(0)  # an interrupt has its turn, whatever is repeated
        if self._unsettled and isinstance(action, QUESTIONS):
            # What a node still says to a red step does not answer the next question.
            await self._trace.sleep(UNCONFIRMED)
            self._unsettled = False
        try:
            await self._do(action)
        except (Failed, LocalError, RemoteError):
            self._unsettled = True
            raise
        self._asking = isinstance(action, suite.Send) or (self._asking and isinstance(action, suite.Save))

    @singledispatchmethod
    async def _do(self, action: suite.Action) -> None:
        """Do the action by its type."""
        raise NotImplementedError(action)

    def words(self, frame: Frame) -> str:
        """Say what a frame means; empty if that is not known."""
        return _words(self._decoder(frame))

    def last_frames(self, number: int) -> Iterator[tuple[SeenFrame, str]]:
        """Yield the last frames of the trace with what they mean, read as those of a log are: by the ones before."""
        following = Following(self._decoder)
        frames = self._trace.frames[-MOST_BEFORE:]
        for place, seen in enumerate(frames, number - len(frames)):
            meaning = following(seen.time, "", seen.frame)
            if place >= 0:
                yield seen, _words(meaning)

    # Asking

    def _ask(self) -> None:
        """Begin a question: what came before it answers nothing."""
        # The edge is where `never` and `period` begin to look, the mark where `expect` does: an answer that was
        # expected moves the edge behind it, but other answers to the same question may stand before it.
        self._mark = self._edge = len(self._trace)

    async def _put(self, frame: Frame) -> None:
        self._trace.add(SeenFrame(await self._bench.send(frame), frame, own=True))

    @_do.register
    async def _send(self, action: suite.Send) -> None:
        if not self._asking:  # several in a row are one question, or the second would lose the answer to the first
            self._ask()
        await self._put(action.sent.frame(self._variables))

    @_do.register
    async def _answer(self, action: suite.Answer) -> None:
        for cob_id, sent in action.answers.items():
            self._answers.pop(cob_id, None)
            if sent is not None:
                self._answers[cob_id] = sent

    def _heard(self, frame: Frame) -> None:
        """Answer a frame for the node that the tester plays."""
        if frame.cob_id in self._answers:
            task = asyncio.ensure_future(self._put(self._answers[frame.cob_id].frame(self._variables)))
            self._answering.add(task)  # the loop itself keeps only a weak reference to a task
            task.add_done_callback(self._answered)

    def _answered(self, task: asyncio.Task[None]) -> None:
        self._answering.discard(task)
        error = None if task.cancelled() else task.exception()
        if isinstance(error, BusError):  # nobody awaits the task, so the step under way has to hear of it
            self._trace.fail(error)

    @_do.register
    async def _nmt(self, action: suite.Nmt) -> None:
        self._ask()
        self._started = action.node_id if action.command is NmtCommand.START else None
        await self._put(Frame(NMT_COB_ID, bytes([action.command, action.node_id])))

    @_do.register
    async def _own(self, action: suite.OwnAction) -> None:
        self._ask()
        await action.action.run(StepTools(self), action.keys)

    @_do.register
    async def _skip(self, action: suite.Skip) -> None:
        raise Skipped(action.reason)

    @_do.register
    async def _wait(self, action: suite.Wait) -> None:
        await self._trace.sleep(action.seconds)
        self._edge = len(self._trace)

    # Expecting

    def _longest(self, within: float | None) -> float:
        return self._timeout if within is None else within

    def _deadline(self, within: float | None) -> float:
        return self._trace.now + self._longest(within)

    async def _next(self, patterns: Sequence[Pattern], start: int, deadline: float) -> tuple[int, SeenFrame] | None:
        """Return the next frame, with its number, that no step has used yet and that one of the patterns may be."""
        cob_ids = frozenset(pattern.cob_id for pattern in patterns)
        number = await self._trace.first(cob_ids, start, deadline)
        while number in self._used:  # two equal `expect` want two frames
            number = await self._trace.first(cob_ids, number + 1, deadline)
        return None if number is None else (number, self._trace.frames[number])

    def _use(self, number: int) -> None:
        self._used.add(number)
        self._edge = number + 1

    @_do.register
    async def _expect(self, action: suite.Expect) -> None:
        order, left = action.expected.order, list(action.expected.patterns)
        deadline, start, other = self._deadline(action.within), self._mark, None
        while left:
            found = await self._next(left, start, deadline)
            if found is None:
                what = f"no {' or '.join(map(str, left))} within {texts.text(self._longest(action.within))}"
                if other is not None:
                    raise self._with_last(what, left[0], other)
                raise Failed(what, "; ".join(each.text(self._variables) for each in left), "nothing")
            number, seen = found
            start = number + 1
            # In order, only the first one may come: a later one that comes now is reported as out of order.
            tried = left[:1] if order is suite.Order.IN_ORDER else left
            hit = next((each for each in tried if not self._mismatches(each, seen)), None)
            if hit is not None:
                self._use(number)
                if isinstance(hit, ServicePattern) and hit.save is not None:
                    self._variables[hit.save] = seen.frame.data[REGISTER]
                left = [] if order is suite.Order.ANY else [each for each in left if each is not hit]
                start = self._mark  # a frame passed over may be what the remaining patterns wait for
            elif any(is_final(each, seen.frame) for each in left if each.cob_id == seen.frame.cob_id):
                # Reported against the closest pattern: one of the same message, with the fewest differences.
                ranks = [(each.cob_id != seen.frame.cob_id, len(self._mismatches(each, seen))) for each in tried]
                nearest = tried[ranks.index(min(ranks))]
                raise self._with_last(f"{nearest} is not as expected", nearest, seen)
            else:
                other = seen

    def _mismatches(self, pattern: Pattern, seen: SeenFrame) -> list[Mismatch]:
        if pattern.cob_id != seen.frame.cob_id:
            return [Mismatch("message", str(pattern), self._meaning(seen))]
        return pattern.mismatches(seen.frame, self._variables)

    def _meaning(self, seen: SeenFrame) -> str:
        return self.words(seen.frame) or str(seen.frame)

    def _with_last(self, what: str, pattern: Pattern, last: SeenFrame | None, off: Sequence[Mismatch] = ()) -> Failed:
        """Say that what was wanted did not come, and what came last instead."""
        wanted = pattern.text(self._variables)
        if last is None:
            return Failed(what, wanted, "nothing")
        return Failed(what, wanted, self._meaning(last), (*self._mismatches(pattern, last), *off))

    @_do.register
    async def _await(self, action: suite.Await) -> None:
        start, last, deadline = len(self._trace), None, self._deadline(action.within)
        while (found := await self._next([action.pattern], start, deadline)) is not None:
            number, last = found
            start = number + 1
            if not self._mismatches(action.pattern, last):
                self._use(number)
                return
        what = f"{action.pattern} not as wanted within {texts.text(self._longest(action.within))}"
        raise self._with_last(what, action.pattern, last)

    @_do.register
    async def _never(self, action: suite.Never) -> None:
        start, deadline = self._edge, self._deadline(action.span)
        while (found := await self._next([action.pattern], start, deadline)) is not None:
            number, seen = found
            if not self._mismatches(action.pattern, seen):
                what = f"{action.pattern} came, though it should not"
                raise Failed(what, f"never {action.pattern.text(self._variables)}", self._meaning(seen))
            start = number + 1
        self._edge = len(self._trace)

    @_do.register
    async def _unheard(self, action: suite.Unheard) -> None:
        seen = [each for each in self._trace.frames if each.frame.cob_id == action.cob_id and not each.own]
        if seen and (suite.Reported.HEARD, action.cob_id) in self._reported:
            raise Skipped("it came again, and was red before")
        if seen:
            self._reported.add((suite.Reported.HEARD, action.cob_id))
            what = f"{amount(len(seen), 'frame')} came with the identifier 0x{action.cob_id:03X}"
            raise Failed(what, "none", str(seen[0].frame))

    @_do.register
    async def _poll(self, action: suite.Poll) -> None:
        self._ask()
        started, start, last = self._trace.now, self._mark, None
        deadline, count = self._deadline(action.within), 0
        while self._trace.now < deadline:
            await self._put(action.sent.frame(self._variables))
            count += 1
            # counted from the start, so that what sending takes does not add up over many polls
            pause = min(started + count * action.every, deadline)
            while (found := await self._next([action.until], start, pause)) is not None:
                number, last = found
                start = number + 1
                if not self._mismatches(action.until, last):
                    self._use(number)
                    return
        raise self._with_last(f"{action.until} not as wanted after {count} x {action.sent}", action.until, last)

    @_do.register
    async def _period(self, action: suite.Period) -> None:
        latest = action.every + action.tolerance
        start, last = self._edge, None
        off: list[Mismatch] = []
        for number in range(action.count + 1):  # one frame more than there are periods between them
            deadline = (self._trace.now if last is None else last.time) + latest
            found = await self._next([action.message], start, deadline)
            if found is None:
                what = f"no {action.message} within {texts.text(latest)}, after {number} of them"
                raise self._with_last(what, action.message, None)
            seen = found[1]
            # Each distance by itself, not the mean: a mean hides a frame that is late after one that was early.
            if last is not None and abs(seen.time - last.time - action.every) > action.tolerance:
                wanted = f"{texts.text(action.every)} +- {texts.text(action.tolerance)}"
                off = [Mismatch(f"period {number}", wanted, texts.text(seen.time - last.time))]
            if off or self._mismatches(action.message, seen):
                raise self._with_last(f"{action.message} is not as expected", action.message, seen, off)
            self._use(found[0])
            start, last = self._edge, seen

    # SDO

    @_do.register
    async def _sdo_read(self, action: suite.SdoRead) -> None:
        self._ask()
        if action.save is not None:
            self._variables.pop(action.save, None)  # what another object had under this name is not this one's
        begin = _UPLOADS[action.blocks]
        data = await self._transfer(action, begin(objects.address_of(action.variable), self._longest(action.within)))
        if data is None:
            return
        size = objects.data_type(action.variable).size
        # Size 0 is a type of any length. Another length is red by itself: decoding would fill it up or cut it off.
        if size not in (0, len(data)):
            raise ValueProblem(f"{amount(len(data), 'byte')} came, the object has {size}")
        value = objects.decode(action.variable, data)
        if action.expected is not None and not action.expected.fits(value, self._variables):
            self._follow(action.variable)
            label = objects.label(action.variable)
            wanted, came = action.expected.text(self._variables), action.expected.shown(value)
            raise Failed(f"{label} is not as expected", wanted, came, (Mismatch(label, wanted, came),))
        if action.save is not None:
            self._variables[action.save] = value
            self._kept[action.save] = objects.address_of(action.variable)

    @_do.register
    async def _sdo_write(self, action: suite.SdoWrite) -> None:
        self._ask()
        begin = _DOWNLOADS[action.blocks]
        content = action.content(self._variables)
        await self._transfer(action, begin(objects.address_of(action.variable), content, self._longest(action.within)))

    async def _transfer(self, action: suite.SdoRead | suite.SdoWrite, transfer: sdo.Transfer) -> bytes | None:
        """Do a transfer that may have to be refused; None if it was refused as it had to be.

        Raises Failed, Skipped, NoAnswer, OddAnswer.
        """
        wanted, address = None if action.abort is None else str(action.abort), objects.address_of(action.variable)
        if action.abort is not None and not action.abort.codes:
            self._follow(action.variable)
        try:
            data = await self._run(transfer, action.node)
        except sdo.Aborted as error:
            if action.abort is not None and action.abort.fits(error.code):
                return None
            came = f"abort {code_and_reason(error.code)}"
            if action.optional is not None and action.optional.fits(error.code):
                raise Skipped(f"{action}: the node does not do this ({came})") from None
            raise Failed(f"{action}: {error}", wanted or "no abort", came) from None
        if wanted is not None:
            self._taken.add(address)
            raise Failed(f"{action}: the node does not refuse", wanted, "no abort")
        if isinstance(action, suite.SdoWrite):
            self._taken.discard(address)
        return data

    def _follow(self, variable: ODVariable) -> None:
        """Raise Skipped for an object that has taken what it should have refused, which is red already."""
        if objects.address_of(variable) in self._taken:
            raise Skipped(f"{objects.label(variable)} has taken what it should refuse, which is red")

    @_do.register
    async def _sdo_restore(self, action: suite.SdoRestore) -> None:
        """Write only what differs; raises Failed if the node does not have the value afterwards."""
        # An interrupt may have come before it was read, and the variable still have what another object had.
        if action.saved not in self._variables or self._kept[action.saved] != objects.address_of(action.variable):
            raise Skipped("it was not read before, so nothing of it has been changed")
        self._ask()
        address, content = objects.address_of(action.variable), action.content(self._variables)
        self._taken.discard(address)
        if await self._read(action, address) == content:
            return
        if address == ERRORS and any(content):
            raise Skipped("errors can be cleared, but not brought back")  # (CiA 301, 7.5.2.4)
        before, after, refused = list[tuple[Address, bytes]](), list[tuple[Address, bytes]](), ""
        for other, change in _meanwhile(address):
            old = await self._read(action, other)
            new = change(int.from_bytes(old, "little")).to_bytes(len(old), "little")
            before += [(other, new)] * (new != old)
            after += [(other, old)] * (new != old and other != address)
        for at, data in (*before, (address, content), *reversed(after)):
            try:
                await self._run(sdo.download(at, data, self._longest(action.within)), action.node)
            except sdo.Aborted as error:
                refused = f" ({label(at)}: {error})"
        now = await self._read(action, address)
        if refused and address[0] in MAPPINGS and address[1] and not any(content):
            # No clause says that an entry behind the last one can be 0, which is not an object.
            raise Skipped(f"an entry that maps nothing{refused}")
        if now != content:
            what = f"{objects.label(action.variable)} cannot be put back{refused}"
            raise Failed(what, content.hex(" ").upper(), now.hex(" ").upper() or "nothing")

    async def _read(self, action: suite.SdoRestore, address: Address) -> bytes:
        """Read an object; one that cannot be read now is empty."""
        with suppress(sdo.Aborted):
            return await self._run(sdo.upload(address, self._longest(action.within)), action.node)
        return b""

    @_do.register
    async def _boot_up(self, action: suite.BootUp) -> None:
        """Wait for a boot-up; raises Failed once for a node that sends none, Gone for one that does not come back."""
        missing = suite.Reported.NO_BOOT_UP, action.node
        # One that sends none is waited for once, and reported once.
        if missing not in self._reported and await self._booted(action):
            return
        deadline = self._deadline(action.within)
        while self._trace.now < deadline:
            # Any answer will do, an abort as well: what it says is not the question here.
            with suppress(NoAnswer):
                with suppress(sdo.Aborted, sdo.OddAnswer):
                    await self._run(sdo.upload(ERROR_REGISTER, POLLED), action.node)  # which every device has
                break
        else:
            raise Gone(f"{self._no_boot_up(action)}, and no answer to an SDO request as long again")
        if missing not in self._reported:
            self._reported.add(missing)
            raise Failed(f"{self._no_boot_up(action)}, but the node answers SDO requests")

    async def _booted(self, action: suite.BootUp) -> bool:
        """Wait for the boot-up since the last question; False if none comes in its time."""
        own, deadline = frozenset([ERROR_CONTROL_BASE + action.node.node_id]), self._deadline(action.within)
        start = self._mark
        # What comes before it was under way when the node heard of the reset: heartbeats, answers to guarding.
        while (number := await self._trace.first(own, start, deadline)) is not None:
            start = number + 1
            if self._trace.frames[number].frame.data == BOOTED:
                self._use(number)
                return True
        return False

    def _no_boot_up(self, action: suite.BootUp) -> str:
        """Say that no boot-up came, and whose came instead: a node may come back with another node-ID."""
        seen = (frame for _, frame, own in self._trace.frames[self._mark :] if not own and frame.data == BOOTED)
        others = sorted({frame.cob_id - ERROR_CONTROL_BASE for frame in seen if frame.cob_id in ERROR_CONTROL})
        instead = f" (node {', '.join(map(str, others))} booted instead)" if others else ""
        within = texts.text(self._longest(action.within))
        return f"no boot-up {ERROR_CONTROL_BASE + action.node.node_id:03X}#00 in {within} after a reset{instead}"

    @_do.register
    async def _dump(self, action: suite.Dump) -> None:
        if action.equal and not self._dumped:
            raise Skipped("nothing was read before")
        self._ask()
        dump = {}
        for variable in action.variables:
            try:
                read = _UPLOADS[suite.Blocks.NONE](objects.address_of(variable), self._timeout)
                data = await self._run(read, action.node)
                dump[objects.label(variable)] = data.hex(" ").upper()
            except sdo.Aborted as error:  # a dump is red only if something has changed, a refusal too
                dump[objects.label(variable)] = code_and_reason(error.code)
            except sdo.OddAnswer as error:
                dump[objects.label(variable)] = str(error)
        if not action.equal:
            self._dumped = dump
            return
        before = {each: self._dumped.get(each, "not read") for each in dump}
        # Errors can be cleared, but not brought back.
        same = {each for each in dump if dump[each] < before[each] and each.startswith(label(ERRORS))}
        off = [
            Mismatch(each, before[each], dump[each]) for each in dump if before[each] != dump[each] and each not in same
        ]
        if off:
            raise Failed(f"{amount(len(off), 'object')} not as before", mismatches=off)

    @_do.register
    async def _errors(self, action: suite.SelfReported) -> None:
        """Read what errors the node has; raises NoAnswer, Failed with all of them in words, Skipped without 0x1001."""
        self._ask()
        try:
            register = await self._run(sdo.upload(ERROR_REGISTER, self._timeout), action.node)
        except sdo.Aborted:
            raise Skipped("the node has no error register (0x1001)") from None
        bits = int.from_bytes(register, "little")
        if bits:
            words = [name for bit, name in enumerate(REGISTER_BITS) if bits >> bit & 1]
            with suppress(sdo.Aborted):  # no device has to remember its errors: 0x1003 is optional (CiA 301, 7.5.2.4)
                count = await self._run(sdo.upload(ERRORS, self._timeout), action.node)
                for sub in range(1, min(int.from_bytes(count, "little"), HISTORY) + 1):
                    remembered = await self._run(sdo.upload((ERROR_FIELD, sub), self._timeout), action.node)
                    # Its lower half is the error code, the upper half the maker's.
                    code = int.from_bytes(remembered[:2], "little")
                    words.append(f"0x{code:04X} {error_words(code, {})}")
            self._reported.add((suite.Reported.OWN_ERROR, action.node))
            raise Failed(f"{action.node.name} reports an error itself", "none", "; ".join(words))

    async def follows_from_own_error(self, action: suite.Action) -> bool:
        """Whether a node that does not send what is awaited has a known error, and was just told to be OPERATIONAL.

        By 0x1029 such a node may refuse that, or leave it again.
        """
        nodes = (each for _, each in self._reported if isinstance(each, suite.NodeServices))
        node = next((each for each in nodes if each.node_id == self._started), None)
        is_known = node is not None and (suite.Reported.OWN_ERROR, node) in self._reported
        if node is None or not is_known or not isinstance(action, (suite.Expect, suite.Period)):
            return False
        try:
            return any(await self._run(sdo.upload(ERROR_REGISTER, self._timeout), node))
        except (sdo.Aborted, NoAnswer) as error:
            return isinstance(error, NoAnswer)  # it has stayed in STOPPED

    async def _run(self, transfer: sdo.Transfer, node: suite.NodeServices) -> bytes:
        """Do a transfer and return what it brought; raises NoAnswer, Aborted.

        An answer that has not the length of an SDO frame raises OddAnswer.
        """
        requests = transfer.start(self._trace.now)
        start = len(self._trace)  # before sending, as a fast node answers before `_put` has returned
        while True:
            for request in requests:
                await self._put(Frame(node.sdo_request, request))
            if transfer.done:  # only now: the last request may be an abort of ours, which the node has to get
                if requests:  # the end of a block or an abort, which no answer confirms: many servers keep one frame
                    await self._trace.sleep(UNCONFIRMED)
                break
            number = await self._trace.first(frozenset([node.sdo_answer]), start, transfer.deadline)
            if number is None:
                requests = transfer.tick(transfer.deadline)
                continue
            self._use(number)
            start = number + 1  # not the end of the trace: a block's segments come several at a time
            answer = self._trace.frames[number].frame.data
            if len(answer) != LENGTH:
                raise sdo.OddAnswer(answer, f"of {LENGTH} bytes")
            requests = transfer.receive(answer, self._trace.now)
        try:
            return transfer.result()
        except sdo.Silence:
            # A late answer is to this question, and must not be taken for one to the next.
            late = await self._trace.first(frozenset([node.sdo_answer]), start, self._trace.now + transfer.wait)
            if late is not None:
                self._use(late)
                await self._trace.sleep(UNCONFIRMED)  # a node may answer even the abort
            raise NoAnswer("SDO request", f"answer from {node.name}", 1, transfer.wait) from None

    # Variables

    @_do.register
    async def _save(self, action: suite.Save) -> None:
        for name, (binding, field) in action.variables.items():
            frames = (each.frame for each in reversed(self._trace.frames) if not each.own)
            last = next((frame for frame in frames if frame.cob_id == binding.cob_id), None)
            if last is None:
                raise Failed(f"no {binding.name} has come yet")
            self._variables[name] = getattr(self._decoder.protocol.decode(*last), field)


_UPLOADS: Mapping[suite.Blocks, Callable[[Address, float], sdo.Transfer]] = {
    suite.Blocks.NONE: partial(sdo.upload, room=sdo.Room(unannounced=sdo.LONGEST_TEXT)),
    suite.Blocks.PLAIN: sdo.block_upload,
    suite.Blocks.WITHOUT_CRC: partial(sdo.block_upload, crc=0),
}
_DOWNLOADS: Mapping[suite.Blocks, Callable[[Address, bytes, float], sdo.Transfer]] = {
    suite.Blocks.NONE: sdo.download,
    suite.Blocks.PLAIN: sdo.block_download,
    suite.Blocks.WITHOUT_CRC: partial(sdo.block_download, crc=0),
}


class StepTools:
    """What a step of a device package can do: objects by SDO, frames, time; it fails as other steps do.

    `node` is the name of a device; without one it is the first.
    """

    def __init__(self, runner: StepRunner) -> None:
        self._runner = runner

    def device(self, node: str = "") -> Dictionary:
        """Return the dictionary of a device; raises UnknownName."""
        named = {each.name: each for each in self._runner._decoder.dictionaries}
        return look_up("node", node, named) if node else next(iter(named.values()))

    async def read(self, name: str, node: str = "") -> Any:
        """Return the physical value of an object; raises as an `sdo` step."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        await self._runner._sdo_read(suite.SdoRead(suite.NodeServices.of(device), thing, save=name))
        return objects.physical(thing, self._runner._variables[name])

    async def write(self, name: str, text: str, node: str = "") -> None:
        """Write an object, the value as a person writes it; raises as an `sdo` step."""
        device = self.device(node)
        thing = objects.find_one(name, device.objects)
        operand = Operand(objects.parse(thing, text), None, ObjectValues(thing))
        await self._runner._sdo_write(suite.SdoWrite(suite.NodeServices.of(device), thing, operand))

    async def send(self, frame: Frame) -> None:
        """Send a frame."""
        await self._runner._put(frame)

    async def receive(self, cob_id: int, within: float = 1.0) -> bytes:
        """Return the data of the next frame with an identifier; raises Failed if none comes `within` so many s."""
        trace = self._runner._trace
        number = await trace.first(frozenset({cob_id}), self._runner._edge, trace.now + within)
        if number is None:
            raise Failed(f"no 0x{cob_id:03X} within {texts.text(within)}", f"0x{cob_id:03X}", "nothing")
        self._runner._use(number)
        return trace.frames[number].frame.data

    async def wait(self, seconds: float) -> None:
        """Let time pass."""
        await self._runner._trace.sleep(seconds)

    def fail(self, what: str, expected: object = "", came: object = "") -> NoReturn:
        """End the step red."""
        raise Failed(what, str(expected), str(came))


def _meanwhile(address: Address) -> Iterator[tuple[Address, Callable[[int], int]]]:
    """Give the objects that must have another value while an object is changed, and what becomes of theirs."""
    index, sub = address
    if index in MAPPINGS or (index in values.COMMUNICATIONS and sub in NOT_WHILE_VALID):
        yield (index - values.MAPPING_OFFSET * (index in MAPPINGS), COB_ID), lambda cob_id: cob_id | values.NOT_VALID
    if index in MAPPINGS and sub:
        yield (index, 0), lambda _: 0  # (CiA 301, 7.5.2.36)
    if address == SYNC_COUNTER:
        yield SYNC_PERIOD, lambda _: 0  # (CiA 301, 7.5.2.22)


def _words(meaning: Meaning) -> str:
    if isinstance(meaning.raw, Frame) and meaning.raw.is_remote:
        return "remote frame"
    return f"{meaning.name}  {meaning.text}".rstrip() if meaning.name else ""
