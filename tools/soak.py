#!/usr/bin/env python3
"""Injects random faults for as long as one likes into three nodes and a monitor, each in a process of its own.

The bus is SocketCAN's vcan0 where there is one, else a server of python-can-remote on this machine. The core drives
from place to place all the time. Faults come at random times, which follow from the seed. Each has to be *noticed*,
which is reported by a process, and afterwards all has to be *recovered*: all nodes send heartbeats, and another goto is
confirmed.

Numbered frames show what is lost. Each process has to have received every number that was sent, unless it was not
running, its bus was away and it reported that, or it counted as many lost frames within the last seconds (its counters
are of frames of any kind, so older counts excuse nothing). All others are *uncounted*. Two things cannot be known: what
a process received in the last half second before SIGKILL, which counts as "not running" here; and what was on its way
within the operating system when a server ended, which counts as "bus away", as do the seconds before and after.

Memory, threads and file descriptors are read from /proc, once a process has settled, and at its end; memory is judged
by the bytes for each numbered frame in between.

The exit status is 1 if something was not noticed, not recovered, uncounted, or has grown.

`--self-test` runs it with nodes that are broken on purpose, see `soak_node.BROKEN`: each has to be found faulty after a
number of faults, however long they take. The exit status is then 1 if one was not.
"""

from __future__ import annotations

import argparse
import configparser
import operator
import platform
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import ClassVar, NamedTuple, cast

import can
import frame_fuzz
from programs import SERVER, Program, free_port
from soak_node import NUMBERED, Numbers

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.client.master import Master
from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame
from eurobot_od.od.standard import SIGNATURES, STORE
from eurobot_od.robot import dialects
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model.messages import GotoConfirm, KalmanPositionRequest, KalmanPositionResponse, StopDrive
from eurobot_od.robot.nodes import ROLES
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.traffic.monitor import FRAMES_LOST, NOTED_AGAIN

FINE, WRONG = 0, 1

INTERFACE = "vcan0"
PROTOCOL = EurobotProtocol.load()
NODE_IDS = {each.name: each.node_id for each in dialects.load_all()}
EMERGENCY, REQUEST, HEARTBEAT = 0x080, 0x600, 0x700
"""Where the identifiers of EMCY, SDO requests and heartbeats begin; the node-ID is added."""

GOTO_CONFIRM = PROTOCOL.cob_id(GotoConfirm)
HEARTBEATS = {HEARTBEAT + node_id for node_id in NODE_IDS.values()}
EMERGENCIES = {EMERGENCY + node_id: name for name, node_id in NODE_IDS.items()}
HEARD = (GOTO_CONFIRM, *HEARTBEATS, *EMERGENCIES)
"""Identifiers that show whether a fault was noticed and all has recovered."""

NO_ERROR = b"\0\0"
BOOT_UP = b"\0"
"""Data of a boot-up message, which is no heartbeat: a node that only boots is not watched."""

HEARTBEAT_LOST = b"\x30\x81"
PATIENCE = 60.0
"""Seconds within which a fault has to be noticed, and then all recovered."""

STOP, ASK_PLACE, PLACE = (PROTOCOL.cob_id(each) for each in (StopDrive, KalmanPositionRequest, KalmanPositionResponse))

STILL = 0.1
"""How long a place stays the same when the drive stands, in s; it needs a third of that for a millimetre."""

FOREIGN = 2000
"""Frames a second of a stranger while the drive is stopped."""

STRANGER = """
import sys, time
import can
with can.Bus(interface=sys.argv[1], channel=sys.argv[2]) as bus:
    short = can.Message(arbitration_id=0x6F1, data=bytes(8), is_extended_id=False)
    long = can.Message(arbitration_id=0x123457F0, data=bytes(8))  # which ends like that of the numbered frames
    begin, sent = time.monotonic(), 0
    while True:
        due = (time.monotonic() - begin) * int(sys.argv[3])
        while sent < due:
            bus.send(long if sent % 2 else short)
            sent += 1
        time.sleep(0.001)
"""
"""A program of a stranger, with python-can alone: it sends frames of 11 and of 29 bits alternately."""

PERIOD = 0.05
"""Time between two numbered frames, in s."""

FLOOD, HOSTILE = 2000, 300
"""Frames of a flood, and of a burst of hostile ones."""

FROZEN = 3.0
"""How long a node is frozen, in s."""

