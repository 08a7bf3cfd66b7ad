"""What the actions of a suite share: the last request, used frames, variables, and SDO transfers.

`expect` looks at the frames since the last request and uses each frame once; `never` and `period` look at those since
the end of the step before. A request is a `send` (several in a row count as one), an `nmt`, an `sdo` or a `poll`. All
times and frames are those of the bench.
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
from eurobot_od.device.nmt import NmtState, error_control
from eurobot_od.errors import BusError, NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.od import objects
from eurobot_od.od.standard import ERROR_REGISTER
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import LENGTH, AbortCode, ClientCommand, Initiate, aborted
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.meaning import Decoder, Meaning

UNCONFIRMED = 0.02
"""Time to wait after an SDO request that the server does not confirm, in s."""

LATEST = 3.0
"""How long after its request an answer is still taken for this request's, in s; the standard names no time."""

SILENT = 0.05
"""An SDO server that sends nothing for this long, in s, has finished an aborted transfer."""

MOST_BEFORE = 512
"""Maximum number of frames that are decoded to understand the last ones; an SDO block has at most 127."""


class NotPassed(Exception):
    """A step that has not passed; `reason` says why."""

    def __init__(self, what: str, expected: str = "", came: str = "", mismatches: Sequence[Mismatch] = ()) -> None:
        super().__init__(what)
        self.reason = StepReason(what, expected, came, tuple(mismatches))


class Failed(NotPassed):
    """A step is red."""


class Gone(Failed):
    """A node does not come back from a reset, so it can be asked nothing else."""


class Skipped(NotPassed):
    """A step is skipped."""


