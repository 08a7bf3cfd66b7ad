"""Starts a network as an NMT master does (CiA 302-2): slaves are reset, checked, configured, heard, then started.

Theory of operation. A slave boots in the standard's order: reset communication and its boot-up message; device type
(0x1000) and identity (0x1018) as in its file; its configuration, which is loaded unless 0x1020 says that it is the
DCF's; its heartbeat, if it has one. Slaves are started only when all of them are there, in the order of the network.

With many slaves, each step that waits for a heartbeat waits for all at once: `prepare_slave` for each, then
`hear_slave` for each; `order_start` for each, then `started_state`. So a network waits for the slowest heartbeat, and
not for one heartbeat after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from enum import Enum
from functools import partial
from math import inf
from typing import NamedTuple

from eurobot_od.client.configure import configure
from eurobot_od.client.description import Description, Identity
from eurobot_od.client.master import Guard, Master, Procedure, RemoteNode, unguarded
from eurobot_od.device.nmt import LOST_AFTER, TOGGLE, Heartbeats, NmtCommand, NmtState
from eurobot_od.errors import BusError, EurobotError, NoAnswer, NodeRefused, RemoteError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import (
    DEVICE_TYPE,
    GUARD_TIME,
    HEARTBEAT_TIME,
    IDENTITY,
    LIFE_TIME_FACTOR,
    VERIFY_CONFIGURATION,
)
from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS
from eurobot_od.support.texts import amount

MARGIN = 0.2
"""Seconds that a heartbeat may be late on a busy machine."""

LENT = 100
"""Period in ms of a heartbeat that is turned on only to see whether a slave has started."""


class BootError(Enum):
    """Why a slave did not boot, with the letters of CiA 302-2."""

    NO_ANSWER = "B"
    DEVICE_TYPE = "C"
    VENDOR = "D"
    CONFIGURATION = "J"
    NO_HEARTBEAT = "K"
    PRODUCT = "M"
    REVISION = "N"
    SERIAL = "O"


IDENTITY_ERRORS = (BootError.VENDOR, BootError.PRODUCT, BootError.REVISION, BootError.SERIAL)
"""The errors of the identity object, in the order of the sub-indices of 0x1018 from 1 on."""


class BootFailed(RemoteError):
    """A slave did not boot; the text says why."""

    def __init__(self, error: BootError, what: str) -> None:
        super().__init__(what)
        self.error = error

    def __str__(self) -> str:
        return f"error {self.error.value}: {self.args[0]}"


class BootedSlave(NamedTuple):
    """A slave that was booted: what was done, in words, and why it `failed`, None if it is as it should be.

    `heartbeat` is its period in ms, 0 for none. `is_lent` tells that it was turned on by us and has to be turned off
    again.
    """

    name: str
    node_id: int
    done: Sequence[str]
    failed: BootFailed | None = None
    heartbeat: int = 0
    is_lent: bool = False


@Procedure
async def boot_slave(node: RemoteNode, description: Description, now: datetime) -> BootedSlave:
    """Boot one slave up to its start; `now` is written to verify its configuration. Raises BusError."""
    return await hear_slave.steps(node, await prepare_slave.steps(node, description, now))


@Procedure
async def prepare_slave(node: RemoteNode, description: Description, now: datetime) -> BootedSlave:
    """Reset, check and configure one slave as `boot_slave` does, without waiting for its heartbeat. Raises BusError."""
    dictionary, done = description.dictionary, list[str]()
    failed, heartbeat = None, 0
    node.master.follow(dictionary)
    try:
        try:
            # Only the communication (CiA 302-2): the application, which may hold a load, goes on.
            await node.reset.steps(NmtCommand.RESET_COMMUNICATION)
        except NoAnswer as error:
            raise BootFailed(BootError.NO_ANSWER, str(error)) from error
        done.append("reset")
        done.append(await _identified(node, description))
        done.append(await _configured(node, description, now))
        heartbeat = await _number(node, HEARTBEAT_TIME, BootError.NO_HEARTBEAT) or 0
        # Heartbeats count from now on, including those that come while other slaves are prepared.
        node.master.states.pop(node.node_id, None)
    except BootFailed as error:
        failed = error
    return BootedSlave(dictionary.name, node.node_id, tuple(done), failed, heartbeat)


@Procedure
async def hear_slave(node: RemoteNode, slave: BootedSlave) -> BootedSlave:
    """Wait for the heartbeat of a prepared slave, if it has one. Raises BusError."""
    period = slave.heartbeat
    if slave.failed:
        return slave
    if not period:
        return slave._replace(done=(*slave.done, "no heartbeat"))
    if await node.master.pump.steps(2 * period / 1000 + MARGIN, lambda: node.last_state is not None):
        return slave._replace(done=(*slave.done, f"heartbeat every {period} ms"))
    return slave._replace(failed=BootFailed(BootError.NO_HEARTBEAT, f"no heartbeat in twice its {period} ms"))


async def _identified(node: RemoteNode, description: Description) -> str:
    """Compare device type and identity with the file's, as far as the file gives them."""
    dictionary = description.dictionary
    wanted = dictionary.number(DEVICE_TYPE)
    found = await _number(node, DEVICE_TYPE, BootError.NO_ANSWER)
    # 0 or no number in the file means that any device type will do (CiA 302-2, 0x1F84).
    if wanted and found != wanted:
        raise BootFailed(BootError.DEVICE_TYPE, f"device type 0x{found or 0:08X}, its file has 0x{wanted:08X}")
    for sub, (error, wanted) in enumerate(zip(IDENTITY_ERRORS, dictionary.identity), start=1):
        found = await _number(node, (IDENTITY, sub), error) if wanted else wanted
        if found != wanted:
            name = Identity._fields[sub - 1]
            raise BootFailed(error, f"{name} 0x{found or 0:08X}, its file has 0x{wanted:08X}")
    return "identity as in its file"