SETTLED = 5.0
"""Time from its first number until a process should not grow any more, in s."""

MARGIN = 1.0
"""Seconds before and after a gap in which its frames may be lost, too, by a server's queues and the printing of lines.
"""

LEAK = 512
"""Bytes for each numbered frame that a process may grow: the monitor's table takes about 120."""

ARENA = 2048
"""KiB that a process may grow in any case, since the allocator takes memory in pieces."""

CREDIT = NOTED_AGAIN + 1.0
"""How long a counted loss explains missing numbers, in s: with a full queue the next number comes later."""

SETTING = (0x2101, 1)
"""Navigation: Position deviation, UNSIGNED16, which is stored again and again."""


ROUTINE = re.compile(r" *\d|last ")
"""Lines that show no event: a frame in the monitor, a node's counters."""


class Usage(NamedTuple):
    """The memory of a process in KiB, its threads and its open file descriptors."""

    memory: int
    threads: int
    descriptors: int

    @classmethod
    def of(cls, pid: int) -> Usage:
        """Read the usage of a process; Linux only. Raises OSError if there is no such process."""
        process = Path("/proc", str(pid))
        fields = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
        descriptors = sum(1 for _ in (process / "fd").iterdir())
        return cls(int(fields["VmRSS"].split()[0]), int(fields["Threads"]), descriptors)


class Life(NamedTuple):
    """The usage of a process when it had settled and when it ended, and the numbered frames sent in between."""

    begin: Usage
    end: Usage
    frames: int

    def __str__(self) -> str:
        changes = (f"{name} {a} to {b}" for name, a, b in zip(Usage._fields, self.begin, self.end) if b > a)
        return f"{', '.join(changes)} in {self.frames} frames"

    @property
    def has_grown(self) -> bool:
        """Whether it holds more threads or descriptors, or more memory for each frame than expected."""
        more = self.end.memory > self.begin.memory + ARENA + self.frames * LEAK / 1024
        return more or self.end.threads > self.begin.threads or self.end.descriptors > self.begin.descriptors


@dataclass
class Loss:
    """Numbers that did not come while a process ran, and how many lost frames it has counted for them."""

    numbers: range
    counted: int = 0


class Losses:
    """The numbers that a process misses, each loss with the lost frames that the process counted near its time."""

    def __init__(self) -> None:
        self.all: list[Loss] = []
        self._open: list[tuple[float, Loss]] = []
        self._credit: list[tuple[float, int]] = []

    def miss(self, numbers: range, now: float, is_away: bool = False) -> None:
        """Note numbers that did not come; those whose bus was away need no counted frames."""
        self.all.append(loss := Loss(numbers))
        if not is_away:
            self._open.append((now, loss))
            self._settle(now)

    def count(self, frames: int, now: float) -> None:
        """Note how many more lost frames the process has counted."""
        if frames > 0:
            self._credit.append((now, frames))
            self._settle(now)

    def _settle(self, now: float) -> None:
        """Assign counted frames to missing numbers, the oldest first; a count older than CREDIT is dropped."""
        self._open = [(at, loss) for at, loss in self._open if now - at <= CREDIT]
        credit = sum(frames for at, frames in self._credit if now - at <= CREDIT)
        for _, loss in self._open:
            taken = min(credit, len(loss.numbers) - loss.counted)
            loss.counted, credit = loss.counted + taken, credit - taken
        self._open = [(at, loss) for at, loss in self._open if loss.counted < len(loss.numbers)]
        self._credit = [(self._credit[-1][0], credit)] if self._credit and credit else []