class BenchTester:
    """The tester on a bench, as the actions of a suite use it.

    `mark`: number of the first frame that may answer the last request.
    `edge`: number of the first frame after the last step.
    `variables`: the variables of the suite; `kept`: the object from which each of them was read.
    `started`: node-ID of the node that an NMT command has just started.
    `taken`: objects that accepted a value that they should refuse.
    `dumped`: what a dump has read; `process_data`: its objects that are not compared.
    `reported`: findings that are reported once per node.
    `answers`: frames with which the tester answers others by itself, by COB-ID.
    `is_asking`: whether the last action was a `send`, so that the next one belongs to the same request.
    `missed`: for how long a frame that did not come may still be on its way, in s.
    `remark`: what a green step has not compared.
    `asked_again`: number of SDO requests that were repeated.
    `slowest`: the longest wait for a frame, in s, of the steps that name no time.
    """

    def __init__(self, timeout: float, decoder: Decoder, bench: Bench, reported: set[suite.Report]) -> None:
        self.timeout = timeout
        self.decoder = decoder
        self.trace = bench.trace
        self.reported = reported
        self.variables: dict[str, Any] = {}
        self.kept: dict[str, Address] = {}
        self.started: int | None = None
        self.mark = 0
        self.edge = len(bench.trace)
        self.dumped: dict[str, str] = {}
        self.process_data: set[str] = set()
        self.remark = ""
        self.taken: set[Address] = set()
        self.answers: dict[int, Sent] = {}
        self.is_asking = False
        self.missed = 0.0
        self.asked_again = 0
        self.slowest = 0.0
        self._servers = {each.sdo_request: each for each in map(suite.NodeServices.of, decoder.dictionaries)}
        self._opened: dict[suite.NodeServices, Address] = {}
        self._silent: set[suite.NodeServices] = set()
        self._bench = bench
        self._used: set[int] = set()
        self._answering: set[asyncio.Task[None]] = set()
        self.trace.listener = self._answer

    def words(self, frame: Frame) -> str:
        """Return the meaning of a frame as text; empty if it is not known."""
        return _words(self.decoder(frame))

    def last_frames(self, number: int) -> Iterator[tuple[SeenFrame, str]]:
        """Yield the last frames of the trace with their meanings; earlier frames are decoded first, as in a log."""
        following = TrackingDecoder(self.decoder)
        frames = self.trace.frames[-MOST_BEFORE:]
        for place, seen in enumerate(frames, number - len(frames)):
            meaning = following(seen.time, "", seen.frame)
            if place >= 0:
                yield seen, _words(meaning)

    # Asking

    def ask(self) -> None:
        """Begin a request: earlier frames do not answer it."""
        # `never` and `period` look from the edge on, `expect` from the mark on. An expected answer moves the edge
        # behind itself, but other answers to the same request may come before it.
        self.mark = self.edge = len(self.trace)

    async def settle(self) -> None:
        """Abort the transfers that a red step has left open, and wait for the rest of their answers."""
        # A late frame would make the next step red as well, if that expects none.
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
        """Wait until a server has sent nothing for a while; it may still be sending a block."""
        deadline = self.trace.now + LATEST
        start = len(self.trace)
        while (now := self.trace.now) < deadline:
            number = await self.trace.first(frozenset([node.sdo_answer]), start, min(now + SILENT, deadline))
            if number is None:
                return
            start = number + 1

    async def put_raw(self, frame: Frame) -> None:
        """Send a frame of a step; a transfer that it begins is aborted later if a step is red."""
        node = self._servers.get(frame.cob_id)
        if node is not None and begins_transfer(frame.data):
            self._opened[node] = Initiate.of(frame.data).address
        await self.put(frame)

    async def put(self, frame: Frame) -> None:
        """Send a frame; raises BusError."""
        self.trace.add(SeenFrame(await self._bench.send(frame), frame, own=True))

    def _answer(self, frame: Frame) -> None:
        """Answer a frame for a node that the tester plays."""
        if frame.cob_id in self.answers:
            task = asyncio.ensure_future(self.put(self.answers[frame.cob_id].frame(self.variables)))
            self._answering.add(task)  # the loop itself keeps only a weak reference to a task
            task.add_done_callback(self._answered)

    def _answered(self, task: asyncio.Task[None]) -> None:
        self._answering.discard(task)
        error = None if task.cancelled() else task.exception()
        if isinstance(error, BusError):  # nothing awaits the task, so the trace passes the error on to the current step
            self.trace.fail(error)

    # Expecting

    def note_wait(self, seconds: float, within: float) -> None:
        """Keep the longest wait for a frame, unless the step names a time shorter than `LATEST`."""
        if within >= LATEST:
            self.slowest = max(self.slowest, seconds)

    def longest(self, within: float | None) -> float:
        """Return the maximum time of a step in s."""
        return self.timeout if within is None else within

    def deadline(self, within: float | None) -> float:
        """Return when a step that begins now has to end."""
        return self.trace.now + self.longest(within)

    async def next(self, patterns: Sequence[Pattern], start: int, deadline: float) -> tuple[int, SeenFrame] | None:
        """Return the next unused frame with the COB-ID of one of the patterns, with its number; None if none comes."""
        cob_ids = frozenset(pattern.cob_id for pattern in patterns)
        number = await self.trace.first(cob_ids, start, deadline)
        while number in self._used:  # two equal `expect` want two frames
            number = await self.trace.first(cob_ids, number + 1, deadline)
        return None if number is None else (number, self.trace.frames[number])

    def use(self, number: int) -> None:
        """Mark a frame as used; the next step looks behind it."""
        self._used.add(number)
        self.edge = number + 1

    def mismatches(self, pattern: Pattern, seen: SeenFrame) -> list[Mismatch]:
        """Return how a frame differs from a pattern; raises NotSaved."""
        if pattern.cob_id != seen.frame.cob_id:
            return [Mismatch("message", str(pattern), self.meaning(seen))]
        return pattern.mismatches(seen.frame, self.variables)

    def meaning(self, seen: SeenFrame) -> str:
        """Return the meaning of a frame as text, the frame itself if that is not known."""
        return self.words(seen.frame) or str(seen.frame)

    def with_last(self, what: str, pattern: Pattern, last: SeenFrame | None, off: Sequence[Mismatch] = ()) -> Failed:
        """Return the error that an expected frame did not come, with the last frame that came instead."""
        wanted = pattern.text(self.variables)
        if last is None:
            return Failed(what, wanted, "nothing")
        return Failed(what, wanted, self.meaning(last), (*self.mismatches(pattern, last), *off))

    # SDO

    def skip_if_taken(self, variable: ODVariable) -> None:
        """Skip the step if the object has accepted a value that it should refuse, which is red already."""
        if objects.address_of(variable) in self.taken:
            raise Skipped(f"{objects.label(variable)} has taken what it should refuse, which is red")

    async def asked(self, begin: Callable[[], sdo.Transfer], node: suite.NodeServices, *, again: bool = True) -> bytes:
        """Do a transfer, and repeat it once if no answer comes, as any client would, unless it is not asked `again`.

        A server that did not answer twice is asked first whether it is there: it may be lost, or STOPPED. Raises
        Skipped if it is not, NoAnswer, Aborted.
        """
        if node in self._silent and not await self.is_there(node, self.timeout):
            raise Skipped(f"{node.name} does not answer since a step that is red")
        self._silent.discard(node)
        if again:
            with suppress(NoAnswer):
                return await self.transfer(begin(), node, LATEST)
            self.asked_again += 1
        try:
            return await self.transfer(begin(), node, 0.0 if again else LATEST)
        except NoAnswer:
            self._silent.add(node)
            raise

    async def is_there(self, node: suite.NodeServices, wait: float) -> bool:
        """Return whether a node answers an SDO request within `wait` s; an abort counts, too."""
        with suppress(NoAnswer):
            with suppress(sdo.Aborted, sdo.OddAnswer):
                await self.transfer(sdo.upload(ERROR_REGISTER, wait, room=sdo.A_NUMBER), node)  # which every device has
            return True
        return False

    def _is_stopped(self, node: suite.NodeServices) -> bool:
        """Return whether a node's last heartbeat says STOPPED."""
        frames = (each.frame for each in reversed(self.trace.frames) if not each.own)
        last = next((each for each in frames if each.cob_id == ERROR_CONTROL_BASE + node.node_id), None)
        return last == error_control(node.node_id, NmtState.STOPPED)

    async def transfer(self, transfer: sdo.Transfer, node: suite.NodeServices, latest: float = 0.0) -> bytes:
        """Do a transfer and return its data; wait for a late answer until `latest` s after its request.

        Raises NoAnswer, Aborted, and OddAnswer for an answer that does not have the length of an SDO frame.
        """
        requests = transfer.start(self.trace.now)
        start = len(self.trace)  # before sending, as a fast node answers before `put` returns
        while True:
            for request in requests:
                await self.put(Frame(node.sdo_request, request))
            if requests and not transfer.done:  # the node's time begins when it has the request
                transfer.deadline = self.trace.now + transfer.wait
            if transfer.done:  # after sending, as the last request may be our abort, which the node needs
                if (
                    requests
                ):  # the end of a block or an abort, which is not confirmed: many servers buffer one frame only
                    await self.trace.sleep(UNCONFIRMED)
                break
            number = await self.trace.first(frozenset([node.sdo_answer]), start, transfer.deadline)
            if number is None:
                requests = transfer.tick(transfer.deadline)
                continue
            self.use(number)
            start = number + 1  # not the end of the trace, as several segments of a block may have come
            answer = self.trace.frames[number].frame.data
            if len(answer) != LENGTH:
                raise sdo.OddAnswer(answer, f"of {LENGTH} bytes")
            requests = transfer.receive(answer, self.trace.now)
        try:
            return transfer.result()
        except sdo.Silence as silence:
            # A late answer belongs to this request, and must not be taken for one to the next.
            patience = max(transfer.wait, latest - transfer.wait)
            late = await self.trace.first(frozenset([node.sdo_answer]), start, self.trace.now + patience)
            if late is not None:
                self.use(late)
                await self.trace.sleep(UNCONFIRMED)  # a node may answer even the abort
            other = f" (but {silence.skipped[-1].hex(' ').upper()}, which is none)" if silence.skipped else ""
            other += f" ({IS_STOPPED})" if self._is_stopped(node) else ""
            raise NoAnswer("SDO request", f"answer from {node.name}{other}", 1, transfer.wait) from None


IS_STOPPED = "its last heartbeat says stopped: a stopped node answers no SDO; NMT start wakes it"


def begins_transfer(request: bytes) -> bool:
    """Return whether a request begins a transfer, by its command specifier and, for blocks, its subcommand."""
    command = request[0] if len(request) == LENGTH else 0
    is_block_upload, is_block_download = command & 0xE3 == 0xA0, command & 0xE1 == 0xC0
    return command >> 5 in (ClientCommand.DOWNLOAD, ClientCommand.UPLOAD) or is_block_upload or is_block_download


def _words(meaning: Meaning) -> str:
    if isinstance(meaning.raw, Frame) and meaning.raw.is_remote:
        return "remote frame"
    return f"{meaning.name}  {meaning.text}".rstrip() if meaning.name else ""