async def _configured(node: RemoteNode, description: Description, now: datetime) -> str:
    """Load the configuration of a DCF, unless the slave says that it already has it."""
    dictionary = description.dictionary
    if dictionary.commissioned_node_id is None:
        return "an EDS: its own configuration"
    if not any(map(dictionary.has_own_value, dictionary.addresses())):
        return "no ParameterValue: its own configuration"
    stamps = [dictionary.default(each) for each in VERIFY_CONFIGURATION]
    # A date or time of 0 means that no configuration is stored (CiA 301, 7.5.2.23).
    if all(stamps) and stamps == [await _number(node, each, BootError.CONFIGURATION) for each in VERIFY_CONFIGURATION]:
        return "configured already (0x1020)"
    try:
        result = await configure.steps(node, description, now)
    except BusError:
        raise
    except EurobotError as error:
        raise BootFailed(BootError.CONFIGURATION, str(error)) from error
    return f"configured: {amount(result.changed, 'object')} changed" if result.changed else "configured already"


async def _number(node: RemoteNode, address: tuple[int, int], error: BootError) -> int | None:
    """Read a number; None if the slave does not have the object."""
    try:
        return int.from_bytes(await node.upload.steps(address), "little")
    except NodeRefused:
        return None
    except RemoteError as failure:
        raise BootFailed(error, str(failure)) from failure


@Procedure
async def start_slave(node: RemoteNode, slave: BootedSlave, dictionary: Dictionary) -> NmtState | None:
    """Start a slave and return its state, as `order_start` and `started_state` do for many slaves."""
    started = await order_start.steps(node, slave, dictionary)
    return await started_state.steps(node, started) if started else None


@Procedure
async def order_start(node: RemoteNode, slave: BootedSlave, dictionary: Dictionary) -> BootedSlave | None:
    """Start a slave; return it if it will report its state, in its next heartbeat or in answer to node guarding.

    A slave that must not be guarded just once is lent a heartbeat, if it has one that is off. Raises BusError.
    """
    node.command(NmtCommand.START)
    if slave.heartbeat:
        return slave
    # Without a heartbeat its state comes only when it is asked for (CiA 301, 7.2.8.3.2.1). The first request starts
    # life guarding: a device with a life time would go back to PRE-OPERATIONAL, as nobody asks again.
    has_life_time = dictionary.number(GUARD_TIME) and dictionary.number(LIFE_TIME_FACTOR)
    if GUARD_TIME[0] in dictionary.members and not has_life_time:
        node.master.request(ERROR_CONTROL_BASE + node.node_id)
        return slave
    return slave._replace(heartbeat=LENT, is_lent=True) if await _beats(node, LENT) else None


@Procedure
async def started_state(node: RemoteNode, slave: BootedSlave) -> NmtState | None:
    """Wait until a slave that was started reports OPERATIONAL; return its last state, None if it reported none.

    A heartbeat that was lent is turned off again. Raises BusError.
    """
    await node.wait_for.steps(NmtState.OPERATIONAL, 2 * slave.heartbeat / 1000 + MARGIN)
    if slave.is_lent:
        await _beats(node, 0)
    return node.last_state


async def _beats(node: RemoteNode, period: int) -> bool:
    """Set the period of a slave's heartbeat in ms; return whether the slave accepted it."""
    with suppress(NodeRefused, NoAnswer):
        await node.download.steps(HEARTBEAT_TIME, period.to_bytes(2, "little"))
        return True
    return False


LONGEST_PAUSE = 0.1
"""Seconds after which `watch_nodes` checks whether it should end."""


class NodeChange(Enum):
    """What happens to a node, in words for a person."""

    FOUND = "is there"
    BOOTED = "has booted"
    LOST = "is lost"
    BACK = "is back"


class NodeEvent(NamedTuple):
    """A `change` of a node at a `time` in seconds; `state` is the last one reported, None if there was none."""

    time: float
    node_id: int
    change: NodeChange
    state: NmtState | None


class WatchedNode:
    """One node: its `pulse`, its `state`, and whether it is `lost`."""

    def __init__(self, period: float = 0.0) -> None:
        self.pulse, self.lost = Heartbeats(period), False
        self.state: NmtState | None = None
        self.toggle: int | None = None


