"""What the actions of a suite share: the last question, used frames, variables, and SDO transfers.

`expect` looks at what has come since the last question, and each frame counts once; `never` and `period` look at what
comes from the end of the step before. A question is a `send` (several in a row count as one), an `nmt`, an `sdo` or a
`poll`. The only clock and the only bus are those of the bench.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from canopen.objectdictionary import ODVariable

from eurobot_od.check import suite
from eurobot_od.check.bench import Bench, SeenFrame
from eurobot_od.check.report import StepReason
from eurobot_od.check.suite import Mismatch, Pattern, Sent
from eurobot_od.errors import BusError, NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.standard import ERROR_REGISTER
from eurobot_od.od.values import Address
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import LENGTH, AbortCode, ClientCommand, Initiate, aborted
from eurobot_od.traffic.decoding import Following
from eurobot_od.traffic.meaning import Decoder, Meaning

UNCONFIRMED = 0.02
"""Seconds that a server is given for a request that it does not answer."""

LATEST = 3.0
"""How late an answer may come and still be told from the next one's, in s; the standard names no time."""

SILENT = 0.05
"""An SDO server that has sent nothing for this long, in s, has nothing left to say of an aborted transfer."""

MOST_BEFORE = 512
"""Frames that are looked at to understand the last ones; a block of SDO has at most 127."""


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


