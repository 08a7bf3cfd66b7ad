"""A CANopen master on a python-can bus: SDO transfers with one node after the other, NMT, heartbeats.

Rule of this file: the only waiting of the package. No thread receives; whoever waits for an answer takes the frames
from the bus meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

import can
import canopen
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import BusError, NoAnswer, NodeRefused, RemoteError
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, NODE_IDS, SDO_REQUEST_BASE, SDO_RESPONSE_BASE, Address

if TYPE_CHECKING:
    from can import BusABC

ANSWER_WAIT = 0.5
"""Seconds that a node has for the answer to an SDO request, where nothing else is said."""

STORE_WAIT = 5.0
"""Seconds that a node has to store its parameters: it may have to erase a flash memory."""

BOOT_WAIT = 5.0
"""Seconds that a node has from a reset to its boot-up message."""

SDO_LENGTH = 8
"""Bytes of every SDO frame (CiA 301, 7.2.4.3)."""

DRIVER_ERRORS = (can.CanError, OSError)
"""What python-can's drivers raise."""

T = TypeVar("T")


class Master:
    """The master's end of a bus; use it as a context manager, it shuts the bus down at its end.

    `answer_wait` is how many seconds a node has for an answer. `states` has the last NMT state heard of each node.
    """

    def __init__(self, bus: BusABC, answer_wait: float = ANSWER_WAIT) -> None:
        self.bus, self.answer_wait = bus, answer_wait
        self.network = canopen.Network(bus)
        self.states: dict[int, NmtState] = {}

    def __enter__(self) -> Master:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bus.shutdown()

    def node(self, node_id: int) -> RemoteNode:
        """Return a node to talk to, whether it is there or not."""
        return RemoteNode(self, node_id)

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; raises BusError."""
        try:
            self.network.send_message(cob_id, data)
        except DRIVER_ERRORS as error:
            raise self.failure(error) from error

    def drain(self) -> None:
        """Take in the frames that are waiting already. Raises BusError."""
        try:
            while (message := self.bus.recv(0)) is not None:
                self._take(message)
        except DRIVER_ERRORS as error:
            raise self.failure(error) from error

    def pump(self, done: Callable[[], bool], wait: float) -> bool:
        """Take in frames until `done`, for `wait` seconds at most; return whether it is done. Raises BusError."""
        end = time.monotonic() + wait
        try:
            while not done() and (left := end - time.monotonic()) > 0:
                if (message := self.bus.recv(left)) is not None:
                    self._take(message)
        except DRIVER_ERRORS as error:
            raise self.failure(error) from error
        return done()

    def failure(self, error: Exception) -> BusError:
        """Return a driver's error as one of ours, in one line."""
        what = " ".join(str(error).split()) or type(error).__name__
        return BusError(f"the bus {self.bus.channel_info} failed: {what}")

    def _take(self, message: can.Message) -> None:
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        node_id = message.arbitration_id - ERROR_CONTROL_BASE
        if node_id in NODE_IDS and len(message.data) == 1 and message.data[0] in set(NmtState):
            self.states[node_id] = NmtState(message.data[0])
        self.network.notify(message.arbitration_id, message.data, message.timestamp)