class NodeWatch:
    """Watches nodes and calls `report` with each event.

    `periods` are heartbeat periods in seconds by node-ID, where they are known. `expected` nodes are lost if they are
    not heard within `patience` seconds of the first tick. `guarded` has, by node-ID, the periods in seconds at which
    nodes are asked by a remote frame: without a heartbeat a node can be watched only in this way.
    """

    def __init__(
        self,
        report: Callable[[NodeEvent], object],
        periods: Mapping[int, float] = {},
        expected: Iterable[int] = (),
        patience: float = LOST_AFTER,
        guarded: Mapping[int, float] = {},
    ) -> None:
        self._report = report
        self.nodes: dict[int, WatchedNode] = {node_id: WatchedNode(period) for node_id, period in periods.items()}
        self._expected, self._patience = {*expected, *guarded}, patience
        self._guarded = dict(guarded)
        self._next_guard = dict.fromkeys(guarded, -inf)
        self._started: float | None = None

    def receive(self, node_id: int, data: bytes, now: float) -> None:
        """Take in an error control frame; anything else is ignored."""
        state = data[0] & ~TOGGLE if len(data) == 1 else None
        if state not in set(NmtState):
            return
        node = self._node(node_id)
        # A boot-up is not an answer, and has the toggle bit 0 whatever the last answer had.
        if state and node_id in self._guarded and data[0] & TOGGLE == node.toggle:
            return  # an answer heard twice, or a node that is stuck, is not a sign of life
        # After a boot-up the first answer has the toggle bit 0 (CiA 301, 7.2.8.3.2.1).
        node.toggle = data[0] & TOGGLE if state and node_id in self._guarded else None
        first, was_lost = node.pulse.heard is None, node.lost
        node.state, node.lost = NmtState(state), False
        (node.pulse.beat if state else node.pulse.boot)(now)
        change = (
            NodeChange.BOOTED if not state else NodeChange.BACK if was_lost else NodeChange.FOUND if first else None
        )
        if change:
            self._tell(now, node_id, change)

    def tick(self, now: float) -> list[int]:
        """Notice which nodes are lost, and return the COB-IDs that have to be asked by remote frames now."""
        if self._started is None:
            self._started = now
        for node_id in sorted({*self.nodes, *self._expected}):
            node = self._node(node_id)
            if not node.lost and now > self._deadline(node_id, node):
                node.lost = True
                self._tell(now, node_id, NodeChange.LOST)
        asked = [node_id for node_id, due in self._next_guard.items() if now >= due]
        # From now, not from when it was due: after a pause, the requests that were missed must not go out at once.
        self._next_guard |= {node_id: now + self._guarded[node_id] for node_id in asked}
        return [ERROR_CONTROL_BASE + node_id for node_id in asked]

    @property
    def next_wakeup(self) -> float:
        """When to call `tick`, infinite if nothing is planned."""
        waiting = (self._deadline(node_id, node) for node_id, node in self.nodes.items() if not node.lost)
        return min([*waiting, *self._next_guard.values()], default=inf)

    def _node(self, node_id: int) -> WatchedNode:
        return self.nodes.setdefault(node_id, WatchedNode(self._guarded.get(node_id, 0.0)))

    def _deadline(self, node_id: int, node: WatchedNode) -> float:
        # A node that was never heard has no period yet: all nodes have the same time to boot.
        if node.pulse.heard is None and node_id in self._expected and self._started is not None:
            return self._started + self._patience
        return node.pulse.deadline

    def _tell(self, now: float, node_id: int, change: NodeChange) -> None:
        self._report(NodeEvent(now, node_id, change, self.nodes[node_id].state))


@Procedure
async def without_heartbeat(master: Master, node_ids: Iterable[int]) -> list[int]:
    """Return the nodes that do not say that they send a heartbeat (0x1017). Raises BusError.

    A device with a heartbeat does not answer node guarding: it has one or the other (CiA 301, 7.2.8.2.2).
    """
    found = []
    for node_id in node_ids:
        try:
            period = await master.node(node_id).upload.steps(HEARTBEAT_TIME)
        except RemoteError:  # it is not there yet, or does not have the object
            period = b""
        if not any(period):
            found.append(node_id)
    return found


def watch_nodes(master: Master, watch: NodeWatch, end: float = inf, guard: Guard = unguarded) -> None:
    """Watch the nodes of a bus until its clock is at `end`, each step under the guard. Raises BusError."""

    def received(node_id: int, data: bytes) -> None:
        watch.receive(node_id, data, master.clock())

    def step() -> None:
        now = master.clock()
        for cob_id in watch.tick(now):
            master.request(cob_id)
        # At least a millisecond: a deadline at this very moment is not over yet, and the loop would run without a
        # pause.
        master.pump(min(max(watch.next_wakeup - now, 0.001), LONGEST_PAUSE, end - now))

    for node_id in NODE_IDS:
        master.listeners[ERROR_CONTROL_BASE + node_id] = partial(received, node_id)
    while master.clock() < end:
        guard(step)
