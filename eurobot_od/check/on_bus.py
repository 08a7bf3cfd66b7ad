"""Benches: a simulated bus with nodes in simulated time, and a real bus with the nodes on it.

On the simulated one, the same suite and seed give the same frames, bit by bit.

The tester is one more node on it. Its frames take part in the arbitration like any other, so `send` ends when the bus
has carried the frame; answers are measured from that time. The bus runs between two steps of the event loop (see
`bus.simulated.loop`), and the loop adds the frames to the trace in their order.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import Any, NamedTuple, TypeAlias

import can

from eurobot_od.bus import live as runtime
from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import Simulation, processing_time
from eurobot_od.check.bench import BEHIND, SeenFrame, Trace
from eurobot_od.check.report import SuiteResult
from eurobot_od.check.runner import Runner, RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.controller import Report
from eurobot_od.device.nmt import NmtState, error_control
from eurobot_od.device.node import Node
from eurobot_od.device.station import OnError
from eurobot_od.errors import BusError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ERROR_CONTROL_BASE
from eurobot_od.support import extras

POWER_UP = 0.1
"""Time after which all nodes are up, in s; then the suite and the nodes' programs begin."""

BOOT_STEP = 0.02
"""Time between the boot-ups of two nodes, in s."""

SEND_WAIT = 0.5
"""Maximum time that a frame may wait for the bus, in s."""


class NotSent(RemoteError):
    """A frame that the tester could not send, because frames of higher priority kept the bus busy."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(f"the bus was never free for {frame}")


class NodeUnderTest(NamedTuple):
    """A simulated node, and the program it runs after each boot; None if it only answers."""

    node: Node
    program: Callable[[], Coroutine[Any, Any, None]] | None = None


MakeNodes: TypeAlias = Callable[[Mapping[str, Dictionary], int, Callable[[], float]], Sequence[NodeUnderTest]]
"""Makes the nodes under test from their dictionaries by name, with all chance from a seed, and with a clock."""


class Tester(Node):
    """The tester as a node on the simulated bus; it sends only the frames that are put into it."""

    def start(self, now: float) -> list[Frame]:
        self.now = now
        return []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return []


class SimulatedBench:
    """The bench of a simulated bus."""

    def __init__(self, network: Simulation, tester: Tester) -> None:
        self._network = network
        self._tester = tester
        self.trace = Trace()
        self._sending: list[tuple[Frame, asyncio.Future[float]]] = []

    async def begin(self) -> None:
        """Start to record the nodes' frames, and let the nodes boot."""
        running = asyncio.get_running_loop()

        def seen(now: float, frame: Frame) -> None:
            # A node's frame that equals the tester's is taken for the tester's; on a wire the two could merge.
            # The bus runs while the loop sleeps, so tasks are woken in the loop's next turn.
            own = next((each for each in self._sending if each[0] == frame), None)
            if own is not None:
                running.call_soon_threadsafe(own[1].set_result, now)
                self._sending.remove(own)
            else:
                running.call_soon_threadsafe(self.trace.add, SeenFrame(now, frame))

        self._network.observers.append(seen)
        await asyncio.sleep(POWER_UP)

    async def recover(self) -> bool:
        """Return False: a simulated bus is never lost, so it never comes back."""
        return False

    async def send(self, frame: Frame) -> float:
        """Send a frame; return the time at which the bus has carried it. Raises NotSent."""
        if frame.is_remote:
            self._network.request(frame)
            return asyncio.get_running_loop().time()
        sent: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        sending = frame, sent
        self._sending.append(sending)
        self._tester.put(frame)
        # `wait_for` would cancel the future, whose result may have been scheduled already.
        await asyncio.wait([sent], timeout=SEND_WAIT)
        if not sent.done():
            self._sending.remove(sending)
            raise NotSent(frame)
        return sent.result()


class Program:
    """Runs a node's program from its beginning at each boot of the node, and cancels the run before."""

    def __init__(self, node: Node, program: Callable[[], Coroutine[Any, Any, None]], network: Simulation) -> None:
        self._program = program
        self._network = network
        self._boot_up = error_control(node.device.node_id, NmtState.INITIALISING)
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the program, now and at every boot-up message of the node."""
        running = asyncio.get_running_loop()
        self._restart()

        def seen(_: float, frame: Frame) -> None:
            if frame == self._boot_up:
                running.call_soon_threadsafe(self._restart)

        self._network.observers.append(seen)

    def _restart(self) -> None:
        self.stop()
        self._task = asyncio.ensure_future(self._play())

    def stop(self) -> None:
        """Cancel the program."""
        if self._task is not None:
            self._task.cancel()

    async def _play(self) -> None:
        await asyncio.sleep(POWER_UP)  # after each boot: the other nodes may be booting as well
        await self._program()


def run_simulated(suite: Suite, options: RunOptions, make_nodes: MakeNodes, seed: int = 1) -> SuiteResult:
    """Run a suite against simulated nodes, with all random numbers from `seed`."""
    network = Simulation()
    tested = make_nodes({name: suite.dictionaries[name] for name in suite.nodes}, seed, lambda: network.now)
    for number, (node, _) in enumerate(tested):
        network.attach(node, number * BOOT_STEP, processing_time(seed, node.name), OnError.RESTART)
    # A node needs a dictionary, but the tester uses nothing of it.
    tester = Tester(next(iter(suite.dictionaries.values())))
    network.attach(tester)
    programs = [Program(node, program, network) for node, program in tested if program is not None]

    async def main() -> SuiteResult:
        for program in programs:
            program.start()
        try:
            bench = SimulatedBench(network, tester)
            return await Runner(suite, bench, options).run(f"simulated, seed {seed}")
        finally:
            for program in programs:
                program.stop()
            await asyncio.sleep(0)  # a cancelled task ends only when the loop has its turn

    result = loop.run(network, main())
    return replace(result, remarks=(*result.remarks, *dict.fromkeys(raised(network.reports))))


def raised(reports: Sequence[Report]) -> Iterator[str]:
    """Yield each exception that a node has raised, with the line in a package's code; a suite sees no answer only."""
    for each in reports:
        if each.error is not None:
            yield f"{each.name} has failed: {extras.complaint(each.error, each.name, extras.is_foreign)}"