class Role:
    """A process that may end and be started again, with its lines, the numbers it misses, and the usage of each life.

    `came_up` is when a node was on the bus. `away` are the times, in seconds, between which its bus was gone; `losses`
    the numbers that did not come while it ran, `before` those that were sent before the first that it saw, and `pauses`
    the times between which it was not up.
    """

    def __init__(self, name: str, *command: str) -> None:
        self.name = name
        self._command = command
        self.said: list[tuple[float, str]] = []
        self.away: list[list[float]] = []
        self.losses = Losses()
        self.before: list[range] = []
        self.pauses: list[list[float]] = [[0.0, float("inf")]]
        self.lives: list[Life] = []
        self._counted = 0
        self.last: int | None = None
        self._watched = Numbers(self._miss)
        self.start()

    def start(self) -> None:
        """Start the process; all is prepared for its first line before."""
        self._begin: tuple[Usage, int] | None = None
        self._up: float | None = None
        self._told = float("inf")
        self.came_up = float("inf")
        self._counted = 0
        self.program = Program(*self._command, took=self._take)

    def kill(self) -> None:
        """End it by SIGKILL."""
        # What it has received since its last line nobody knows; on a busy machine that is more than half a second.
        self.pauses.append([min(time.monotonic(), self._told) - MARGIN, float("inf")])
        self.program.kill()

    def interrupt(self) -> None:
        """End it as Ctrl-C does: the monitor prints its counters only then."""
        self.program.signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            self.program.wait()

    @property
    def is_running(self) -> bool:
        return self.program.popen.poll() is None

    def has_printed(self, what: str, since: float) -> bool:
        """Return whether it has printed a line with that text since a time."""
        return any(what in text for _, text in takewhile(lambda line: line[0] >= since, reversed(self.said)))

    # What it prints

    def _take(self, line: str) -> None:
        for pattern, take in self.LINES:
            match = pattern.search(line)
            if match:
                take(self, *match.groups())
        if not ROUTINE.match(line):
            self.said.append((time.monotonic(), line))

    def _count(self, last: str, overflow: str, missed: str) -> None:
        self._note_lost(int(overflow) + int(missed))
        if last != "None":
            self._saw(int(last))

    def _saw(self, number: int) -> None:
        self._told = time.monotonic()
        if self._up is None:
            self._up = time.monotonic()
            self.before.append(range(0 if self.last is None else self.last + 1, number))
        self.last = number

    def _report_missing(self, first: str, last: str) -> None:
        self._saw(int(first) - 1)
        self._miss(int(first), int(last))

    def _miss(self, first: int, last: int) -> None:
        now = time.monotonic()
        self.losses.miss(range(first, last + 1), now, is_away=bool(self.away) and now <= self.away[-1][1])

    def _watch(self, number: str) -> None:
        self._watched.take(bytes.fromhex(number))
        self._saw(int.from_bytes(bytes.fromhex(number), "little"))

    def _note_overflow(self, frames: str) -> None:
        self._note_lost(int(frames))

    def _note_lost(self, counted: int) -> None:
        self.losses.count(counted - self._counted, time.monotonic())
        self._counted = max(self._counted, counted)

    def _come_up(self) -> None:
        self.came_up = time.monotonic()
        self.pauses[-1][1] = self.came_up + MARGIN

    def _lose_bus(self) -> None:
        self.away.append([time.monotonic() - MARGIN, float("inf")])

    def _find_bus(self) -> None:
        if self.away:
            self.away[-1][1] = time.monotonic() + MARGIN

    LINES: ClassVar[tuple[tuple[re.Pattern[str], Callable[..., None]], ...]] = (
        (re.compile(r"^last (\w+), overflow (\d+), missed (\d+)$"), _count),
        (re.compile(r"^numbers (\d+)\.\.(\d+) missing$"), _report_missing),
        (re.compile(r"^on the bus$"), _come_up),
        (re.compile(rf"(?<![0-9A-F]){NUMBERED:03X}#([0-9A-F]{{8}})"), _watch),
        (re.compile(FRAMES_LOST.format(r"(\d+)")), _note_overflow),
        (re.compile(r"it is opened again"), _lose_bus),
        (re.compile(r"after a gap of"), _find_bus),
    )

    # What it has of the system

    @property
    def has_settled(self) -> bool:
        """Whether its usage after settling is known."""
        return self._begin is not None

    def note_settled(self) -> None:
        """Note its usage if it has settled just now."""
        if self._begin is None and self._up is not None and time.monotonic() - self._up >= SETTLED:
            with suppress(OSError):
                self._begin = Usage.of(self.program.popen.pid), self.last or 0

    def note_life(self) -> None:
        """Note its usage at its end, if it has lived long enough to settle."""
        if self._begin is not None:
            usage, number = self._begin
            with suppress(OSError, KeyError):
                self.lives.append(Life(usage, Usage.of(self.program.popen.pid), (self.last or 0) - number))


