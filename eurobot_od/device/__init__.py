"""One CANopen device from its EDS: NMT slave, PDOs gated by state, heartbeat, emergencies, values.

Rule of this package: no clock and no bus. Frames and the time in seconds go in, frames and typed messages come out;
what a peer sends wrong becomes an EMCY and a count, never an exception.
"""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.device.emergency import Emergencies, ErrorCode
from eurobot_od.device.nmt import (
    NMT_COB_ID,
    TARGET,
    NmtCommand,
    NmtState,
    Reset,
    boot_state,
    command_in,
    error_control,
)
from eurobot_od.dictionary import NOT_VALID, Address, Dictionary, PdoDirection, Value
from eurobot_od.errors import DictionaryError, FrameLengthError, StateError
from eurobot_od.frame import Frame
from eurobot_od.messages import EmergencyShutdown, EmergencyStop, Message, StopDrive
from eurobot_od.protocol import Protocol

EMCY_COB_ID: Address = (0x1014, 0)
HEARTBEAT_TIME: Address = (0x1017, 0)
NMT_STARTUP: Address = (0x1F80, 0)

ALWAYS: tuple[type[Message], ...] = (EmergencyShutdown, EmergencyStop, StopDrive)
"""Messages that are sent and acted on in every NMT state: a robot must stop whatever a master did to its nodes."""


class Reaction(NamedTuple):
    """What a frame did to a device: `frames` to send, the `message` for the application, a `reset` of it."""

    frames: list[Frame]
    message: Message | None = None
    reset: Reset | None = None


class Device:
    """The CANopen side of a node, made from its `dictionary`.

    `state` is the NMT state, `protocol` its messages, `values` its objects' present values by address,
    `next_wakeup` the time of the next heartbeat (None: none is due).
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self.node_id = dictionary.node_id
        self.protocol = Protocol.of(dictionary)
        self.state = NmtState.INITIALISING
        self.values: dict[Address, Value] = {}
        self.emergencies = Emergencies(self._emcy_cob_id)
        self.next_wakeup: float | None = None
        valid = [pdo for pdo in dictionary.pdos if pdo.valid]
        self._received = {pdo.cob_id for pdo in valid if pdo.direction is PdoDirection.RPDO}
        self._sent = {self.protocol.binding(p.name).type for p in valid if p.direction is PdoDirection.TPDO}

    # Values

    def value(self, address: Address) -> Value:
        """Return an object's present value: as written, or as in the file."""
        return self.values[address] if address in self.values else self.dictionary.default(address)

    def number(self, address: Address) -> int:
        """Return an object's present value as a number; raises DictionaryError if it has none."""
        value = self.value(address)
        if not isinstance(value, int):
            raise DictionaryError(self.dictionary.file, address[0], f"sub {address[1]} has no number as its value")
        return value

    def setting(self, name: str) -> int:
        """Return the value of a setting by its ParameterNames, `Goto handshake.Confirm wait`.

        Raises DictionaryError.
        """
        return self.number(self.dictionary.address(name))

    def _emcy_cob_id(self) -> int | None:
        entry = self.value(EMCY_COB_ID)
        return entry if isinstance(entry, int) and not entry & NOT_VALID else None

    # NMT

    def start(self, now: float) -> list[Frame]:
        """Boot: send the boot-up message and enter the state that NMT startup 0x1F80 says (CiA 301, 7.3.2.2)."""
        self.state = boot_state(int(self.value(NMT_STARTUP) or 0))
        self._plan_heartbeat(now)
        return [error_control(self.node_id, NmtState.INITIALISING)]

    def _plan_heartbeat(self, now: float) -> None:
        period = int(self.value(HEARTBEAT_TIME) or 0)
        self.next_wakeup = now + period / 1000 if period else None

    def tick(self, now: float) -> list[Frame]:
        """Return the heartbeat if it is due."""
        if self.next_wakeup is None or now < self.next_wakeup:
            return []
        self._plan_heartbeat(self.next_wakeup)
        return [error_control(self.node_id, self.state)]

    def command(self, command: NmtCommand, now: float) -> Reaction:
        """Carry out an NMT command."""
        if command in TARGET:
            self.state = TARGET[command]
            return Reaction([])
        return self._reset(Reset(command), now)

    def _reset(self, reset: Reset, now: float) -> Reaction:
        keep = {} if reset is Reset.NODE else {a: v for a, v in self.values.items() if not 0x1000 <= a[0] < 0x2000}
        self.values = keep
        self.emergencies = Emergencies(self._emcy_cob_id)
        return Reaction(self.start(now), reset=reset)

    # PDOs

    @property
    def identifiers(self) -> list[int]:
        """COB-IDs of all frames that the device listens to, for receive filters."""
        return sorted({NMT_COB_ID} | self._received)

    def receive(self, frame: Frame, now: float) -> Reaction:
        """Take in one frame from the bus; before `start` a device hears nothing."""
        if self.state is NmtState.INITIALISING:
            return Reaction([])
        command = command_in(frame, self.node_id)
        if command is not None:
            return self.command(command, now)
        if frame.cob_id not in self._received:
            return Reaction([])
        return self._receive_pdo(frame)

    def _receive_pdo(self, frame: Frame) -> Reaction:
        binding = self.protocol.binding_of(frame.cob_id)
        if self.state is not NmtState.OPERATIONAL and binding.type not in ALWAYS:
            return Reaction([])
        info = frame.cob_id.to_bytes(2, "little") + bytes([len(frame.data)])
        try:
            message = self.protocol.decode(*frame)
        except FrameLengthError:
            return Reaction(self.emergencies.raised(ErrorCode.PDO_TOO_SHORT, binding.name, info))
        if len(frame.data) > binding.layout.length:
            return Reaction(self.emergencies.raised(ErrorCode.PDO_TOO_LONG, binding.name, info), message)
        return Reaction(self.emergencies.cleared(binding.name), message)

    def transmit(self, message: Message) -> Frame:
        """Return the frame of a message that this device sends.

        Raises StateError if it is not one of its TPDOs or if its NMT state does not allow it, FieldError for a value.
        """
        if type(message) not in self._sent:
            raise StateError(f"{self.dictionary.name} has no TPDO for {type(message).__name__}")
        if self.state is not NmtState.OPERATIONAL and not isinstance(message, ALWAYS):
            raise StateError(f"{self.dictionary.name} is {self.state.name}: only stops may be sent")
        return self.protocol.encode(message)
