"""Makes a drive watch this program: it performs a quick stop when our heartbeat is lost.

Theory of operation. We send a heartbeat under a node-ID of our own, and have the drive consume it: a free entry of
0x1016 (CiA 301, 7.5.2.19), with quick stop as the abort connection option code 0x6007 (CiA 402-2, clause 8.4.4). Both
are read first and put back at the end; if the program is killed, the next one finds what 0x6007 was in the time of the
entry. A drive without one of them goes on when this program or its adapter fails, and
whoever orders a motion has to be told before. The heartbeat comes from the thread that also ends motions, or stops
when nobody says any more that the program is alive: a program that hangs must not look alive.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import NamedTuple

from eurobot_od.client.master import Master, Procedure, RemoteNode
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import BusError, NodeRefused
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.values import ERROR_CONTROL_BASE, UNSIGNED32, Address

OWN_ID = 127
"""Node-ID of our heartbeat, unless another node uses it."""

PERIOD = 0.1
"""Period of our heartbeat, in s."""

LOST_AFTER = 0.5
"""Time without a heartbeat after which the drive stops, in s."""

CONSUMERS = 0x1016
ERROR_BEHAVIOUR: Address = (0x1029, 1)
STOPPED_ON_ERROR = b"\2"
"""Value of 0x1029:1 with which a communication error takes the node to Stopped (CiA 301, 7.5.2.32)."""

QUICK_STOP_ON_LOSS = 3
"""The abort connection option code of a quick stop."""

NOTED = range(9)
"""Option codes that `_watch_time` encodes in the heartbeat time of the drive's entry."""

NOTES = round(LOST_AFTER * 1000) + 10
"""The heartbeat time in 0x1016 for a noted option code of 0, in ms."""

GOES_ON = "this drive goes on if this program or its adapter fails"


class Lifeline(NamedTuple):
    """How a drive watches us: its entry in 0x1016, and the `former` contents to restore, in order.

    `lacks` says why the drive does not, or not surely, stop when our heartbeat is lost; it is empty if it does. `left`
    says what a program that was killed has left in the drive, and cannot be put back.
    """

    entry: Address | None
    former: tuple[tuple[Address, bytes], ...]
    lacks: str
    left: str = ""


def free_id(heard: Iterable[int], wanted: int = OWN_ID) -> int:
    """Return the node-ID for our heartbeat: the wanted one, or the next lower one that is free."""
    taken = set(heard)
    return next((each for each in (*range(wanted, 0, -1), *range(OWN_ID, wanted, -1)) if each not in taken), wanted)


def heartbeat(node_id: int) -> Frame:
    """Return the frame of our heartbeat."""
    return Frame(ERROR_CONTROL_BASE + node_id, bytes([NmtState.OPERATIONAL]))


@Procedure
async def arm(node: RemoteNode, offsets: Iterable[int], own: int) -> Lifeline:
    """Make a drive watch our heartbeat, which must be sent from now on; `offsets` are those of its axes.

    Raises NoAnswer, BusError; what the drive refuses is in the result.
    """
    former: list[tuple[Address, bytes]] = []
    entry = await _free_entry(node, own)
    if entry is None:
        return Lifeline(None, (), "it has no free entry in 0x1016")
    lacks = ""
    offsets = tuple(offsets)
    for offset in offsets:
        if not await _set(node, (cia402.ABORT_CONNECTION + offset, 0), bytes([QUICK_STOP_ON_LOSS, 0]), former):
            lacks = f"it has no 0x{cia402.ABORT_CONNECTION + offset:04X}, which would say to make a quick stop then"
    if lacks:  # STOPPED may stop the motor, which is better than nothing
        await _set(node, ERROR_BEHAVIOUR, STOPPED_ON_ERROR, former)
    before = await node.upload.steps(entry)
    is_left = before[2:3] == bytes([own])  # by one of us that was killed
    left = _take_over(offsets, int.from_bytes(before[:2], "little") - NOTES, former) if is_left and not lacks else ""
    watched = UNSIGNED32.write(own << 16 | _watch_time(offsets, former))
    try:
        await node.download.steps(entry, watched)
    except NodeRefused as refused:
        return Lifeline(None, tuple(former), f"it refuses an entry in 0x1016: {refused}")
    # A consumer watches from the first heartbeat on, so it must receive one before anything moves.
    node.master.send(*heartbeat(own))
    return Lifeline(entry, ((entry, bytes(4) if is_left else before), *former), lacks, left)


