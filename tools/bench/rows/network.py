"""Many nodes at once: twenty configured at the same time, and a TPDO read at 100 Hz, beside stock canopen.

The nodes are simulated servo drives that answer 2 ms after a request, as drives on a bus do; one thread runs them all,
whichever master asks.
"""

from __future__ import annotations

import asyncio
import heapq
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import count, islice, pairwise
from pathlib import Path
from statistics import median

import can
import canopen

from bench.measure import SELDOM, Claim, Contender, Figures, Quantity, Scale, Series, Way
from bench.shared import new_bus, new_channel
from eurobot_od import AsyncNetwork, Dictionary, Frame, Network, SimulatedDevice
from eurobot_od.od import dcf
from eurobot_od.od.values import NMT_COB_ID, SDO_REQUEST_BASE, SYNC_COB_ID

EDS = Path(__file__).parents[3] / "docs" / "servo.eds"
ANSWER_DELAY = 0.002
"""Time from a request to its answer, in s: both frames and a control loop of the drive."""

PATIENCE = 10.0
"""Timeout of an answer for both masters, in s; on a busy machine it may be late."""

PERIOD = 0.01
LOOK = 0.002


class Rack:
    """Drives on one bus, run by one thread."""

    def __init__(self, channel: str, devices: Mapping[int, SimulatedDevice]) -> None:
        self._bus = new_bus(channel)
        self._devices = devices
        self._answers: list[tuple[float, int, Frame]] = []
        self._numbers = count()
        self._runs = True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and leave the bus."""
        self._runs = False
        self._thread.join()
        self._bus.shutdown()

    def _plan(self, due: float, frames: Sequence[Frame]) -> None:
        for frame in frames:
            heapq.heappush(self._answers, (due, next(self._numbers), frame))

    def _run(self) -> None:
        for device in self._devices.values():
            self._plan(0.0, device.start(time.perf_counter()))
        while self._runs:
            now = time.perf_counter()
            while self._answers and self._answers[0][0] <= now:
                cob_id, data = heapq.heappop(self._answers)[-1]
                self._bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
            due = self._answers[0][0] - now if self._answers else LOOK
            message = self._bus.recv(max(0.0, min(due, LOOK)))
            if message is not None:
                self._hear(Frame(message.arbitration_id, bytes(message.data)), time.perf_counter())
            for device in self._devices.values():
                if device.next_wakeup <= now:
                    self._plan(now, device.tick(now))

    def _hear(self, frame: Frame, now: float) -> None:
        node_id = frame.cob_id - SDO_REQUEST_BASE
        if node_id in self._devices:
            self._plan(now + ANSWER_DELAY, self._devices[node_id].receive(frame, now))
        elif frame.cob_id in (NMT_COB_ID, SYNC_COB_ID):
            for device in self._devices.values():
                self._plan(now, device.receive(frame, now))


def files_of(folder: Path, servos: Mapping[int, Dictionary], velocity: int) -> dict[int, Path]:
    """Write a DCF for each drive with another velocity, heartbeat time and gain than before, and a longer TPDO1."""
    files = {node_id: folder / f"{velocity}_{node_id}.dcf" for node_id in servos}
    for node_id, servo in servos.items():
        mapping = {(0x1A00, 0): 3, (0x1A00, 1): 0x60410010, (0x1A00, 2): 0x606C0020, (0x1A00, 3): 0x60770010}
        values = {(0x6081, 0): velocity, (0x1017, 0): 500 + velocity % 7, (0x2010, 1): velocity, **mapping}
        files[node_id].write_text(dcf.with_values(servo.device, values, node_id, "servo", 500))
    return files


async def _side_by_side(channel: str, servos: Mapping[int, Dictionary], files: Mapping[int, Path]) -> float:
    async with AsyncNetwork.open("virtual", channel, answer_wait=PATIENCE) as network:
        drives = [network.add(*each) for each in servos.items()]
        started = time.perf_counter()
        await asyncio.gather(*(drive.configure(files[drive.node_id]) for drive in drives))
        return time.perf_counter() - started


def _one_after_the_other(channel: str, files: Mapping[int, Path]) -> float:
    network = canopen.Network()
    network.NOTIFIER_CYCLE = PERIOD
    network.connect(interface="virtual", channel=channel)
    nodes = [network.add_node(canopen.RemoteNode(node_id, str(file))) for node_id, file in files.items()]
    started = time.perf_counter()
    for node in nodes:
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        node.load_configuration()
    seconds = time.perf_counter() - started
    network.disconnect()
    return seconds


@contextmanager
def configured(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Run the drives, and yield both masters; each round writes other values."""
    channel = new_channel()
    velocities = count(1001)
    servo = Dictionary.load(EDS, 1)
    servos = {node_id: servo.renumbered(node_id) for node_id in range(1, scale.of(20, 2) + 1)}
    rack = Rack(channel, {node_id: SimulatedDevice(each) for node_id, each in servos.items()})
    with tempfile.TemporaryDirectory() as folder:
        written = partial(files_of, Path(folder), servos)
        yield {
            "ours": lambda: {Quantity.TIME: asyncio.run(_side_by_side(channel, servos, written(next(velocities))))},
            "stock": lambda: {Quantity.TIME: _one_after_the_other(channel, written(next(velocities)))},
        }
    rack.stop()