class RemoteNode:
    """One node as the master sees it: its objects' bytes by address, and its NMT state."""

    def __init__(self, master: Master, node_id: int) -> None:
        self.master, self.node_id = master, node_id
        self._sdo = _Sdo(master, node_id)
        master.network.subscribe(SDO_RESPONSE_BASE + node_id, self._sdo.on_response)

    def upload(self, address: Address, name: str = "") -> bytes:
        """Read an object's bytes. Raises NodeRefused, NoAnswer, RemoteError for an odd answer, BusError."""
        return self._transfer("read", address, name, lambda: self._sdo.upload(*address))

    def upload_block(self, address: Address, name: str = "") -> bytes:
        """Read a long object by block transfer; by segments if the node has no blocks, however it says so."""
        try:
            return self._transfer("read", address, name, lambda: self._sdo.upload_block(*address))
        except RemoteError:
            return self.upload(address, name)

    def download(self, address: Address, data: bytes, name: str = "", wait: float | None = None) -> None:
        """Write an object's bytes, waiting up to `wait` seconds for each answer. Raises as `upload` does."""
        self._transfer("write", address, name, lambda: self._sdo.download(*address, data), wait)

    def command(self, command: NmtCommand) -> None:
        """Send an NMT command to this node; it is not confirmed, and heartbeats from before it count no more."""
        self.master.drain()
        self.master.states.pop(self.node_id, None)
        self.master.send(NMT_COB_ID, bytes([command, self.node_id]))

    def state(self, wait: float) -> NmtState | None:
        """Wait for the node's next heartbeat and return its state, None if there is no heartbeat."""
        self.master.states.pop(self.node_id, None)
        self.master.pump(lambda: self.node_id in self.master.states, wait)
        return self.master.states.get(self.node_id)

    def wait_for(self, state: NmtState, wait: float) -> bool:
        """Wait until a heartbeat tells a state, INITIALISING being the boot-up; return whether one did."""
        return self.master.pump(lambda: self.last_state is state, wait)

    @property
    def last_state(self) -> NmtState | None:
        """The state in the last heartbeat that was heard, None if there was none."""
        return self.master.states.get(self.node_id)

    def reset(self, command: NmtCommand = NmtCommand.RESET_NODE) -> None:
        """Reset the node and wait for its boot-up message. Raises NoAnswer."""
        self.command(command)
        if not self.wait_for(NmtState.INITIALISING, BOOT_WAIT):
            raise NoAnswer(command.name.replace("_", " ").lower(), f"boot-up of node {self.node_id}", 1, BOOT_WAIT)

    def _transfer(
        self, verb: str, address: Address, name: str, transfer: Callable[[], T], wait: float | None = None
    ) -> T:
        """Turn what canopen and the driver raise on a transfer into one of our errors."""
        self._sdo.wait = wait or self.master.answer_wait
        try:
            return transfer()
        except SdoError as error:
            raise self._error(error, f"{verb} {label(address, name)}") from error
        except DRIVER_ERRORS as error:
            raise self.master.failure(error) from error

    def _error(self, error: SdoError, request: str) -> RemoteError:
        if isinstance(error, SdoAbortedError):
            reason = SdoAbortedError.CODES.get(error.code, "for a reason of its own")
            return NodeRefused(self.node_id, request, error.code, reason)
        if isinstance(error, _Silence):
            return NoAnswer(request, f"answer of node {self.node_id}", 1, self._sdo.wait)
        return RemoteError(f"node {self.node_id} gave an odd answer to {request}: {error}")


def label(address: Address, name: str = "") -> str:
    """Write an address for a person: `0x1017:0 Producer heartbeat time`."""
    return f"0x{address[0]:04X}:{address[1]} {name}".rstrip()


class _Silence(SdoCommunicationError):
    """No answer came in its time."""


class _Sdo(SdoClient):
    """canopen's SDO client without a receiving thread; a frame that is no SDO frame by its length is not heard."""

    def __init__(self, master: Master, node_id: int) -> None:
        super().__init__(SDO_REQUEST_BASE + node_id, SDO_RESPONSE_BASE + node_id, ObjectDictionary())  # type: ignore[no-untyped-call]
        self.network = master.network
        self.wait = master.answer_wait
        self._pump = master.pump

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == SDO_LENGTH:
            super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]

    def upload_block(self, index: int, subindex: int) -> bytes:
        """Read an object by block transfer, with CRC."""
        with self.open(index, subindex, "rb", block_transfer=True) as stream:  # type: ignore[no-untyped-call]
            return bytes(stream.read())

    def read_response(self) -> bytes:
        if not self._pump(lambda: not self.responses.empty(), self.wait):
            raise _Silence("no answer")
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response