class Remote:
    """A bus of python-can-remote, whose server can be away."""

    kind = "bus server killed and restarted"

    def __init__(self) -> None:
        self._port = free_port()
        self.bus = ("remote", f"ws://127.0.0.1:{self._port}/")
        self.back()

    def lose(self) -> None:
        """Kill the server."""
        self._server.kill()

    def back(self) -> None:
        """Start the server, and wait until it serves."""
        said: list[str] = []
        self._server = Program(sys.executable, "-c", SERVER, str(self._port), took=said.append)
        end = time.monotonic() + PATIENCE
        while not said and time.monotonic() < end:
            time.sleep(PERIOD)

    close = lose


class SocketCan:
    """The kernel's bus, whose interface can be down."""

    kind = "interface down and up"
    bus = ("socketcan", INTERFACE)

    def _set(self, state: str) -> None:
        program = [shutil.which("ip")] if shutil.which("ip") else ["busybox", "ip"]
        subprocess.run([*map(str, program), "link", "set", INTERFACE, state], check=True, timeout=PATIENCE)

    def lose(self) -> None:
        """Set the interface down."""
        self._set("down")

    def back(self) -> None:
        """Set it up."""
        self._set("up")

    close = back


class Heard(NamedTuple):
    """A received frame's data, and when it came by the monotonic clock."""

    time: float
    data: bytes


class FaultRecord(NamedTuple):
    """The result of a fault: its kind; seconds until it was noticed and, from its end, recovered (None: it was not)."""

    kind: str
    noticed: float | None
    recovered: float | None


Condition = Callable[[], bool]