class BenchTester:
    """The tester on a bench, as the actions of a suite use it.

    `variables` are those of the suite; `kept` says which object a variable was read from. Frames from number `mark` on
    answer the last question, those from `edge` on came after the last step. `started` is the node that NMT has just
    started, `taken` are objects that took what they should refuse, `dumped` is what a dump has read, and `reported`
    what is red once for a node. `answers` are what the tester answers by itself, by COB-ID. `missed` says for how long
    a frame that did not come may still be on its way, in s, `process_data` which objects of a dump are not compared,
    `remark` what a green step has left out, `asked_again` how many SDO requests were asked a second time, `slowest` the
    longest time until what was waited for came, in s, where the step names none.
    """

    def __init__(self, timeout: float, decoder: Decoder, bench: Bench, reported: set[suite.Report]) -> None:
        self.timeout, self.decoder, self.trace, self.reported = timeout, decoder, bench.trace, reported
        self.variables: dict[str, Any] = {}
        self.kept: dict[str, Address] = {}
        self.started: int | None = None
        self.mark, self.edge = 0, len(bench.trace)
        self.dumped: dict[str, str] = {}
        self.process_data: set[str] = set()
        self.remark = ""
        self.taken: set[Address] = set()
        self.answers: dict[int, Sent] = {}
        self.is_asking, self.missed = False, 0.0
        self.asked_again, self.slowest = 0, 0.0
        self._servers = {each.sdo_request: each for each in map(suite.NodeServices.of, decoder.dictionaries)}
        self._opened: dict[suite.NodeServices, Address] = {}
        self._silent: set[suite.NodeServices] = set()
        self._bench = bench
        self._used: set[int] = set()
        self._answering: set[asyncio.Task[None]] = set()
        self.trace.heard = self._heard

    def words(self, frame: Frame) -> str:
        """Say what a frame means; empty if that is not known."""
        return _words(self.decoder(frame))

    def last_frames(self, number: int) -> Iterator[tuple[SeenFrame, str]]:
        """Yield the last frames of the trace with what they mean, read as those of a log are: by the ones before."""
        following = Following(self.decoder)
        frames = self.trace.frames[-MOST_BEFORE:]
        for place, seen in enumerate(frames, number - len(frames)):
            meaning = following(seen.time, "", seen.frame)
            if place >= 0:
                yield seen, _words(meaning)

    # Asking

    def ask(self) -> None:
        """Begin a question: what came before it answers nothing."""
        # The edge is where `never` and `period` begin to look, the mark where `expect` does: an answer that was
        # expected moves the edge behind it, but other answers to the same question may stand before it.
        self.mark = self.edge = len(self.trace)

    async def settle(self) -> None:
        """End what a red step has left open: what a node still says to it does not answer the next question."""
        # A frame that did not come may be on its way: it would be red once more, where none may come.
        if self.missed > 0:
            await self.trace.sleep(self.missed)
        for node, address in self._opened.items():
            await self.put(Frame(node.sdo_request, aborted(address, AbortCode.GENERAL)))
            await self._wait_for_silence(node)
            if not await self.is_there(node, self.timeout):  # it may have crashed
                self._silent.add(node)
        self._opened.clear()
        self.missed = 0.0
        await self.trace.sleep(UNCONFIRMED)
        self.edge = len(self.trace)

    async def _wait_for_silence(self, node: suite.NodeServices) -> None:
        """Wait until a server has sent nothing for a while, such as the rest of a block."""
        deadline, start = self.trace.now + LATEST, len(self.trace)
        while (now := self.trace.now) < deadline:
            number = await self.trace.first(frozenset([node.sdo_answer]), start, min(now + SILENT, deadline))
            if number is None:
                return
            start = number + 1

    async def put_raw(self, frame: Frame) -> None:
        """Send a frame of a step; one that begins a transfer is aborted if a step behind it is red."""
        node = self._servers.get(frame.cob_id)
        if node is not None and begins_transfer(frame.data):
            self._opened[node] = Initiate.of(frame.data).address
        await self.put(frame)

    async def put(self, frame: Frame) -> None:
        """Send a frame; raises BusError."""
        self.trace.add(SeenFrame(await self._bench.send(frame), frame, own=True))

    def _heard(self, frame: Frame) -> None:
        """Answer a frame for the node that the tester plays."""
        if frame.cob_id in self.answers:
            task = asyncio.ensure_future(self.put(self.answers[frame.cob_id].frame(self.variables)))
            self._answering.add(task)  # the loop itself keeps only a weak reference to a task
            task.add_done_callback(self._answered)

    def _answered(self, task: asyncio.Task[None]) -> None:
        self._answering.discard(task)
        error = None if task.cancelled() else task.exception()
        if isinstance(error, BusError):  # nobody awaits the task, so the step under way has to hear of it
            self.trace.fail(error)

    # Expecting

    def came(self, after: float, within: float) -> None:
        """Note when something came that was waited for; who waits less than `LATEST` s has a reason for it."""
        self.slowest = max(self.slowest, after if within >= LATEST else 0.0)

    def longest(self, within: float | None) -> float:
        """Return how long a step takes at most, in s."""
        return self.timeout if within is None else within

    def deadline(self, within: float | None) -> float:
        """Return when a step that begins now is at its end."""
        return self.trace.now + self.longest(within)

    async def next(self, patterns: Sequence[Pattern], start: int, deadline: float) -> tuple[int, SeenFrame] | None:
        """Return the next frame, with its number, that no step has used yet and that one of the patterns may be."""
        cob_ids = frozenset(pattern.cob_id for pattern in patterns)
        number = await self.trace.first(cob_ids, start, deadline)
        while number in self._used:  # two equal `expect` want two frames
            number = await self.trace.first(cob_ids, number + 1, deadline)
        return None if number is None else (number, self.trace.frames[number])

    def use(self, number: int) -> None:
        """Note that a step has used a frame, and that the next one looks behind it."""
        self._used.add(number)
        self.edge = number + 1

    def mismatches(self, pattern: Pattern, seen: SeenFrame) -> list[Mismatch]:
        """Return how a frame differs; raises NotSaved."""
        if pattern.cob_id != seen.frame.cob_id:
            return [Mismatch("message", str(pattern), self.meaning(seen))]
        return pattern.mismatches(seen.frame, self.variables)

    def meaning(self, seen: SeenFrame) -> str:
        """Say what a frame means, or what it is."""
        return self.words(seen.frame) or str(seen.frame)

    def with_last(self, what: str, pattern: Pattern, last: SeenFrame | None, off: Sequence[Mismatch] = ()) -> Failed:
        """Say that what was wanted did not come, and what came last instead."""
        wanted = pattern.text(self.variables)
        if last is None:
            return Failed(what, wanted, "nothing")
        return Failed(what, wanted, self.meaning(last), (*self.mismatches(pattern, last), *off))

    # SDO

    def skip_if_taken(self, variable: ODVariable) -> None:
        """Raise Skipped for an object that has taken what it should have refused, which is red already."""
        if objects.address_of(variable) in self.taken:
            raise Skipped(f"{objects.label(variable)} has taken what it should refuse, which is red")

    async def asked(self, begin: Callable[[], sdo.Transfer], node: suite.NodeServices) -> bytes:
        """Do a transfer, a second time if its answer does not come, as any client would; raises NoAnswer, Aborted.

        One that did not answer twice is first asked whether it is there: it may be gone, or STOPPED; raises Skipped.
        """
        if node in self._silent and not await self.is_there(node, self.timeout):
            raise Skipped(f"{node.name} does not answer since a step that is red")
        self._silent.discard(node)
        with suppress(NoAnswer):
            return await self.transfer(begin(), node, LATEST)
        self.asked_again += 1
        try:
            return await self.transfer(begin(), node)
        except NoAnswer:
            self._silent.add(node)
            raise

    async def is_there(self, node: suite.NodeServices, wait: float) -> bool:
        """Return whether a node answers at all within `wait` s, if only by an abort."""
        with suppress(NoAnswer):
            with suppress(sdo.Aborted, sdo.OddAnswer):
                await self.transfer(sdo.upload(ERROR_REGISTER, wait), node)  # which every device has
            return True
        return False

    async def transfer(self, transfer: sdo.Transfer, node: suite.NodeServices, latest: float = 0.0) -> bytes:
        """Do a transfer and return what it brought; a late answer is waited for until `latest` s after its request.

        Raises NoAnswer, Aborted.

        An answer that has not the length of an SDO frame raises OddAnswer.
        """
        requests = transfer.start(self.trace.now)
        start = len(self.trace)  # before sending, as a fast node answers before `_put` has returned
        while True:
            for request in requests:
                await self.put(Frame(node.sdo_request, request))
            if requests and not transfer.done:  # the node's time begins when it can have the request
                transfer.deadline = self.trace.now + transfer.wait
            if transfer.done:  # only now: the last request may be an abort of ours, which the node has to get
                if requests:  # the end of a block or an abort, which no answer confirms: many servers keep one frame
                    await self.trace.sleep(UNCONFIRMED)
                break
            number = await self.trace.first(frozenset([node.sdo_answer]), start, transfer.deadline)
            if number is None:
                requests = transfer.tick(transfer.deadline)
                continue
            self.use(number)
            start = number + 1  # not the end of the trace: a block's segments come several at a time
            answer = self.trace.frames[number].frame.data
            if len(answer) != LENGTH:
                raise sdo.OddAnswer(answer, f"of {LENGTH} bytes")
            requests = transfer.receive(answer, self.trace.now)
        try:
            return transfer.result()
        except sdo.Silence as silence:
            # A late answer is to this question, and must not be taken for one to the next.
            patience = max(transfer.wait, latest - transfer.wait)
            late = await self.trace.first(frozenset([node.sdo_answer]), start, self.trace.now + patience)
            if late is not None:
                self.use(late)
                await self.trace.sleep(UNCONFIRMED)  # a node may answer even the abort
            other = f" (but {silence.skipped[-1].hex(' ').upper()}, which is none)" if silence.skipped else ""
            raise NoAnswer("SDO request", f"answer from {node.name}{other}", 1, transfer.wait) from None


def begins_transfer(request: bytes) -> bool:
    """Return whether a request begins a transfer, by its command specifier and, of blocks, its sub-command."""
    command = request[0] if len(request) == LENGTH else 0
    is_block_upload, is_block_download = command & 0xE3 == 0xA0, command & 0xE1 == 0xC0
    return command >> 5 in (ClientCommand.DOWNLOAD, ClientCommand.UPLOAD) or is_block_upload or is_block_download


def _words(meaning: Meaning) -> str:
    if isinstance(meaning.raw, Frame) and meaning.raw.is_remote:
        return "remote frame"
    return f"{meaning.name}  {meaning.text}".rstrip() if meaning.name else ""