# A real bus

RETRY = 0.001  # at 1 Mbit/s a bus carries some eight frames in this time
"""Time between two tries to send, in s."""

RECOVERY = 12.0
"""Maximum time to wait for a bus before the teardown, in s: the last try to open it again is after 11.3 s."""


DRIFT = 1e-4
"""Maximum relative difference between a driver's clock and ours."""


class Arrivals:
    """Converts a driver's time stamps to our clock, however late frames are read.

    The stamps start anywhere. A frame that was read without delay shows the offset; one that seems to have waited
    longer than `BEHIND` shows that the driver's clock was set.
    """

    def __init__(self) -> None:
        self._offset = inf
        self._last = 0.0

    def time(self, stamp: float, now: float) -> float:
        """Return when a frame came that is read `now`; `stamp` is 0.0 if the driver gives none."""
        if not stamp:
            return now
        self._offset = min(self._offset + DRIFT * (now - self._last), now - stamp)
        self._last = now
        if now - stamp - self._offset > BEHIND:
            self._offset = now - stamp
        return stamp + self._offset


class LiveBench:
    """The bench of a python-can bus, opened by `open_bus` when its `reader` is entered; opening raises BusError.

    `seen` and `failed` may be called from any thread.
    """

    def __init__(self, open_bus: Callable[[], can.BusABC]) -> None:
        loop = self._loop = asyncio.get_running_loop()
        self._works = asyncio.Event()
        self._works.set()
        self._arrivals = Arrivals()
        self.reader = runtime.FrameReader(
            open_bus(),
            self.seen,
            None,
            self.failed,
            opener=open_bus,
            back=lambda _gap: loop.call_soon_threadsafe(self._works.set),
            idle=lambda: loop.call_soon_threadsafe(self.trace.caught_up, time.monotonic()),
        )
        self.trace = Trace()
        self.trace.read_to = time.monotonic()

    async def begin(self) -> None:
        """Do not wait: on a real bus nothing says when the nodes have booted."""

    def seen(self, stamp: float, frame: Frame) -> None:
        """Record a frame, with its time by the clock of asyncio's loop, which deadlines use, too."""
        came = self._arrivals.time(stamp, time.monotonic())
        self._loop.call_soon_threadsafe(self.trace.add, SeenFrame(came, frame))

    def failed(self, failure: BusError) -> None:
        """Make the trace raise the error, as the bus has failed."""
        self._loop.call_soon_threadsafe(self._works.clear)
        self._loop.call_soon_threadsafe(self.trace.fail, failure)

    async def recover(self) -> bool:
        """Wait until the bus works again; return False if it does not within `RECOVERY` s."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._works.wait(), RECOVERY)
        # Also if it did not come back: the teardown is skipped then, and nothing waits for a frame any more.
        self.trace.recover()
        return self._works.is_set()

    async def send(self, frame: Frame) -> float:
        """Send a frame; raises BusError if the driver does not accept it."""
        begun = now = self._loop.time()
        while not self.reader.send(frame):
            if now > begun + SEND_WAIT:
                raise BusError(f"the bus {self.reader.name} did not take {frame}")
            await asyncio.sleep(RETRY)
            # The time before the try that succeeds: an answer must not seem to come before its request.
            now = self._loop.time()
        return now


def _played_but_present(suite: Suite, frames: Sequence[SeenFrame]) -> Iterator[str]:
    """Yield a line for each node whose messages the tester sent while the node was on the bus."""
    sent = {each.frame.cob_id for each in frames if each.own}
    heard = {each.frame.cob_id for each in frames if not each.own}
    for name, dictionary in suite.dictionaries.items():
        messages = {each.cob_id for each in suite.decoder.protocol.bindings if name in each.senders}
        if name not in suite.nodes and messages & sent and ERROR_CONTROL_BASE + dictionary.node_id in heard:
            yield f"{name} (node {dictionary.node_id}) is on this bus, and the tester sends its messages: switch it off"


def run_live(suite: Suite, options: RunOptions, open_bus: Callable[[], can.BusABC]) -> SuiteResult:
    """Run a suite against the nodes on a bus; raises BusError if the bus cannot be opened."""

    async def main() -> SuiteResult:
        bench = LiveBench(open_bus)
        with bench.reader:
            result = await Runner(suite, bench, options).run(f"on {bench.reader.name}")
            return replace(result, remarks=(*result.remarks, *_played_but_present(suite, bench.trace.frames)))

    return asyncio.run(main())