class Soak:
    """The processes on their bus, and the faults injected so far."""

    def __init__(
        self,
        transport: Remote | SocketCan,
        seed: int,
        folder: Path,
        broken: str = "",
        only: Sequence[str] = (),
        foreign: int = 0,
    ) -> None:
        self.transport = transport
        self.dice = random.Random(seed)
        self._only = only
        self._foreign = foreign
        self.records: list[FaultRecord] = []
        self.wrong: list[str] = []
        self.sent_at: list[float] = []
        self._heard: dict[int, Heard] = {}
        self._emergencies: list[tuple[float, str, bytes]] = []
        self._folder = folder
        self._stored = self._default = cast(int, dialects.load("navigation").default(SETTING))
        node = (sys.executable, str(Path(__file__).with_name("soak_node.py")))
        monitor = (sys.executable, "-m", "eurobot_od", "monitor", "--plain")
        interface, channel = transport.bus
        self.roles = {name: Role(name, *node, name, interface, channel, str(folder), broken) for name in ROLES}
        self.monitor = Role("monitor", *monitor, "-i", interface, "-c", channel)
        self.opener = partial(open_bus, interface, channel)
        gatekeeper = Gatekeeper(PROTOCOL)
        gatekeeper.add_node(lambda: HEARD, self._hear, "soak")
        self.live = Live(self.opener(), gatekeeper, opener=self.opener)
        self.stands: list[float | None] = []
        self._beside: dict[str, Program] = {}

    @property
    def everybody(self) -> tuple[Role, ...]:
        return (*self.roles.values(), self.monitor)

    def _hear(self, frame: Frame, _: float) -> None:
        now = time.monotonic()
        self._heard[frame.cob_id] = Heard(now, frame.data)
        if frame.cob_id in EMERGENCIES:
            self._emergencies.append((now, EMERGENCIES[frame.cob_id], frame.data))

    # Conditions

    def goes_on(self) -> Condition:
        """Return a condition: all nodes run, and since then send heartbeats, and a goto was confirmed.

        A node watches another from the first heartbeat that it has received (CiA 301, 7.2.8.3.2.2).
        """
        begin = time.monotonic()
        wanted = {GOTO_CONFIRM, *HEARTBEATS}

        def all_is_well() -> bool:
            since = max(begin, *(each.came_up for each in self.roles.values()))
            heard = {cob_id for cob_id, (at, data) in list(self._heard.items()) if at > since and data != BOOT_UP}
            return heard >= wanted and all(each.is_running for each in self.everybody)

        return all_is_well

    def emergency(self, node: str | None, code: bytes = b"") -> Condition:
        """Return a condition: from now on a node, or any, has reported an error by EMCY."""
        since = time.monotonic()

        def is_reported() -> bool:
            return any(
                at > since and node in (None, teller) and data[:2] != NO_ERROR and data.startswith(code)
                for at, teller, data in self._emergencies
            )

        return is_reported

    # What goes on all the time

    def send(self, cob_id: int, data: bytes) -> bool:
        """Send a frame; return whether the bus took it."""
        try:
            self.live.bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False), timeout=1.0)
        except Exception:  # whatever the driver raises: it is being opened again
            return False
        return True

    def send_number(self) -> None:
        """Send the next numbered frame."""
        now = time.monotonic()
        number = len(self.sent_at)
        if self.send(NUMBERED, number.to_bytes(4, "little") + bytes(4)):
            self.sent_at.append(now)

    def wait(self, condition: Condition, patience: float = PATIENCE) -> bool:
        """Continue until a condition holds, and return whether it did in time."""
        end = time.monotonic() + patience
        while not condition() and time.monotonic() < end:
            self.send_number()
            for role in self.everybody:
                role.note_settled()
            time.sleep(PERIOD)
        return condition()

    # Faults: each gives when it is noticed; then ends, and gives when everything is recovered

    def kill(self, name: str) -> Iterator[Condition]:
        """Kill a node, and restart it when the others have noticed."""
        noticed = self.emergency("drive" if name == "core" else "core", HEARTBEAT_LOST)
        self.roles[name].note_life()
        self.roles[name].kill()
        yield noticed
        self.roles[name].start()
        yield self.goes_on()

    def freeze(self, name: str) -> Iterator[Condition]:
        """Freeze a node for some seconds: another one notices, and it reports the pause itself when it wakes."""
        noticed = self.emergency("drive" if name == "core" else "core", HEARTBEAT_LOST)
        since = time.monotonic()
        self.roles[name].program.signal(signal.SIGSTOP)
        self.wait(lambda: False, FROZEN)
        self.roles[name].program.signal(signal.SIGCONT)
        yield lambda: noticed() and self.roles[name].has_printed("stood still", since)
        yield self.goes_on()

    def lose_bus(self) -> Iterator[Condition]:
        """Take the bus away for some seconds."""
        since = time.monotonic()
        self.transport.lose()
        yield lambda: all(role.has_printed("it is opened again", since) for role in self.everybody)
        self.wait(lambda: False, self.dice.uniform(0.5, 3.0))
        since = time.monotonic()
        self.transport.back()
        well = self.goes_on()
        yield lambda: well() and all(role.has_printed("after a gap of", since) for role in self.everybody)

    def hostile(self) -> Iterator[Condition]:
        """Send frames on which no node may act."""
        noticed = self.emergency(None)
        dice = frame_fuzz.Dice.of(str(self.dice.random()), dialects.DEFAULT)
        for _ in range(HOSTILE):
            cob_id, data = self.dice.choice(frame_fuzz.MEANINGLESS)(dice)
            if cob_id != NUMBERED:  # a number that was never sent would be a loss of all before it
                self.send(cob_id, data)
        yield noticed
        yield self.goes_on()

    def flood(self) -> Iterator[Condition]:
        """Send numbered frames as fast as the bus takes them: each process sees the last one, or a later one."""
        for _ in range(FLOOD):
            self.send_number()
        last = len(self.sent_at)
        yield lambda: all((role.last or 0) >= last for role in self.everybody)
        yield self.goes_on()

    def ask(self) -> Iterator[Condition]:
        """Read each node's identity by segments and by blocks, as a master does, and write read-only objects."""
        with Master(self.opener(), answer_wait=PATIENCE / 4) as master:
            for node_id in NODE_IDS.values():
                node = master.node(node_id)
                # Between gotos the core asks the drive itself: of two clients on one channel (CiA 301, 7.2.4.1), each
                # ends the other's transfer.
                self.wait(self.goes_on())
                if node.upload((0x1008, 0)) != node.upload_block((0x1008, 0)):
                    self.wrong.append(f"node {node_id}: its name by segments is not that by blocks")
                with suppress(EurobotError):
                    node.download((0x1000, 0), bytes(4))
                    self.wrong.append(f"node {node_id}: its device type was written")
        yield lambda: True
        yield self.goes_on()

    def stop(self) -> Iterator[Condition]:
        """Stop the drive on its way while a stranger sends FOREIGN frames a second, and wait until it stands."""
        stranger = Program(sys.executable, "-c", STRANGER, *self.transport.bus, str(FOREIGN), took=lambda _: None)
        try:
            self.wait(self.goes_on())  # a goto is confirmed: it drives
            with self.opener() as bus:
                begun = time.monotonic()
                self.send(STOP, b"")
                self.stands.append(self._stand(bus, begun))
        finally:
            stranger.kill()
        yield lambda: self.stands[-1] is not None
        yield self.goes_on()

    def _stand(self, bus: can.BusABC, begun: float) -> float | None:
        """Return after how many seconds the drive stands, None if it does not in SETTLED: the stop was lost."""
        place = b""
        since = begun
        while (now := time.monotonic()) < begun + SETTLED:
            if place and now - since > STILL:
                return since - begun
            bus.send(can.Message(arbitration_id=ASK_PLACE, is_extended_id=False))
            while (came := bus.recv(STILL)) is not None and came.arbitration_id != PLACE:
                pass
            if came is not None and bytes(came.data) != place:
                place = bytes(came.data)
                since = time.monotonic()
        return None

    def run_beside(self) -> None:
        """Run python-can's own logger on the bus, and a stranger if asked; each ends when its bus is lost."""
        interface, channel = self.transport.bus
        file = str(self._folder / "beside.asc")
        commands: dict[str, tuple[str, ...]] = {
            "logger": ("-m", "can.logger", "-i", interface, "-c", channel, "-f", file)
        }
        if self._foreign:
            commands["stranger"] = ("-c", STRANGER, interface, channel, str(self._foreign))
        for name, command in commands.items():
            if name not in self._beside or self._beside[name].popen.poll() is not None:
                self._beside[name] = Program(sys.executable, *command, took=lambda _: None)

    def store(self) -> Iterator[Condition]:
        """Store a setting in navigation, and kill it.

        Its file has the new value if the store was confirmed, else either one.
        """
        navigation = self.roles["navigation"]
        navigation.note_life()  # not in the midst of it: it has files open then
        value = self.dice.randrange(1, 1 << 16)
        waits = self.dice.random() < 0.5
        allowed = [value] if waits else [self._stored, value]
        with Master(self.opener(), answer_wait=PATIENCE / 4) as master:
            node = master.node(NODE_IDS["navigation"])
            node.download(SETTING, value.to_bytes(2, "little"))
            if waits:
                node.download((STORE, 1), SIGNATURES[STORE])
            else:
                request = bytes([0x23, *STORE.to_bytes(2, "little"), 1]) + SIGNATURES[STORE]
                master.send(REQUEST + node.node_id, request)
                time.sleep(self.dice.uniform(0.0, 0.03))
            since = time.monotonic()
            navigation.kill()
            self._stored = self._value_in_file()
            navigation.start()
            yield lambda: self._heard[HEARTBEAT + NODE_IDS["navigation"]].time > since
            self.wait(self.goes_on())  # until the core has read the node's identity: it and we would hear each other's
            master.drain()
            found = int.from_bytes(node.upload(SETTING), "little")
        if self._stored not in allowed:
            self.wrong.append(f"navigation's file has {self._stored}, not {' or '.join(map(str, allowed))}")
        if found != self._stored:
            self.wrong.append(f"navigation has {found}, its file {self._stored}")
        yield self.goes_on()

    def _value_in_file(self) -> int:
        """Read the setting with a general reader of DCF files, not with the code that wrote it."""
        stored = configparser.ConfigParser()
        stored.read(self._folder / "navigation.dcf", encoding="latin-1")
        sections = {name.lower(): name for name in stored}
        section = sections.get(f"{SETTING[0]:04x}sub{SETTING[1]:x}")
        return int(stored[section]["ParameterValue"], 0) if section else self._default

    def faults(self) -> dict[str, Callable[[], Iterator[Condition]]]:
        """Return all faults by their names in the report."""
        named: dict[str, Callable[[], Iterator[Condition]]] = {
            self.transport.kind: self.lose_bus,
            f"{HOSTILE} hostile frames": self.hostile,
            f"flood of {FLOOD} frames": self.flood,
            "SDO transfers, segments and blocks": self.ask,
            "navigation killed while it stores": self.store,
            f"stop among {FOREIGN} foreign frames a second": self.stop,
        }
        for name in ROLES:
            named[f"{name} killed (SIGKILL) and restarted"] = partial(self.kill, name)
            named[f"{name} frozen for {FROZEN:.0f} s (SIGSTOP)"] = partial(self.freeze, name)
        return named

    # The run

    def run(self, is_enough: Callable[[int], bool]) -> None:
        """Inject fault after fault until `is_enough`, all kinds equally often, and wait until all is quiet."""
        with ExitStack() as stack:
            stack.callback(self._end)
            stack.enter_context(self.live)
            well = self.goes_on()
            # What comes before a process has settled tells nothing of how it grows.
            if not self.wait(lambda: well() and all(role.has_settled for role in self.everybody)):
                self.wrong.append("the nodes have not started up")
            deck: list[str] = []
            kinds = sorted(self._only or self.faults())
            while not self.wrong and not is_enough(len(self.records)):
                deck = deck or self.dice.sample(kinds, len(kinds))
                self._inject(deck.pop())
                self.wait(lambda: False, self.dice.uniform(0.2, 2.0))
            self.wait(lambda: all(role.last == len(self.sent_at) - 1 for role in self.everybody), SETTLED)
            quiet = len(self.sent_at) - 1
            self.wait(lambda: all((role.last or 0) >= quiet for role in self.everybody))

    def _inject(self, kind: str) -> None:
        self.run_beside()
        began = time.monotonic()
        steps = self.faults()[kind]()
        noticed = recovered = None
        try:
            if self.wait(next(steps)):
                noticed = time.monotonic() - began
            condition = next(steps)
            ended = time.monotonic()
            if self.wait(condition):
                recovered = time.monotonic() - ended
        except EurobotError as error:
            self.wrong.append(f"{kind}: {error}")
        self.records.append(FaultRecord(kind, noticed, recovered))

    def _end(self) -> None:
        for role in self.everybody:
            role.note_life()
        self.monitor.interrupt()
        for program in self._beside.values():
            program.kill()
        for role in self.everybody:
            role.kill()
        self.transport.close()

    # What was lost

    def lost(self, role: Role) -> Lost:
        """Return what became of the numbered frames for a process."""
        away = counted = uncounted = 0
        for loss in role.losses.all:
            excused = self._sent_within(loss.numbers, role.away)
            missing = len(loss.numbers) - excused
            away, counted = away + excused, counted + min(missing, loss.counted)
            uncounted += max(missing - loss.counted, 0)
        not_running = sum(self._sent_within(each, [*role.pauses, *role.away]) for each in role.before)
        uncounted += sum(map(len, role.before)) - not_running
        received = len(self.sent_at) - not_running - away - counted - uncounted
        return Lost(received, not_running, away, counted, uncounted)

    def _sent_within(self, numbers: range, times: Iterable[Sequence[float]]) -> int:
        return sum(any(begin <= self.sent_at[number] <= end for begin, end in times) for number in numbers)

    def complaints(self) -> list[str]:
        """Return what is wrong."""
        found = [f"{each.kind}: not noticed" for each in self.records if each.noticed is None]
        found += [f"{each.kind}: not recovered" for each in self.records if each.recovered is None]
        found += ["a stop was lost"] * self.stands.count(None)
        found += [f"{role.name}: {lost} frames uncounted" for role in self.everybody if (lost := self.lost(role)[-1])]
        grown = ((role.name, life) for role in self.everybody for life in role.lives if life.has_grown)
        found += [f"{name}: has grown: {life}" for name, life in grown]
        return [*self.wrong, *found]