def _take_over(offsets: Iterable[int], noted: int, former: list[tuple[Address, bytes]]) -> str:
    """Add the option codes that a killed program has noted; return a text on those that are unknown."""
    known = [address for address, _ in former]
    changed = [each for offset in offsets if (each := (cia402.ABORT_CONNECTION + offset, 0)) not in known]
    if noted not in NOTED:
        said = ", ".join(f"0x{index:04X}" for index, _ in changed)
        return f"a program that was killed has left 3 in {said}: what was there before is not known" if said else ""
    former += [(each, bytes([noted, 0])) for each in changed if noted != QUICK_STOP_ON_LOSS]
    return ""


def _watch_time(offsets: Iterable[int], former: list[tuple[Address, bytes]]) -> int:
    """Return the heartbeat time in ms; its last digit is the former option code, for use after a kill."""
    changed = {address[0]: int.from_bytes(content, "little") for address, content in former}
    codes = {changed.get(cia402.ABORT_CONNECTION + each, QUICK_STOP_ON_LOSS) for each in offsets}
    code = codes.pop() if len(codes) == 1 else NOTED.stop
    return NOTES + (code if code in NOTED else NOTED.stop)


async def _free_entry(node: RemoteNode, own: int) -> Address | None:
    try:
        most = (await node.upload.steps((CONSUMERS, 0)))[0]
        entries = [await node.upload.steps((CONSUMERS, sub)) for sub in range(1, most + 1)]
    except NodeRefused:
        return None
    mine = [sub for sub, content in enumerate(entries, 1) if content[2:3] == bytes([own])]
    free = [sub for sub, content in enumerate(entries, 1) if content[:2] == b"\0\0" or content[2:3] == b"\0"]
    return (CONSUMERS, (mine + free)[0]) if mine + free else None


async def _set(node: RemoteNode, address: Address, content: bytes, former: list[tuple[Address, bytes]]) -> bool:
    """Write an object and keep its former content; return False if the drive refuses."""
    try:
        before = (await node.upload.steps(address))[: len(content)]
        if before != content:
            await node.download.steps(address, content)
            former.append((address, before))
    except NodeRefused:
        return False
    return True


@Procedure
async def holds(node: RemoteNode, line: Lifeline, own: int) -> bool:
    """Return whether the drive still watches us; a reset or another master may have changed that."""
    return line.entry is not None and (await node.upload.steps(line.entry))[2:3] == bytes([own])


@Procedure
async def disarm(node: RemoteNode, line: Lifeline) -> None:
    """Restore the former contents, except those that the drive refuses; raises NoAnswer, BusError."""
    for address, content in line.former:
        with suppress(NodeRefused):
            await node.download.steps(address, content)


class HeartbeatThread:
    """Sends our heartbeat for a blocking program while `kick` is called at least every `patience` seconds."""

    def __init__(self, master: Master, own: int, patience: float) -> None:
        self._master = master
        self._frame = heartbeat(own)
        self._patience = patience
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)
        self.kick()

    def kick(self) -> None:
        """Confirm that the program is alive."""
        self._alive_until = self._master.clock() + self._patience

    def __enter__(self) -> HeartbeatThread:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.is_set():
            if self._master.clock() < self._alive_until:
                with suppress(BusError):  # the next request to the drive raises it
                    self._master.send(*self._frame)
            self._ended.wait(PERIOD)