# A TPDO at 100 Hz


def _figures(times: Sequence[float], cpu: float) -> Figures:
    gaps = [later - earlier for earlier, later in pairwise(times)]
    jitter = median(abs(gap - PERIOD) for gap in gaps)
    return {Quantity.TIME: jitter, Quantity.CPU: cpu / (times[-1] - times[0])}


def _ours(channel: str, servo: Dictionary, number: int) -> Figures:
    with Network.open("virtual", channel, answer_wait=PATIENCE) as network:
        drive = network.add(1, servo)
        drive.nmt.start()
        network.sync(PERIOD)
        begun = time.process_time()
        times = [time.perf_counter() for _ in islice(drive.pdo["TPDO1"], number)]
        return _figures(times, time.process_time() - begun)


def _stock(channel: str, servo: Dictionary, number: int) -> Figures:
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    node = network.add_node(canopen.RemoteNode(1, servo.objects))
    node.sdo.RESPONSE_TIMEOUT = PATIENCE
    node.tpdo.read()  # type: ignore[no-untyped-call]
    node.nmt.state = "OPERATIONAL"
    network.sync.start(PERIOD)
    begun = time.process_time()
    times = list[float]()
    while len(times) < number:
        node.tpdo[1].wait_for_reception(1.0)
        times.append(time.perf_counter())
    spent = time.process_time() - begun
    network.sync.stop()  # type: ignore[no-untyped-call]
    network.disconnect()
    return _figures(times, spent)


@contextmanager
def read(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Run a drive, and yield both masters; for both, the CPU time includes that of the drive."""
    channel = new_channel()
    servo = Dictionary.load(EDS, 1)
    rack = Rack(channel, {1: SimulatedDevice(servo)})
    number = scale.of(200, 20)
    yield {"ours": lambda: _ours(channel, servo, number), "stock": lambda: _stock(channel, servo, number)}
    rack.stop()


CONFIGURED, READ = "20 nodes configured", "TPDO every 10 ms"
SERIES = (
    Series(
        "network",
        CONFIGURED,
        configured,
        (Claim(f"{CONFIGURED}, side by side: stock canopen, one by one", "ours", "stock", Way.RATIO, 1.0),),
        SELDOM,
    ),
    Series(
        "network",
        READ,
        read,
        (
            Claim(f"{READ}, median jitter: stock canopen", "ours", "stock", Way.DIFFERENCE),
            Claim(f"{READ}, CPU: stock canopen", "ours", "stock", Way.RATIO, None, Quantity.CPU),
        ),
        SELDOM,
    ),
)