class Lost(NamedTuple):
    """What became of the numbered frames for one process."""

    received: int
    not_running: int
    bus_away: int
    counted: int
    uncounted: int


# The report


def report(soak: Soak, command: str, seconds: float) -> Iterator[str]:
    """Yield the lines of the report, in Markdown."""
    yield f"`{command}` on {soak.transport.bus[0]}, Python {platform.python_version()}, {seconds / 60:.1f} minutes:"
    yield ""
    yield "| fault | injected | noticed | recovered | noticed after, at most | recovered after, at most |"
    yield "|---" * 6 + "|"
    for kind in sorted({each.kind for each in soak.records}):
        records = [each for each in soak.records if each.kind == kind]
        noticed = [each.noticed for each in records if each.noticed is not None]
        recovered = [each.recovered for each in records if each.recovered is not None]
        worst = f"{max(noticed, default=0):.1f} s | {max(recovered, default=0):.1f} s"
        yield f"| {kind} | {len(records)} | {len(noticed)} | {len(recovered)} | {worst} |"
    yield ""
    columns = "received | sent while it was not running | bus away | counted as lost | uncounted"
    yield f"| of {len(soak.sent_at)} numbered frames | {columns} |"
    yield "|---" * 6 + "|"
    for role in soak.everybody:
        yield f"| {role.name} | {' | '.join(map(str, soak.lost(role)))} |"
    yield ""
    yield "| process | lives | memory, KiB | threads | file descriptors | bytes a frame |"
    yield "|---" * 6 + "|"
    for role in soak.everybody:
        if role.lives:
            most = max(role.lives, key=lambda life: life.end.memory - life.begin.memory)
            pairs = " | ".join(f"{begin} → {end}" for begin, end in zip(most.begin, most.end))
            slope = 1024 * (most.end.memory - most.begin.memory) / max(most.frames, 1)
            yield f"| {role.name} | {len(role.lives)} | {pairs} | {slope:.0f} |"
    yield ""
    if stands := [each for each in soak.stands if each is not None]:
        median = statistics.median(stands)
        longest = max(stands)
        lost = len(soak.stands) - len(stands)
        yield f"{len(soak.stands)} stops, {lost} lost; to the stand {median:.2f} s (median), {longest:.2f} s at most"
        yield ""
    wrong = soak.complaints()
    yield from (f"- {each}" for each in wrong)
    yield f"{len(soak.records)} faults, {len(wrong)} wrong"


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    command.add_argument("--minutes", type=float, default=10.0, metavar="N", help="how long (default: %(default)s)")
    command.add_argument("--seed", type=int, default=1, help="which faults, and when (default: %(default)s)")
    command.add_argument("--remote", action="store_true", help="python-can-remote even where there is a vcan0")
    command.add_argument("--foreign", type=int, default=0, metavar="N", help="foreign frames a second, all the time")
    command.add_argument("--self-test", action="store_true", help="nodes broken on purpose: each is found wrong")
    return command


