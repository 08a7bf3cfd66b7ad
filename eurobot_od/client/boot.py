"""Boots a network as an NMT master does (CiA 302-2): reset, check, configure, await heartbeats, start.

Theory of operation. A slave boots in the standard's order: reset communication and its boot-up message; device type
(0x1000) and identity (0x1018) as in its file; its configuration, which is loaded unless 0x1020 says that it is the
DCF's; its heartbeat, if it has one. Slaves are started only when all of them are there, in the order of the network.

With many slaves, each step that waits for a heartbeat waits for all at once: `prepare_slave` for each, then
`hear_slave` for each; `order_start` for each, then `started_state`. So a network waits for the slowest heartbeat, and
not for one heartbeat after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from enum import Enum
from typing import NamedTuple

from eurobot_od.client.configure import configure
from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.client.watch import LOST_AFTER
from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError, EurobotError, NoAnswer, NodeRefused, RemoteError
from eurobot_od.od import standard
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.values import ERROR_CONTROL_BASE
from eurobot_od.support.texts import amount

MARGIN = 0.2
"""Tolerance for late heartbeats on a busy machine, in s."""


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
"""Errors for the sub-indices 1 to 4 of the identity object 0x1018."""


class BootFailed(RemoteError):
    """A slave did not boot, for the reason in the text."""

    def __init__(self, error: BootError, what: str) -> None:
        super().__init__(what)
        self.error = error

    def __str__(self) -> str:
        return f"error {self.error.value}: {self.args[0]}"


class BootedSlave(NamedTuple):
    """Result of booting a slave: the steps that were `done`, as text, and the error if it `failed`.

    `heartbeat` is its period in ms, 0 for none.
    """

    name: str
    node_id: int
    done: Sequence[str]
    failed: BootFailed | None = None
    heartbeat: int = 0


@Procedure
async def prepare_slave(node: RemoteNode, dictionary: Dictionary, now: datetime) -> BootedSlave:
    """Reset, check and configure one slave; `hear_slave` then waits for its heartbeat. Raises BusError.

    `now` is written to verify its configuration.
    """
    done = list[str]()
    failed = None
    heartbeat = 0
    node.master.follow(dictionary)
    try:
        try:
            # Only communication is reset (CiA 302-2), as the application may hold a load.
            await node.reset.steps(NmtCommand.RESET_COMMUNICATION)
        except NoAnswer as error:
            raise BootFailed(BootError.NO_ANSWER, str(error)) from error
        done.append("reset")
        done.append(await _identified(node, dictionary))
        done.append(await _configured(node, dictionary, now))
        heartbeat = await _number(node, standard.HEARTBEAT_TIME, BootError.NO_HEARTBEAT) or 0
        # Heartbeats that come while other slaves are prepared count too.
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
    if await node.master.pump.steps(LOST_AFTER * period / 1000 + MARGIN, lambda: node.last_state is not None):
        return slave._replace(done=(*slave.done, f"heartbeat every {period} ms"))
    what = f"no heartbeat for {LOST_AFTER:g} periods of {period} ms"
    return slave._replace(failed=BootFailed(BootError.NO_HEARTBEAT, what))


async def _identified(node: RemoteNode, dictionary: Dictionary) -> str:
    """Compare device type and identity with those of the file."""
    wanted = dictionary.number(standard.DEVICE_TYPE)
    found = await _number(node, standard.DEVICE_TYPE, BootError.NO_ANSWER)
    # Without a device type in the file, or with 0, any type is accepted (CiA 302-2, 0x1F84).
    if wanted and found != wanted:
        raise BootFailed(BootError.DEVICE_TYPE, f"device type 0x{found or 0:08X}, its file has 0x{wanted:08X}")
    for sub, (error, wanted) in enumerate(zip(IDENTITY_ERRORS, Identity.of(dictionary)), start=1):
        found = await _number(node, (standard.IDENTITY, sub), error) if wanted else wanted
        if found != wanted:
            name = Identity._fields[sub - 1]
            raise BootFailed(error, f"{name} 0x{found or 0:08X}, its file has 0x{wanted:08X}")
    return "identity as in its file"


async def _configured(node: RemoteNode, dictionary: Dictionary, now: datetime) -> str:
    """Write the configuration of a DCF unless the slave already has it."""
    if dictionary.device.commissioned_node_id is None:
        return "an EDS: its own configuration"
    if not any(map(dictionary.has_own_value, dictionary.addresses())):
        return "no ParameterValue: its own configuration"
    stamps = [dictionary.default(each) for each in standard.VERIFY_CONFIGURATION]
    # A date or time of 0 means that no configuration is stored (CiA 301, 7.5.2.23).
    if all(stamps) and stamps == [
        await _number(node, each, BootError.CONFIGURATION) for each in standard.VERIFY_CONFIGURATION
    ]:
        return "configured already (0x1020)"
    try:
        result = await configure.steps(node, dictionary, now)
    except BusError:
        raise
    except EurobotError as error:
        raise BootFailed(BootError.CONFIGURATION, str(error)) from error
    return f"configured: {amount(result.changed, 'object')} changed" if result.changed else "configured already"


async def _number(node: RemoteNode, address: tuple[int, int], error: BootError) -> int | None:
    """Read a number; return None if the slave does not have the object."""
    try:
        return int.from_bytes(await node.upload.steps(address), "little")
    except NodeRefused:
        return None
    except RemoteError as failure:
        raise BootFailed(error, str(failure)) from failure


@Procedure
async def order_start(node: RemoteNode, slave: BootedSlave, dictionary: Dictionary) -> BootedSlave | None:
    """Start a slave; return it if it will report its state by heartbeat or node guarding.

    Raises BusError.
    """
    node.command(NmtCommand.START)
    if slave.heartbeat:
        return slave
    # A node without a heartbeat sends its state only on request (CiA 301, 7.2.8.3.2.1). A request also starts life
    # guarding: without further requests, a device with a life time would return to PRE-OPERATIONAL.
    has_life_time = dictionary.number(standard.GUARD_TIME) and dictionary.number(standard.LIFE_TIME_FACTOR)
    if standard.GUARD_TIME[0] in dictionary.members and not has_life_time:
        node.master.request(ERROR_CONTROL_BASE + node.node_id)
        return slave
    return None


@Procedure
async def started_state(node: RemoteNode, slave: BootedSlave) -> NmtState | None:
    """Wait until a started slave reports OPERATIONAL; return its last state, or None if it reported none.

    Raises BusError.
    """
    await node.wait_for.steps(NmtState.OPERATIONAL, 2 * slave.heartbeat / 1000 + MARGIN)
    return node.last_state