class Trial(NamedTuple):
    """A build that is broken on purpose: how often a fault is injected, which one, and the expected complaint."""

    times: int
    fault: str
    complaint: str


STORED, FLOODED = "navigation killed while it stores", f"flood of {FLOOD} frames"

SELF_TEST = {
    "store": Trial(8, STORED, r"navigation's file has \d+, not \d+"),
    "deaf": Trial(1, "navigation killed (SIGKILL) and restarted", r"\w+: \d+ frames uncounted"),
    "leak": Trial(2, FLOODED, r"\w+: has grown"),
    "skips": Trial(1, FLOODED, r"\w+: \d+ frames uncounted"),
    "descriptors": Trial(1, FLOODED, r"\w+: has grown"),
}
"""The trials, by the names in `soak_node.BROKEN`."""


def self_test(transport: Callable[[], Remote | SocketCan], seed: int) -> Iterator[tuple[str, bool]]:
    """Run with each broken build, and yield a line on it, and whether its expected complaint came."""
    for broken, trial in SELF_TEST.items():
        with tempfile.TemporaryDirectory() as folder:
            soak = Soak(transport(), seed, Path(folder), broken, (trial.fault,))
            soak.run(partial(operator.eq, trial.times))
        said = soak.complaints()
        yield f"{broken}: {'; '.join(said) or 'nothing wrong'}", any(re.match(trial.complaint, each) for each in said)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it and print the report."""
    options = parser().parse_args(arguments)
    # Ignored in what a script starts in the background, and in all that this starts: the monitor is ended by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    transport = Remote if options.remote or not Path("/sys/class/net", INTERFACE).exists() else SocketCan
    if options.self_test:
        found = []
        for line, is_found in self_test(transport, options.seed):
            print(f"{'found' if is_found else 'MISSED'}  {line}", flush=True)
            found.append(is_found)
        return FINE if all(found) else WRONG
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(transport(), options.seed, Path(folder), foreign=options.foreign)
        started = time.monotonic()
        soak.run(lambda _: time.monotonic() >= started + 60 * options.minutes)
        seconds = time.monotonic() - started
    command = f"python3 tools/soak.py --minutes {options.minutes:g} --seed {options.seed} --foreign {options.foreign}"
    for line in report(soak, command, seconds):
        print(line, flush=True)
    return WRONG if soak.complaints() else FINE


if __name__ == "__main__":
    sys.exit(main())
